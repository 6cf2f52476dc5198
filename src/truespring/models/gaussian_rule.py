"""The rule `gaussian`: its potential, and the stiffness of its springs."""

from dataclasses import replace

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ModelError
from truespring.models.fem_potential import FemPotential
from truespring.models.fibres import stiff_fibres
from truespring.models.gaussian import GaussianElements, SummedGaussian
from truespring.models.gaussian_quadratic import GaussianQuadratic, gaussian_quadratic
from truespring.models.gaussian_weights import check_hourglass, hourglass_values, laplacians
from truespring.models.interpolation import SIMPLICES
from truespring.models.law import Law
from truespring.models.laws import LAWS, law_constants
from truespring.models.links import n_links
from truespring.models.quadratic import QuadraticPotential
from truespring.models.summed import SummedElements
from truespring.plugins import Names
from truespring.potential import Potential
from truespring.problem import Problem

#: Laws of Gaussian springs: functions of the trace of C and of the volume ratio.
GAUSSIAN_LAWS = Names(LAWS, lambda law: law.invariants is not None)

DEFAULT_LAW = "neo-hookean"


def gaussian_potential(
    problem: Problem, hourglass: float | None = None, element: str | None = None, law: str = DEFAULT_LAW
) -> GaussianElements | SummedGaussian | GaussianQuadratic:
    """Return Gaussian springs on the mesh of a problem.

    `law` is one of GAUSSIAN_LAWS. Raises ModelError for hourglass modes without stiffness, and for springs of second
    order on other meshes than triangles or tetrahedra, or of other laws than the neo-Hookean.
    """
    if element is not None:
        _check_quadratic(problem, hourglass, element, law)
        return gaussian_quadratic(problem)
    check_hourglass(problem.mesh, hourglass)
    values = hourglass_values(problem, hourglass)
    parts = tuple(_of_one_kind(part, law, values[numbers]) for numbers, part in problem.blocks)
    return parts[0] if len(parts) == 1 else SummedGaussian(parts, problem)


def _of_one_kind(problem: Problem, law: str, hourglass: Floats) -> GaussianElements:
    """Return Gaussian springs on elements of one kind; `hourglass` has shape (n_elements,)."""
    fibres = stiff_fibres(problem)
    forms = laplacians(problem, hourglass, None if fibres is None else fibres.directions)
    return GaussianElements(problem, LAWS[law], law_constants(problem, law), forms, fibres)


def with_law(potential: Potential | None, law: Law) -> Potential:
    """Return a potential of Gaussian springs with another law of the same constants, a function of I1 and ln J.

    Springs of second order become finite elements with the law at every Gauss point. Raises ModelError for other
    potentials.
    """
    match potential:
        case GaussianElements():
            return replace(potential, law=law)
        case SummedGaussian():
            return SummedGaussian(tuple(replace(part, law=law) for part in potential.parts), potential.problem)
        case QuadraticPotential():
            return QuadraticPotential(potential.problem, law, potential.constants, potential.fibres)
    raise ModelError(f"{type(potential).__name__} are not Gaussian springs: use rule = 'gaussian'")


def with_law_at_points(potential: Potential | None, law: Law) -> Potential:
    """Return finite elements with another law of the same constants at every Gauss point, on the mesh of the springs.

    Raises ModelError for other potentials than Gaussian springs.
    """
    match potential:
        case GaussianElements():
            return FemPotential(potential.problem, law, potential.constants, potential.fibres)
        case SummedGaussian():
            parts = [FemPotential(part.problem, law, part.constants, part.fibres) for part in potential.parts]
            return SummedElements(tuple(parts), potential.problem)
    return with_law(potential, law)


def gaussian_stiffness(
    problem: Problem, hourglass: float | None = None, element: str | None = None, law: str = DEFAULT_LAW
) -> Floats:
    """Return w = - mu integral of grad N_a . grad N_b [N/m], shape (n_elements, links), by the rule `gaussian`.

    The springs have zero rest length. Squares with c = hourglass/6, in mu t: edges c, diagonals 1/2 - c. Cubes with s =
    hourglass/12, in mu h, up to hourglass = 1: face diagonals s, body diagonals 1/4 - 2 s; above, with c = (5/6 - 6 s)
    / 4: body diagonals c, edges a = 2 s - 1/4 + c, face diagonals s - a. Triangles: mu t cot(opposite angle) / 2.
    If the mesh has several kinds of elements, rows are padded with zeros.
    """
    if element is not None:
        raise ModelError("element = 'quadratic' joins more nodes than the links of the mesh: see its potential")
    check_hourglass(problem.mesh, hourglass)
    values, found = hourglass_values(problem, hourglass), np.zeros((len(problem.mesh.elements), n_links(problem.mesh)))
    for numbers, part in problem.blocks:
        links = np.array(part.mesh.kind.links)
        own = laplacians(part, values[numbers])
        mu = part.of_elements(lambda material: material.lame.mu)
        found[numbers, : len(links)] = mu[:, None] * -own.matrices[0][own.of][:, links[:, 0], links[:, 1]]
    return found


def _check_quadratic(problem: Problem, hourglass: float | None, element: str, law: str) -> None:
    """Raise ModelError unless springs of second order are available."""
    if element != "quadratic":
        raise ModelError(f"element = '{element}' is unknown; allowed with rule = 'gaussian': quadratic")
    if problem.mesh.element not in SIMPLICES:
        raise ModelError(
            f"element = 'quadratic' requires a mesh of {' or '.join(SIMPLICES)} elements, this one has "
            f"{problem.mesh.kinds} elements: remove element; springs on these do not lock"
        )
    if hourglass is not None:
        raise ModelError(f"hourglass = {hourglass:g} has no effect on {problem.mesh.kinds} elements: remove it")
    if law != DEFAULT_LAW:
        raise ModelError(
            f"law = '{law}' is not available with element = 'quadratic' of rule = 'gaussian'; allowed: {DEFAULT_LAW}; "
            f"use kind = 'fem' with this law, or remove element"
        )
