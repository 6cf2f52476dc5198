"""Keys of `[[tool]]` and `[[grasp]]`."""

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Annotated, Any, NamedTuple, Self

from pydantic import Field, PlainValidator, WithJsonSchema, model_validator

from truespring.errors import StudyError, TruespringError, shown
from truespring.mesh import Mesh, facets_within
from truespring.study.paths import read_path
from truespring.study.places import Places
from truespring.study.schema.values import (
    FILE,
    FileName,
    Keys,
    Length,
    Number,
    On,
    Stiffness,
    StiffnessPerArea,
    as_value_error,
    key_of,
    two_or_three,
)
from truespring.tools import CONTACTS, TOOLS, Grasp, Tool
from truespring.units import to_si

_FORM = '[["0 s", "40 mm", "70 mm"], ["0.5 s", "40 mm", "50 mm"]]'
_PATH_WORDS = (
    "places along the way: rows of the share of the way, 0 to 1, or in motion of the time, and of the coordinates, "
    f"such as {_FORM}; one list of coordinates for a place that does not move; or the name of a CSV file with columns "
    "t, x, y[, z], and with a column name of rows for several"
)


class Within(NamedTuple):
    """An interval.

    Attributes:
        ends: its begin and its end, shares of the way or times [s].
        timed: whether one was given as a time with its unit.
    """

    ends: tuple[float, float]
    timed: bool


def _during(value: Any) -> Within:
    """Return an interval; raise TruespringError for anything else."""
    if not isinstance(value, list) or len(value) != 2:
        raise TruespringError(f'{shown(value)} is not an interval: give begin and end, such as ["0.2 s", "1.4 s"]')
    begin, end = (to_si(one, "time") for one in value)
    return Within((begin, end), any(isinstance(one, str) for one in value))


def _path(value: Any) -> str | list[float] | list[list[float]]:
    """Return the name of a file, a place, or rows in SI units; raise TruespringError for anything else."""
    if isinstance(value, str):
        return value
    if not isinstance(value, list) or not value:
        raise TruespringError(f"{shown(value)} is not a path: give {_PATH_WORDS}")
    if not isinstance(value[0], list):
        return [to_si(one, "length") for one in value]
    for row in value:
        if not isinstance(row, list) or len(row) != len(value[0]) or len(row) not in (3, 4):
            raise TruespringError(f"{shown(row)} is not a row of a path: give {_PATH_WORDS}")
    return [[to_si(row[0], "time"), *(to_si(one, "length") for one in row[1:])] for row in value]


_NUMBERS = {"type": "array", "items": {"type": ["number", "string"]}}
Way = Annotated[
    Any,
    FILE,
    PlainValidator(as_value_error(_path)),
    WithJsonSchema({"anyOf": [{"type": "string"}, _NUMBERS, {"type": "array", "items": _NUMBERS}]}),
]
Interval = Annotated[
    Any, PlainValidator(as_value_error(_during)), WithJsonSchema({**_NUMBERS, "minItems": 2, "maxItems": 2})
]
Point = Annotated[list[Length], two_or_three]
Shape = Annotated[str, key_of(TOOLS), WithJsonSchema({"enum": list(TOOLS)})]
ContactName = Annotated[str, key_of(CONTACTS), WithJsonSchema({"enum": list(CONTACTS)})]


class MovingKeys(Keys):
    """Something that moves along a path."""

    name: Annotated[str, Field(min_length=1)] | None = Field(
        default=None, description='name in tables; default: its number, such as "tool 1"'
    )
    path: Way = Field(description=_PATH_WORDS)
    during: Interval | None = Field(
        default=None,
        description="begin and end of the interval in which it acts: times in a motion, shares of the way at rest; "
        "default: the whole way",
    )

    def arguments(self, places: Places, table: str, number: int, moves: bool) -> dict[str, Any]:
        """Return the values that are set, by argument.

        Args:
            places: the study file.
            table: name of the table, "tool" or "grasp".
            number: number of the table among those of its name, from 0.
            moves: whether the study is of a motion, so that places on the way are times.
        """
        values = {key: getattr(self, key) for key in sorted(self.model_fields_set - {"shape"})}
        name = self.name or f"{table} {number + 1}"
        with places.at(table, number, "path"):
            values["path"] = read_path(places.beside(self.path), name) if isinstance(self.path, str) else self.path
        if self.during is not None:
            values["during"] = self.during.ends
            with places.at(table, number, "during"):
                if self.during.timed and not moves:
                    raise StudyError("times need [dynamics]: at rest an interval is of shares of the way, 0 to 1")
        return {"name": name} | {key: value for key, value in values.items() if value is not None}


