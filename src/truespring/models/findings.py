"""Findings about springs on a mesh: made once, as a code, numbers and a sentence, for terminal, warnings and page."""

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
    """One thing to know of springs on a mesh of one material.

    Attributes:
        code: what it is about, a key of CODES.
        numbers: what was found, by name: shares without unit, moduli in Pa.
        sentence: the finding in words, without the full stop, to stand after a semicolon.
        excess: how far springs and material are apart, a share; infinite where that is no matter of degree.
    """

    code: str
    numbers: Mapping[str, float]
    sentence: str
    excess: float = math.inf


@dataclass(frozen=True, slots=True)
class Code:
    """What a code of findings is about.

    Attributes:
        meaning: in a few words.
        fault: whether springs are unfit where the excess is above the tolerance of whoever judges.
        noted: the excess from which on a model warns of it; infinite where it never does.
    """

    meaning: str
    fault: bool
    noted: float = 0.0


#: The codes of findings, in the order in which findings are listed.
CODES: MappingProxyType[str, Code] = MappingProxyType(
    {
        "young": Code("Young's modulus is not the material's in every direction", True, 0.01),
        "poisson": Code("Poisson's ratio is not the material's in every direction", True, 0.01),
        "negative": Code("springs have a negative stiffness", True),
        "unstable": Code("the springs are not stable at rest", True),
        "patch-score": Code("nodal forces of a uniform strain are not in balance on an irregular mesh", False),
        "patch-test": Code("a uniform stress does not strain the body uniformly", True, math.inf),
        "outer-test": Code("the patch test fails at outer elements only, which are not those of the lattice", False),
        "outer-elements": Code("outer elements are not those of the lattice", False, 0.01),
        "locking": Code("the elements lock", True),
        "locking-term": Code("the volume terms lock", False),
        "simplices": Code("linear triangles or tetrahedra are too stiff in bending", True, math.inf),
        "coupled": Code("coupled springs: their cost and their law", False, math.inf),
        "unbounded": Code("the volume term is negative", False),
        "bending": Code("the bending stiffness of a strip is not the material's", False, 0.05),
    }
)


def findings(problem: Problem, springs: SpringsByRule) -> tuple[Finding, ...]:
    """Return what the moduli of springs show, on a body of one material; cheap, nothing is solved."""
    return tuple(_ordered(_found(problem, springs)))


@remembered
def all_findings(problem: Problem, springs: SpringsByRule) -> tuple[Finding, ...]:
    """Return all findings, those of a patch test and of bending among them, which take a linear solve."""
    return tuple(_ordered([*_found(problem, springs), *_tested(problem, springs)]))


def springs_warnings(problem: Problem, springs: SpringsByRule) -> tuple[str, ...]:
    """Return the sentences of the findings that a model warns of, with their material where there are several."""
    noted = said(
        problem,
        lambda twin: (one.sentence for one in findings(twin, springs) if one.excess > CODES[one.code].noted),
    )
    return noted


def said(problem: Problem, say: Callable[[Problem], Iterable[str]]) -> tuple[str, ...]:
    """Return what `say` yields for each material of a body, each once, named by the material unless all have it."""
    twins = problem.homogeneous
    found: dict[str, list[str]] = {}
    for twin in twins:
        material = twin.material
        assert material is not None  # springs need one
        for text in say(twin):
            found.setdefault(text, []).append(f"E is {material.young:g} Pa and nu {material.poisson:g}")
    return tuple(
        text if len(whose) == len(twins) else f"where {' or '.join(whose)}, {text}" for text, whose in found.items()
    )


def _ordered(found: Iterable[Finding]) -> list[Finding]:
    order = list(CODES)
    return sorted(found, key=lambda one: order.index(one.code))


def _found(problem: Problem, springs: SpringsByRule) -> Iterator[Finding]:
    realised, material = moduli(problem, springs), problem.material
    assert material is not None  # springs need one
    yield from moduli_findings(problem, realised)
    if realised.n_negative:
        yield Finding(
            "negative",
            {"n_negative": realised.n_negative, "n_springs": realised.n_springs},
            f"{realised.n_negative} of {realised.n_springs} springs have a negative stiffness",
        )
    if not realised.stable:
        yield Finding("unstable", {}, "the springs are not stable at rest: inner nodes have no positive stiffness")
    if realised.patch_score and not springs.coupled:
        yield from _scored(problem, realised)
    if springs_lock(problem, springs):
        code = "locking" if springs.coupled else "locking-term"
        what = "they are linear finite elements, which lock" if springs.coupled else "the volume terms lock"
        yield Finding(
            code,
            {"poisson": material.poisson},
            f"at a Poisson's ratio of {material.poisson:g} {what} on {problem.mesh.kinds} elements: too stiff",
        )
    if springs.coupled:
        yield Finding(
            "coupled",
            {},
            "coupled springs cost more than plain ones; their law is St. Venant-Kirchhoff's, which softens in "
            "compression and differs from others, such as the neo-Hookean, from strains of some percent on",
        )
    kappa = float(springs.kappa(problem)[0])
    if kappa < -1e-9 * material.young:  # not of rounding
        yield Finding(
            "unbounded",
            {"kappa": kappa},
            f"the volume term has a negative modulus ({kappa:.4g} Pa): at large stretch nothing bounds the energy from "
            "below; the rule biquadratic has no such limit",
        )


