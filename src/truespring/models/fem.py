"""The finite element model."""

from dataclasses import dataclass, field, replace

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
        law: the constitutive law, a key of LAWS.
        element: the interpolation. "linear" has full integration, 2 Gauss points per direction. "mean-dilatation"
            (quadrilaterals, hexahedra, wedges and pyramids) uses the mean volume ratio of the element. "quadratic"
            (triangles and tetrahedra) has nodes at the midpoints of edges; "quadratic-mean-dilatation" also uses the
            mean volume ratio in the part of lam. By default, None, elements do not lock: quadratic on triangles and
            tetrahedra, which are too stiff in bending if linear, and mean dilatation on all kinds above a Poisson's
            ratio of 0.4 in plane strain and 3D; otherwise linear. On a mesh of several kinds, triangles and tetrahedra
            are linear, since quadratic ones would not be conforming.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> ts.solve(problem, ts.Fem("neo-hookean"))
        Solution(neo-Hookean FEM, converged, 11 states up to load factor 1)
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
        """Name in figures and tables."""
        element = "" if self.element is None else f" ({self.element.replace('-', ' ')})"
        return f"{LAWS[self.law].label} FEM{element}"

    def chosen_element(self, problem: Problem) -> str:
        """Return the interpolation on the mesh of a problem; raise ModelError if the mesh does not allow `element`."""
        return chosen_interpolation(problem, self.law, self.element)

    @property
    def finite(self) -> bool:
        """Whether strains are finite; false for the linear law."""
        return LAWS[self.law].finite

    @property
    def takes_fibres(self) -> bool:
        """Whether fibres are included: under laws of finite strain; fibres that bear tension only are nonlinear."""
        return self.finite

    @property
    def element_is_open(self) -> bool:
        """Whether the mesh determines the interpolation."""
        return self.element is None

    def on_pieces(self, problem: Problem) -> "Fem | None":
        """Return the model with the interpolation on the whole mesh; None for elements of second order."""
        chosen = self.chosen_element(problem)
        return None if chosen.startswith("quadratic") else replace(self, element=chosen)

    def second_order(self, problem: Problem) -> "Fem | None":
        """Return the model with elements of second order, or None if the elements of this model are not linear."""
        return Fem(self.law) if self.chosen_element(problem) == "linear" else None

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return warnings about elements that lock or are too stiff in bending."""
        chosen, stiff = self.chosen_element(problem), stiff_simplices(problem)
        if chosen != "linear" or not locks(problem):
            return stiff
        largest = max(material.poisson for material in problem.materials)
        return (
            f"linear elements lock at a Poisson's ratio of {largest:g}: they are too stiff; "
            f'element = "{default_interpolations(problem, self.law)[-1]}", the default on this mesh, does not lock',
            *stiff,
        )

    def potential(self, problem: Problem) -> FemPotential | SummedElements:
        """Return the potential on the mesh of a problem."""
        return fem_potential(problem, self.law, self.chosen_element(problem))