class ToolKeys(MovingKeys):
    """A rigid body that moves along a path and touches the body."""

    shape: Shape = Field(description="shape of the tool; in the plane disc, stadium, half-plane and rectangle")
    radius: Length | None = Field(default=None, description="radius of a sphere or capsule")
    start: Point | None = Field(default=None, description="start of the axis of a capsule, relative to its place")
    end: Point | None = Field(default=None, description="end of the axis of a capsule, relative to its place")
    normal: Annotated[list[Number], two_or_three] | None = Field(
        default=None, description="direction of a plane towards the body; the place is a point of the plane"
    )
    size: Point | None = Field(default=None, description="lengths of a box along the axes; the place is its centre")
    file: FileName | None = Field(
        default=None, description="STL file of a closed surface, relative to the study; the place is its origin"
    )
    unit: str | None = Field(default=None, description='length unit of the STL file, such as "mm"; default: m')
    contact: ContactName | None = Field(
        default=None,
        description='"penalty", the default: nodes enter the tool by pressure / stiffness; or "barrier": they stay out',
    )
    stiffness: StiffnessPerArea | None = Field(
        default=None, description="pressure per depth of the contact; default: 1000 young / diagonal of the body"
    )
    width: Length | None = Field(
        default=None, description="distance at which a barrier begins to push; default: diagonal of the body / 1000"
    )
    friction: Number | None = Field(default=None, description="coefficient of Coulomb friction; default: 0")
    on: On = Field(default=None, description="facets of the body that the tool may touch; default: its whole boundary")

    @model_validator(mode="after")
    def _keys_of_the_shape(self) -> Self:
        ours = {one.name: one for one in fields(TOOLS[self.shape]) if one.init}
        for key in sorted(self.model_fields_set - {"shape"}):
            if key not in ours and getattr(self, key) is not None:
                raise ValueError(f"{key} is no key of a {self.shape}: leave it out; keys: {', '.join(sorted(ours))}")
        for key, one in ours.items():
            if key != "name" and one.default is MISSING and getattr(self, key) is None:
                raise ValueError(f"{key} is required and missing for a {self.shape}")
        return self

    def build(self, places: Places, number: int, mesh: Mesh, moves: bool) -> Tool:
        """Return the tool, the `number`-th of the study from 0; raise StudyError if it does not fit the mesh."""
        if self.on is not None:
            with places.at("tool", number, "on"):
                facets_within(mesh, self.on)
        values = self.arguments(places, "tool", number, moves)
        values |= {"file": places.beside(values["file"])} if "file" in values else {}
        with places.at("tool", number, *(["file"] if "file" in values else [])):
            return TOOLS[self.shape](**values)


class GraspKeys(MovingKeys):
    """A patch of the boundary that is held by springs to a place that moves."""

    at: Point = Field(description="centre of the patch on the undeformed body")
    radius: Length = Field(description="distance within which nodes of the boundary are held")
    stiffness: Stiffness | None = Field(
        default=None,
        description="stiffness of all springs together; default: young times radius, in the plane times thickness",
    )

    origin: Point | None = Field(
        default=None,
        description="place on the path at which the undeformed patch is unloaded; default: the begin of the path",
    )

    def build(self, places: Places, number: int, mesh: Mesh, moves: bool) -> Grasp:
        """Return the grasp, the `number`-th of the study from 0."""
        return Grasp(**self.arguments(places, "grasp", number, moves))


def key_of_tool(name: str, key: str, several: Mapping[str, list[Any]]) -> tuple[str | int, ...]:
    """Return the place in the study of a tool or grasp: `several` has those of each table, `key` may be empty."""
    table, number = next(
        (table, number) for table, ones in several.items() for number, one in enumerate(ones) if one.name == name
    )
    return (table, number, key) if key else (table, number)
