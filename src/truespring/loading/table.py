"""The loads of a study file: each key of `[[load]]`, the class that it makes and the values that it takes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType

from truespring.loading.dead import Force, Gravity, Traction
from truespring.loading.load import Load
from truespring.loading.moment import Moment
from truespring.loading.pressure import Pressure
from truespring.units import Dimension


@dataclass(frozen=True, slots=True)
class Quantity:
    """A value of a load in a study file.

    Attributes:
        argument: the argument of the class that takes it, in SI.
        dimension: what it measures, of `units.SI_UNITS`.
        about: what it is, for the schema and the documentation.
        vector: whether it has one component a direction instead of one number.
        default: its value where the key is left out; None where it must be given.
    """

    argument: str
    dimension: Dimension
    about: str
    vector: bool = False
    default: float | None = None


@dataclass(frozen=True, slots=True)
class LoadKind:
    """A load of study files.

    Attributes:
        load: its class; one with an argument `on` needs a selection, another acts on the whole body.
        value: what its own key takes.
        further: other keys beside it, by name.
        dims: the dimensions of the bodies that it loads.
    """

    load: type[Load]
    value: Quantity
    further: Mapping[str, Quantity] = field(default_factory=dict)
    dims: tuple[int, ...] = (2, 3)

    def quantities(self, key: str) -> dict[str, Quantity]:
        """Return what its keys take, `key` being its own."""
        return {key: self.value, **self.further}

    @property
    def on_selection(self) -> bool:
        """Whether it acts on a selection, not on the whole body."""
        return any(one.name == "on" and one.init for one in fields(self.load))  # type: ignore[arg-type]  # a dataclass


#: The loads by their key of `[[load]]`.
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
            Quantity("moment", "moment", "the moment, anticlockwise, which turns with the nodes of a plane body"),
            dims=(2,),
        ),
        "gravity": LoadKind(
            Gravity, Quantity("acceleration", "acceleration", "the acceleration of the whole body", vector=True)
        ),
    }
)
