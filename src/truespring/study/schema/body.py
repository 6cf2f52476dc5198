"""Keys of `[material]`, `[[region]]`, `[section]`, `[[support]]` and `[[load]]`."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import ConfigDict, Field, create_model, model_validator

from truespring.errors import StudyError
from truespring.fibres import Fibres
from truespring.loading import LOADS, Fixed, Load, LoadKind
from truespring.material import SECTIONS, Material, Section
from truespring.mesh import Mesh, select, select_elements
from truespring.models import Constant, material_constants
from truespring.problem import Region
from truespring.study.places import Places
from truespring.study.schema.values import (
    QUANTITIES,
    SELECTION_FORMS,
    Along,
    Angle,
    Density,
    Direction,
    History,
    Keys,
    Length,
    Number,
    On,
    SectionKind,
    Stress,
    three,
    two_or_three,
)

#: The pairs of elastic constants of a material: exactly one is set.
ELASTIC_PAIRS = (("young", "poisson"), ("mu", "bulk"))
_PAIR_WORDS = "set young and poisson, or mu and bulk"


class FibreKeys(Keys):
    """Fibres of a material, which bear tension only: k1 / (2 k2) (exp(k2 <I4 - 1>^2) - 1) for each family."""

    along: Along | None = Field(
        default=None,
        description="direction of the fibres: a vector, or the name of a cell array of the mesh file; for several "
        "families a list of these",
    )
    angle: Angle | list[Angle] | None = Field(
        default=None,
        description="direction in a plane body, instead of along: angle from x, or a list of angles for several "
        "families",
    )
    k1: Stress = Field(default=0.0, description="stiffness; default: 0, fibres for an active tension only")
    k2: Number = Field(default=0.0, description="increase of the stiffness with the stretch")

    @model_validator(mode="after")
    def _one_direction(self) -> Self:
        if (self.along is None) == (self.angle is None):
            raise ValueError("a direction is required: set along, or angle in a plane body")
        if self.angle == []:
            raise ValueError("angle = []: give an angle, or a list with the angle of each family")
        return self

    def build(self, dim: int) -> Fibres:
        """Return the fibres of a body of a dimension; raise StudyError for an angle in 3D."""
        if self.angle is not None and dim == 3:
            raise StudyError("fibres: angle is for plane bodies: set along, such as along = [1, 0, 0]")
        if self.angle is None:
            assert self.along is not None  # see _one_direction
            return Fibres(self.along, self.k1, self.k2)
        angles = self.angle if isinstance(self.angle, list) else [self.angle]
        return Fibres([(math.cos(one), math.sin(one)) for one in angles], self.k1, self.k2)


class PlainMaterialKeys(Keys):
    """The material of the body: young and poisson, or mu and bulk."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": list(pair)} for pair in ELASTIC_PAIRS]})

    young: Stress | None = Field(
        default=None, description='Young\'s modulus: a number in Pa, or a string with its unit such as "10 kPa"'
    )
    poisson: Number | None = Field(default=None, description="Poisson's ratio")
    mu: Stress | None = Field(
        default=None, description="shear modulus at small strain [Pa], with bulk, instead of young and poisson"
    )
    bulk: Stress | None = Field(
        default=None, description="bulk modulus at small strain [Pa], with mu, instead of young and poisson"
    )
    density: Density | None = Field(default=None, description="density, needed for gravity")
    fibres: FibreKeys | None = Field(
        default=None, description='fibres, such as { along = [1, 0, 0], k1 = "5 kPa", k2 = 10 }'
    )

    @model_validator(mode="after")
    def _one_pair(self) -> Self:
        names = [name for pair in ELASTIC_PAIRS for name in pair if getattr(self, name) is not None]
        if tuple(names) not in ELASTIC_PAIRS:
            found = f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} set" if names else "no modulus is set"
            raise ValueError(f"{found}: {_PAIR_WORDS}")
        return self

    def build(self, dim: int) -> Material:
        """Return the material of a body of a dimension."""
        constants = {name: getattr(self, name, None) for name in material_constants()}
        stated = {name: value for name, value in constants.items() if value is not None}
        fibres = None if self.fibres is None else self.fibres.build(dim)
        if self.mu is not None and self.bulk is not None:
            return Material.from_moduli(self.mu, self.bulk, self.density, stated, fibres)
        assert self.young is not None and self.poisson is not None  # see _one_pair
        return Material(self.young, self.poisson, self.density, stated, fibres)


def with_constants(keys: type[Keys], name: str, constants: Mapping[str, Constant]) -> type[Keys]:
    """Return a subclass of `keys` called `name` with the constants of laws as further optional keys."""
    fields: dict[str, Any] = {}
    for key, constant in constants.items():
        quantity = Number if constant.dimension is None else QUANTITIES[constant.dimension]
        described = Field(default=None, description=f"{constant.meaning} [{constant.unit}]")
        fields[key] = (quantity | None, described)
    return create_model(name, __base__=keys, __doc__=keys.__doc__, **fields)


if TYPE_CHECKING:
    MaterialKeys = PlainMaterialKeys
else:
    MaterialKeys = with_constants(PlainMaterialKeys, "MaterialKeys", material_constants())


class RegionKeys(MaterialKeys):
    """Elements of another material."""

    on: On = Field(
        description="elements of this material: a group of an imported mesh, or a box that contains their centres"
    )

    def region(self, mesh: Mesh) -> Region:
        """Return the region; raise MeshError if it selects no element."""
        select_elements(mesh, self.on)
        return Region(self.on, self.build(mesh.dim))


