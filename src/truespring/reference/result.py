"""Read result files of any format, as a record or as a solution."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from truespring.equilibrium import Solution
from truespring.errors import ReferenceFileError, nearest
from truespring.mesh.files.heads import HEAD, Recognises, format_by_head, listed_keys, read_as
from truespring.opening import open_file
from truespring.plugins import Table
from truespring.reference.checks import refuse_unreadable
from truespring.reference.dat import is_dat, read_dat
from truespring.reference.frd import is_frd, read_frd
from truespring.reference.joining import joined
from truespring.reference.markers import read_markers
from truespring.reference.placing import Placing, placed
from truespring.reference.record import Reading, Record
from truespring.reference.rst import is_rst, read_rst
from truespring.reference.stl_record import is_stl, read_stl_pair
from truespring.reference.vtk import RESULTS, read_vtk_result


class Format(NamedTuple):
    """A format of result files.

    Attributes:
        recognises: returns whether the beginning of a file is that of the format.
        read: returns the record of a file; takes the file, a callback for progress, and `options`.
        options: which of `field`, `undeformed`, `mesh` apply to it.
        unnoticed: when a truncated file is read without an error; empty if any truncation is an error.
        is_marked: whether every file of the format is recognised by its content.
    """

    recognises: Recognises
    read: Callable[..., Record]
    options: frozenset[str] = frozenset()
    unnoticed: str = ""
    is_marked: bool = True


_FIELD, _REST = frozenset({"field"}), frozenset({"undeformed"})

#: Formats by lower-case suffix; if several recognise a file, the one with its suffix is used, else the first.
READERS: Table[Format] = Table(
    "truespring.readers",
    {
        ".frd": Format(
            is_frd, read_frd, unnoticed="truncated after a level it reads as a run that stopped, with a note"
        ),
        ".dat": Format(
            is_dat, read_dat, frozenset({"mesh"}), unnoticed="truncated after a table it reads as a run that stopped"
        ),
        **{suffix: Format(recognises, read_vtk_result, _FIELD) for suffix, recognises in RESULTS.items()},
        ".rst": Format(is_rst, read_rst),
        ".csv": Format(  # any table
            lambda head: False,
            read_markers,
            _REST,
            "rows of plain text have no end mark: truncated after a digit of the last number of a row it is shorter",
            is_marked=False,
        ),
        ".stl": Format(is_stl, read_stl_pair, _REST, is_marked=False),  # binary files have no mark
    },
    Format,
)


def format_of(file: Path) -> str | None:
    """Return the key in READERS of a file's format: by its content, else its suffix; None if unknown."""
    return format_by_head(file.suffix, _head(file), {suffix: form.recognises for suffix, form in READERS.items()})


def _head(file: Path) -> bytes:
    """Return the first bytes of a file, empty if it cannot be read (its reader then raises the error)."""
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
    """Read a result of another program as a solution, for comparison with others.

    Args:
        file: a .frd or .dat file of CalculiX, a file of VTK's (.vtu, .vtk, .pvd, .vtkhdf, ...), a .rst file of Ansys, a
            .csv table of markers, or a .stl file with the body at rest.
        unit: the file's unit of length, such as "mm".
        axes: axes of the file along x, y and z of the study: with ("x", "z", "-y") the study's y is the file's z, and
            the study's z is the file's -y.
        shift: translation after that [m].
        load_factor: load factor of a file with one level; full load by default.
        full_time: time of full load in the file; by default 1, or the last time if that is later.
        force_unit: unit of force in the file; without it the energies of a .dat file are omitted.
        field, undeformed, mesh, reading: see read_record.

    The solution has a mesh of the corners of the file's cells, no loads and no supports; `all_positions` of its states
    includes the further nodes of the cells. Raises ReferenceFileError if the file cannot be read or contains no body.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> solution = ts.solve(problem, ts.Fem("neo-hookean"))
        >>> read = ts.read_result(solution.write("fem.pvd"))
        >>> read.load_factors.tolist() == solution.load_factors.tolist()
        True
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
    """Read a result of another program as a record; its format is found by content, else by suffix.

    Args:
        file: a .frd or .dat file of CalculiX, a file of VTK's (.vtu, .vtk, .pvd, .vtkhdf, ...), a .rst file of Ansys, a
            .csv table of markers or a .stl file.
        field: name of the displacement, for VTK files.
        undeformed: file with the undeformed state, for tables of markers and STL files.
        mesh: deck with nodes and elements, for .dat files.
        reading: called with the fraction that has been read, ascending to 1.

    Raises ReferenceFileError if the file cannot be read, or an option does not apply to its format.
    """
    file = Path(file)
    if file.is_dir():
        raise ReferenceFileError(f"{file} is a folder: use the result file in it")
    key = format_of(file)
    if key is None:
        raise ReferenceFileError(
            f"{file}: the suffix of a result is {', '.join(READERS)}, not '{file.suffix}'"
            f"{nearest(file.suffix.lower(), READERS)}, and its content has none of these formats: "
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
        raise ReferenceFileError(f"{file}: {name} does not apply to {key} files, only to {others}")
    if not (key == ".dat" and file.is_file()):  # the reader reports empty files
        refuse_unreadable(file)
    try:
        record = READERS[key].read(file, reading, **given)
    except ReferenceFileError as error:
        if not READERS[key].is_marked or _is_recognised(file, key):
            raise
        raise ReferenceFileError(f"{error}; its content does not match {listed_keys(READERS, key)} either") from None
    record = joined(record)
    return replace(record, notes=(*read_as(key, file.suffix), *record.notes))
