"""Pydantic types of values in study files: quantities in SI units, names, selections and files."""

import math
from collections.abc import Callable, Collection
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainValidator, WithJsonSchema

from truespring.errors import TruespringError, nearest, shown
from truespring.material import SECTIONS
from truespring.mesh import DIAGONALS, PLANE_ELEMENTS, SOLID_ELEMENTS, Box, Near, Plane, Selection
from truespring.models import ELEMENTS, LAWS, PAIR_LAWS, RULES
from truespring.units import LARGEST, SI_UNITS, SIZES, SMALLEST, Dimension, to_si


def as_value_error(convert: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a conversion that raises ValueError, which pydantic collects, instead of TruespringError."""

    def converted(value: Any) -> Any:
        try:
            return convert(value)
        except TruespringError as error:
            raise ValueError(str(error)) from None

    return converted


def _si(dimension: Dimension) -> BeforeValidator:
    return BeforeValidator(as_value_error(lambda value: to_si(value, dimension)))


def _quantity(dimension: Dimension) -> WithJsonSchema:
    unit, example = SI_UNITS[dimension]
    description = f"{dimension}: a number in {unit}, or a string with its unit such as {example}"
    return WithJsonSchema({"type": ["number", "string"], "description": description})


def key_of(names: Collection[str]) -> BeforeValidator:
    """Return a validator that accepts the keys of a mapping such as RULES."""

    def check(value: Any) -> Any:
        if not isinstance(value, str) or value not in names:
            raise ValueError(f"{shown(value)} is unknown{nearest(shown(value), names)}; allowed: {', '.join(names)}")
        return value

    return BeforeValidator(check)


def _strict_number(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{shown(value)} is not a number")
    if value == value and abs(value) != math.inf and value and not SMALLEST <= abs(value) <= LARGEST:
        raise ValueError(f"{shown(value)} is out of range: must be a number {SIZES}, or zero")
    return value


def _file_name(value: Any) -> Any:
    if isinstance(value, str) and not value.isprintable():
        raise ValueError(f"{shown(value)} is not a file name: it has a non-printing character")
    return value


Length = Annotated[float, _si("length"), _quantity("length")]
Stress = Annotated[float, _si("stress"), _quantity("stress")]
Density = Annotated[float, _si("density"), _quantity("density")]
Stiffness = Annotated[float, _si("stiffness"), _quantity("stiffness")]
StiffnessPerArea = Annotated[float, _si("stiffness per area"), _quantity("stiffness per area")]
Angle = Annotated[float, _si("angle"), _quantity("angle")]
Time = Annotated[float, _si("time"), _quantity("time")]
Rate = Annotated[float, _si("rate"), _quantity("rate")]
Speed = Annotated[float, _si("speed"), _quantity("speed")]
Step = Annotated[
    float | str,
    BeforeValidator(lambda value: value if value == "auto" else as_value_error(lambda one: to_si(one, "time"))(value)),
    WithJsonSchema({"type": ["number", "string"], "description": '"auto", or a time'}),
]
QUANTITIES: dict[Dimension, Any] = {
    dimension: Annotated[float, _si(dimension), _quantity(dimension)] for dimension in SI_UNITS
}
_RULES = {"description": "; ".join(f"{name}: {rule.idea}" for name, rule in RULES.items())}
RuleName = Annotated[str, key_of(RULES), WithJsonSchema({"enum": list(RULES)} | _RULES)]
_PLAIN_RULES = [name for name, rule in RULES.items() if not rule.coupled]
PlainRuleName = Annotated[str, key_of(_PLAIN_RULES), WithJsonSchema({"enum": _PLAIN_RULES})]
_LAWS = {"description": "; ".join(f"{name}: {law.source}" for name, law in LAWS.items())}
LawName = Annotated[str, key_of(LAWS), WithJsonSchema({"enum": list(LAWS)} | _LAWS)]
# Laws that no spring has are an error of the model, with the reason.
_SPRINGS_LAWS = list(dict.fromkeys((*LAWS, *PAIR_LAWS)))
SpringsLawName = Annotated[str, key_of(_SPRINGS_LAWS), WithJsonSchema({"enum": _SPRINGS_LAWS})]
FemElement = Annotated[str, key_of(ELEMENTS), WithJsonSchema({"enum": list(ELEMENTS)})]
PlaneElement = Annotated[str, key_of(PLANE_ELEMENTS), WithJsonSchema({"enum": list(PLANE_ELEMENTS)})]
SolidElement = Annotated[str, key_of(SOLID_ELEMENTS), WithJsonSchema({"enum": list(SOLID_ELEMENTS)})]
Diagonal = Annotated[str, key_of(DIAGONALS), WithJsonSchema({"enum": list(DIAGONALS)})]
SectionKind = Annotated[str, key_of(SECTIONS), WithJsonSchema({"enum": list(SECTIONS)})]
Number = Annotated[float, BeforeValidator(_strict_number), Field(allow_inf_nan=False)]
#: Mark of keys whose strings are names of files.
FILE = object()
#: Path of a file, relative to the folder of the study unless absolute.
FileName = Annotated[str, BeforeValidator(_file_name), Field(min_length=1), FILE]
Direction = Literal["x", "y", "z"]

SELECTION_FORMS = (
    'a side ("left", "right", "bottom", "top", "back", "front"), a group of an imported mesh, a point '
    '("right-middle"), { x = "0 mm" }, { box = [[xmin, ymin], [xmax, ymax]] } or { near = [x, y] }'
)


def _selection(value: Any) -> Selection:
    if isinstance(value, str):
        return value
    if not isinstance(value, dict) or len(value) != 1:
        raise TruespringError(f"{shown(value)} is not a selection; allowed: {SELECTION_FORMS}")
    ((key, what),) = value.items()
    if key in ("x", "y", "z"):
        return Plane(key, to_si(what, "length"))
    if key == "near":
        return Near(_point(what))
    if key == "box":
        if isinstance(what, list) and len(what) in (4, 6):  # both corners in one list
            what = [what[: len(what) // 2], what[len(what) // 2 :]]
        if not isinstance(what, list) or len(what) != 2:
            raise TruespringError(f"box = {shown(what)}: must be two corners, [[xmin, ymin], [xmax, ymax]]")
        return Box(_point(what[0]), _point(what[1]))
    known = ("x", "y", "z", "box", "near")
    raise TruespringError(f"{shown(key)} is not a selection{nearest(key, known)}; allowed: {SELECTION_FORMS}")


def _point(value: Any) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) not in (2, 3):
        raise TruespringError(f'{shown(value)} is not a point: give coordinates such as ["160 mm", "20 mm"]')
    return tuple(to_si(coordinate, "length") for coordinate in value)


def _along(value: Any) -> Any:
    """Return the direction of fibres, or a list of them, each a vector or the name of an array."""
    families = value if isinstance(value, list) and value and isinstance(value[0], list | str) else [value]
    for one in families:
        vector = isinstance(one, list) and len(one) in (2, 3) and all(map(_is_number, one))
        if not vector and not isinstance(one, str):
            raise TruespringError(
                f"{shown(one)} is no direction: give a vector such as [1, 0, 0], the name of an array of the mesh "
                "file, or a list of these"
            )
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


class Over(NamedTuple):
    """A history of a load or of a prescribed motion.

    Attributes:
        rows: place and share of each row, see History.
        timed: whether a place was given as a time with its unit.
    """

    rows: tuple[tuple[float, float], ...]
    timed: bool


def _over(value: Any) -> Over:
    """Return a history from a list of rows of place and share."""
    form = 'rows of place and share, such as [["0 s", 0], ["0.2 s", 1]] in motion or [[0, 0], [0.5, 1]] at rest'
    if not isinstance(value, list) or not value:
        raise TruespringError(f"{shown(value)} is not a history: give {form}")
    rows = []
    for row in value:
        if not isinstance(row, list) or len(row) != 2 or not _is_number(row[1]):
            raise TruespringError(f"{shown(row)} is not a row of place and share: give {form}")
        rows.append((to_si(row[0], "time"), float(row[1])))
    return Over(tuple(rows), any(isinstance(row[0], str) for row in value))


def _probe(value: Any) -> str | tuple[float, ...]:
    return value if isinstance(value, str) else _point(value)


_ON_SCHEMA = {
    "description": SELECTION_FORMS,
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
On = Annotated[Any, PlainValidator(as_value_error(_selection)), WithJsonSchema(_ON_SCHEMA)]
_POINT_SCHEMA = {"type": "array", "items": {"type": ["number", "string"]}}
_OVER_SCHEMA = {
    "type": "array",
    "minItems": 1,
    "items": {"type": "array", "minItems": 2, "maxItems": 2, "items": {"type": ["number", "string"]}},
}
History = Annotated[Any, PlainValidator(as_value_error(_over)), WithJsonSchema(_OVER_SCHEMA)]
Probe = Annotated[
    Any, PlainValidator(as_value_error(_probe)), WithJsonSchema({"anyOf": [{"type": "string"}, _POINT_SCHEMA]})
]


_ONE_ALONG = [{"type": "string"}, {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 3}]
#: Direction of fibres: a vector or the name of an array of the mesh file, or a list of these.
Along = Annotated[
    Any,
    PlainValidator(as_value_error(_along)),
    WithJsonSchema({"anyOf": [*_ONE_ALONG, {"type": "array", "items": {"anyOf": _ONE_ALONG}, "minItems": 1}]}),
]

Count = Annotated[int, Field(ge=1, le=10**9)]
#: Lengths of lists with one value per direction, in 2D, in 3D, or in either.
two, three = Field(min_length=2, max_length=2), Field(min_length=3, max_length=3)
two_or_three = Field(min_length=2, max_length=3)


class Keys(BaseModel):
    """Base class of the tables of a study file: frozen, other keys are errors."""

    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True, strict=True, protected_namespaces=())
