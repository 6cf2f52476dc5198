"""The kinds of unknowns of a calibration, and for which springs they are available."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

from truespring.calibration.model_unknowns import hourglass_fault, hourglass_unknown, material_unknowns
from truespring.calibration.stiffness_unknowns import (
    classes,
    directions_and_rows,
    each_spring,
    regions,
    stiffness_unknowns,
)
from truespring.calibration.unknowns import Unknowns
from truespring.errors import ModelError, nearest
from truespring.models import Springs
from truespring.problem import Problem


def _coupled_fault(problem: Problem, springs: Springs) -> str:
    """Return why the stiffness of springs cannot be fitted; empty if it can."""
    return "are coupled and have no individual stiffness to fit" if springs.coupled else ""


def _no_fault(problem: Problem, springs: Springs) -> str:
    return ""


@dataclass(frozen=True, slots=True)
class UnknownKind:
    """A kind of unknowns.

    Attributes:
        make: returns the unknowns of a problem and springs; the last argument is the key in UNKNOWNS.
        about: what each unknown scales, in a few words.
        fault: returns why springs on the body of a problem have no such unknowns, as a predicate; empty if they have.
    """

    make: Callable[[Problem, Springs, str], Unknowns]
    about: str
    fault: Callable[[Problem, Springs], str] = _coupled_fault

    def suits(self, problem: Problem, springs: Springs) -> bool:
        """Return whether the unknowns are available for springs on the body of a problem."""
        return springs.element is None and not self.fault(problem, springs)


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
            fault=hourglass_fault,
        ),
        "material": UnknownKind(material_unknowns, "the moduli of one material", fault=_no_fault),
    }
)


def make_unknowns(problem: Problem, springs: Springs, kind: str | None = None) -> Unknowns:
    """Return the unknowns of a kind, a key of UNKNOWNS, for the springs of a problem.

    By default, the first kind that suits the springs. Raises ModelError for a kind that is unknown or does not suit the
    springs, and for springs that do not fit the mesh.
    """
    suited = [name for name, one in UNKNOWNS.items() if one.suits(problem, springs)]
    kind = next(iter(suited), "class") if kind is None else kind
    if kind not in UNKNOWNS:
        raise ModelError(f"unknowns = '{kind}' is unknown{nearest(kind, UNKNOWNS)}; allowed: {', '.join(UNKNOWNS)}")
    if springs.element is not None:
        raise ModelError(
            f"element = '{springs.element}': springs between all nodes cannot be calibrated: they are finite elements "
            "of second order; remove element"
        )
    if kind not in suited:
        why = UNKNOWNS[kind].fault(problem, springs)
        raise ModelError(f"unknowns = '{kind}': {springs.label} {why}; allowed for these springs: {', '.join(suited)}")
    return UNKNOWNS[kind].make(problem, springs, kind)
