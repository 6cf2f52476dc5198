"""Findings about springs on a mesh: a code, numbers and a sentence each, for terminal, warnings and report."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from truespring.mesh import plural
from truespring.models.bending import bending_excess
from truespring.models.by_rule import SpringsByRule
from truespring.models.interpolation import SIMPLICES, locks
from truespring.models.moduli import Moduli, moduli
from truespring.models.patch import patch_test
from truespring.problem import Problem
from truespring.remembering import remembered


@dataclass(frozen=True)
class Finding:
    """A finding about springs on a mesh of one material.

    Attributes:
        code: subject of the finding, a key of CODES.
        numbers: values by name: relative values [-], moduli [Pa].
        sentence: the finding in words, without a full stop, for use after a semicolon.
        excess: relative deviation from the material; infinite if the finding has no degree.
    """

    code: str
    numbers: Mapping[str, float]
    sentence: str
    excess: float = math.inf


@dataclass(frozen=True, slots=True)
class Code:
    """The meaning of a code of findings.

    Attributes:
        meaning: in a few words.
        fault: whether springs are unfit if the excess is above the tolerance.
        noted: excess above which a model issues a warning; infinite for none.
    """

    meaning: str
    fault: bool
    noted: float = 0.0


#: The codes of findings, in the order of lists of findings.
CODES: MappingProxyType[str, Code] = MappingProxyType(
    {
        "young": Code("Young's modulus is not the material's in every direction", True, 0.01),
        "poisson": Code("Poisson's ratio is not the material's in every direction", True, 0.01),
        "negative": Code("springs have a negative stiffness", True),
        "negative-weights": Code("Gaussian springs across obtuse angles have a negative stiffness", False, math.inf),
        "unstable": Code("the springs are not stable at rest", True),
        "patch-score": Code("nodal forces of a uniform strain are not in balance on an irregular mesh", False),
        "patch-test": Code("a uniform stress does not cause a uniform strain", True, math.inf),
        "outer-test": Code("the patch test fails only at outer elements that differ from the lattice", False),
        "outer-elements": Code("outer elements differ from the lattice", False, 0.01),
        "locking": Code("the elements lock", True),
        "locking-term": Code("the volume terms lock", False),
        "simplices": Code("linear triangles or tetrahedra are too stiff in bending", True, math.inf),
        "coupled": Code("cost and law of coupled springs", False, math.inf),
        "unbounded": Code("the volume term is negative", False),
        "bending": Code("the bending stiffness of a strip is not that of the material", False, 0.05),
    }
)


def findings(problem: Problem, springs: SpringsByRule) -> tuple[Finding, ...]:
    """Return the findings on the moduli of springs, for a body of one material; nothing is solved."""
    return tuple(_ordered(_found(problem, springs)))


@remembered
def all_findings(problem: Problem, springs: SpringsByRule) -> tuple[Finding, ...]:
    """Return all findings for a body of one material; the patch test and bending require a linear solve."""
    return tuple(_ordered([*_found(problem, springs), *_tested(problem, springs)]))


def springs_warnings(problem: Problem, springs: SpringsByRule) -> tuple[str, ...]:
    """Return the warnings about springs: findings above `Code.noted`, with the material if there are several."""
    return by_material(
        problem,
        lambda twin: (one.sentence for one in findings(twin, springs) if one.excess > CODES[one.code].noted),
    )


def by_material(problem: Problem, sentences: Callable[[Problem], Iterable[str]]) -> tuple[str, ...]:
    """Return the sentences for each material of a body, each once, with the materials unless it applies to all."""
    twins = problem.homogeneous
    found: dict[str, list[str]] = {}
    for twin in twins:
        material = twin.material
        assert material is not None  # required by springs
        for text in sentences(twin):
            found.setdefault(text, []).append(f"E is {material.young:g} Pa and nu {material.poisson:g}")
    return tuple(
        text if len(whose) == len(twins) else f"where {' or '.join(whose)}, {text}" for text, whose in found.items()
    )


def _ordered(found: Iterable[Finding]) -> list[Finding]:
    """Return findings in the order of CODES."""
    order = list(CODES)
    return sorted(found, key=lambda one: order.index(one.code))


def _found(problem: Problem, springs: SpringsByRule) -> Iterator[Finding]:
    """Yield the findings that need no solve."""
    effective, material = moduli(problem, springs), problem.material
    assert material is not None  # required by springs
    yield from moduli_findings(problem, effective)
    if effective.n_negative:
        yield Finding(
            "negative-weights" if springs.coupled else "negative",
            {"n_negative": effective.n_negative, "n_springs": effective.n_springs},
            f"{effective.n_negative} of {effective.n_springs} springs have a negative stiffness"
            + (", across obtuse angles; the sum over each element is not negative" if springs.coupled else ""),
        )
    if not effective.stable:
        yield Finding("unstable", {}, "the undeformed springs are unstable: inner nodes have no positive stiffness")
    if effective.patch_score and not springs.coupled:
        yield from _scored(problem, effective)
    if springs_lock(problem, springs):
        code = "locking" if springs.coupled else "locking-term"
        what = "they are linear finite elements, which lock" if springs.coupled else "the volume terms lock"
        yield Finding(
            code,
            {"poisson": material.poisson},
            f"at a Poisson's ratio of {material.poisson:g} {what} on {problem.mesh.kinds} elements: too stiff",
        )
    if springs.coupled and springs.remark:
        yield Finding("coupled", {}, springs.remark)
    kappa = float(springs.kappa(problem)[0])
    if kappa < -1e-9 * material.young:  # above rounding
        yield Finding(
            "unbounded",
            {"kappa": kappa},
            f"the volume term has a negative modulus ({kappa:.4g} Pa): the energy is unbounded below at large stretch; "
            "the rule gaussian does not have this limit",
        )


def _scored(problem: Problem, effective: Moduli) -> Iterator[Finding]:
    """Yield the findings on a uniform strain that is not an equilibrium."""
    if not effective.lattice:
        unit = "E h^2" if problem.mesh.dim == 3 else "E h"
        yield Finding(
            "patch-score",
            {"score": effective.patch_score},
            "on this irregular mesh a uniform strain is not an equilibrium of these springs (patch test: unbalanced "
            f"force {effective.patch_score:.2g} {unit} at inner nodes); the rule gaussian passes",
        )
        return
    apart = float(np.linalg.norm(effective.body - effective.elasticity) / np.linalg.norm(effective.elasticity))
    yield Finding(
        "outer-elements",
        {"deviation": apart},
        f"the outer elements differ from the lattice: the elasticity of this body differs by {apart:.1%} from that of "
        "the lattice, whose effective moduli are reported",
        apart,
    )


def _tested(problem: Problem, springs: SpringsByRule) -> Iterator[Finding]:
    """Yield the findings that need a linear solve: bending of coupled simplices, and the patch test."""
    effective, kind = moduli(problem, springs), problem.mesh.element
    if springs.coupled and kind in springs.locks_on and kind in SIMPLICES and not springs_lock(problem, springs):
        excess = bending_excess(problem)
        yield Finding(
            "simplices",
            {"excess": excess},
            f"they are finite elements of linear {plural(kind)}, which are {100 * excess:.2g} % too stiff in bending "
            "on this mesh",
            excess,
        )
    if not effective.stable or not effective.patch_score or effective.n_negative or springs.coupled:
        return
    patch = patch_test(problem, springs)
    moved = f"displacements deviate by {100 * patch.error:.0f} % from a uniform strain"
    if patch.outside:
        text = f"the outer elements differ from the lattice: under a uniform load {moved}"
    else:
        text = "on this irregular mesh the patch test fails: under a uniform load "
        text += moved if math.isfinite(patch.error) else "no equilibrium is found"
    yield Finding("outer-test" if patch.outside else "patch-test", {"error": patch.error}, text, patch.error)


def moduli_findings(problem: Problem, effective: Moduli) -> tuple[Finding, ...]:
    """Return the findings on Young's modulus, Poisson's ratio and, if known, bending stiffness."""
    bending = () if effective.depth is None else (_bending(effective, effective.depth),)
    return (_young(problem, effective), _poisson(effective), *bending)


def _young(problem: Problem, effective: Moduli) -> Finding:
    """Return the finding on Young's modulus."""
    section = problem.section
    within = f"{section.within}, {section.moduli_words}," if section is not None and section.within else ""
    lowest, highest = (value / effective.material_young for value in effective.young_range)
    whose = f"that of the material{within} ({effective.material_young:.4g} Pa)"
    first, last = _rounded(lowest), _rounded(highest)
    where = f"is {first} times {whose} in every direction"
    if first != last:
        where = f"ranges from {first} to {last} times {whose} over all directions"
    numbers = {"lowest": lowest, "highest": highest, "material": effective.material_young}
    return Finding("young", numbers, f"Young's modulus {where}", max(abs(lowest - 1), abs(highest - 1)))