class SectionKeys(Keys):
    """Section of a plane body: its thickness, and plane stress or plane strain."""

    kind: SectionKind = Field(description="whether the stress or the strain normal to the plane is zero")
    thickness: Length = Field(
        description='thickness of the body: a number in m, or a string with its unit such as "10 mm"'
    )

    def build(self) -> Section:
        """Return the section."""
        return SECTIONS[self.kind](self.thickness)


class SupportKeys(Keys):
    """Nodes that are held or moved."""

    on: On = Field(description=f"nodes that are held or moved: {SELECTION_FORMS}")
    fix: Annotated[list[Direction], Field(min_length=1)] | None = Field(
        default=None, description="directions that are held or prescribed; default: all"
    )
    displacement: Annotated[list[Length], two_or_three] | None = Field(
        default=None, description="prescribed displacement at full load; default: none, the nodes are held"
    )
    rotation: Angle = Field(
        default=0.0,
        description='prescribed rotation at full load, anticlockwise in 2D, about an axis in 3D: radians, or "10 deg"',
    )
    about: Annotated[list[Length], two_or_three] | None = Field(
        default=None, description="centre of the rotation; default: the centre of the selection"
    )
    axis: Annotated[list[Number], three] | None = Field(default=None, description="axis of the rotation in 3D")
    over: History | None = Field(
        default=None,
        description="history, rows of place and share: times in a motion, shares of the way at rest; default: in "
        "proportion to the way at rest, constant in a motion",
    )

    def build(self, places: Places, number: int, mesh: Mesh) -> Fixed:
        """Return the support, the `number`-th of the study from 0; raise StudyError if it does not fit the mesh."""
        with places.at("support", number, "on"):
            select(mesh, self.on)
        for key in ("displacement", "about"):
            with places.at("support", number, key):
                check_length(getattr(self, key), mesh)
        over = None if self.over is None else self.over.rows
        return Fixed(self.on, self.fix, self.displacement, self.rotation, self.about, self.axis, over=over)


class LoadKeys(Keys):
    """A load, which has exactly one of the keys that name a load; most loads act on a selection."""

    on: On = None
    over: History | None = Field(
        default=None,
        description="history, rows of place and share: times in a motion, shares of the way at rest; default: in "
        "proportion to the way at rest, constant in a motion",
    )
    kinds: ClassVar[Mapping[str, LoadKind]] = {}

    @model_validator(mode="after")
    def _one_load(self) -> Self:
        named = [name for name in self.kinds if getattr(self, name) is not None]
        if len(named) != 1:
            found = f"{' and '.join(named)} are set" if named else "no load is set"
            raise ValueError(f"{found}: set exactly one of {', '.join(self.kinds)}")
        if self.kind.needs_selection and self.on is None:
            raise ValueError(f"on is required and missing: where the {self.key} acts")
        if not self.kind.on_selection and self.on is not None:
            raise ValueError(f"{self.key} acts on the whole body: leave out on")
        for key in sorted(self.model_fields_set - {"on", "over", self.key, *self.kind.further}):
            raise ValueError(f"{key} cannot be combined with {self.key}: leave it out")
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
        """The kind of the load."""
        return self.kinds[self.key]

    @property
    def values(self) -> dict[str, Any]:
        """The values of the keys in SI units, defaults included, by key."""
        quantities = self.kind.quantities(self.key)
        stated = {key: getattr(self, key) for key in (self.key, *self.kind.further)}
        return {key: quantities[key].default if value is None else value for key, value in stated.items()}

    def load(self) -> Load:
        """Return the load."""
        quantities = self.kind.quantities(self.key)
        arguments: dict[str, Any] = {quantities[key].argument: value for key, value in self.values.items()}
        if self.over is not None:
            arguments["over"] = self.over.rows
        return self.kind.load(**({"on": self.on} if self.kind.on_selection else {}), **arguments)

    def build(self, places: Places, number: int, mesh: Mesh) -> Load:
        """Return the load, the `number`-th of the study from 0; raise StudyError if it does not fit the mesh."""
        if self.on is not None:
            with places.at("load", number, "on"):
                self.load().nodes(mesh)
        for key, value in self.values.items():
            with places.at("load", number, key):
                check_length(value, mesh)
        return self.load()


def load_form(kinds: Mapping[str, LoadKind]) -> type[LoadKeys]:
    """Return the class of keys of `[[load]]` for these kinds of loads."""
    keys = {key: one for name, kind in kinds.items() for key, one in kind.quantities(name).items()}
    fields: dict[str, Any] = {}
    for key, quantity in keys.items():
        number: Any = QUANTITIES[quantity.dimension]
        form: Any = Annotated[list[number], two_or_three] if quantity.vector else number
        fields[key] = (form | None, Field(None, description=quantity.about))
    made: type[LoadKeys] = create_model("LoadKeys", __base__=LoadKeys, __doc__=LoadKeys.__doc__, **fields)
    made.kinds = kinds
    return made


if TYPE_CHECKING:
    AnyLoad = LoadKeys
else:
    AnyLoad = load_form(LOADS)


def check_length(values: Any, mesh: Mesh) -> None:
    """Raise StudyError if a list does not have one value per direction of the mesh."""
    if isinstance(values, list) and len(values) != mesh.dim:
        raise StudyError(f"{values} has {len(values)} values, the body has {mesh.dim} directions")
