"""Fitness: whether springs are fit for a material on a mesh, and which rule is better, before anything is solved."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Bools
from truespring.errors import ModelError
from truespring.loading import Fixed
from truespring.material import Material, PlaneStress
from truespring.mesh import Mesh, box, plural, rectangle
from truespring.models.advice import springs_lock
from truespring.models.bending import bending_excess
from truespring.models.elasticity import hooke, lattice_classes
from truespring.models.finite_elements import fem_potential
from truespring.models.interpolation import SIMPLICES
from truespring.models.moduli import Moduli, moduli, spring_counts
from truespring.models.relaxation import pinned, relaxed
from truespring.models.rules import RULES, require_body
from truespring.models.springs import Springs
from truespring.models.strain import uniform_strain, voigt_pairs
from truespring.modes import rigid_body_modes
from truespring.problem import Problem
from truespring.remembering import remembered

# Poisson's ratio of an isotropic lattice of plain springs (Cauchy's relation lam = mu), in the plane and in space.
_CAUCHY = {2: 1 / 3, 3: 1 / 4}

# Meshes on which plain springs can be isotropic, by the kind of element that mostly is no such mesh.
_ISOTROPIC_MESH = {
    "triangle": "equilateral triangles, or squares",
    "tetrahedron": 'body-centred-cubic tetrahedra (of a box: element = "bcc-tetrahedron")',
}


@dataclass(frozen=True)
class Fitness:
    """A judgement of springs.

    Attributes:
        fit: whether they realise every material of the body in every direction, within the tolerance, and are not
            elements that are too stiff.
        reasons: why they do not, empty where they do.
        better: springs that do, where these do not: plain ones before those with a volume term before coupled ones.
        sentence: all of it in words, with what should be known even of springs that are fit.
    """

    fit: bool
    reasons: tuple[str, ...]
    better: Springs | None
    sentence: str


@remembered
def judge(problem: Problem, springs: Springs, tolerance: float = 0.05) -> Fitness:
    """Return whether springs are fit for each material of a body, and which are better where they are not.

    Fit are springs without negative stiffness, stable at rest, whose Young's modulus in every direction is
    within the share `tolerance` of the wanted one and Poisson's ratio within `tolerance` itself, and which
    pass the patch test: loaded at its boundary as for a uniform stress, the body is strained uniformly, but
    for `tolerance` of the displacement (root mean square, the worst stress). That displacement, rather than
    the unbalanced force, is by how much a body deforms otherwise than its moduli tell: disorder from element
    to element averages out, regions that are too stiff or too soft do not.

    Coupled springs, which are finite elements of first order, must besides not lock at the Poisson's ratio, and on
    triangles and tetrahedra, which then strain uniformly, not be too stiff by more than `tolerance` when the whole body
    is bent: that they are the elements does not make them right. They are still what is better where other springs fail
    for their moduli, with that said.

    What finer elements mend is else remarked upon and decides nothing: the bending factor, and the patch test of
    a body that is cut from a lattice and fails at its outer elements only.

    Raises ModelError where the springs do not go with the mesh, or do not resist every strain.
    """
    judged = _Judge(problem, tolerance)
    reasons = judged.said(lambda twin: (*judged.faults(twin, springs), *judged.of_elements(twin, springs)))
    better = judged.better(springs) if reasons else None
    sentences = judged.against(springs, better) if reasons else judged.in_favour(springs)
    return Fitness(not reasons, reasons, better, " ".join(sentences))


@dataclass(frozen=True)
class _Judge:
    """One body, and how near to its materials springs should be."""

    problem: Problem
    tolerance: float

    def faults(self, twin: Problem, springs: Springs) -> Iterator[str]:
        """Why springs are not fit for a body of one material."""
        realised = moduli(twin, springs)
        if max(abs(value / realised.young_wanted - 1) for value in realised.young_range) > self.tolerance:
            yield f"{self._young(twin, realised)} (wanted within {100 * self.tolerance:.6g} %)"
        if max(abs(value - realised.poisson_wanted) for value in realised.poisson_range) > self.tolerance:
            yield f"{self._poisson(realised)} (within {self.tolerance:.6g})"
        if realised.n_negative:
            yield f"{realised.n_negative} of {realised.n_springs} springs have a negative stiffness"
        if not realised.stable:
            yield "they are not stable at rest"
        elif realised.patch_score and not realised.n_negative:
            patch = _patch_test(twin, springs)
            if patch.error > self.tolerance and not patch.outside:
                off = f"nodes come to lie {100 * patch.error:.0f} % off a uniform strain"
                lost = "no equilibrium is found"
                yield (
                    "on this irregular mesh the patch test fails: loaded uniformly, "
                    f"{off if math.isfinite(patch.error) else lost}"
                )

    def of_elements(self, twin: Problem, springs: Springs) -> Iterator[str]:
        """Why springs that are finite elements of first order are too stiff, though their moduli are right."""
        material = twin.material
        assert material is not None  # springs have asked for it
        kind = twin.mesh.element
        if springs.coupled and springs_lock(twin, springs):
            yield f"they are linear finite elements, which lock at a Poisson's ratio of {material.poisson:g}"
        elif springs.coupled and kind in SIMPLICES and (excess := bending_excess(twin)) > self.tolerance:
            yield (
                f"they are finite elements of linear {plural(kind)}, which on this mesh are too stiff in bending by "
                f"{100 * excess:.2g} %"
            )

    def better(self, than: Springs) -> Springs | None:
        """The plain springs that are nearest to the material, or else the first others whose moduli are right."""
        rules = [name for name, rule in RULES.items() if rule.takes(self.problem.mesh)]
        plain = [Springs(name) for name in rules if not RULES[name].coupled]
        # Plain springs that are nearly isotropic are nearly at Cauchy's ratio: for others none need be tried.
        near = max(abs(above) for above in self._above_cauchy()) <= 2 * self.tolerance
        fit = [springs for springs in plain if near and self._is_fit(springs)]
        if fit:
            return min(fit, key=self._deviation)
        lattice = lattice_classes(self.problem.mesh) is not None  # others have no volume term
        others = [Springs(one.rule, volume=True) for one in plain if lattice]
        others += [Springs(name) for name in rules if RULES[name].coupled]
        return next((springs for springs in others if springs != than and self._is_fit(springs)), None)

    def _above_cauchy(self) -> list[float]:
        """How far each material's Poisson's ratio is above that of an isotropic lattice of plain springs."""
        section = self.problem.section
        assert section is not None  # springs have asked for it
        wanted = [section.apparent_moduli(material)[1] for material in self.problem.materials]
        return [poisson - _CAUCHY[self.problem.mesh.dim] for poisson in wanted]

    def _is_fit(self, springs: Springs) -> bool:
        try:
            mesh, stiffness = self.problem.mesh, springs.element_stiffness(self.problem)
            if not springs.coupled and spring_counts(mesh, stiffness).n_negative:
                return False  # before anything is relaxed
            twins = self.problem.homogeneous
            return not any(_unbounded(twin, springs) or any(self.faults(twin, springs)) for twin in twins)
        except ModelError:
            return False

    def _deviation(self, springs: Springs) -> float:
        """Of the worst material; what differs by rounding alone is equal, and the first rule stands."""
        return max(round(moduli(twin, springs).deviation, 9) for twin in self.problem.homogeneous)

    def in_favour(self, springs: Springs) -> Iterator[str]:
        """Say of springs that they are fit, and what should be known of them."""
        yield f"Fit for {self._whom()}: {self._realised(springs)}."
        yield from self._remarks(springs)
        yield from self._bending(springs)

    def against(self, springs: Springs, better: Springs | None) -> Iterator[str]:
        """Say of springs that they are not fit, and which are better."""
        found = self.said(
            lambda twin: ["; ".join((*self.faults(twin, springs), *self.of_elements(twin, springs))) or "they are fit"]
        )
        yield f"Not fit for {self._whom()}: {'; '.join(found)}."
        if better is None:
            mend = " Finite elements of second order and finer meshes are better." if springs.coupled else ""
            yield f"No rule here is better on this mesh.{mend}"
            yield from self._remarks(springs) if springs.coupled else ()
            yield from self._bending(springs)
            return
        key = f'rule = "{better.rule}"' + (", volume = true" if better.volume else "")
        exact = self._deviation(better) < 1e-6
        yield f"Better here: {key}{', which realises it exactly' if exact else f': {self._realised(better)}'}."
        for text in self.said(lambda twin: self.of_elements(twin, better)):
            yield f"But {text}: use them for a first look only, or take finite elements of second order."
        yield from self._remarks(better)
        simpler = min(self._above_cauchy()) >= -self.tolerance  # below, the volume term is negative on any mesh
        if better.coupled and simpler and self.problem.mesh.element in _ISOTROPIC_MESH:
            yield f"Simpler springs want another mesh: {_ISOTROPIC_MESH[self.problem.mesh.element]}."
        yield from self._bending(springs, better)

    def said(self, say: Callable[[Problem], Iterable[str]]) -> tuple[str, ...]:
        """What is to be said of the materials, each thing once, with the materials unless it holds for all."""
        twins = self.problem.homogeneous
        found: dict[str, list[str]] = {}
        for twin in twins:
            material = twin.material
            assert material is not None  # springs have asked for it
            for text in say(twin):
                found.setdefault(text, []).append(f"E is {material.young:g} Pa and nu {material.poisson:g}")
        return tuple(
            text if len(whose) == len(twins) else f"where {' or '.join(whose)}, {text}" for text, whose in found.items()
        )

    def _whom(self) -> str:
        return "this material" if len(self.problem.homogeneous) == 1 else "these materials"

    def _realised(self, springs: Springs) -> str:
        def both(twin: Problem) -> tuple[str]:
            realised = moduli(twin, springs)
            return (f"{self._young(twin, realised)}, {self._poisson(realised)}",)

        return "; ".join(self.said(both))

    def _young(self, twin: Problem, realised: Moduli) -> str:
        whose = "the material's" + (twin.section.within if twin.section else "")
        lowest, highest = (self._number(value / realised.young_wanted) for value in realised.young_range)
        if lowest == highest:
            return f"Young's modulus is {lowest} times {whose} in every direction"
        return f"Young's modulus runs from {lowest} to {highest} times {whose} over the directions"

    def _poisson(self, realised: Moduli) -> str:
        lowest, highest = (self._number(value) for value in realised.poisson_range)
        wanted = self._number(realised.poisson_wanted)
        found = f"is {lowest}" if lowest == highest else f"runs from {lowest} to {highest}"
        return f"Poisson's ratio {found}" + ("" if lowest == highest == wanted else f" where {wanted} is wanted")

    def _number(self, value: float) -> str:
        """With as many digits as the tolerance asks for, and no zero below zero."""
        digits = max(2, -math.floor(math.log10(self.tolerance)))
        return f"{round(value, digits) + 0.0:.{digits}f}"

    def _remarks(self, springs: Springs) -> Iterator[str]:
        for text in self.said(lambda twin: _remarks(twin, springs, self.tolerance)):
            yield f"{text[0].upper()}{text[1:]}."

    def _bending(self, *several: Springs) -> Iterator[str]:
        """The bending factors on this mesh: of springs and, if any, of better ones, where one is far from 1."""
        known = [moduli(self.problem.homogeneous[0], springs) for springs in several]
        depth = known[0].depth
        if depth is None or max(abs(one.bending[depth] - 1) for one in known) <= self.tolerance:
            return
        found = [f"{one.bending[depth]:.3f}" for one in known]
        beside = f", the better ones {found[1]}" if len(found) > 1 else ""
        yield (
            f"Bent along x, {depth} element{'' if depth == 1 else 's'} deep, these springs have {found[0]} times the "
            f"material's EI{beside}, FEM on this mesh {known[0].fem_bending[depth]:.3f}."
        )


def _remarks(twin: Problem, springs: Springs, tolerance: float) -> Iterator[str]:
    """What should be known of springs even where they are fit."""
    material, realised = twin.material, moduli(twin, springs)
    assert material is not None  # springs have asked for it
    if realised.patch_score and _patch_test(twin, springs).error > tolerance:
        yield (
            "its outer elements are not those of the lattice: loaded uniformly, nodes of so coarse a body come to lie "
            f"{100 * _patch_test(twin, springs).error:.0f} % off a uniform strain"
        )
    if springs.coupled:
        yield (
            "coupled springs cost more than plain ones; their law is St. Venant-Kirchhoff's, which softens in "
            "compression and is far from others, such as the neo-Hookean, from strains of some percent on"
        )
    if _unbounded(twin, springs):
        yield "the volume term is negative: at large stretch nothing bounds the energy from below"
    if springs_lock(twin, springs) and not springs.coupled:  # of these it is a fault
        yield f"at a Poisson's ratio of {material.poisson:g} this mesh locks with them, as with linear finite elements"


def _unbounded(twin: Problem, springs: Springs) -> bool:
    """Whether the volume term is negative, by more than rounding: it takes more energy than the springs store."""
    material = twin.material
    assert material is not None  # springs have asked for it
    return bool((springs.kappa(twin) < -1e-9 * material.young).any())


@dataclass(frozen=True)
class _Patch:
    """What a patch test finds.

    Attributes:
        error: distance of the nodes from where a uniform strain has them, over its displacement (rms) [-].
        outside: whether the body is a lattice, and forces are out of balance at its outer elements only.
    """

    error: float
    outside: bool


@remembered
def _patch_test(problem: Problem, springs: Springs) -> _Patch:
    """Load the free body as for a uniform stress, and see how far from uniform the strain is; the worst stress.

    The strain is compared with that of the springs' own moduli, apart from rigid motion. For springs that are
    stable at rest; the error is infinite where no equilibrium is found.
    """
    mesh, realised = problem.mesh, moduli(problem, springs)
    material, section = require_body(problem)
    K = springs.potential(problem).hessian(mesh.nodes)
    exact = fem_potential(problem, "linear").hessian(mesh.nodes)  # passes: its forces of a uniform strain are right
    elasticity = hooke(*section.lame_within(material), mesh.dim)
    centred = mesh.nodes - mesh.nodes.mean(axis=0)
    strains = np.stack([uniform_strain(centred, i, j).ravel() for i, j in voigt_pairs(mesh.dim)], axis=1)
    expected = strains @ np.linalg.solve(realised.elasticity, elasticity)
    definite = not realised.n_negative and not _unbounded(problem, springs)
    moved = relaxed(K, exact @ strains, mesh.nodes, pinned(mesh.nodes), definite)
    if moved is None:
        return _Patch(math.inf, False)
    rigid, _ = np.linalg.qr(rigid_body_modes(mesh.nodes))
    apart = moved - expected
    apart -= rigid @ (rigid.T @ apart)
    worst = float((np.linalg.norm(apart, axis=0) / np.linalg.norm(expected, axis=0)).max())
    unbalanced = np.abs(K @ strains)
    balanced = unbalanced[np.repeat(_far_inside(mesh), mesh.dim)].max(initial=0.0) <= 1e-6 * unbalanced.max()
    return _Patch(worst, bool(realised.lattice and balanced))


def _far_inside(mesh: Mesh) -> Bools:
    """The nodes whose elements have no node at the boundary, shape (n_nodes,)."""
    outside, inside = np.zeros(mesh.n_nodes, dtype=bool), np.ones(mesh.n_nodes, dtype=bool)
    outside[mesh.boundary] = True
    inside[mesh.elements[outside[mesh.elements].any(axis=1)]] = False
    return inside


def follows_poisson(rule: str) -> bool:
    """Return whether the springs of a rule change with the material's Poisson's ratio: found out by trying."""
    element = RULES[rule].elements[-1]
    flat = element in ("triangle", "quadrilateral")
    mesh = rectangle((1.0, 1.0), (1, 1), element) if flat else box((1.0, 1.0, 1.0), (1, 1, 1), element)
    held, section = Fixed(on="left", displacement=(1.0,) * mesh.dim), PlaneStress(1.0) if flat else None
    low, high = (
        Springs(rule).element_stiffness(Problem(mesh, Material(1.0, poisson), section, [held]))
        for poisson in (0.2, 0.3)
    )
    return not np.allclose(low, high, rtol=1e-9, atol=0)
