"""The kinds of unknowns of a calibration, and which springs they are for."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

from truespring.calibration.model_unknowns import hourglass_unknown, material_unknowns
from truespring.calibration.stiffness_unknowns import (
    classes,
    directions_and_rows,
    each_spring,
    regions,
    stiffness_unknowns,
)
from truespring.calibration.unknowns import Unknowns
from truespring.errors import ModelError, nearest
from truespring.models import RULES, Springs
from truespring.problem import Problem


@dataclass(frozen=True, slots=True)
class UnknownKind:
    """A kind of unknowns.

    Attributes:
        make: returns the unknowns of a problem and springs; the last argument is the key in UNKNOWNS.
        about: what each unknown scales, in a few words.
        coupled: whether the springs may be coupled within an element; the stiffness of such springs is not fitted.
        parameter: parameter that the rule must have; empty for any rule.
    """

    make: Callable[[Problem, Springs, str], Unknowns]
    about: str
    coupled: bool = False
    parameter: str = ""

    def suits(self, springs: Springs) -> bool:
        """Return whether the unknowns are defined for springs, on meshes that have them."""
        if springs.element is not None or (springs.coupled and not self.coupled):
            return False
        return not self.parameter or (springs.rule is not None and self.parameter in RULES[springs.rule].parameters)


#: Kinds of unknowns by name.
UNKNOWNS: Mapping[str, UnknownKind] = MappingProxyType(
    {
        "class": UnknownKind(
            partial(stiffness_unknowns, groups=classes),
            "edges, face diagonals or body diagonals; on lattices edges along x, y or z; the volume term",
        ),
        "region": UnknownKind(partial(stiffness_unknowns, groups=regions), "a class in one material"),
        "direction-row": UnknownKind(
            partial(stiffness_unknowns, groups=directions_and_rows), "springs of one direction at one height"
        ),
        "spring": UnknownKind(partial(stiffness_unknowns, groups=each_spring), "one spring; the volume term"),
        "hourglass": UnknownKind(
            hourglass_unknown,
            "the stiffness of the hourglass modes, the key hourglass of the rule gaussian",
            coupled=True,
            parameter="hourglass",
        ),
        "material": UnknownKind(material_unknowns, "the moduli of one material", coupled=True),
    }
)


def first_kind(springs: Springs) -> str:
    """Return the first kind of unknowns that suits springs; "class" if none does."""
    return next((name for name, kind in UNKNOWNS.items() if kind.suits(springs)), "class")


def make_unknowns(problem: Problem, springs: Springs, kind: str | None = None) -> Unknowns:
    """Return the unknowns of a kind, a key of UNKNOWNS, for the springs of a problem.

    By default, the first kind that suits the springs. Raises ModelError for a kind that is unknown or does not suit the
    springs, and for springs that do not fit the mesh.
    """
    kind = first_kind(springs) if kind is None else kind
    if kind not in UNKNOWNS:
        raise ModelError(f"unknowns = '{kind}' is unknown{nearest(kind, UNKNOWNS)}; allowed: {', '.join(UNKNOWNS)}")
    if springs.element is not None:
        raise ModelError(
            f"element = '{springs.element}': springs between all nodes cannot be calibrated: they are finite elements "
            "of second order; remove element"
        )
    if not UNKNOWNS[kind].suits(springs):
        allowed = ", ".join(name for name, one in UNKNOWNS.items() if one.suits(springs))
        why = "are coupled and have no individual stiffness to fit" if springs.coupled else "have no such parameter"
        raise ModelError(f"unknowns = '{kind}': {springs.label} {why}; allowed for these springs: {allowed}")
    return UNKNOWNS[kind].make(problem, springs, kind)
