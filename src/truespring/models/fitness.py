"""Fitness: whether springs are fit for a material on a mesh, and which rule is better, before anything is solved."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from truespring.errors import ModelError
from truespring.loading import Fixed
from truespring.material import Material, PlaneStress
from truespring.mesh import box, rectangle
from truespring.models.elasticity import lattice_classes
from truespring.models.findings import CODES, Finding, all_findings, said, springs_lock
from truespring.models.interpolation import SIMPLICES
from truespring.models.moduli import moduli, spring_counts
from truespring.models.response import Response, response
from truespring.models.rules import RULES
from truespring.models.springs import Springs
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
        fit: whether no finding is a fault for any material of the body.
        reasons: the sentences of the findings that are faults, empty where springs are fit.
        better: springs to take instead, None where these are fit or no others are better: plain ones before those with
            a volume term before coupled ones; where coupled ones lock, those whose response is nearest.
        sentence: all of it in words, with findings on springs that are fit.
        findings: all findings, those of each material in turn.
    """

    fit: bool
    reasons: tuple[str, ...]
    better: Springs | None
    sentence: str
    findings: tuple[Finding, ...] = ()


@remembered
def judge(problem: Problem, springs: Springs, tolerance: float = 0.05) -> Fitness:
    """Return whether springs are fit for each material of a body, and which are better where they are not.

    Springs are fit that have no negative stiffness, are stable at rest, have Young's modulus in every direction within
    the share `tolerance` of the material's and Poisson's ratio within `tolerance` itself, and pass the patch test:
    under forces on its boundary as of a uniform stress the body strains uniformly, but for `tolerance` of the
    displacement (root mean square, the worst stress). That displacement says how much a body deforms otherwise than by
    its moduli, which the unbalanced force does not: disorder from element to element averages out, regions that are too
    stiff or too soft do not.

    Coupled springs, which are finite elements of first order, are unfit too where they lock at the Poisson's ratio, and
    on triangles and tetrahedra, whose strain is uniform, where they are too stiff by more than `tolerance` when the
    whole body is bent. They are better than other springs whose moduli are wrong, which the sentence then says, unless
    they lock: then what is better is the springs whose response to stretch and bending is nearest to the material's.

    Finer elements mend the bending factor, and the patch test of a body that is cut from a lattice and fails at its
    outer elements only: these decide nothing.

    Raises ModelError where the springs do not go with the mesh, or do not resist every strain.
    """
    judged = _Judge(problem, tolerance)
    reasons = said(problem, lambda twin: (one.sentence for one in judged.faults(twin, springs)))
    better = judged.better(springs) if reasons else None
    sentences = judged.against(springs, better) if reasons else judged.in_favour(springs)
    found = tuple(one for twin in problem.homogeneous for one in all_findings(twin, springs))
    return Fitness(not reasons, reasons, better, " ".join(sentences), found)