def _scored(problem: Problem, realised: Moduli) -> Iterator[Finding]:
    if not realised.lattice:
        unit = "E h^2" if problem.mesh.dim == 3 else "E h"
        yield Finding(
            "patch-score",
            {"score": realised.patch_score},
            "on this irregular mesh a uniform strain is no equilibrium of these springs (patch test: "
            f"{realised.patch_score:.2g} {unit} unbalanced at inner nodes); the rule biquadratic passes",
        )
        return
    apart = float(np.linalg.norm(realised.body - realised.elasticity) / np.linalg.norm(realised.elasticity))
    yield Finding(
        "outer-elements",
        {"deviation": apart},
        f"the outer elements are not those of the lattice: the elasticity of this body is {apart:.1%} off the "
        "lattice's, for which the effective moduli are given",
        apart,
    )


def _tested(problem: Problem, springs: SpringsByRule) -> Iterator[Finding]:
    realised, kind = moduli(problem, springs), problem.mesh.element
    if springs.coupled and kind in SIMPLICES and not springs_lock(problem, springs):
        excess = bending_excess(problem)
        yield Finding(
            "simplices",
            {"excess": excess},
            f"they are finite elements of linear {plural(kind)}, which on this mesh are too stiff in bending by "
            f"{100 * excess:.2g} %",
            excess,
        )
    if not realised.stable or not realised.patch_score or realised.n_negative or springs.coupled:
        return
    patch = patch_test(problem, springs)
    moved = f"nodes are displaced {100 * patch.error:.0f} % off a uniform strain"
    if patch.outside:
        text = f"its outer elements are not those of the lattice: under uniform load {moved}"
    else:
        text = "on this irregular mesh the patch test fails: under uniform load "
        text += moved if math.isfinite(patch.error) else "no equilibrium is found"
    yield Finding("outer-test" if patch.outside else "patch-test", {"error": patch.error}, text, patch.error)


def moduli_findings(problem: Problem, realised: Moduli) -> tuple[Finding, ...]:
    """Return the findings on Young's modulus, Poisson's ratio and, where known, bending stiffness, of known moduli."""
    bending = () if realised.depth is None else (_bending(realised, realised.depth),)
    return (_young(problem, realised), _poisson(realised), *bending)


def _young(problem: Problem, realised: Moduli) -> Finding:
    section = problem.section
    within = f"{section.within}, {section.moduli_words}," if section is not None and section.within else ""
    lowest, highest = (value / realised.young_wanted for value in realised.young_range)
    whose = f"the material's{within} ({realised.young_wanted:.4g} Pa)"
    first, last = _rounded(lowest), _rounded(highest)
    where = f"is {first} times {whose} in every direction"
    if first != last:
        where = f"runs from {first} to {last} times {whose} over the directions"
    numbers = {"lowest": lowest, "highest": highest, "material": realised.young_wanted}
    return Finding("young", numbers, f"Young's modulus {where}", max(abs(lowest - 1), abs(highest - 1)))


def _poisson(realised: Moduli) -> Finding:
    lowest, highest = realised.poisson_range
    first, last, wanted = _rounded(lowest), _rounded(highest), _rounded(realised.poisson_wanted)
    found = f"is {first}" if first == last else f"runs from {first} to {last}"
    beside = "" if first == last == wanted else f", the material's is {wanted}"
    numbers = {"lowest": lowest, "highest": highest, "material": realised.poisson_wanted}
    excess = max(abs(lowest - realised.poisson_wanted), abs(highest - realised.poisson_wanted))
    return Finding("poisson", numbers, f"Poisson's ratio {found}{beside}", excess)


def _bending(realised: Moduli, depth: int) -> Finding:
    factor, elements = realised.bending[depth], realised.fem_bending[depth]
    return Finding(
        "bending",
        {"factor": factor, "fem": elements, "depth": depth},
        f"bent along x, {depth} element{'' if depth == 1 else 's'} deep, these springs have {factor:.3f} times the "
        f"material's EI, finite elements on this mesh {elements:.3f}",
        abs(factor - 1),
    )


def _rounded(value: float) -> str:
    """A number with three decimals, and no zero below zero."""
    return f"{round(value, 3) + 0.0:.3f}"


def springs_lock(twin: Problem, springs: SpringsByRule) -> bool:
    """Return whether springs are too stiff as linear finite elements are: coupled ones, and a term in each simplex."""
    return locks(twin) and (springs.coupled or (springs.volume and twin.mesh.element in SIMPLICES))
