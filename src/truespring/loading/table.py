"""The keys of `[[load]]` in study files, with the class of each load and its values."""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from types import MappingProxyType

from truespring.loading.active import ActiveTension
from truespring.loading.dead import Force, Gravity, Traction
from truespring.loading.load import Load
from truespring.loading.moment import Moment
from truespring.loading.pressure import Pressure
from truespring.units import Dimension


@dataclass(frozen=True, slots=True)
class Quantity:
    """A value of a load in a study file.

    Attributes:
        argument: the argument of the class that receives the value in SI units.
        dimension: dimension of the value, a key of `units.SI_UNITS`.
        about: description for the schema and for messages.
        vector: whether the value has one component per direction instead of being one number.
        default: value if the key is left out; None for a required key.
    """

    argument: str
    dimension: Dimension
    about: str
    vector: bool = False
    default: float | None = None


@dataclass(frozen=True, slots=True)
class LoadKind:
    """A kind of load in study files.

    Attributes:
        load: the class of the load; with an argument `on` the load acts on a selection, which may be left out if the
            argument has a default, else on the whole body.
        value: the value of the key that names the load.
        further: values of further keys, by key.
        dims: dimensions of the bodies that the load can act on.
    """

    load: type[Load]
    value: Quantity
    further: Mapping[str, Quantity] = field(default_factory=dict)
    dims: tuple[int, ...] = (2, 3)

    def quantities(self, key: str) -> dict[str, Quantity]:
        """Return the values of all keys of the load, where `key` names the load."""
        return {key: self.value, **self.further}

    @property
    def on_selection(self) -> bool:
        """Whether the load acts on a selection, not on the whole body."""
        return any(one.name == "on" and one.init for one in fields(self.load))  # type: ignore[arg-type]  # a dataclass

    @property
    def needs_selection(self) -> bool:
        """Whether the selection is required."""
        ours = fields(self.load)  # type: ignore[arg-type]  # a dataclass
        return any(one.name == "on" and one.init and one.default is MISSING for one in ours)


#: The kinds of loads by the key of `[[load]]` that names them.
LOADS: Mapping[str, LoadKind] = MappingProxyType(
    {
        "force": LoadKind(
            Force, Quantity("total", "force", "the total force, shared consistently over the selection", vector=True)
        ),
        "traction": LoadKind(
            Traction, Quantity("traction", "stress", "the force per area of the undeformed body", vector=True)
        ),
        "pressure": LoadKind(
            Pressure, Quantity("pressure", "stress", "the pressure on the facets, which stays normal to them")
        ),
        "moment": LoadKind(
            Moment,
            Quantity("moment", "moment", "the moment on nodes of a plane body, anticlockwise, which rotates with them"),
            dims=(2,),
        ),
        "tension": LoadKind(
            ActiveTension,
            Quantity(
                "tension",
                "stress",
                "the active tension along the fibres of the material, a nominal stress, negative for fibres that push; "
                "on: elements, a group or a box",
            ),
        ),
        "gravity": LoadKind(
            Gravity, Quantity("acceleration", "acceleration", "the acceleration of the whole body", vector=True)
        ),
    }
)