@dataclass(frozen=True)
class _Judge:
    """One body, and how near to its materials springs must be."""

    problem: Problem
    tolerance: float

    def faults(self, twin: Problem, springs: Springs) -> list[Finding]:
        """The findings for which springs are unfit for a body of one material."""
        return [one for one in all_findings(twin, springs) if CODES[one.code].fault and one.excess > self.tolerance]

    def better(self, than: Springs) -> Springs | None:
        """The plain springs nearest to the material, else the first others whose moduli are right and do not lock."""
        rules = [name for name, rule in RULES.items() if rule.takes(self.problem.mesh)]
        plain = [Springs(name) for name in rules if not RULES[name].coupled]
        # Plain springs that are nearly isotropic are nearly at Cauchy's ratio: for others none need be tried.
        near = max(abs(above) for above in self._above_cauchy()) <= 2 * self.tolerance
        fit = [springs for springs in plain if near and self._is_right(springs)]
        if fit:
            return min(fit, key=self._deviation)
        lattice = lattice_classes(self.problem.mesh) is not None  # others have no volume term
        others = [Springs(one.rule, volume=True) for one in plain if lattice]
        others += [Springs(name) for name in rules if RULES[name].coupled]
        found = next((springs for springs in others if self._is_right(springs)), None)
        if found is not None and found.coupled and self._locks(found) and self.problem.mesh.element in SIMPLICES:
            found = self._nearest([found, *plain, than])
        return None if found == than else found

    def _above_cauchy(self) -> list[float]:
        """How far each material's Poisson's ratio is above that of an isotropic lattice of plain springs."""
        section = self.problem.section
        assert section is not None  # springs need one
        ratios = [section.apparent_moduli(material)[1] for material in self.problem.materials]
        return [poisson - _CAUCHY[self.problem.mesh.dim] for poisson in ratios]

    def _is_right(self, springs: Springs) -> bool:
        """Whether the moduli of springs are right, and nothing else is wrong but being linear elements."""
        codes = {"locking", "simplices"}
        try:
            mesh, stiffness = self.problem.mesh, springs.element_stiffness(self.problem)
            if not springs.coupled and spring_counts(mesh, stiffness).n_negative:
                return False  # before anything is relaxed
            for twin in self.problem.homogeneous:
                wrong = {one.code for one in self.faults(twin, springs)} - codes
                if wrong or any(one.code == "unbounded" for one in all_findings(twin, springs)):
                    return False
        except ModelError:
            return False
        return True

    def _locks(self, springs: Springs) -> bool:
        return any(springs_lock(twin, springs) for twin in self.problem.homogeneous)

    def _nearest(self, several: list[Springs]) -> Springs | None:
        """The springs whose response to stretch and bending is nearest to the material's, the first of equal ones."""
        known = [(found.worst, springs) for springs in several if (found := self._response(springs)) is not None]
        return min(known, key=lambda one: round(one[0], 9))[1] if known else None

    def _response(self, springs: Springs) -> Response | None:
        """The response for the worst material; None where it is not known."""
        try:
            found = [response(twin, springs) for twin in self.problem.homogeneous]
        except ModelError:
            return None
        known = [one for one in found if one is not None]
        return max(known, key=lambda one: one.worst) if len(known) == len(found) else None

    def _deviation(self, springs: Springs) -> float:
        """Of the worst material; what differs by rounding alone is equal, and the first rule stands."""
        return max(round(moduli(twin, springs).deviation, 9) for twin in self.problem.homogeneous)

    def in_favour(self, springs: Springs) -> Iterator[str]:
        """Say of springs that they are fit, with their findings."""
        yield f"Fit for {self._whom()}: {self._moduli(springs)}."
        yield from self._remarks(springs)
        yield from self._bending(springs)

    def against(self, springs: Springs, better: Springs | None) -> Iterator[str]:
        """Say of springs that they are not fit, and which are better."""

        def reasons(twin: Problem) -> list[str]:
            return ["; ".join(one.sentence for one in self.faults(twin, springs)) or "they are fit"]

        found = "; ".join(said(self.problem, reasons))
        yield f"Not fit for {self._whom()} within {100 * self.tolerance:.6g} %: {found}."
        if better is None:
            mend = " Finite elements of second order and finer meshes are better." if springs.coupled else ""
            yield f"No rule here is better on this mesh.{mend}"
            yield from self._remarks(springs) if springs.coupled else ()
            yield from self._bending(springs)
            return
        key = f'rule = "{better.rule}"' + (", volume = true" if better.volume else "")
        yield f"Better here: {key}: {self._moduli(better)}."
        yield from self._but(better)
        yield from self._remarks(better)
        simpler = min(self._above_cauchy()) >= -self.tolerance  # below, the volume term is negative on any mesh
        if better.coupled and simpler and self.problem.mesh.element in _ISOTROPIC_MESH:
            yield f"Plain springs need another mesh: {_ISOTROPIC_MESH[self.problem.mesh.element]}."
        yield from self._bending(springs, better)

    def _but(self, better: Springs) -> Iterator[str]:
        """Say what is wrong with the better springs too: elements that are too stiff, or moduli that are not right."""
        faults = said(self.problem, lambda twin: (one.sentence for one in self.faults(twin, better)))
        if not faults:
            return
        nearest = self._response(better) if self._locks(Springs("biquadratic")) else None
        if nearest is None:
            yield f"But {'; '.join(faults)}: use them for a first look only, or finite elements of second order."
            return
        yield (
            f"But they are not fit either: the whole body deforms {_signed(nearest.stretch)} under stretch and "
            f"{_signed(nearest.bending)} in bending, nearer to the material than by other rules, some of which lock; "
            "use them for a first look only, or finite elements that do not lock."
        )

    def _whom(self) -> str:
        return "this material" if len(self.problem.homogeneous) == 1 else "these materials"

    def _moduli(self, springs: Springs) -> str:
        def both(twin: Problem) -> list[str]:
            return [", ".join(one.sentence for one in all_findings(twin, springs) if one.code in ("young", "poisson"))]

        return "; ".join(said(self.problem, both))

    def _remarks(self, springs: Springs) -> Iterator[str]:
        codes = ("outer-test", "locking-term", "coupled", "unbounded")

        def remarks(twin: Problem) -> list[str]:
            return [
                one.sentence for one in all_findings(twin, springs) if one.code in codes and one.excess > self.tolerance
            ]

        for text in said(self.problem, remarks):
            yield f"{text[0].upper()}{text[1:]}."

    def _bending(self, *several: Springs) -> Iterator[str]:
        """The bending factors on this mesh, of springs and, if any, of better ones, where one is far from 1."""
        twin = self.problem.homogeneous[0]
        known = [one for springs in several for one in all_findings(twin, springs) if one.code == "bending"]
        if not known or max(one.excess for one in known) <= self.tolerance:
            return
        text = known[0].sentence
        beside = f"; the better springs {known[1].numbers['factor']:.3f}" if len(known) > 1 else ""
        yield f"{text[0].upper()}{text[1:]}{beside}."


def _signed(error: float) -> str:
    """An error of a deformation in words: 12 % too little."""
    return f"{100 * abs(error):.0f} % too {'little' if error < 0 else 'much'}"


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
