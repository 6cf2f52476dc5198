"""The commands of a live session: what is asked of it, in the order of time, so that it can be repeated."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import NamedTuple

from truespring.errors import LiveError, nearest


@dataclass(frozen=True, slots=True)
class Command:
    """A command.

    Attributes:
        frame: number of frames before it.
        kind: what is asked, one of COMMANDS.
        name: of the grasp, sphere, pin or model.
        place: coordinates [m], one value per direction.
        radius: [m].
        value: what the kind needs.
        begin: motion of the patch of a grasp at its begin [m]; empty for the mean displacement of the patch.
        elements: of a cut the numbers, in the uncut body, of the elements that it removes; None for those that the
            blade passes now. A session that repeats the command removes the same, whatever its model.
    """

    frame: int
    kind: str
    name: str = ""
    place: tuple[float, ...] = ()
    radius: float | None = None
    value: float | None = None
    begin: tuple[float, ...] = ()
    elements: tuple[int, ...] | None = None


class Kind(NamedTuple):
    """What a kind of command needs.

    Attributes:
        says: what it does.
        place: whether it needs a place.
        radius: whether it needs a radius.
        bounds: smallest and largest value, both allowed; None without a value.
        name: whether it needs a name.
        repeats: whether a study repeats it, with the same model and material.
        holds: whether it changes grasps and spheres only, not the body.
        lasts: whether it still acts after a restart.
        blade: whether the place is a blade: start, end and, in space, the vector of its depth, with dim values each.
    """

    says: str
    place: bool = False
    radius: bool = False
    bounds: tuple[float, float] | None = None
    name: bool = False
    repeats: bool = True
    holds: bool = False
    lasts: bool = False
    blade: bool = False


_SIZE = (0.0, math.inf)

#: The commands by kind.
COMMANDS: Mapping[str, Kind] = MappingProxyType(
    {
        "grasp": Kind("hold the patch within `radius` of a place of the undeformed body by springs of `value` N/m",
                      place=True, radius=True, bounds=_SIZE, name=True, holds=True),
        "sphere": Kind("add a sphere at a place, of `value` Pa/m",
                       place=True, radius=True, bounds=_SIZE, name=True, holds=True),
        "move": Kind("move a grasp or sphere to a place", place=True, name=True, holds=True),
        "release": Kind("remove a grasp, pin or sphere", name=True, holds=True),
        "gravity": Kind("multiply gravity by `value`", bounds=(-10.0, 10.0), lasts=True),
        "young": Kind("multiply Young's moduli of the study by `value`",
                      bounds=(1e-3, 1e3), repeats=False, lasts=True),
        "poisson": Kind("set Poisson's ratio", bounds=(-0.9, 0.4999), repeats=False, lasts=True),
        "damping": Kind("set the damping by mass to `value` 1/s", bounds=(0.0, 1e3), repeats=False, lasts=True),
        "model": Kind("change to another model of the study", name=True, repeats=False, lasts=True),
        "cut": Kind("remove the elements that a blade passes: its place is start, end and, in space, depth",
                    repeats=False, blade=True),
        "restart": Kind("bring the body back to its begin, without cuts, grasps and spheres"),
    }
)  # fmt: skip


def checked(command: Command, dim: int) -> Command:
    """Return a command; raise LiveError unless its kind is known and it has finite values for all that it needs."""
    if command.kind not in COMMANDS:
        allowed = ", ".join(COMMANDS)
        raise LiveError(f"command '{command.kind}'{nearest(command.kind, COMMANDS)}; allowed: {allowed}")
    kind = COMMANDS[command.kind]
    if kind.name and not command.name:
        raise LiveError(f"{command.kind}: needs a name")
    if kind.place and not _finite(command.place, dim):
        raise LiveError(f"{command.kind}: place = {list(command.place)!r}: give {dim} finite coordinates [m]")
    if command.begin and not _finite(command.begin, dim):
        raise LiveError(f"{command.kind}: begin = {list(command.begin)!r}: give {dim} finite components [m], or none")
    if kind.blade:
        _check_cut(command, dim)
    if kind.radius and not (command.radius is not None and math.isfinite(command.radius) and command.radius > 0):
        raise LiveError(f"{command.kind}: radius = {command.radius!r} m: must be a positive number")
    if kind.bounds is not None:
        low, high = kind.bounds
        value = command.value
        if value is None or not math.isfinite(value) or not low <= value <= high:
            raise LiveError(f"{command.kind}: value = {value!r}: must be a number from {low:g} to {high:g}")
    return command


def _check_cut(command: Command, dim: int) -> None:
    """Raise LiveError unless a cut has the place of a blade, or elements."""
    known = "start and end" if dim == 2 else "start, end and depth"
    if not (command.elements is not None and not command.place) and not _finite(command.place, dim * dim):
        raise LiveError(
            f"{command.kind}: place = {list(command.place)!r}: give {known}, {dim * dim} finite numbers [m] in all"
        )
    wrong = [one for one in command.elements or () if not isinstance(one, int) or isinstance(one, bool) or one < 0]
    if wrong:
        raise LiveError(f"{command.kind}: elements: {wrong[0]!r} is no number of an element: 0, 1, 2, ...")


def _finite(place: Sequence[float], dim: int) -> bool:
    """Return whether a place has `dim` finite coordinates."""
    return len(place) == dim and all(isinstance(one, int | float) and math.isfinite(one) for one in place)


@dataclass
class Log:
    """The commands since the begin of a session, and where grasps and spheres were at the end of each frame.

    Attributes:
        frame: time between frames [s].
        frames: number of frames so far.
        commands: in the order of time.
        places: number of frames, name and place [m] of what moved.
        before: commands before the begin that still act, as a changed modulus does after a restart.
    """

    frame: float
    frames: int = 0
    commands: list[Command] = field(default_factory=list)
    places: list[tuple[int, str, tuple[float, ...]]] = field(default_factory=list)
    before: list[Command] = field(default_factory=list)

    @property
    def repeatable(self) -> int:
        """The number of frames that a study can repeat: up to the first change of model or material."""
        others = [one.frame for one in self.commands if not COMMANDS[one.kind].repeats]
        return min([self.frames, *others])

    def begun_again(self) -> "Log":
        """Return the log of a session that begins again, with the commands that still act."""
        lasting = [replace(one, frame=-1) for one in self.commands if COMMANDS[one.kind].lasts]
        return Log(self.frame, before=[*self.before, *lasting])
