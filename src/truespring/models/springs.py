"""The mass-spring model of a body."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ModelError, nearest
from truespring.material import Material
from truespring.mesh import Mesh, Remainder
from truespring.models.by_rule import SpringCounts
from truespring.models.elasticity import hooke, lattice_classes, lattice_elasticity
from truespring.models.findings import springs_warnings
from truespring.models.gaussian_quadratic import gaussian_quadratic
from truespring.models.interpolation import SIMPLICES
from truespring.models.links import in_a_row
from truespring.models.model import Model
from truespring.models.moduli import Moduli, moduli, spring_counts
from truespring.models.network import SpringNetwork
from truespring.models.pair_laws import STRAIGHT
from truespring.models.rules import (
    RULES,
    UserStiffness,
    check_law,
    check_rule,
    require_body,
    rule_stiffness,
    user_stiffness,
)
from truespring.models.volume import VolumeTerm
from truespring.models.volume_springs import VolumeSprings
from truespring.potential import Stressed
from truespring.problem import Problem

# Largest relative deviation of a lattice from isotropy for which a volume term is allowed.
_ISOTROPIC = 1e-6


@dataclass(frozen=True)
class Springs(Model):
    """The mass-spring model: springs on the edges and diagonals of every element.

    Attributes:
        rule: the stiffness rule, a key of RULES.
        stiffness: user-defined stiffness, instead of a rule.
        sharing: stiffness of a spring that several elements share: "summed" is the sum over the elements, "single" the
            mean.
        allow_negative: allow springs with negative stiffness, which some rules give on some meshes; coupled rules
            always do.
        volume: add the area or volume term that gives an isotropic lattice the Young's modulus and the Poisson's ratio
            of the material, from 0 to 0.5; the springs are rescaled.
        k_body: stiffness of each body diagonal of a cube in E h, for the rule isotropic.
        hourglass: stiffness of the hourglass modes over that of finite elements, for the rule gaussian; by default,
            None, 1 in the plane, and in space a function of Poisson's ratio (see docs/hourglass.md).
        element: "quadratic" for springs between all nodes of triangles or tetrahedra of second order, for the rule
            gaussian.
        law: of the rule gaussian the constitutive law, one of GAUSSIAN_LAWS, by default, None, neo-hookean; of other
            springs the force law, a key of PAIR_LAWS, by default straight; see `laws` of a rule.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> ts.solve(problem, ts.Springs("gaussian"))
        Solution(springs (gaussian), converged, 11 states up to load factor 1)
    """

    rule: str | None = None
    stiffness: UserStiffness | None = None
    sharing: str = "summed"
    allow_negative: bool = False
    volume: bool = False
    k_body: float | None = None
    hourglass: float | None = None
    element: str | None = None
    law: str | None = None

    def __post_init__(self) -> None:
        if (self.rule is None) == (self.stiffness is None):
            raise ModelError(f"springs: give either a rule ({', '.join(RULES)}) or stiffness")
        if self.stiffness is not None and not isinstance(self.stiffness, UserStiffness):
            raise ModelError(f"stiffness = {self.stiffness!r}: give UserStiffness(edge=..., diagonal=...)")
        if self.rule is not None and self.rule not in RULES:
            raise ModelError(f"rule = '{self.rule}' is unknown{nearest(self.rule, RULES)}; allowed: {', '.join(RULES)}")
        if self.sharing not in ("summed", "single"):
            raise ModelError(f"sharing = '{self.sharing}' is unknown; allowed: summed, single")
        if self.k_body is not None and not np.isfinite(self.k_body):
            raise ModelError(f"k_body = {self.k_body}: must be finite")
        if self.k_body is not None and self.rule is None:
            raise ModelError("k_body requires the rule isotropic; with stiffness, use its key body")
        name = next((name for name in self.parameters if name != "law"), None)
        if self.rule is None and name is not None:
            owners = [rule for rule, entry in RULES.items() if name in entry.parameters]
            raise ModelError(f"{name} requires a rule ({', '.join(owners)}), not stiffness")
        if self.volume and self.coupled:
            raise ModelError(
                f"volume = true: the law of rule = '{self.rule}' contains the energy of the change of volume, so that "
                "the Poisson's ratio is that of the material: remove volume"
            )
        if self.sharing == "single" and (self.volume or self.coupled):
            what = "volume = true" if self.volume else f"rule = '{self.rule}'"
            raise ModelError(
                f"sharing = 'single': {what} requires the sum over the elements that share a spring: remove sharing"
            )
        if self.law is not None:
            check_law(self.law, self.rule)

    kind = "springs"
    has_springs = True

    @property
    def lines(self) -> str:
        """Name of the lines of the potential in figures: springs between all nodes of an element are not drawn."""
        return "springs" if self.element is None else "edges"

    @property
    def coupled(self) -> bool:
        """Whether the springs of an element are coupled, see BiquadraticSprings."""
        return self.rule is not None and RULES[self.rule].coupled

    @property
    def takes_fibres(self) -> bool:
        """Whether the rule includes the fibres of the material."""
        return self.rule is not None and RULES[self.rule].takes_fibres

    @property
    def locks_on(self) -> tuple[str, ...]:
        """Kinds of elements on which the springs lock near Poisson's ratio 1/2."""
        if self.coupled:
            return RULES[str(self.rule)].locks_on if self.element is None else ()
        return SIMPLICES if self.volume else ()

    @property
    def remark(self) -> str:
        """A sentence on cost and law of coupled springs, without a full stop."""
        return RULES[self.rule].remark if self.rule is not None else ""

    @property
    def label(self) -> str:
        """Name in figures and tables."""
        words = [self.rule or "own stiffness"]
        words += [f"{name} {value}" for name, value in self.parameters.items()]
        words += ["single"] if self.sharing == "single" else []
        words += ["volume"] if self.volume else []
        return f"springs ({', '.join(words)})"

    def element_stiffness(self, problem: Problem) -> Floats:
        """Return the stiffness of each element's links [N/m], shape (n_elements, links).

        If the mesh has several kinds of elements, rows are padded with zeros.
        """
        unscaled = self._unscaled_stiffness(problem)
        if not self.volume:
            return unscaled
        scale = {material: self._correction(problem, material)[0] for material in problem.materials}
        return unscaled * problem.of_elements(lambda material: scale[material])[:, None]

    def counts(self, problem: Problem) -> SpringCounts:
        """Return the number of springs on the mesh of a problem, and of those with negative and zero stiffness."""
        if self.element is None:
            return spring_counts(problem.mesh, self.element_stiffness(problem))
        stiffness = gaussian_quadratic(problem).stiffness
        return SpringCounts(len(stiffness), int((stiffness < 0).sum()), 0)

    def _unscaled_stiffness(self, problem: Problem) -> Floats:
        """Return the stiffness of links [N/m], shape (n_elements, links), before scaling for a volume term."""
        if self.stiffness is not None:
            return user_stiffness(problem, self.stiffness)
        return rule_stiffness(problem, str(self.rule), self.parameters)

    @property
    def parameters(self) -> dict[str, Any]:
        """Parameters of the rule that are set, by name."""
        names = dict.fromkeys(name for rule in RULES.own.values() for name in rule.parameters)
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}

    def kappa(self, problem: Problem) -> Floats:
        """Return the modulus of the area or volume term of each element [Pa], shape (n_elements,); zero without one."""
        if not self.volume:
            return np.zeros(len(problem.mesh.elements))
        kappas = {material: self._correction(problem, material)[1] for material in problem.materials}
        return problem.of_elements(lambda material: kappas[material])

    def _correction(self, problem: Problem, material: Material) -> tuple[float, float]:
        """Return the scale factor of the springs [-] and the modulus of the volume term [Pa] for one material.

        Springs have lam = mu (Cauchy's relation). Scaled to the mu of the material, the term adds kappa = lam - mu
        (Golec et al. 2020). Scaling the springs to E instead gives a wrong mu.
        """
        _, section = require_body(problem)
        if material.poisson < 0:
            raise ModelError(
                f"volume = true: poisson = {material.poisson:g} must be from 0 to 0.5; the rule gaussian allows any"
            )
        alone = dict(zip(problem.materials, problem.homogeneous, strict=True))[material]
        classes = lattice_classes(problem.mesh)
        found = lattice_elasticity(alone, self._unscaled_stiffness(alone), classes)
        mu = float(found[-1, -1])
        if classes is None or np.abs(found - hooke(mu, mu, problem.mesh.dim)).max() > _ISOTROPIC * abs(mu):
            this = "irregular" if classes is None else "anisotropic"
            other = {
                "triangle": "rule lloyd on equilateral triangles",
                "tetrahedron": "rule lloyd on body-centred-cubic tetrahedra, at least three cells deep",
            }.get(problem.mesh.element, "rule isotropic")
            raise ModelError(
                f"volume = true requires isotropic lattices, this mesh is {this}: use the {other}, or the rule "
                "gaussian, which has the Poisson's ratio of the material on any mesh"
            )
        exact = section.lame_within(material)
        return exact.mu / mu, exact.lam - exact.mu

    def potential(self, problem: Problem) -> Stressed:
        """Return the potential of the springs; raise ModelError if one has a negative stiffness, unless allowed."""
        build = None if self.rule is None else RULES[self.rule].potential
        if build is not None:
            check_rule(problem, str(self.rule), self.parameters)
            return build(problem, **self.parameters)
        network = self.network(problem, self.element_stiffness(problem))
        return VolumeSprings(network, VolumeTerm(problem, self.kappa(problem))) if self.volume else network

    def check(self, problem: Problem) -> None:
        """Raise ModelError if the springs do not fit the problem, or do not resist every strain."""
        self.potential(problem)
        self.moduli(problem.homogeneous[0])

    def moduli(self, problem: Problem) -> Moduli:
        """Return the effective moduli on the mesh of the problem, all of it of the material of the problem."""
        return moduli(problem, self)

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return warnings: effective moduli that differ from those of the material, locking."""
        return springs_warnings(problem, self)

    def on_pieces(self, problem: Problem) -> "Springs | None":
        """Return the springs as a sum over elements; None for a mean, a volume term or springs of second order.

        A spring at the boundary of a piece may be negative there and not in the sum, which is checked here.
        """
        if self.sharing == "single" or self.volume or self.element is not None:
            return None
        if self.rule is None or RULES[self.rule].potential is None:
            self.network(problem, self.element_stiffness(problem))
        return self.allowing_negative()

    def on_remainder(self, left: Remainder) -> "Springs":
        """Return the springs, of which some on the faces of a cut may be negative: they were not in the sum."""
        return self.allowing_negative()

    def allowing_negative(self) -> "Springs":
        """Return a copy that allows negative stiffness."""
        return replace(self, allow_negative=True)

    def network(self, problem: Problem, per_element: Floats) -> SpringNetwork:
        """Return springs from the stiffness of each element's links [N/m], shape (n_elements, links)."""
        mesh = problem.mesh
        springs, place = shared_springs(mesh)
        stiffness = np.bincount(place, in_a_row(mesh, per_element)).astype(np.float64)
        if self.sharing == "single":
            stiffness = stiffness / np.bincount(place)
        # Where contributions of a rule cancel, only rounding is left: not a negative spring.
        stiffness[np.abs(stiffness) <= 1e-12 * np.abs(stiffness).max()] = 0.0
        negative = np.flatnonzero(stiffness < 0)
        if negative.size and not self.allow_negative:
            middle = mesh.nodes[springs[negative[0]]].mean(axis=0)
            raise ModelError(
                f"{negative.size} of {len(springs)} springs have a negative stiffness, the first "
                f"{stiffness[negative[0]]:g} N/m at {middle.tolist()} m: use elements closer to squares, cubes or "
                "regular simplices, another rule, or allow_negative = true"
            )
        return SpringNetwork(mesh.nodes, springs, stiffness, law=self.law or STRAIGHT)


def springs_by_rule(models: Mapping[str, object]) -> dict[str, Springs]:
    """Return the models that are springs by a rule or by user-defined stiffness, by name."""
    return {name: model for name, model in models.items() if isinstance(model, Springs)}


def shared_springs(mesh: Mesh) -> tuple[Ints, Ints]:
    """Return the springs of a mesh, and the number of the spring of each link.

    Shapes (n_springs, 2), node numbers, each pair once, and (n_elements * links,), kind by kind of element.
    """
    from truespring.kernels.sparsity import unique_pairs
    from truespring.kernels.threads import writable

    pairs = [part.elements[:, np.array(part.kind.links)].reshape(-1, 2) for _, part in mesh.blocks]
    springs, place = unique_pairs(writable(pairs[0] if len(pairs) == 1 else np.concatenate(pairs)), mesh.n_nodes)
    return springs, place
