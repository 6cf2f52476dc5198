"""Finite elements on the same mesh, the embedded reference."""

from dataclasses import dataclass, field

from truespring.errors import ModelError, nearest
from truespring.models.fem_potential import FemPotential
from truespring.models.finite_elements import fem_potential
from truespring.models.interpolation import (
    ELEMENTS,
    chosen_interpolation,
    default_interpolations,
    locks,
    stiff_simplices,
)
from truespring.models.laws import LAWS
from truespring.models.model import Model
from truespring.models.summed import SummedElements
from truespring.problem import Problem


@dataclass(frozen=True)
class Fem(Model):
    """The finite element model.

    Attributes:
        law: a key of LAWS.
        element: "linear", full integration, 2 Gauss points a direction; "mean-dilatation" (quadrilaterals, hexahedra,
            wedges and pyramids), whose volume changes as a whole; "quadratic" (triangles and tetrahedra), with nodes
            in the middle of the edges, and "quadratic-mean-dilatation", these with lambda's part of the law at the
            mean volume. None takes what does not lock: quadratic ones on triangles and tetrahedra, since linear ones
            are too stiff in bending at any Poisson's ratio, and mean dilatation on all of them above a Poisson's ratio
            of 0.4 in plane strain and in 3D; linear ones on others. On a mesh of several kinds triangles and
            tetrahedra are linear: quadratic ones do not meet the others.
    """

    law: str = field()
    element: str | None = None

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise ModelError(f"law = '{self.law}' is unknown{nearest(self.law, LAWS)}; allowed: {', '.join(LAWS)}")
        if self.element is not None and self.element not in ELEMENTS:
            close = nearest(self.element, ELEMENTS)
            raise ModelError(f"element = '{self.element}' is unknown{close}; allowed: {', '.join(ELEMENTS)}")

    kind = "fem"

    @property
    def label(self) -> str:
        """How curves and tables call the model: the law is always named."""
        asked = "" if self.element is None else f" ({self.element.replace('-', ' ')})"
        return f"{LAWS[self.law].label} FEM{asked}"

    def chosen_element(self, problem: Problem) -> str:
        """Return the interpolation on the problem's mesh; raise ModelError where the one asked for is not for it."""
        return chosen_interpolation(problem, self.law, self.element)

    @property
    def finite(self) -> bool:
        """Whether strains are finite: false for the linear law."""
        return LAWS[self.law].finite

    @property
    def element_is_open(self) -> bool:
        """Whether the mesh decides on the interpolation."""
        return self.element is None

    def second_order(self, problem: Problem) -> "Fem | None":
        """Return the model of second order on triangles or tetrahedra; None where the own elements are as good."""
        return Fem(self.law) if self.chosen_element(problem) == "linear" else None

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return what should be known before the model is solved: elements that lock, or that are too stiff."""
        chosen, stiff = self.chosen_element(problem), stiff_simplices(problem)
        if chosen != "linear" or not locks(problem):
            return stiff
        largest = max(material.poisson for material in problem.materials)
        return (
            f"linear elements lock at a Poisson's ratio of {largest:g}: they are too stiff; "
            f'element = "{default_interpolations(problem, self.law)[-1]}", the default here, does not lock',
            *stiff,
        )

    def potential(self, problem: Problem) -> FemPotential | SummedElements:
        """Return the potential on the problem's mesh."""
        return fem_potential(problem, self.law, self.chosen_element(problem))
