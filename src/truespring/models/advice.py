"""What should be known of a model before it is solved, in words."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from truespring.models.by_rule import SpringsByRule
from truespring.models.interpolation import locks
from truespring.models.moduli import Moduli, moduli
from truespring.problem import Problem

# Moduli within this share are the material's, a bending factor within that one is worth no word.
_SAME_MODULI, _SAME_BENDING = 0.01, 0.05


def springs_warnings(problem: Problem, springs: SpringsByRule) -> tuple[str, ...]:
    """Return what should be known of springs: moduli other than the material's, springs that lock, in sentences."""
    found: dict[str, list[str]] = {}  # each warning once, with its materials
    for twin in problem.homogeneous:
        material = twin.material
        assert material is not None  # springs have asked for it
        for text in _springs_warnings(twin, springs, moduli(twin, springs)):
            found.setdefault(text, []).append(f"E is {material.young:g} Pa and Poisson's ratio {material.poisson:g}")
    everywhere = len(problem.homogeneous)
    return tuple(
        text if len(whose) == everywhere else f"where {' or '.join(whose)}: {text}" for text, whose in found.items()
    )


def _springs_warnings(problem: Problem, springs: SpringsByRule, realised: Moduli) -> Iterator[str]:
    yield from _moduli_warning(problem, realised)
    if not realised.stable:
        yield "these springs are not stable at rest: nodes inside the body have no positive stiffness"
    unit = "E h^2" if problem.mesh.dim == 3 else "E h"
    if realised.patch_score and not realised.lattice and not springs.coupled:
        yield (
            "on this irregular mesh a uniform strain is no equilibrium of these springs (patch test: "
            f"{realised.patch_score:.2g} {unit} unbalanced at inner nodes): they distort where the material would not; "
            "the rule biquadratic does not"
        )
    elif realised.patch_score:
        apart = float(np.linalg.norm(realised.body - realised.elasticity) / np.linalg.norm(realised.elasticity))
        if apart > _SAME_MODULI:
            yield (
                "this body is so thin that its outer elements count, which are not those of the lattice: its "
                f"elasticity is {apart:.1%} off that of the lattice, for which the moduli are told"
            )
    if realised.n_negative:
        yield f"{realised.n_negative} of {realised.n_springs} springs have a negative stiffness"
    factor = realised.bending[realised.depth] if realised.depth else 1.0
    if abs(factor - 1) > _SAME_BENDING:
        yield (
            f"bent along x, {realised.depth} elements deep, these springs have {factor:.4g} times the bending "
            "stiffness EI of the material"
        )
    material = problem.material
    assert material is not None  # springs have asked for it
    kappa = float(springs.kappa(problem)[0])
    if kappa < -1e-9 * material.young:  # not of rounding
        yield (
            f"the volume term has a negative modulus ({kappa:.4g} Pa, Poisson's ratio below "
            f"{'1/3' if problem.mesh.dim == 2 else '1/4'}): at large stretch nothing bounds the energy from below; "
            "the rule biquadratic has no such limit"
        )
    if springs_lock(problem, springs):
        yield (
            f"at a Poisson's ratio of {material.poisson:g} {problem.mesh.kinds} elements lock with these springs, "
            "as linear ones of FEM do: they are too stiff"
        )


def _moduli_warning(problem: Problem, realised: Moduli) -> Iterator[str]:
    directions: dict[str, Any]
    if realised.dim == 2:
        directions = {f"at {angle} degrees": angle for angle in (0, 45, 90)}
    else:
        directions = {"along x": (1, 0, 0), "along y": (0, 1, 0), "along z": (0, 0, 1)}
        directions |= {"along x + y": (1, 1, 0), "along x + y + z": (1, 1, 1)}
    found = {name: (realised.young(along), realised.poisson(along)) for name, along in directions.items()}
    if all(
        abs(young / realised.young_wanted - 1) <= _SAME_MODULI
        and abs(poisson - realised.poisson_wanted) <= _SAME_MODULI
        for young, poisson in found.values()
    ):
        return
    shown: dict[str, str] = {}  # each pair once, at its first direction
    for name, (young, poisson) in found.items():
        shown.setdefault(f"{young:.6g} Pa and {poisson:.4g}", name)
    said = ", ".join(f"{pair} {name}" for pair, name in shown.items())
    explained = f" ({problem.section.moduli_words})" if problem.section and problem.section.moduli_words else ""
    yield (
        f"these springs realise a Young's modulus and a Poisson's ratio of {said}; the material in its section "
        f"has {realised.young_wanted:.6g} Pa and {realised.poisson_wanted:.4g}{explained}"
    )


def springs_lock(twin: Problem, springs: SpringsByRule) -> bool:
    """Return whether springs are too stiff as linear finite elements are: coupled ones, and a term in each simplex."""
    simplices = twin.mesh.element in ("triangle", "tetrahedron")
    return locks(twin) and (springs.coupled or (springs.volume and simplices))
