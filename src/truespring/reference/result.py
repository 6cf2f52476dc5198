"""Any result file, by its content and its suffix: as its file tells it, and as a path."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from truespring.equilibrium import Solution
from truespring.errors import ReferenceFileError, nearest
from truespring.mesh.files.heads import HEAD, Recognises, format_by_head, is_vtk_xml, listed_keys, read_as
from truespring.mesh.files.vtk_file import VTK_FORMATS
from truespring.opening import open_file
from truespring.reference.checks import refuse_unreadable
from truespring.reference.dat import is_dat, read_dat
from truespring.reference.frd import is_frd, read_frd
from truespring.reference.joining import joined
from truespring.reference.markers import read_markers
from truespring.reference.placing import Placing, placed
from truespring.reference.record import Reading, Record
from truespring.reference.rst import is_rst, read_rst
from truespring.reference.stl_record import is_stl, read_stl_pair
from truespring.reference.vtk import read_vtk_result


class Format(NamedTuple):
    """A format of result files.

    Attributes:
        recognises: whether a file begins as those of the format do.
        read: returns the record of a file; takes the file, what to call with the share that is read, and `options`.
        options: which of `field`, `undeformed`, `mesh` it takes.
        unnoticed: why a truncated file may pass for a whole one, and where; empty where any truncation is an error.
        is_marked: whether every file of the format is recognised by its content.
    """

    recognises: Recognises
    read: Callable[..., Record]
    options: frozenset[str] = frozenset()
    unnoticed: str = ""
    is_marked: bool = True


_FIELD, _REST = frozenset({"field"}), frozenset({"undeformed"})

#: By suffix in small letters; of a file that several recognise the one with its suffix counts, else the first.
READERS: MappingProxyType[str, Format] = MappingProxyType(
    {
        ".frd": Format(is_frd, read_frd, unnoticed="truncated after a level it is a run that stopped; a note says so"),
        ".dat": Format(
            is_dat, read_dat, frozenset({"mesh"}), unnoticed="truncated after a table it is a run that stopped"
        ),
        **{suffix: Format(recognises, read_vtk_result, _FIELD) for suffix, recognises in VTK_FORMATS.items()},
        ".pvd": Format(is_vtk_xml("Collection"), read_vtk_result, _FIELD),
        ".rst": Format(is_rst, read_rst),
        ".csv": Format(  # any table
            lambda head: False,
            read_markers,
            _REST,
            "rows of plain text have no end mark: truncated after a digit of the last number of a row it is shorter",
            is_marked=False,
        ),
        ".stl": Format(is_stl, read_stl_pair, _REST, is_marked=False),  # binary files have no mark
    }
)


def format_of(file: Path) -> str | None:
    """Return the key in READERS of a file's format: by its content, else its suffix; None where neither tells."""
    return format_by_head(file.suffix, _head(file), {suffix: form.recognises for suffix, form in READERS.items()})


def _head(file: Path) -> bytes:
    """What a file begins with, nothing where it cannot be read: whoever reads it tells why."""
    try:
        with open_file(file, ReferenceFileError) as stream:
            return stream.read(HEAD)
    except (ReferenceFileError, OSError):
        return b""


def _is_recognised(file: Path, key: str) -> bool:
    head = _head(file)
    return not head or READERS[key].recognises(head)


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
) -> Solution:
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
    """Read a result that another program wrote; its content tells the format, else its suffix.

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
    if file.is_dir():
        raise ReferenceFileError(f"{file} is a folder: give the result file itself")
    key = format_of(file)
    if key is None:
        raise ReferenceFileError(
            f"{file}: a result ends in {', '.join(READERS)}, not in '{file.suffix}'"
            f"{nearest(file.suffix.lower(), READERS)}, and what it begins with is none of these formats: "
            "convert it to VTK"
        )
    options = {
        "field": field,
        "undeformed": None if undeformed is None else Path(undeformed),
        "mesh": None if mesh is None else Path(mesh),
    }
    given = {name: value for name, value in options.items() if value is not None}
    for name in given.keys() - READERS[key].options:
        others = ", ".join(other for other, form in READERS.items() if name in form.options)
        raise ReferenceFileError(f"{file}: {name} is not for {key} files, but for {others}")
    if not (key == ".dat" and file.is_file()):  # of an empty one its reader knows why
        refuse_unreadable(file)
    try:
        record = READERS[key].read(file, reading, **given)
    except ReferenceFileError as error:
        if not READERS[key].is_marked or _is_recognised(file, key):
            raise
        raise ReferenceFileError(f"{error}; it does not begin like {listed_keys(READERS, key)} either") from None
    record = joined(record)
    return replace(record, notes=(*read_as(key, file.suffix), *record.notes))
