"""Keys of `[models.NAME]`: one class for each kind, which builds the model."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from operator import or_
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import Discriminator, Field, model_validator

from truespring.errors import StudyError, nearest
from truespring.models import (
    ELEMENTS,
    GAUSSIAN_LAWS,
    LAWS,
    PAIR_LAWS,
    RULES,
    BemSprings,
    Fem,
    Heml,
    MassTensor,
    Model,
    PrescribedSprings,
    SpringNetwork,
    Springs,
    Terzopoulos,
    UserStiffness,
)
from truespring.models.pair_laws import STRAIGHT
from truespring.problem import Problem
from truespring.program import ReadSolution
from truespring.reference import CalculiX, read_stl
from truespring.solvers import Solver
from truespring.study.places import Places
from truespring.study.schema.values import (
    FemElement,
    FileName,
    Keys,
    LawName,
    Number,
    On,
    PlainRuleName,
    RuleName,
    SpringsLawName,
)
from truespring.study.spring_files import read_spring_files


@dataclass(frozen=True, eq=False)
class Scope:
    """The parts of a study that its models are built from.

    Attributes:
        places: locations of the keys, for error messages.
        problem, solver: problem and solver of the study.
        network: the network if the mesh is one, else None.
        models: the keys of all models of the study, by name.
        name: name of the model to build.
    """

    places: Places
    problem: Problem
    solver: Solver
    network: SpringNetwork | None
    models: Mapping[str, "ModelKeys"]
    name: str


class ModelKeys(Keys):
    """A model; a subclass has the key `kind` with one allowed value.

    Attributes:
        of_springs: whether the model consists of springs, which another program can solve.
    """

    of_springs: ClassVar[bool] = False
    if TYPE_CHECKING:  # with one value and a description in the subclass
        kind: Any

    @abstractmethod
    def build(self, scope: Scope) -> Model:
        """Return the model."""

    def check(self, scope: Scope, model: Any) -> None:
        """Raise TruespringError if the model does not fit the problem; solve nothing."""
        model.check(scope.problem)


class StiffnessKeys(Keys):
    """Stiffness of springs by kind, or of each spring from a CSV file.

    Numbers are in thickness times Young's modulus; in 3D in Young's modulus times element size.
    """

    edge: Number | None = Field(default=None, description="stiffness of the springs along edges")
    diagonal: Number = Field(default=0.0, description="stiffness of the springs along diagonals of faces")
    body: Number = Field(default=0.0, description="stiffness of the springs along body diagonals, in 3D")
    file: FileName | None = Field(
        default=None,
        description="CSV file of the stiffness of each spring, relative to the study: columns a, b, stiffness [N/m]",
    )
    volume: FileName | None = Field(
        default=None,
        description="CSV file of the volume term of each element, relative to the study: columns element, kappa [Pa]",
    )

    @model_validator(mode="after")
    def _numbers_or_file(self) -> Self:
        if self.file is None and self.edge is None:
            raise ValueError("edge is required and missing; or set file, a CSV file of the stiffness of each spring")
        if self.file is not None and {"edge", "diagonal", "body"} & self.model_fields_set:
            raise ValueError("file gives the stiffness of each spring: leave edge, diagonal and body out")
        if self.file is None and self.volume is not None:
            raise ValueError("volume, the moduli of the volume term, needs file, the stiffness of each spring")
        return self


class SpringsKeys(ModelKeys):
    """A mass-spring model."""

    of_springs: ClassVar[bool] = True

    kind: Literal["springs"] = Field(description="springs along edges and diagonals of the elements")
    rule: RuleName | None = Field(
        default=None,
        description=f"stiffness rule, which sets the stiffness of springs from the material: {', '.join(RULES)}",
    )
    stiffness: StiffnessKeys | None = Field(default=None, description="stiffness of the springs, instead of a rule")
    sharing: Literal["summed", "single"] = Field(
        default="summed",
        description="whether a spring sums the stiffness of all elements that share it, or takes that of one",
    )
    allow_negative: bool = Field(
        default=False,
        description="whether springs of negative stiffness are accepted; no effect with the rules biquadratic and "
        "gaussian",
    )
    volume: bool = Field(
        default=False,
        description="whether an area or volume term is added, so that the body has the Poisson's ratio of the material",
    )
    k_body: Number | None = Field(
        default=None,
        description="stiffness of the body diagonals of a cube, in Young's modulus times edge; rule isotropic only",
    )
    hourglass: Number | None = Field(
        default=None,
        description="stiffness of the hourglass modes over that of finite elements; rule gaussian only; default: 1 in "
        "the plane, a function of Poisson's ratio in space",
    )
    element: Literal["quadratic"] | None = Field(
        default=None,
        description="springs between all nodes of triangles or tetrahedra of second order; rule gaussian only",
    )
    law: SpringsLawName | None = Field(
        default=None,
        description=f"constitutive law of the rule gaussian: {', '.join(GAUSSIAN_LAWS)}; default: neo-hookean; force "
        f"law of the springs of the rules isotropic and lloyd, or of given stiffness: {', '.join(PAIR_LAWS)}; default: "
        f"{STRAIGHT}",
    )

    @property
    def _parameters(self) -> dict[str, Any]:
        """Parameters of the rule, by name."""
        return {name: getattr(self, name) for rule in RULES.own.values() for name in rule.parameters}

    @model_validator(mode="after")
    def _stiffness_read(self) -> Self:
        if self.stiffness is not None and self.stiffness.file is not None:
            named = sorted(({"rule", "sharing", "volume", *self._parameters} - {"law"}) & self.model_fields_set)
            if named:
                raise ValueError(f"stiffness is read from a file, so leave {' and '.join(named)} out")
        return self

    def build(self, scope: Scope) -> Springs | PrescribedSprings:
        """Return springs by a rule, by numbers, or from a file."""
        keys = self.stiffness
        if keys is not None and keys.file is not None:
            volume = None if keys.volume is None else scope.places.beside(keys.volume)
            file, law = scope.places.beside(keys.file), self.law or STRAIGHT
            return read_spring_files(scope.problem, file, volume, self.allow_negative, law)
        numbers = None if keys is None or keys.edge is None else UserStiffness(keys.edge, keys.diagonal, keys.body)
        return Springs(self.rule, numbers, self.sharing, self.allow_negative, self.volume, **self._parameters)


class FemKeys(ModelKeys):
    """A finite element model."""

    kind: Literal["fem"] = Field(description="finite elements")
    law: LawName = Field(description=f"constitutive law: {', '.join(LAWS)}")
    element: FemElement | None = Field(
        default=None, description=f"interpolation: {', '.join(ELEMENTS)}; default: one that does not lock"
    )

    def build(self, scope: Scope) -> Fem:
        """Return finite elements."""
        return Fem(self.law, self.element)


class HemlKeys(ModelKeys):
    """Hyper-elastic mass links."""

    kind: Literal["heml"] = Field(description="hyper-elastic mass links")
    law: LawName = Field(description="constitutive law")

    def build(self, scope: Scope) -> Heml:
        """Return the links."""
        return Heml(self.law)


class MassTensorKeys(ModelKeys):
    """The mass-tensor method."""

    kind: Literal["mass-tensor"] = Field(description="the mass-tensor method")
    law: LawName = Field(description="constitutive law")

    def build(self, scope: Scope) -> MassTensor:
        """Return the model."""
        return MassTensor(self.law)


class NetworkKeys(ModelKeys):
    """The spring network that is the mesh."""

    of_springs: ClassVar[bool] = True

    kind: Literal["network"] = Field(description="the springs of the mesh, a plain network")

    def build(self, scope: Scope) -> SpringNetwork:
        """Return the network."""
        if scope.network is None:
            raise StudyError('kind = "network" needs a [mesh] of nodes and springs')
        return scope.network


class CalculixKeys(ModelKeys):
    """CalculiX, with finite elements of a law or with the springs of another model of the study."""

    kind: Literal["calculix"] = Field(description="the same problem, solved by CalculiX")
    law: Literal["linear", "saint-venant-kirchhoff"] | None = Field(
        default=None, description="constitutive law of the finite elements"
    )
    springs: str | None = Field(
        default=None,
        description="name of a springs model of the study, to be solved by CalculiX instead of finite elements",
    )
    element: Literal["linear", "quadratic"] | None = Field(default=None, description="order of the finite elements")

    @model_validator(mode="after")
    def _one_body(self) -> Self:
        if self.element is not None and self.springs is not None:
            raise ValueError(
                "element and springs are set: element is for finite elements, springs names another model; set one"
            )
        if self.law is not None and self.springs is not None:
            raise ValueError(
                "law and springs are set: law is for finite elements, springs names another model; set one"
            )
        return self

    def build(self, scope: Scope) -> CalculiX:
        """Return the model; CalculiX is not run."""
        springs = None if self.springs is None else self._named(scope, self.springs)
        law = {} if self.law is None else {"law": self.law}
        return CalculiX(springs=springs, element=self.element, **law)

    def check(self, scope: Scope, model: CalculiX) -> None:
        """Raise TruespringError if CalculiX cannot solve the problem."""
        model.check_run(scope.problem, scope.solver)

    def _named(self, scope: Scope, name: str) -> Model:
        """Return the springs model of the study with this name; raise StudyError if there is none."""
        known = [one for one, keys in scope.models.items() if keys.of_springs]
        with scope.places.at("models", scope.name, "springs"):
            if name in known:
                return scope.models[name].build(scope)
            there = f"there are {', '.join(known)}" if known else "there are none"
            raise StudyError(f"'{name}' is not a springs model of this study{nearest(name, known)}: {there}")


class TerzopoulosKeys(ModelKeys):
    """The metric-tensor model on a regular grid."""

    kind: Literal["terzopoulos"] = Field(description="the metric-tensor model of Terzopoulos et al.")
    boundary: Literal["paper", "trapezoid"] = Field(
        default="paper", description="weights at the boundary: those of the paper, or of the trapezoidal rule"
    )

    def build(self, scope: Scope) -> Terzopoulos:
        """Return the model."""
        return Terzopoulos(self.boundary)


class BemSpringsKeys(ModelKeys):
    """A block of boundary elements, and springs elsewhere."""

    kind: Literal["bem-springs"] = Field(description="a block of boundary elements, springs elsewhere")
    block: On = Field(
        description="elements of the block: a group of an imported mesh, or a box that contains their centres"
    )
    rule: PlainRuleName = Field(default="isotropic", description="stiffness rule of the springs")
    corotated: bool = Field(default=False, description="whether the block may rotate without strain")

    def build(self, scope: Scope) -> BemSprings:
        """Return the block and the springs."""
        return BemSprings(self.block, self.rule, self.corotated)


class StlKeys(ModelKeys):
    """A deformed mesh of another program, as STL files with their length unit."""

    kind: Literal["stl"] = Field(description="a deformed mesh computed by another program")
    file: FileName = Field(description="STL file of the deformed body, relative to the study")
    undeformed: FileName | None = Field(
        default=None, description="STL file of the undeformed body with the same triangles"
    )
    load_factor: Annotated[Number, Field(gt=0, le=1)] = Field(default=1.0, description="load level of the file")
    unit: str = Field(default="m", description='length unit of the files, such as "mm", which STL files do not state')

    def build(self, scope: Scope) -> ReadSolution:
        """Return the solution in the files."""
        undeformed = None if self.undeformed is None else scope.places.beside(self.undeformed)
        file = scope.places.beside(self.file)
        return ReadSolution(read_stl(scope.problem, file, self.load_factor, undeformed, self.unit))

    def check(self, scope: Scope, model: Model) -> None:
        """Do nothing: `build` has checked the files."""


def _by_kind(*classes: type[ModelKeys]) -> Mapping[str, type[ModelKeys]]:
    """Return the classes by the allowed value of their key `kind`."""
    return MappingProxyType({get_args(one.model_fields["kind"].annotation)[0]: one for one in classes})


#: The keys of each kind of model; add the class of a new kind here.
MODEL_KINDS = _by_kind(
    SpringsKeys,
    FemKeys,
    HemlKeys,
    MassTensorKeys,
    TerzopoulosKeys,
    BemSpringsKeys,
    NetworkKeys,
    CalculixKeys,
    StlKeys,
)

if TYPE_CHECKING:
    AnyModel = ModelKeys
else:
    AnyModel = Annotated[reduce(or_, MODEL_KINDS.values()), Discriminator("kind")]
