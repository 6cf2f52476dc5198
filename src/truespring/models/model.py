"""The base class of models."""

from typing import Any

from truespring.completing import completed
from truespring.errors import ModelError
from truespring.mesh import Remainder
from truespring.models.fem_potential import FiniteElements
from truespring.models.fibres import stiff_fibres
from truespring.models.laws import LAWS
from truespring.models.moduli import Moduli
from truespring.potential import Potential
from truespring.problem import Problem


class Model:
    """A model of a body, which makes the potential of a problem.

    Subclasses define `kind`, `label` and `potential`; the rest has defaults. A user-defined class need not derive from
    it: `solve` accepts any object with a method `potential(problem)`, and any potential. See `as_model`.

    Attributes:
        kind: kind of the model in study files and summaries.
        law: name of the constitutive law; None for models without one.
        has_springs: whether the potential consists of springs, which are drawn and exported.
        any_mesh: whether the model can be solved on other meshes of the body, for refinement.
        solves: whether the model is solved; false for a solution that is read from a file.
    """

    kind: str = "potential"
    law: str | None = None
    has_springs: bool = False
    any_mesh: bool = True
    solves: bool = True

    @property
    def label(self) -> str:
        """Name in figures and tables."""
        return type(self).__name__

    @property
    def lines(self) -> str:
        """Name of the lines of the potential in figures."""
        return "springs"

    @property
    def takes_fibres(self) -> bool:
        """Whether the potential includes the stiffness of the material's fibres; without, such fibres are an error."""
        return False

    @property
    def finite(self) -> bool:
        """Whether strains are finite; false for a linear theory, in which loads act on the undeformed body."""
        return True

    @property
    def limit(self) -> str:
        """A sentence on a deformation that the law does not reach, without a full stop; "" if there is none."""
        return LAWS[self.law].limit if self.law is not None and self.law in LAWS else ""

    @property
    def element_is_open(self) -> bool:
        """Whether the mesh determines the interpolation, which is of second order on triangles or tetrahedra."""
        return False

    def potential(self, problem: Problem) -> Potential:
        """Return the potential of a problem; raise ModelError if the model does not fit the problem."""
        raise NotImplementedError(f"{type(self).__name__} has no method potential(problem)")

    def check(self, problem: Problem) -> None:
        """Raise ModelError if the model does not fit the problem; nothing is solved."""
        self.potential(problem)

    def label_on(self, problem: Problem) -> str:
        """Return the name of the model for a problem in figures and tables."""
        return self.label

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return warnings about the model for a problem, as sentences."""
        return ()

    def moduli(self, problem: Problem) -> Moduli | None:
        """Return the effective moduli on the mesh of a problem, all of it of its material; None if unknown."""
        return None

    def chosen_element(self, problem: Problem) -> str | None:
        """Return the interpolation of finite elements on the mesh, one of ELEMENTS; None for other models."""
        return None

    def on_pieces(self, problem: Problem) -> "Model | None":
        """Return the model whose potentials on pieces of the mesh add up to that of this model on all of it.

        None if the energy is not such a sum over elements. Pieces have no elements in common. What depends on the whole
        mesh, such as a default, is fixed in the model that is returned.
        """
        return None

    def on_remainder(self, left: Remainder) -> "Model":
        """Return the model on the elements that a cut leaves, which keep the springs that they have.

        Raises ModelError if the model cannot be cut.
        """
        return self

    def second_order(self, problem: Problem) -> "Model | None":
        """Return a model with elements of second order and the same limit on fine meshes; None if there is none."""
        return None


class BarePotential(Model):
    """The model of a given potential."""

    def __init__(self, potential: Potential) -> None:
        self._potential = potential

    @property
    def label(self) -> str:
        """Name of the class of the potential."""
        return type(self._potential).__name__

    @property
    def takes_fibres(self) -> bool:
        """True: a given potential is used as it is."""
        return True

    @property
    def finite(self) -> bool:
        """Whether strains are finite; false for finite elements of the linear law."""
        return not isinstance(self._potential, FiniteElements) or self._potential.law.finite

    def potential(self, problem: Problem) -> Potential:
        """Return the potential."""
        return self._potential

    def on_remainder(self, left: Remainder) -> Model:
        """Raise ModelError: of a given potential it is not known what a cut leaves."""
        raise ModelError(
            f"{self.label}: a given potential cannot be cut: give a model with the method potential(problem), which "
            "is called again for the elements that remain"
        )

    def chosen_element(self, problem: Problem) -> str | None:
        """Return the interpolation of finite elements, None for other potentials."""
        return self._potential.interpolation if isinstance(self._potential, FiniteElements) else None


def as_model(model: Any) -> Model:
    """Return a Model for a model, a potential or an object with a method `potential(problem)`.

    Raises ModelError for anything else.
    """
    if isinstance(model, Model):
        return model
    if isinstance(model, Potential):
        return BarePotential(model)
    if not hasattr(model, "potential"):
        raise ModelError(f"{model!r} is not a model: use Springs(rule=...), Fem(law=...) or a SpringNetwork")
    return completed(model, Model)


def check_fibres(problem: Problem, model: Model) -> None:
    """Raise ModelError if the material has fibres with a stiffness, which the model would ignore."""
    if model.takes_fibres or not model.solves or stiff_fibres(problem) is None:
        return
    raise ModelError(
        f"{model.label}: this model has no fibres, the material has fibres with k1 > 0: use rule = 'gaussian', or "
        "kind = 'fem' with a law of finite strain; fibres with k1 = 0 may have an active tension in every model"
    )
