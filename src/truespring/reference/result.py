"""Any result file, by its suffix: as its file tells it, and as a path."""

from collections.abc import Callable, Sequence
from pathlib import Path
from types import MappingProxyType

from truespring.equilibrium import Path as Equilibria
from truespring.errors import ReferenceFileError, nearest
from truespring.mesh.files.vtk_file import VTK_SUFFIXES
from truespring.reference.checks import refuse_unreadable
from truespring.reference.dat import read_dat
from truespring.reference.frd import read_frd
from truespring.reference.markers import read_markers
from truespring.reference.placing import Placing, placed
from truespring.reference.record import Reading, Record
from truespring.reference.rst import read_rst
from truespring.reference.stl_record import read_stl_pair
from truespring.reference.vtk import read_vtk_result

_VTK = frozenset({"field"})

#: By suffix in small letters: the reader, and which of the options `field`, `undeformed` and `mesh` it takes.
READERS: MappingProxyType[str, tuple[Callable[..., Record], frozenset[str]]] = MappingProxyType(
    {
        ".frd": (read_frd, frozenset()),
        ".dat": (read_dat, frozenset({"mesh"})),
        **dict.fromkeys((".vtu", ".vtk", ".pvd", *VTK_SUFFIXES), (read_vtk_result, _VTK)),
        ".rst": (read_rst, frozenset()),
        ".csv": (read_markers, frozenset({"undeformed"})),
        ".stl": (read_stl_pair, frozenset({"undeformed"})),
    }
)


def read_result(
    file: str | Path,
    *,
    unit: str = "m",
    axes: Sequence[str] = ("x", "y", "z"),
    shift: Sequence[float] = (0.0, 0.0, 0.0),
    load_factor: float | None = None,
    force_unit: str | None = None,
    full_time: float | None = None,
    field: str | None = None,
    undeformed: str | Path | None = None,
    mesh: str | Path | None = None,
    reading: Reading | None = None,
) -> Equilibria:
    """Read a result that another program wrote as a path that can be compared with others.

    Args:
        file: a .frd or .dat file of CalculiX, a file of VTK's (.vtu, .vtk, .pvd, ...), a .rst file of Ansys, a .csv
            table of markers, or a .stl file with the body at rest.
        unit: the file's unit of length, such as "mm".
        axes: the file's axes along ours: ("x", "z", "-y") has its z along our y, and our z against its y.
        shift: what is added to its places then [m].
        load_factor: of a file of one level; full load by default.
        full_time: the file's time of full load; by default 1, or its last time where that is later.
        force_unit: the file's unit of force, without which the energies of a .dat file are left out.
        field, undeformed, mesh, reading: see read_record.

    The path has a mesh of the corners of the file's cells, no loads and no supports; further nodes of its cells are
    in `all_positions` of its states. Raises ReferenceFileError where the file cannot be read or holds no body.
    """
    placing = Placing(unit, tuple(axes), tuple(shift), load_factor, force_unit, full_time)
    record = read_record(file, field=field, undeformed=undeformed, mesh=mesh, reading=reading)
    return placed(record, placing, Path(file).name)


def read_record(
    file: str | Path,
    *,
    field: str | None = None,
    undeformed: str | Path | None = None,
    mesh: str | Path | None = None,
    reading: Reading | None = None,
) -> Record:
    """Read a result that another program wrote; its suffix tells the format.

    Args:
        file: a .frd or .dat file of CalculiX, a file of VTK's (.vtu, .vtk, .pvd, ...), a .rst file of Ansys, a .csv
            table of markers or a .stl file.
        field: of VTK files, the name of the displacement.
        undeformed: of tables of markers and STL files, the file with the state at rest.
        mesh: of .dat files, the deck with nodes and elements.
        reading: is called with the share that is read, which ascends to 1.

    Raises ReferenceFileError where the file cannot be read, or an option is not for its format.
    """
    file = Path(file)
    suffix = file.suffix.lower()
    if file.is_dir():
        raise ReferenceFileError(f"{file} is a folder: give the result file itself")
    if suffix not in READERS:
        raise ReferenceFileError(
            f"{file}: a result ends in {', '.join(READERS)}, not in '{file.suffix}'{nearest(suffix, READERS)}"
        )
    reader, takes = READERS[suffix]
    options = {
        "field": field,
        "undeformed": None if undeformed is None else Path(undeformed),
        "mesh": None if mesh is None else Path(mesh),
    }
    given = {name: value for name, value in options.items() if value is not None}
    for name in given.keys() - takes:
        others = ", ".join(other for other, (_, names) in READERS.items() if name in names)
        raise ReferenceFileError(f"{file}: {name} is not for {suffix} files, but for {others}")
    if not (suffix == ".dat" and file.is_file()):  # of an empty one its reader knows why
        refuse_unreadable(file)
    return reader(file, reading, **given)
