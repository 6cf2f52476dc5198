"""Contents of a result file of any format: points, cells, and displacements at each level."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from truespring.arrays import Floats, Ints

#: Called by readers of large files with the fraction that has been read, 0 to 1.
Reading = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class Level:
    """A load level.

    Attributes:
        time: time, load factor or number of the level in the file.
        displacement: displacement of each point [the file's unit of length], shape (n_points, 3).
        energy: stored elastic energy [J; for CalculiX in the units of the deck], None if the file has none.
        force: total of the loads [N; for CalculiX in the unit of the deck], shape (3,), None if the file has none.
    """

    time: float
    displacement: Floats
    energy: float | None = None
    force: Floats | None = None


@dataclass(frozen=True, eq=False)
class Record:
    """A result in the unit of length and the axes of its file.

    Attributes:
        file: path of the file.
        kind: format, such as "frd"; also the kind of the solution.
        points: undeformed position of each point [the file's unit of length], shape (n_points, 3); z = 0 if plane.
        cells: point numbers by key of CELL_SHAPES ("quad", "hexahedron20", ...), in VTK's node order, each of shape
            (n_cells, k); empty for markers.
        levels: at least one level, in the order of the file; the undeformed state only if the file has it.
        names: number or name of each point in the file, of length n_points, or empty.
        stopped: whether the run stopped early, according to the file.
        in_load_factors: whether the times are load factors, not seconds.
        notes: remarks on the file.
    """

    file: Path
    kind: str
    points: Floats
    cells: Mapping[str, Ints]
    levels: tuple[Level, ...]
    names: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())
    stopped: bool = False
    in_load_factors: bool = False
