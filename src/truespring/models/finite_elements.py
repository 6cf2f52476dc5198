"""The potential of finite elements, for every interpolation and for meshes of one or several kinds of elements."""

from truespring.mesh import MIXED
from truespring.models.fem_potential import FemPotential, of_one_kind, require_continuum
from truespring.models.mean_dilatation import MeanDilatationPotential
from truespring.models.quadratic import QuadraticPotential
from truespring.models.quadratic_mean import QuadraticMeanPotential
from truespring.models.summed import SummedElements
from truespring.problem import Problem

_POTENTIALS: dict[str, type[FemPotential]] = {
    kind.interpolation: kind
    for kind in (FemPotential, MeanDilatationPotential, QuadraticPotential, QuadraticMeanPotential)
}


def fem_potential(problem: Problem, law: str, interpolation: str = "linear") -> FemPotential | SummedElements:
    """Return the potential of a law on the mesh of a problem; for several kinds of elements, the sum over the kinds.

    Raises ModelError if the problem has no material or section, or a mesh of lines.
    """
    require_continuum(problem)
    kind = _POTENTIALS[interpolation]
    if problem.mesh.element == MIXED:
        return SummedElements(tuple(of_one_kind(part, law, kind) for _, part in problem.blocks), problem)
    return of_one_kind(problem, law, kind)
