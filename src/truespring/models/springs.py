"""Springs: a body idealised as nodes joined by springs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ModelError, nearest
from truespring.material import Material
from truespring.mesh import Mesh
from truespring.models.biquadratic import BiquadraticSprings
from truespring.models.elasticity import hooke, lattice_classes, lattice_elasticity
from truespring.models.findings import springs_warnings
from truespring.models.linked import LinkedElements
from truespring.models.links import in_a_row
from truespring.models.model import Model
from truespring.models.moduli import Moduli, moduli
from truespring.models.network import SpringNetwork
from truespring.models.rules import RULES, UserStiffness, check_rule, require_body, rule_stiffness, user_stiffness
from truespring.models.summed import SummedLinks, summed_links
from truespring.models.volume import VolumeTerm
from truespring.models.volume_springs import VolumeSprings
from truespring.problem import Problem

# A lattice whose elasticity is within this share of an isotropic one takes a volume term.
_ISOTROPIC = 1e-6


@dataclass(frozen=True)
class Springs(Model):
    """The mass-spring model: the edges and diagonals of every element carry springs.

    Attributes:
        rule: how stiffness follows from the material, a key of RULES.
        stiffness: numbers of the user's own instead of a rule.
        sharing: "summed" adds the springs of elements that share a pair of nodes,
            "single" takes one spring a pair (their mean).
        allow_negative: accept springs of negative stiffness, which some rules give on some meshes.
        volume: add the area or volume term with which an isotropic lattice realises the material's
            Young's modulus and Poisson's ratio, from 0 on; the springs are rescaled for it.
        k_body: stiffness of each diagonal through the body of a cube, in E h, for the rule isotropic.
    """

    rule: str | None = None
    stiffness: UserStiffness | None = None
    sharing: str = "summed"
    allow_negative: bool = False
    volume: bool = False
    k_body: float | None = None

    def __post_init__(self) -> None:
        if (self.rule is None) == (self.stiffness is None):
            raise ModelError(f"springs take either a rule ({', '.join(RULES)}) or a stiffness of your own")
        if self.stiffness is not None and not isinstance(self.stiffness, UserStiffness):
            raise ModelError(f"stiffness = {self.stiffness!r}: give UserStiffness(edge=..., diagonal=...)")
        if self.rule is not None and self.rule not in RULES:
            raise ModelError(f"rule = '{self.rule}' is unknown{nearest(self.rule, RULES)}; allowed: {', '.join(RULES)}")
        if self.sharing not in ("summed", "single"):
            raise ModelError(f"sharing = '{self.sharing}' is unknown; allowed: summed, single")
        if self.k_body is not None and not np.isfinite(self.k_body):
            raise ModelError(f"k_body = {self.k_body}: must be finite")
        if self.k_body is not None and self.rule is None:
            raise ModelError("k_body is for the rule isotropic; of your own stiffness `body` is that of the diagonals")
        if self.sharing == "single" and (self.volume or self.coupled):
            what = "volume = true" if self.volume else f"rule = '{self.rule}'"
            raise ModelError(f"{what} takes every element's springs: sharing = 'single' does not go with it")
        if self.volume and self.coupled:
            raise ModelError(f"rule = '{self.rule}' realises any Poisson's ratio by itself: leave volume out")

    kind = "springs"
    has_springs = True

    @property
    def coupled(self) -> bool:
        """Whether the springs of an element answer to each other's lengths: see BiquadraticSprings."""
        return self.rule is not None and RULES[self.rule].coupled

    @property
    def label(self) -> str:
        """How curves and tables call the model."""
        words = [self.rule or "own stiffness"]
        words += [f"k_body {self.k_body:g}"] if self.k_body is not None else []
        words += ["single"] if self.sharing == "single" else []
        words += ["volume"] if self.volume else []
        return f"springs ({', '.join(words)})"

    def element_stiffness(self, problem: Problem) -> Floats:
        """Stiffness of each element's own springs [N/m], shape (n_elements, links of the kind).

        Of several kinds of elements as many as the kind with most has, zero beyond an element's own.
        """
        given = self._given_stiffness(problem)
        if not self.volume:
            return given
        scale = {material: self._correction(problem, material)[0] for material in problem.materials}
        return given * problem.of_elements(lambda material: scale[material])[:, None]

    def _given_stiffness(self, problem: Problem) -> Floats:
        """What the rule or the user gives, before a volume term rescales it."""
        if self.stiffness is not None:
            return user_stiffness(problem, self.stiffness)
        return rule_stiffness(problem, str(self.rule), self._parameters)

    @property
    def _parameters(self) -> dict[str, float]:
        """What was given of the rule's parameters."""
        return {} if self.k_body is None else {"k_body": self.k_body}

    def kappa(self, problem: Problem) -> Floats:
        """Modulus of the area or volume term of each element [Pa], shape (n_elements,); zero without one."""
        if not self.volume:
            return np.zeros(len(problem.mesh.elements))
        kappas = {material: self._correction(problem, material)[1] for material in problem.materials}
        return problem.of_elements(lambda material: kappas[material])

    def _correction(self, problem: Problem, material: Material) -> tuple[float, float]:
        """What scales the springs, and the modulus of the volume term [Pa], on a body of one material.

        Springs alone have lam = mu (Cauchy). Scaled to the material's mu, they leave lam - mu to the
        term. Scaled to E instead, as is sometimes seen, they leave mu wrong.
        """
        _, section = require_body(problem)
        if material.poisson < 0:
            raise ModelError(
                f"volume = true: poisson = {material.poisson:g} is below 0; a volume term realises 0 to 0.5, "
                "the rule biquadratic any"
            )
        alone = dict(zip(problem.materials, problem.homogeneous, strict=True))[material]
        classes = lattice_classes(problem.mesh)
        found = lattice_elasticity(alone, self._given_stiffness(alone), classes)
        mu = float(found[-1, -1])
        if classes is None or np.abs(found - hooke(mu, mu, problem.mesh.dim)).max() > _ISOTROPIC * abs(mu):
            this = "none" if classes is None else "anisotropic"
            other = {
                "triangle": "rule lloyd on equilateral triangles",
                "tetrahedron": "rule lloyd on body-centred-cubic tetrahedra, three cells deep or more",
            }.get(problem.mesh.element, "rule isotropic")
            raise ModelError(
                f"volume = true is for isotropic lattices, this one is {this}: take the {other}, "
                "or the rule biquadratic, which realises any Poisson's ratio on any mesh"
            )
        wanted = section.lame_within(material)
        return wanted.mu / mu, wanted.lam - wanted.mu

    def potential(self, problem: Problem) -> SpringNetwork | LinkedElements | SummedLinks | VolumeSprings:
        """Return the springs on the problem's mesh; raise ModelError for a negative one unless allowed."""
        if self.coupled:
            check_rule(problem, str(self.rule), self._parameters)
            return summed_links(problem, BiquadraticSprings)
        network = self.network(problem, self.element_stiffness(problem))
        return VolumeSprings(network, VolumeTerm(problem, self.kappa(problem))) if self.volume else network

    def check(self, problem: Problem) -> None:
        """Raise ModelError where the springs do not fit the problem, or do not resist every strain."""
        self.potential(problem)
        self.moduli(problem.homogeneous[0])

    def moduli(self, problem: Problem) -> Moduli:
        """Return the effective moduli on the problem's mesh, all of it of its own material."""
        return moduli(problem, self)

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return what should be known of the springs: moduli other than the material's, springs that lock."""
        return springs_warnings(problem, self)

    def allowing_negative(self) -> "Springs":
        """Return the same springs, those of negative stiffness allowed."""
        return replace(self, allow_negative=True)

    def network(self, problem: Problem, per_element: Floats) -> SpringNetwork:
        """Return the springs of the given stiffness of each element's links [N/m], shape (n_elements, links)."""
        mesh = problem.mesh
        springs, place = shared_springs(mesh)
        stiffness = np.bincount(place, in_a_row(mesh, per_element)).astype(np.float64)
        if self.sharing == "single":
            stiffness = stiffness / np.bincount(place)
        # Rules whose sum is zero on some links leave rounding there, which is no negative spring.
        stiffness[np.abs(stiffness) <= 1e-12 * np.abs(stiffness).max()] = 0.0
        negative = np.flatnonzero(stiffness < 0)
        if negative.size and not self.allow_negative:
            middle = mesh.nodes[springs[negative[0]]].mean(axis=0)
            raise ModelError(
                f"{negative.size} of {len(springs)} springs have a negative stiffness, "
                f"the first {stiffness[negative[0]]:g} "
                f"N/m at {middle.tolist()} m: take elements nearer to squares, cubes or regular simplices, "
                "another rule, or allow_negative = true"
            )
        return SpringNetwork(mesh.nodes, springs, stiffness)


def springs_by_rule(models: Mapping[str, object]) -> dict[str, Springs]:
    """Return those of several models that are springs by a rule or of the user's numbers, by name."""
    return {name: model for name, model in models.items() if isinstance(model, Springs)}


def shared_springs(mesh: Mesh) -> tuple[Ints, Ints]:
    """Return the pairs of nodes that links join, each once, and the number of the pair of each element's each link.

    Shapes (n_springs, 2) and (n_elements * links,), of several kinds of elements kind after kind.
    """
    from truespring.kernels.sparsity import unique_pairs
    from truespring.kernels.threads import writable

    pairs = [part.elements[:, np.array(part.kind.links)].reshape(-1, 2) for _, part in mesh.blocks]
    springs, place = unique_pairs(writable(pairs[0] if len(pairs) == 1 else np.concatenate(pairs)), mesh.n_nodes)
    return springs, place
