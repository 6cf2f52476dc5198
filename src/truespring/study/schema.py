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

    shape: Literal["rectangle"]
    size: Annotated[list[Length], _two]
    elements: Annotated[list[_Count], _two]
    element: PlaneElement = "quadrilateral"
    diagonal: Diagonal = "right"


class BoxTable(Table):
    """A box, and what it is divided into."""

    shape: Literal["box"]
    size: Annotated[list[Length], _three]
    elements: Annotated[list[_Count], _three]
    element: SolidElement = "hexahedron"


class FileTable(Table):
    """A mesh from a file; mesh files know no units, so `unit` tells their length unit.

    `join` makes nodes at one place one; by default where no two elements share a node.
    """

    file: FileName
    unit: str = "m"
    join: bool | None = None


class VoxelsTable(Table):
    """A body from a label image, a hexahedron a voxel; `unit` is that of the image's lengths."""

    voxels: FileName
    label: int | str
    edge: Length | None = None
    unit: str = "mm"


class NetworkMeshTable(Table):
    """A plain network from two CSV files; the model of kind "network" takes their stiffness."""

    nodes: FileName
    springs: FileName


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

    young: Stress
    poisson: Number
    density: Density | None = None


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

    on: On


class SectionTable(Table):
    """How a plane body behaves across the plane."""

    kind: SectionKind
    thickness: Length


class SupportTable(Table):
    """Nodes that are held or moved."""

    on: On
    fix: Annotated[list[Direction], Field(min_length=1)] | None = None
    displacement: Annotated[list[Length], Field(min_length=2, max_length=3)] | None = None
    rotation: Angle = 0.0
    about: Annotated[list[Length], Field(min_length=2, max_length=3)] | None = None
    axis: Annotated[list[Number], _three] | None = None


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

    load_steps: Annotated[int, Field(ge=1, le=100_000)] = 10
    control: Literal["load", "displacement", "arc-length"] = "load"
    on: On = None
    direction: Direction | None = None
    to: Length | None = None
    max_steps: Annotated[int, Field(ge=1, le=100_000)] = 200
    tolerance: Annotated[Number, Field(gt=0, lt=1)] = 1e-10
    max_iterations: Annotated[int, Field(ge=1, le=100_000)] = 50
    method: Literal["auto", "mixed", "line-search"] = "auto"
    linear: Literal["auto", "direct", "multigrid", "pardiso", "rslab", "scipy"] = "auto"


class StiffnessTable(Table):
    """Springs of the user's own, in units of thickness times Young's modulus; in 3D of Young's modulus times size.

    Or spring by spring: `file` is a CSV file with columns a, b and stiffness, `volume` one with element and kappa.
    """

    edge: Number | None = None
    diagonal: Number = 0.0
    body: Number = 0.0
    file: FileName | None = None
    volume: FileName | None = None

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

    kind: Literal["springs"]
    rule: RuleName | None = None
    stiffness: StiffnessTable | None = None
    sharing: Literal["summed", "single"] = "summed"
    allow_negative: bool = False
    volume: bool = False
    k_body: Number | None = None

    @model_validator(mode="after")
    def _stiffness_read(self) -> "SpringsTable":
        if self.stiffness is not None and self.stiffness.file is not None:
            told = sorted({"rule", "sharing", "volume", "k_body"} & self.model_fields_set)
            if told:
                raise ValueError(f"stiffness is read from a file, spring by spring: leave {' and '.join(told)} out")
        return self


class FemTable(Table):
    """A finite element model."""

    kind: Literal["fem"]
    law: LawName
    element: FemElement | None = None


class HemlTable(Table):
    """Hyper-elastic mass links."""

    kind: Literal["heml"]
    law: LawName


class MassTensorTable(Table):
    """The mass-tensor method."""

    kind: Literal["mass-tensor"]
    law: LawName


class NetworkTable(Table):
    """The network of the mesh itself."""

    kind: Literal["network"]


class CalculixTable(Table):
    """The problem in CalculiX, as finite elements of a law, or as the springs of another model of the study."""

    kind: Literal["calculix"]
    law: Literal["linear", "saint-venant-kirchhoff"] | None = None
    springs: str | None = None
    element: Literal["linear", "quadratic"] | None = None

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

    kind: Literal["terzopoulos"]
    boundary: Literal["paper", "trapezoid"] = "paper"


class BemSpringsTable(Table):
    """A block of boundary elements, and springs beside it."""

    kind: Literal["bem-springs"]
    block: On
    rule: PlainRuleName = "isotropic"
    corotated: bool = False


class StlTable(Table):
    """A deformed mesh of another program; STL knows no units, so `unit` tells its length unit."""

    kind: Literal["stl"]
    file: FileName
    undeformed: FileName | None = None
    load_factor: Annotated[Number, Field(gt=0, le=1)] = 1.0
    unit: str = "m"


class CompareTable(Table):
    """Which path is compared with which, and where one looks."""

    model: str | None = None
    references: list[str] | None = None
    probe: Probe = None
    tolerance: Annotated[Number, Field(gt=0, lt=1)] = 0.05
    refine: bool = True


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

    title: str | None = None
    mesh: MeshTable
    material: MaterialTable | None = None
    region: list[RegionTable] = []
    section: SectionTable | None = None
    support: Annotated[list[SupportTable], Field(min_length=1)]
    load: list[load_form(LOADS)] = []  # type: ignore[valid-type]  # the type is made of the table
    solver: SolverTable = SolverTable()
    models: Annotated[dict[ModelName, ModelTable], Field(min_length=1)]
    compare: CompareTable = CompareTable()

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
