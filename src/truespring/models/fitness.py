"""Fitness of springs for a material on a mesh, and the better rule, determined before the study is solved."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from truespring.errors import ModelError
from truespring.loading import Fixed
from truespring.material import Material, PlaneStress
from truespring.mesh import box, rectangle
from truespring.models.elasticity import lattice_classes
from truespring.models.findings import CODES, Finding, all_findings, by_material
from truespring.models.interpolation import SIMPLICES
from truespring.models.moduli import moduli
from truespring.models.rules import RULES
from truespring.models.springs import Springs
from truespring.problem import Problem
from truespring.remembering import remembered

# Poisson's ratio of an isotropic lattice of plain springs (Cauchy's relation lam = mu) in 2D and in 3D.
_CAUCHY = {2: 1 / 3, 3: 1 / 4}

# Meshes on which plain springs can be isotropic, by kind of element.
_ISOTROPIC_MESH = {
    "triangle": "equilateral triangles, or squares",
    "tetrahedron": 'body-centred-cubic tetrahedra (of a box: element = "bcc-tetrahedron")',
}


@dataclass(frozen=True)
class Fitness:
    """The result of `judge`.

    Attributes:
        fit: whether no finding is a fault, for all materials of the body.
        reasons: sentences of the findings that are faults; empty if the springs are fit.
        better: the recommended springs if these are not fit and are others.
        sentence: the result in words.
        findings: all findings, material by material.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> found = ts.judge(problem, ts.Springs("gaussian"))
        >>> found.fit, found.reasons
        (True, ())
    """

    fit: bool
    reasons: tuple[str, ...]
    better: Springs | None
    sentence: str
    findings: tuple[Finding, ...] = ()


@remembered
def judge(problem: Problem, springs: Springs, tolerance: float = 0.05) -> Fitness:
    """Return whether springs are fit for each material of a body, and which springs are better if not.

    Springs are fit if none has a negative stiffness, the undeformed body is stable, Young's modulus in every direction
    is within `tolerance` (relative) and Poisson's ratio within `tolerance` (absolute) of that of the material, and the
    patch test passes: under the boundary forces of a uniform stress, the displacement deviates from that of a uniform
    strain by less than `tolerance` (relative root mean square, worst stress). The displacement is compared rather than
    the unbalanced force, since variations from element to element average out, but stiff or soft regions do not.

    Coupled springs that equal finite elements of first order are also unfit if they lock at the Poisson's ratio, and on
    triangles and tetrahedra if they are more than `tolerance` too stiff in bending of the whole body.

    The bending factor on a lattice, and a patch test that fails only at outer elements that are cut from the lattice,
    are not faults, since both errors vanish on finer meshes.

    Raises ModelError if the springs do not fit the mesh, or do not resist every strain.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> found = ts.judge(problem, ts.Springs("lloyd"))
        >>> found.fit, found.better.rule
        (False, 'gaussian')
    """
    judged = _Judge(problem, tolerance)
    reasons = by_material(problem, lambda twin: (one.sentence for one in judged.faults(twin, springs)))
    better = judged.better(springs) if reasons else None
    sentences = judged.against(springs, better) if reasons else judged.in_favour(springs)
    found = tuple(one for twin in problem.homogeneous for one in all_findings(twin, springs))
    return Fitness(not reasons, reasons, better, " ".join(sentences), found)


@dataclass(frozen=True)
class _Judge:
    """Judges springs on one body within a tolerance."""

    problem: Problem
    tolerance: float

    def faults(self, twin: Problem, springs: Springs) -> list[Finding]:
        """Return the findings that make springs unfit for a body of one material."""
        return [one for one in all_findings(twin, springs) if CODES[one.code].fault and one.excess > self.tolerance]

    def better(self, than: Springs) -> Springs | None:
        """Return the recommended springs; None if these are `than`."""
        found = recommended(self.problem)
        return None if found == than else found

    def plain(self) -> Springs | None:
        """Return the nearest fit springs of pair forces, else the first with a volume term; None if none is fit."""
        rules = [name for name, rule in RULES.items() if rule.takes(self.problem.mesh) and not rule.coupled]
        plain = [Springs(name) for name in rules]
        # Nearly isotropic plain springs have nearly Cauchy's ratio: for other materials none is fit.
        near = max(abs(above) for above in self._above_cauchy()) <= 2 * self.tolerance
        fit = [springs for springs in plain if near and self._is_right(springs)]
        if fit:
            return min(fit, key=self._deviation)
        if lattice_classes(self.problem.mesh) is None:  # a volume term requires a lattice
            return None
        with_volume = (Springs(name, volume=True) for name in rules)
        return next((springs for springs in with_volume if self._is_right(springs)), None)

    def _above_cauchy(self) -> list[float]:
        """Return the Poisson's ratio of each material minus that of an isotropic lattice of plain springs."""
        section = self.problem.section
        assert section is not None  # required by springs
        ratios = [section.apparent_moduli(material)[1] for material in self.problem.materials]
        return [poisson - _CAUCHY[self.problem.mesh.dim] for poisson in ratios]

    def _is_right(self, springs: Springs) -> bool:
        """Return whether plain springs have no faults and no negative volume term."""
        try:
            if springs.counts(self.problem).n_negative:
                return False  # cheaper than the findings
            for twin in self.problem.homogeneous:
                if self.faults(twin, springs) or any(one.code == "unbounded" for one in all_findings(twin, springs)):
                    return False
        except ModelError:
            return False
        return True

    def _deviation(self, springs: Springs) -> float:
        """Return the deviation of the moduli for the worst material, rounded so that equal rules keep their order."""
        return max(round(moduli(twin, springs).deviation, 9) for twin in self.problem.homogeneous)

    def in_favour(self, springs: Springs) -> Iterator[str]:
        """Yield the sentences on fit springs."""
        yield f"Fit for {self._materials()}: {self._moduli(springs)}."
        yield from self._remarks(springs)
        yield from self._bending(springs)

    def against(self, springs: Springs, better: Springs | None) -> Iterator[str]:
        """Yield the sentences on springs that are not fit, and on better ones."""

        def reasons(twin: Problem) -> list[str]:
            return ["; ".join(one.sentence for one in self.faults(twin, springs)) or "they are fit"]

        found = "; ".join(by_material(self.problem, reasons))
        yield f"Not fit for {self._materials()} within {100 * self.tolerance:.6g} %: {found}."
        if better is None:
            yield "No other rule is better on this mesh. Finite elements of second order and finer meshes are better."
            yield from self._remarks(springs)
            yield from self._bending(springs)
            return
        yield f"Better: {keys(better)}: {self._moduli(better)}."
        yield from self._but(better)
        yield from self._remarks(better)
        yield from self._alternative()
        yield from self._bending(springs, better)

    def _alternative(self) -> Iterator[str]:
        """Yield a sentence on springs for programs that support pair forces only."""
        plain, element = self.plain(), self.problem.mesh.element
        if plain is not None:
            yield f"For programs that support pair forces only: {keys(plain)}."
        elif min(self._above_cauchy()) >= -self.tolerance and element in _ISOTROPIC_MESH:  # else on no mesh
            yield f"Springs of pair forces only require another mesh: {_ISOTROPIC_MESH[element]}."

    def _but(self, better: Springs) -> Iterator[str]:
        """Yield a sentence on the faults of the better springs, if any."""
        faults = by_material(self.problem, lambda twin: (one.sentence for one in self.faults(twin, better)))
        if faults:
            yield f"But {'; '.join(faults)}: use them for estimates only, or use finite elements of second order."

    def _materials(self) -> str:
        """Return the subject of a sentence on the materials of the body."""
        return "this material" if len(self.problem.homogeneous) == 1 else "these materials"

    def _moduli(self, springs: Springs) -> str:
        """Return the findings on Young's modulus and Poisson's ratio in words."""

        def both(twin: Problem) -> list[str]:
            return [", ".join(one.sentence for one in all_findings(twin, springs) if one.code in ("young", "poisson"))]

        return "; ".join(by_material(self.problem, both))

    def _remarks(self, springs: Springs) -> Iterator[str]:
        """Yield sentences on findings that are not faults."""
        codes = ("negative-weights", "outer-test", "locking-term", "coupled", "unbounded")

        def remarks(twin: Problem) -> list[str]:
            return [
                one.sentence for one in all_findings(twin, springs) if one.code in codes and one.excess > self.tolerance
            ]

        for text in by_material(self.problem, remarks):
            yield f"{text[0].upper()}{text[1:]}."

    def _bending(self, *several: Springs) -> Iterator[str]:
        """Yield the bending factors of springs, and of better ones if given, unless all are near 1."""
        twin = self.problem.homogeneous[0]
        known = [one for springs in several for one in all_findings(twin, springs) if one.code == "bending"]
        if not known or max(one.excess for one in known) <= self.tolerance:
            return
        text = known[0].sentence
        other = f"; the better springs have {known[1].numbers['factor']:.3f} times" if len(known) > 1 else ""
        yield f"{text[0].upper()}{text[1:]}{other}."


def recommended(problem: Problem) -> Springs:
    """Return the recommended springs for the mesh of a problem: Gaussian, of second order on simplices."""
    return Springs("gaussian", element="quadratic" if problem.mesh.element in SIMPLICES else None)


def keys(springs: Springs) -> str:
    """Return springs as keys of a study."""
    found = [f'rule = "{springs.rule}"']
    found += [f'element = "{springs.element}"'] if springs.element else []
    found += ["volume = true"] if springs.volume else []
    return ", ".join(found)


def follows_poisson(rule: str) -> bool:
    """Return whether the stiffness of a rule depends on Poisson's ratio, determined by evaluating the rule."""
    element = RULES[rule].elements[-1]
    flat = element in ("triangle", "quadrilateral")
    mesh = rectangle((1.0, 1.0), (1, 1), element) if flat else box((1.0, 1.0, 1.0), (1, 1, 1), element)
    held, section = Fixed(on="left", displacement=(1.0,) * mesh.dim), PlaneStress(1.0) if flat else None
    low, high = (
        Springs(rule).element_stiffness(Problem(mesh, Material(1.0, poisson), section, [held]))
        for poisson in (0.2, 0.3)
    )
    return not np.allclose(low, high, rtol=1e-9, atol=0)
