"""A model: how matter is idealised, and what the rest of the code asks of it."""

from typing import Any

from truespring.completing import completed
from truespring.errors import ModelError
from truespring.models.fem_potential import FiniteElements
from truespring.models.moduli import Moduli
from truespring.potential import Potential
from truespring.problem import Problem


class Model:
    """How matter is idealised. A subclass gives `kind`, `label` and `potential`; the other answers have defaults.

    A class of the user's own need not derive from it: `solve` takes any object with a method `potential(problem)`,
    and any potential. See `as_model`.

    Attributes:
        kind: the kind of model in study files and summaries.
        law: the name of the constitutive law, None for models without one.
        has_springs: whether the potential is springs: drawn and exported as such.
        any_mesh: whether the model can be solved on other meshes of the body, as refinement does.
        solves: whether anything is solved; false for a solution that was read from a file.
        lines: the name of the lines of the potential in pictures.
    """

    kind: str = "potential"
    law: str | None = None
    has_springs: bool = False
    any_mesh: bool = True
    solves: bool = True
    lines: str = "springs"

    @property
    def label(self) -> str:
        """The name of the model in figures and tables."""
        return type(self).__name__

    @property
    def finite(self) -> bool:
        """Whether strains are finite; false for a linear theory, whose loads act on the undeformed body."""
        return True

    @property
    def element_is_open(self) -> bool:
        """Whether the mesh decides on the interpolation: on triangles or tetrahedra it is of second order then."""
        return False

    def potential(self, problem: Problem) -> Potential:
        """Build the potential of the problem's body; raise ModelError where the model does not fit it."""
        raise NotImplementedError(f"{type(self).__name__} has no method potential(problem)")

    def check(self, problem: Problem) -> None:
        """Raise ModelError where the model does not fit the problem; solve nothing."""
        self.potential(problem)

    def label_on(self, problem: Problem) -> str:
        """Return the name of the model of this problem."""
        return self.label

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return what should be known before the model is solved, in sentences."""
        return ()

    def moduli(self, problem: Problem) -> Moduli | None:
        """Return the effective moduli on the problem's mesh, all of it of its own material; None where not known."""
        return None

    def chosen_element(self, problem: Problem) -> str | None:
        """Return the interpolation of finite elements on the problem's mesh, one of ELEMENTS; None of other models."""
        return None

    def second_order(self, problem: Problem) -> "Model | None":
        """Return a model of elements of second order with the same limit under refinement; None where there is none."""
        return None


class BarePotential(Model):
    """A potential that is solved as it is."""

    def __init__(self, potential: Potential) -> None:
        self._potential = potential

    @property
    def label(self) -> str:
        """The name of the potential's class."""
        return type(self._potential).__name__

    @property
    def finite(self) -> bool:
        """Whether strains are finite: false for finite elements of the linear law."""
        return not isinstance(self._potential, FiniteElements) or self._potential.law.finite

    def potential(self, problem: Problem) -> Potential:
        """Return the potential."""
        return self._potential

    def chosen_element(self, problem: Problem) -> str | None:
        """Return the interpolation of finite elements, None of other potentials."""
        return self._potential.interpolation if isinstance(self._potential, FiniteElements) else None


def as_model(given: Any) -> Model:
    """Return a model, a potential or a user's object with a method `potential(problem)` as a Model.

    Raises ModelError for anything else.
    """
    if isinstance(given, Model):
        return given
    if isinstance(given, Potential):
        return BarePotential(given)
    if not hasattr(given, "potential"):
        raise ModelError(f"{given!r} is no model: give Springs(rule=...), Fem(law=...) or a SpringNetwork")
    return completed(given, Model)
