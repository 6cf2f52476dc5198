"""The tables of a study file, as pydantic knows them. Numbers are SI; texts carry units."""

import math
from collections.abc import Callable, Collection, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PlainValidator,
    Tag,
    WithJsonSchema,
    create_model,
    field_validator,
    model_validator,
)

from truespring.errors import TruespringError, nearest, shown
from truespring.loading import LOADS, Load, LoadKind
from truespring.material import SECTIONS
from truespring.mesh import DIAGONALS, PLANE_ELEMENTS, SOLID_ELEMENTS, Box, Near, Plane, Selection
from truespring.models import ELEMENTS, LAWS, RULES, Constant, material_constants
from truespring.units import LARGEST, SI_UNITS, SIZES, SMALLEST, Dimension, to_si


def _as_value_error(convert: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Pydantic collects ValueErrors; ours are TruespringErrors."""

    def converted(value: Any) -> Any:
        try:
            return convert(value)
        except TruespringError as error:
            raise ValueError(str(error)) from None

    return converted


def _si(dimension: Dimension) -> BeforeValidator:
    return BeforeValidator(_as_value_error(lambda value: to_si(value, dimension)))


def _quantity(dimension: Dimension) -> WithJsonSchema:
    unit, example = SI_UNITS[dimension]
    description = f"a {dimension}: a number in {unit}, or a text with its unit such as {example}"
    return WithJsonSchema({"type": ["number", "string"], "description": description})


def _key_of(table: Collection[str]) -> BeforeValidator:
    """Accept the names of a table such as RULES, so that it is the one list of them."""

    def check(value: Any) -> Any:
        if not isinstance(value, str) or value not in table:
            told = f"{shown(value)} is unknown{nearest(shown(value), table)}"
            raise ValueError(f"{told}; allowed: {', '.join(table)}")
        return value

    return BeforeValidator(check)


def _strict_number(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{shown(value)} is not a number")
    if value == value and abs(value) != math.inf and value and not SMALLEST <= abs(value) <= LARGEST:
        raise ValueError(f"{shown(value)} is out of range: a number {SIZES} is wanted, or zero")
    return value


def _file_name(value: Any) -> Any:
    if isinstance(value, str) and not value.isprintable():
        raise ValueError(f"{shown(value)} is not a file name: it has a non-printing character")
    return value


Length = Annotated[float, _si("length"), _quantity("length")]
Stress = Annotated[float, _si("stress"), _quantity("stress")]
Density = Annotated[float, _si("density"), _quantity("density")]
Angle = Annotated[float, _si("angle"), _quantity("angle")]
_QUANTITIES: dict[Dimension, Any] = {
    dimension: Annotated[float, _si(dimension), _quantity(dimension)] for dimension in SI_UNITS
}
_RULES = {"description": "; ".join(f"{name}: {rule.idea}" for name, rule in RULES.items())}
RuleName = Annotated[str, _key_of(RULES), WithJsonSchema({"enum": list(RULES)} | _RULES)]
_PLAIN_RULES = [name for name, rule in RULES.items() if not rule.coupled]
PlainRuleName = Annotated[str, _key_of(_PLAIN_RULES), WithJsonSchema({"enum": _PLAIN_RULES})]
_LAWS = {"description": "; ".join(f"{name}: {law.source}" for name, law in LAWS.items())}
LawName = Annotated[str, _key_of(LAWS), WithJsonSchema({"enum": list(LAWS)} | _LAWS)]
FemElement = Annotated[str, _key_of(ELEMENTS), WithJsonSchema({"enum": list(ELEMENTS)})]
PlaneElement = Annotated[str, _key_of(PLANE_ELEMENTS), WithJsonSchema({"enum": list(PLANE_ELEMENTS)})]
SolidElement = Annotated[str, _key_of(SOLID_ELEMENTS), WithJsonSchema({"enum": list(SOLID_ELEMENTS)})]
Diagonal = Annotated[str, _key_of(DIAGONALS), WithJsonSchema({"enum": list(DIAGONALS)})]
SectionKind = Annotated[str, _key_of(SECTIONS), WithJsonSchema({"enum": list(SECTIONS)})]
Number = Annotated[float, BeforeValidator(_strict_number), Field(allow_inf_nan=False)]
#: A file, beside the study's own where the name is no absolute one.
FileName = Annotated[str, BeforeValidator(_file_name), Field(min_length=1)]
Direction = Literal["x", "y", "z"]

_SELECTION_FORMS = (
    'a side ("left", "right", "bottom", "top", "back", "front"), a group of an imported mesh, a point '
    '("right-middle"), { x = "0 mm" }, { box = [[xmin, ymin], [xmax, ymax]] } or { near = [x, y] }'
)


def _selection(value: Any) -> Selection:
    if isinstance(value, str):
        return value
    if not isinstance(value, dict) or len(value) != 1:
        raise TruespringError(f"{shown(value)} is no selection; allowed: {_SELECTION_FORMS}")
    ((key, what),) = value.items()
    if key in ("x", "y", "z"):
        return Plane(key, to_si(what, "length"))
    if key == "near":
        return Near(_point(what))
    if key == "box":
        if isinstance(what, list) and len(what) in (4, 6):  # the corners in one list
            what = [what[: len(what) // 2], what[len(what) // 2 :]]
        if not isinstance(what, list) or len(what) != 2:
            raise TruespringError(f"box = {shown(what)}: two corners are wanted, [[xmin, ymin], [xmax, ymax]]")
        return Box(_point(what[0]), _point(what[1]))
    known = ("x", "y", "z", "box", "near")
    raise TruespringError(f"{shown(key)} is no selection{nearest(key, known)}; allowed: {_SELECTION_FORMS}")


def _point(value: Any) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) not in (2, 3):
        raise TruespringError(f'{shown(value)} is no point: wanted are coordinates such as ["160 mm", "20 mm"]')
    return tuple(to_si(coordinate, "length") for coordinate in value)


def _probe(value: Any) -> str | tuple[float, ...]:
    return value if isinstance(value, str) else _point(value)


_ON_SCHEMA = {
    "description": _SELECTION_FORMS,
    "anyOf": [
        {"type": "string"},
        *(
            {"type": "object", "properties": {key: form}, "required": [key], "additionalProperties": False}
            for key, form in (
                ("x", {"type": ["number", "string"]}),
                ("y", {"type": ["number", "string"]}),
                ("z", {"type": ["number", "string"]}),
                ("box", {"type": "array", "minItems": 2, "maxItems": 6}),
                ("near", {"type": "array", "items": {"type": ["number", "string"]}}),
            )
        ),
    ],
}
On = Annotated[Any, PlainValidator(_as_value_error(_selection)), WithJsonSchema(_ON_SCHEMA)]
_POINT_SCHEMA = {"type": "array", "items": {"type": ["number", "string"]}}
Probe = Annotated[
    Any, PlainValidator(_as_value_error(_probe)), WithJsonSchema({"anyOf": [{"type": "string"}, _POINT_SCHEMA]})
]


class Table(BaseModel):
    """A table of a study file: frozen, and without keys that it does not know."""

    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True, strict=True, protected_namespaces=())


_Count = Annotated[int, Field(ge=1, le=10**9)]
_two, _three = Field(min_length=2, max_length=2), Field(min_length=3, max_length=3)


class RectangleTable(Table):
    """A rectangle, and what it is divided into."""

    shape: Literal["rectangle"] = Field(description="a rectangle with a corner in the origin")
    size: Annotated[list[Length], _two] = Field(description="lengths along x and y")
    elements: Annotated[list[_Count], _two] = Field(description="numbers of elements along x and y")
    element: PlaneElement = Field(default="quadrilateral", description="kind of elements")
    diagonal: Diagonal = Field(default="right", description="how triangles split each rectangle")


class BoxTable(Table):
    """A box, and what it is divided into."""

    shape: Literal["box"] = Field(description="a box with a corner in the origin")
    size: Annotated[list[Length], _three] = Field(description="lengths along x, y and z")
    elements: Annotated[list[_Count], _three] = Field(description="numbers of elements along x, y and z")
    element: SolidElement = Field(default="hexahedron", description="kind of elements")


class FileTable(Table):
    """A mesh from a file; mesh files know no units, so `unit` tells their length unit.

    `join` makes nodes at one place one; by default where no two elements share a node.
    """

    file: FileName = Field(
        description="mesh file, relative to the study: gmsh .msh, Abaqus or CalculiX .inp, VTK .vtk and .vtu"
    )
    unit: str = Field(default="m", description='length unit of the file, such as "mm", which mesh files do not state')
    join: bool | None = Field(
        default=None,
        description="whether nodes at the same position become one; default: only where no two elements share a node",
    )


class VoxelsTable(Table):
    """A body from a label image, a hexahedron a voxel; `unit` is that of the image's lengths."""

    voxels: FileName = Field(description="label image, relative to the study: .nii, .nrrd, .mha, .vti or .npy")
    label: int | str = Field(
        description="label of the body in the image: its value, or its name where the file has names"
    )
    edge: Length | None = Field(
        default=None, description="edge of the cubes to which the image is resampled; default: its own voxels"
    )
    unit: str = Field(default="mm", description="length unit of the image")


class NetworkMeshTable(Table):
    """A plain network from two CSV files; the model of kind "network" takes their stiffness."""

    nodes: FileName = Field(description="CSV file of nodes, relative to the study: columns x, y and, in 3D, z [m]")
    springs: FileName = Field(
        description="CSV file of springs, relative to the study: columns a, b, stiffness [N/m], rest_length [m]"
    )


def _mesh_form(value: Any) -> str | None:
    """Tell the table of a mesh by its keys."""
    if not isinstance(value, dict):
        return None
    return next((form for form in ("file", "voxels", "springs") if form in value), str(value.get("shape")))


MeshTable = Annotated[
    Annotated[RectangleTable, Tag("rectangle")]
    | Annotated[BoxTable, Tag("box")]
    | Annotated[FileTable, Tag("file")]
    | Annotated[VoxelsTable, Tag("voxels")]
    | Annotated[NetworkMeshTable, Tag("springs")],
    Discriminator(_mesh_form),
]


class _PlainMaterialTable(Table):
    """What the body is made of."""

    young: Stress = Field(description='Young\'s modulus: a number in Pa, or a string with its unit such as "10 kPa"')
    poisson: Number = Field(description="Poisson's ratio")
    density: Density | None = Field(default=None, description="density, needed for gravity")


def with_constants(table: type[Table], name: str, constants: Mapping[str, Constant]) -> type[Table]:
    """Return a table of this name that takes the constants of laws too, each an optional key with its unit."""
    fields: dict[str, Any] = {}
    for key, constant in constants.items():
        quantity = Number if constant.dimension is None else _QUANTITIES[constant.dimension]
        described = Field(default=None, description=f"{constant.meaning} [{constant.unit}]")
        fields[key] = (quantity | None, described)
    return create_model(name, __base__=table, __doc__=table.__doc__, **fields)


if TYPE_CHECKING:
    MaterialTable = _PlainMaterialTable
else:
    MaterialTable = with_constants(_PlainMaterialTable, "MaterialTable", material_constants())


class RegionTable(MaterialTable):
    """A part of the body of another material."""

    on: On = Field(
        description="elements of this material: a group of an imported mesh, or a box that holds their centres"
    )


class SectionTable(Table):
    """How a plane body behaves across the plane."""

    kind: SectionKind = Field(description="whether stress or strain vanishes across the plane")
    thickness: Length = Field(
        description='thickness of the body: a number in m, or a string with its unit such as "10 mm"'
    )


class SupportTable(Table):
    """Nodes that are held or moved."""

    on: On = Field(description=f"nodes that are held or moved: {_SELECTION_FORMS}")
    fix: Annotated[list[Direction], Field(min_length=1)] | None = Field(
        default=None, description="directions that are held or prescribed; default: all"
    )
    displacement: Annotated[list[Length], Field(min_length=2, max_length=3)] | None = Field(
        default=None, description="prescribed displacement at full load; default: none, the nodes are held"
    )
    rotation: Angle = Field(
        default=0.0,
        description='prescribed rotation at full load, anticlockwise in 2D, about an axis in 3D: radians, or "10 deg"',
    )
    about: Annotated[list[Length], Field(min_length=2, max_length=3)] | None = Field(
        default=None, description="centre of the rotation; default: the centre of the selection"
    )
    axis: Annotated[list[Number], _three] | None = Field(default=None, description="axis of the rotation in 3D")


class LoadTable(Table):
    """A load: one key names it; all but those of the whole body act on a selection."""

    on: On = None
    kinds: ClassVar[Mapping[str, LoadKind]] = {}

    @model_validator(mode="after")
    def _one_load(self) -> Self:
        given = [name for name in self.kinds if getattr(self, name) is not None]
        if len(given) != 1:
            found = f"{' and '.join(given)} are given" if given else "nothing is given"
            raise ValueError(f"{found}: a load has one of {', '.join(self.kinds)}")
        if self.kind.on_selection and self.on is None:
            raise ValueError(f"on is required and missing: where the {self.key} acts")
        if not self.kind.on_selection and self.on is not None:
            raise ValueError(f"{self.key} acts on the whole body: leave out on")
        for key in sorted(self.model_fields_set - {"on", self.key, *self.kind.further}):
            raise ValueError(f"{key} does not go with {self.key}: leave it out")
        for key, quantity in self.kind.further.items():
            if getattr(self, key) is None and quantity.default is None:
                raise ValueError(f"{key} is required and missing: {quantity.about}")
        return self

    @property
    def key(self) -> str:
        """The key that names the load."""
        return next(name for name in self.kinds if getattr(self, name) is not None)

    @property
    def kind(self) -> LoadKind:
        """What the load is."""
        return self.kinds[self.key]

    @property
    def values(self) -> dict[str, Any]:
        """The values of the load's keys in SI, by key."""
        given = {key: getattr(self, key) for key in (self.key, *self.kind.further)}
        return {key: self.kind.quantities(self.key)[key].default if one is None else one for key, one in given.items()}

    def load(self) -> Load:
        """Return the load."""
        quantities = self.kind.quantities(self.key)
        arguments: dict[str, Any] = {quantities[key].argument: value for key, value in self.values.items()}
        return self.kind.load(**({"on": self.on} if self.kind.on_selection else {}), **arguments)


def load_form(kinds: Mapping[str, LoadKind]) -> type[LoadTable]:
    """Return the schema of `[[load]]` that takes these loads."""
    keys = {key: one for name, kind in kinds.items() for key, one in kind.quantities(name).items()}
    fields: dict[str, Any] = {}
    for key, quantity in keys.items():
        number: Any = _QUANTITIES[quantity.dimension]
        form: Any = Annotated[list[number], Field(min_length=2, max_length=3)] if quantity.vector else number
        fields[key] = (form | None, Field(None, description=quantity.about))
    made: type[LoadTable] = create_model("LoadTable", __base__=LoadTable, __doc__=LoadTable.__doc__, **fields)
    made.kinds = kinds
    return made


class SolverTable(Table):
    """How equilibrium is found."""

    load_steps: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=10, description="number of load levels between no load and full load"
    )
    control: Literal["load", "displacement", "arc-length"] = Field(
        default="load",
        description="what is prescribed at each step: the load, a displacement, or the arc length of the path",
    )
    on: On = Field(
        default=None, description="with control by displacement: the nodes whose mean displacement is prescribed"
    )
    direction: Direction | None = Field(
        default=None, description="with control by displacement: the direction of that displacement"
    )
    to: Length | None = Field(
        default=None, description="with control by displacement: the displacement at the end of the path"
    )
    max_steps: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=200, description="with control by arc length: largest number of steps"
    )
    tolerance: Annotated[Number, Field(gt=0, lt=1)] = Field(
        default=1e-10,
        description="unbalanced force over the larger of applied and internal force at which a level is solved",
    )
    max_iterations: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=50, description="largest number of Newton iterations per load level, before the step is reduced"
    )
    method: Literal["auto", "mixed", "line-search"] = Field(
        default="auto",
        description="Newton's method with mixed integration points, with a line search, or one after the other",
    )
    linear: Literal["auto", "direct", "multigrid", "pardiso", "rslab", "scipy"] = Field(
        default="auto",
        description="solver of linear systems: direct or multigrid, by size; or a library that factorises",
    )


