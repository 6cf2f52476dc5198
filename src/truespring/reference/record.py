"""What a result file holds, whatever its format: places, cells, and how far each place has moved at each level."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from truespring.arrays import Floats, Ints

#: Called by readers of large files with the share that is read, 0 to 1.
Reading = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class Level:
    """A load level.

    Attributes:
        time: what the file counts levels by: a time, a load factor or a number.
        displacement: of each point [the file's unit of length], shape (n_points, 3).
        energy: stored elastic energy [J, of CalculiX the deck's units], None where the file tells none.
        force: total of the loads [N, of CalculiX the deck's unit], shape (3,), None where the file tells none.
    """

    time: float
    displacement: Floats
    energy: float | None = None
    force: Floats | None = None


@dataclass(frozen=True, eq=False)
class Record:
    """A result as its file tells it: in its own unit of length, its own axes.

    Attributes:
        file: where it was read.
        kind: the format, such as "frd": becomes the kind of the path.
        points: where each point was at rest [the file's unit of length], shape (n_points, 3); a plane body has z = 0.
        cells: rows of `points` by a key of CELL_SHAPES ("quad", "hexahedron20", ...), in VTK's order of
            nodes, each of shape (n_cells, k); empty for markers.
        levels: in the file's order, at least one; a state of rest is among them only if the file has it.
        names: the number or name that the file gives each point, of length n_points.
        stopped: whether the file tells that the run did not get to its end.
        notes: what should be known of the file, in words.
    """

    file: Path
    kind: str
    points: Floats
    cells: Mapping[str, Ints]
    levels: tuple[Level, ...]
    names: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())
    stopped: bool = False