def _poisson(effective: Moduli) -> Finding:
    """Return the finding on Poisson's ratio."""
    lowest, highest = effective.poisson_range
    first, last, exact = _rounded(lowest), _rounded(highest), _rounded(effective.material_poisson)
    found = f"is {first}" if first == last else f"ranges from {first} to {last}"
    compared = "" if first == last == exact else f", that of the material is {exact}"
    numbers = {"lowest": lowest, "highest": highest, "material": effective.material_poisson}
    excess = max(abs(lowest - effective.material_poisson), abs(highest - effective.material_poisson))
    return Finding("poisson", numbers, f"Poisson's ratio {found}{compared}", excess)


def _bending(effective: Moduli, depth: int) -> Finding:
    """Return the finding on the bending stiffness at a depth in elements."""
    factor, elements = effective.bending[depth], effective.fem_bending[depth]
    return Finding(
        "bending",
        {"factor": factor, "fem": elements, "depth": depth},
        f"bent along x, {depth} element{'' if depth == 1 else 's'} deep, these springs have {factor:.3f} times the EI "
        f"of the material, finite elements on this mesh {elements:.3f} times",
        abs(factor - 1),
    )


def _rounded(value: float) -> str:
    """Return a number with three decimals, never -0.000."""
    return f"{round(value, 3) + 0.0:.3f}"


def springs_lock(twin: Problem, springs: SpringsByRule) -> bool:
    """Return whether springs lock on an element of the mesh at the Poisson's ratio of the material."""
    return locks(twin) and not set(springs.locks_on).isdisjoint(twin.mesh.element_kinds)