class StiffnessTable(Table):
    """Springs of the user's own, in units of thickness times Young's modulus; in 3D of Young's modulus times size.

    Or spring by spring: `file` is a CSV file with columns a, b and stiffness, `volume` one with element and kappa.
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
    def _numbers_or_file(self) -> "StiffnessTable":
        if self.file is None and self.edge is None:
            raise ValueError("edge is required and missing; or file, with the stiffness of each spring")
        if self.file is not None and {"edge", "diagonal", "body"} & self.model_fields_set:
            raise ValueError("file tells the stiffness of each spring: leave edge, diagonal and body out")
        if self.file is None and self.volume is not None:
            raise ValueError("volume, the moduli of the volume term, goes with a file of springs: file is missing")
        return self


class SpringsTable(Table):
    """A mass-spring model."""

    kind: Literal["springs"] = Field(description="springs along edges and diagonals of the elements")
    rule: RuleName | None = Field(
        default=None,
        description=f"stiffness rule, which sets the stiffness of springs from the material: {', '.join(RULES)}",
    )
    stiffness: StiffnessTable | None = Field(default=None, description="stiffness of the springs, instead of a rule")
    sharing: Literal["summed", "single"] = Field(
        default="summed",
        description="whether a spring sums the stiffness of all elements that share it, or takes that of one",
    )
    allow_negative: bool = Field(default=False, description="whether springs of negative stiffness are accepted")
    volume: bool = Field(
        default=False,
        description="whether an area or volume term is added, so that the body has the Poisson's ratio of the material",
    )
    k_body: Number | None = Field(
        default=None,
        description="stiffness of the body diagonals of a cube, in Young's modulus times edge; rule isotropic only",
    )

    @model_validator(mode="after")
    def _stiffness_read(self) -> "SpringsTable":
        if self.stiffness is not None and self.stiffness.file is not None:
            told = sorted({"rule", "sharing", "volume", "k_body"} & self.model_fields_set)
            if told:
                raise ValueError(f"stiffness is read from a file, spring by spring: leave {' and '.join(told)} out")
        return self


class FemTable(Table):
    """A finite element model."""

    kind: Literal["fem"] = Field(description="finite elements")
    law: LawName = Field(description=f"constitutive law: {', '.join(LAWS)}")
    element: FemElement | None = Field(
        default=None, description=f"interpolation: {', '.join(ELEMENTS)}; default: one that does not lock"
    )


class HemlTable(Table):
    """Hyper-elastic mass links."""

    kind: Literal["heml"] = Field(description="hyper-elastic mass links")
    law: LawName = Field(description="constitutive law")


class MassTensorTable(Table):
    """The mass-tensor method."""

    kind: Literal["mass-tensor"] = Field(description="the mass-tensor method")
    law: LawName = Field(description="constitutive law")


class NetworkTable(Table):
    """The network of the mesh itself."""

    kind: Literal["network"] = Field(description="the springs of the mesh, a plain network")


class CalculixTable(Table):
    """The problem in CalculiX, as finite elements of a law, or as the springs of another model of the study."""

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
    def _one_body(self) -> "CalculixTable":
        if self.element is not None and self.springs is not None:
            raise ValueError(
                "element and springs are given: an element is of a continuum, springs name a model; give one"
            )
        if self.law is not None and self.springs is not None:
            raise ValueError("law and springs are given: a law is for a continuum, springs name a model; give one")
        return self


class TerzopoulosTable(Table):
    """The metric-tensor model on a regular grid."""

    kind: Literal["terzopoulos"] = Field(description="the metric-tensor model of Terzopoulos et al.")
    boundary: Literal["paper", "trapezoid"] = Field(
        default="paper", description="weights at the boundary: those of the paper, or of the trapezoidal rule"
    )


class BemSpringsTable(Table):
    """A block of boundary elements, and springs beside it."""

    kind: Literal["bem-springs"] = Field(description="a block of boundary elements, springs elsewhere")
    block: On = Field(
        description="elements of the block: a group of an imported mesh, or a box that holds their centres"
    )
    rule: PlainRuleName = Field(default="isotropic", description="stiffness rule of the springs")
    corotated: bool = Field(default=False, description="whether the block may rotate without strain")


class StlTable(Table):
    """A deformed mesh of another program; STL knows no units, so `unit` tells its length unit."""

    kind: Literal["stl"] = Field(description="a deformed mesh computed by another program")
    file: FileName = Field(description="STL file of the deformed body, relative to the study")
    undeformed: FileName | None = Field(
        default=None, description="STL file of the undeformed body with the same triangles"
    )
    load_factor: Annotated[Number, Field(gt=0, le=1)] = Field(default=1.0, description="load level of the file")
    unit: str = Field(default="m", description='length unit of the files, such as "mm", which STL files do not state')


class CompareTable(Table):
    """Which path is compared with which, and where one looks."""

    model: str | None = Field(
        default=None, description="name of the model that is compared with the others; default: the first springs"
    )
    references: list[str] | None = Field(
        default=None, description="names of the models that it is compared with; default: all others"
    )
    probe: Probe = Field(
        default=None,
        description='node that the curves follow: "right-middle", or coordinates; default: the node that moves most',
    )
    tolerance: Annotated[Number, Field(gt=0, lt=1)] = Field(
        default=0.05, description="largest error at which two models agree"
    )
    refine: bool = Field(
        default=True, description="whether each reference is solved on finer meshes too, to estimate its own error"
    )


#: What a model may be, by its kind.
MODEL_KINDS: MappingProxyType[str, type[Table]] = MappingProxyType(
    {
        "springs": SpringsTable,
        "fem": FemTable,
        "heml": HemlTable,
        "mass-tensor": MassTensorTable,
        "terzopoulos": TerzopoulosTable,
        "bem-springs": BemSpringsTable,
        "network": NetworkTable,
        "calculix": CalculixTable,
        "stl": StlTable,
    }
)
ModelTable = Annotated[
    SpringsTable
    | FemTable
    | HemlTable
    | MassTensorTable
    | TerzopoulosTable
    | BemSpringsTable
    | NetworkTable
    | CalculixTable
    | StlTable,
    Discriminator("kind"),
]
ModelName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")]


class StudyTable(Table):
    """A whole study file."""

    title: str | None = Field(default=None, description="title of the report; default: the file's name")
    mesh: MeshTable = Field(description="the body: a shape, a mesh file, a label image or a network")
    material: MaterialTable | None = Field(default=None, description="material of the body")
    region: list[RegionTable] = Field(
        default=[], description="parts of another material; where regions overlap, the last one applies"
    )
    section: SectionTable | None = Field(default=None, description="section of a plane body; absent in 3D")
    support: Annotated[list[SupportTable], Field(min_length=1)] = Field(
        description="supports, which together prevent rigid-body motion"
    )
    load: list[load_form(LOADS)] = Field(  # type: ignore[valid-type]  # the type is made of the table
        default=[], description="loads; load_factor scales all of them, linearly"
    )
    solver: SolverTable = Field(default=SolverTable(), description="how equilibrium is found")
    models: Annotated[dict[ModelName, ModelTable], Field(min_length=1)] = Field(
        description="models to solve, by names of your choice"
    )
    compare: CompareTable = Field(default=CompareTable(), description="which models are compared, and where")

    @field_validator("models")
    @classmethod
    def _names_of_files(cls, models: dict[str, ModelTable]) -> dict[str, ModelTable]:
        """Names become files: none may be another's on a system that tells no case, nor one that Windows keeps."""
        seen: set[str] = set()
        for name in models:
            if name.casefold() in seen | _TAKEN_NAMES:
                raise ValueError(f"'{name}' cannot be told from another file on every system: choose another name")
            seen.add(name.casefold())
        return models


_DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{number}" for port in ("com", "lpt") for number in range(1, 10))}
_TAKEN_NAMES = {"figures"} | _DEVICES
