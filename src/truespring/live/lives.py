"""What acted when in a session: the grasps and spheres, each with its places, and the share of gravity."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from truespring.live.commands import Command, Log

Place = tuple[float, ...]


@dataclass(frozen=True)
class Life:
    """A grasp, pin or sphere from the frame in which it was added to that in which it was released.

    Attributes:
        name: a name that no other one has.
        command: the command that added it.
        begin, end: numbers of frames; it acts on forces after the begin, up to and with the end.
        places: numbers of frames and its places [m] at these, from `begin` to `end`; linear between.
    """

    name: str
    command: Command
    begin: int
    end: int
    places: tuple[tuple[int, Place], ...]


def lives(log: Log, frames: int, taken: Collection[str]) -> tuple[Life, ...]:
    """Return what acted in the first frames of a session, in the order of its begin, under names that are not taken."""
    found: list[Life] = []
    used = set(taken)
    for command, end in _spans(log.commands, frames):
        if command.frame < end:
            name = _free(command.name, used)
            used.add(name)
            found.append(Life(name, command, command.frame, end, tuple(_filled(_noted(log, command, end), end))))
    return tuple(found)


def gravity(log: Log, frames: int, begin: float) -> list[tuple[int, float]]:
    """Return numbers of frames and shares of gravity at these, linear between; it begins with a share at frame 0."""
    rows = {0: begin}
    share = begin
    for frame, value in {one.frame: one.value for one in log.commands if one.kind == "gravity"}.items():
        if value is not None and value != share and frame < frames:
            rows[frame], rows[frame + 1], share = share, value, value
    return sorted(rows.items())


def _spans(commands: Sequence[Command], frames: int) -> Iterator[tuple[Command, int]]:
    """Yield the commands that add a grasp or sphere, with the frame of its end."""
    for number, one in enumerate(commands):
        if one.kind in ("grasp", "sphere"):
            later = (other.frame for other in commands[number:] if other.kind == "release" and other.name == one.name)
            yield one, min(frames, next(later, frames))


def _noted(log: Log, command: Command, end: int) -> list[tuple[int, Place]]:
    """Return the places of a grasp or sphere where it was added and where it moved.

    Another one of the same name may have ended where it begins, and may begin where it ends.
    """
    name, begin = command.name, command.frame
    mine = [(frame, place) for frame, other, place in log.places if other == name and begin <= frame <= end]
    first = [one for one in mine if one[0] == begin][-1]
    last = [one for one in mine if one[0] == end]
    added = sum(one.frame == end and one.name == name and one.kind in ("grasp", "sphere") for one in log.commands)
    return [first, *(one for one in mine if begin < one[0] < end), *last[: len(last) - added]]


def _filled(noted: Sequence[tuple[int, Place]], end: int) -> Iterator[tuple[int, Place]]:
    """Yield places with those before and after a rest: between rows they are linear."""
    before: tuple[int, Place] | None = None
    for frame, place in noted:
        if before is not None and before[0] < frame - 1:
            yield frame - 1, before[1]
        yield frame, place
        before = frame, place
    if before is not None and before[0] < end:
        yield end, before[1]


def _free(name: str, used: Collection[str]) -> str:
    """Return a name, with a number if it is used."""
    if name not in used:
        return name
    number = 2
    while f"{name} {number}" in used:
        number += 1
    return f"{name} {number}"
