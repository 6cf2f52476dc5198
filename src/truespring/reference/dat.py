"""CalculiX results in .dat files, the output of *NODE PRINT and *EL PRINT; the mesh is in the deck.

Source: *NODE PRINT and *EL PRINT in the CalculiX manual, https://www.dhondt.de, and files of CalculiX 2.20.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import MeshError, ReferenceFileError
from truespring.mesh.files.contents import Contents
from truespring.mesh.files.inp import read_inp
from truespring.opening import read_file
from truespring.reference.checks import checked, refuse_repeated, refuse_unreadable, rows_of, without_modes
from truespring.reference.record import Level, Reading, Record
from truespring.reference.scan import CHUNK, Scan, scanning
from truespring.reference.vtk_cells import named

_HEAD = re.compile(
    rb"\s*(displacements \(vx,vy,vz\)|total force \(fx,fy,fz\)|total internal energy) for set (.+?) and time\s+(\S+)\s*"
)
_MODE = re.compile(rb"\s*E I G E N V A L U E\s+N U M B E R\s+\d+\s*")
_DISPLACEMENT, _FORCE, _ENERGY = "displacements", "total force", "total internal energy"
_ID_WIDTH, _REAL_WIDTH = 10, 14


def is_dat(head: bytes) -> bool:
    """Return whether one of the first lines of a file is the title of a CalculiX table."""
    return any(_HEAD.fullmatch(line) for line in head.splitlines())


def read_dat(file: Path, reading: Reading | None = None, mesh: Path | None = None) -> Record:
    """Read the displacements in a .dat file of CalculiX.

    Sets printed at the same time form one level. Its energy is `total internal energy` of the element sets, if they
    make up the body; its force is `total force`, if there is one set: for a set of supports the reaction.

    Args:
        file: the result.
        reading: called with the fraction that has been read.
        mesh: the deck, .inp; default: the one with the name of `file` in the same folder.

    Returns a record of kind "dat", whose names are the node numbers. Raises ReferenceFileError, with the line, if the
    file is damaged or truncated within a table, does not belong to the deck, or has no displacement.
    """
    if file.is_file() and not file.stat().st_size:
        raise ReferenceFileError(
            f"{file} is empty: CalculiX rejected the deck (see its messages), or the deck has no *NODE PRINT with a "
            "line U"
        )
    refuse_unreadable(file)
    deck = _deck(file, mesh)
    with scanning(file, reading) as scan:
        increments = _Printed(scan, deck).increments()
    return checked(_record(file, deck, increments))


def _deck(file: Path, mesh: Path | None) -> Contents:
    deck = file.with_suffix(".inp") if mesh is None else mesh
    if mesh is None and not deck.is_file():
        raise ReferenceFileError(
            f"{file} has no nodes and elements: put the deck {deck.name} into the same folder, or use --mesh DECK"
        )
    if deck.suffix.lower() != ".inp":
        raise ReferenceFileError(f"{deck}: nodes and elements of {file.name} are read from its deck, a .inp file")
    refuse_unreadable(deck)
    try:
        contents = read_inp(read_file(deck, ReferenceFileError), deck.parent)
    except MeshError as error:
        raise ReferenceFileError(f"{deck}: {error}") from None
    refuse_repeated(contents.node_numbers, "*NODE", deck)
    return contents


@dataclass
class _Increment:
    """The tables printed at one time."""

    time: float
    is_mode: bool
    displacement: Floats
    is_known: Bools
    sets: set[tuple[str, str]] = field(default_factory=set)  # quantity and set
    energy: dict[str, float] = field(default_factory=dict)
    force: dict[str, Floats] = field(default_factory=dict)


class _Printed:
    """Reader of the tables of a file."""

    def __init__(self, scan: Scan, deck: Contents) -> None:
        self._scan, self._deck = scan, deck
        self._sets = {name.upper(): np.unique(group) for name, group in deck.node_groups.items()}
        self._increments: list[_Increment] = []

    def increments(self) -> list[_Increment]:
        """Return the increments in the order of the file."""
        scan = self._scan
        is_mode = False
        while line := scan.line():
            if b"\0" in line:
                scan.refuse("not a .dat file of CalculiX: it is binary, not text")
            if not line.endswith(b"\n"):
                scan.refuse(f"the file is truncated: {scan.shown(line)} has no line end")
            if _MODE.fullmatch(line):
                is_mode = True
            elif head := _HEAD.fullmatch(line):
                self._add(head, is_mode)
                is_mode = False
        scan.done()
        return self._increments

    def _add(self, head: re.Match[bytes], is_mode: bool) -> None:
        scan = self._scan
        quantity = head[1].decode().partition(" (")[0]
        name = head[2].decode("utf-8", errors="replace").strip()
        try:
            time = float(head[3])
        except ValueError:
            scan.refuse(f"{scan.shown(head[3])} is not a time")
        increment = self._increment(time, is_mode, (quantity, name))
        if scan.line().strip():
            scan.refuse(f"the title of {quantity} must be followed by an empty line")
        match quantity:
            case "displacements":
                self._add_displacement(increment, name)
            case "total force":
                increment.force[name] = self._total(quantity, 3)
            case _:
                increment.energy[name] = float(self._total(quantity, 1)[0])

    def _increment(self, time: float, is_mode: bool, table: tuple[str, str]) -> _Increment:
        """Return the increment of a table; a new one starts if the time changes or the table is already in the last."""
        last = self._increments[-1] if self._increments else None
        if last is None or last.time != time or table in last.sets or is_mode:
            points = self._deck.points
            last = _Increment(time, is_mode, np.full(points.shape, np.nan), np.zeros(len(points), dtype=bool))
            self._increments.append(last)
        last.sets.add(table)
        return last

    def _total(self, quantity: str, width: int) -> Floats:
        line = self._scan.line()
        if not line.endswith(b"\n"):
            self._scan.refuse(f"the file is truncated: {width} numbers of {quantity} are expected")
        return np.asarray(self._scan.columns([line], 6, (width, _REAL_WIDTH, "float"))[0][0])

    def _add_displacement(self, increment: _Increment, name: str) -> None:
        scan, what = self._scan, f"set {name} at time {increment.time:g}"
        seen = []
        lines: list[bytes] = []
        more = True
        while more:
            line = scan.line()
            more = bool(line.strip())
            if more:
                lines.append(line)
            if lines and (not more or len(lines) == CHUNK):
                nodes, values = self._rows(lines, more)
                rows = rows_of(self._deck.node_numbers, nodes, f"{what} (line {scan.line_number} or before)", scan.file)
                increment.displacement[rows], increment.is_known[rows] = values, True
                seen.append(nodes)
                lines = []
        numbers = np.concatenate(seen) if seen else np.zeros(0, dtype=np.int64)
        refuse_repeated(numbers, what, scan.file)
        known = self._sets.get(name.upper())
        if known is not None and len(numbers) != len(known):
            scan.refuse(
                f"{what} has {len(known)} nodes in the deck, {len(numbers)} are printed: the file is truncated, or "
                "belongs to another deck"
            )
        if not len(numbers):
            scan.refuse(f"{what} has no rows: the file is truncated")

    def _rows(self, lines: Sequence[bytes], more: bool) -> tuple[Ints, Floats]:
        scan = self._scan
        if not more:  # the last line read is the blank one after the table
            scan.line_number -= 1
        if not lines[-1].endswith(b"\n"):
            scan.refuse(f"the file is truncated: {scan.shown(lines[-1])} has no line end")
        nodes, values = scan.columns(list(lines), 0, (1, _ID_WIDTH, "int"), (3, _REAL_WIDTH, "float"))
        scan.line_number += not more
        return nodes[:, 0], values


# --- levels ---------------------------------------------------------------------------------------


def _record(file: Path, deck: Contents, increments: Sequence[_Increment]) -> Record:
    moved = [increment for increment in increments if increment.is_known.any()]
    if not moved:
        raise ReferenceFileError(
            f"{file} has no table 'displacements (vx,vy,vz) for set ...': request it by *NODE PRINT with a line U"
        )
    body = {name.upper(): np.unique(group) for name, group in deck.cell_groups.items()}
    elements = np.concatenate([block.numbers for block in deck.cells])
    levels = [
        Level(one.time, one.displacement, _energy(one.energy, body, elements), _force(one, deck)) for one in moved
    ]
    kept, notes = without_modes(levels, [one.is_mode for one in moved])
    cells = {
        name: rows_of(deck.node_numbers, nodes, f"a {name}", file) for name, nodes in named(deck.cells, file).items()
    }
    names = tuple(map(str, deck.node_numbers.tolist()))
    return Record(file, "dat", deck.points, cells, kept, names, (*notes, *_notes(moved, levels, deck)))


def _energy(printed: Mapping[str, float], body: Mapping[str, Ints], elements: Ints) -> float | None:
    """Return the energy of the body: of a set of all elements, or the sum over sets that partition them; else None."""
    members = {name: body.get(name.upper(), np.zeros(0, dtype=np.int64)) for name in printed}
    for name, value in printed.items():
        if len(members[name]) == len(elements):
            return value
    together = np.concatenate([*members.values(), np.zeros(0, dtype=np.int64)])
    shared = len(together) == len(elements) == len(np.unique(together))
    return sum(printed.values()) if shared else None


def _loaded(increment: _Increment, deck: Contents) -> list[str]:
    """Return the sets with a total force, without sets of all nodes, on which loads and reactions balance."""
    sizes = {name.upper(): len(np.unique(group)) for name, group in deck.node_groups.items()}
    return [name for name in increment.force if sizes.get(name.upper()) != len(deck.points)]


def _force(increment: _Increment, deck: Contents) -> Floats | None:
    names = _loaded(increment, deck)
    return increment.force[names[0]] if len(names) == 1 else None


def _notes(increments: Sequence[_Increment], levels: Sequence[Level], deck: Contents) -> list[str]:
    notes = []
    energies = sorted({name for one in increments for name in one.energy})
    if energies and any(level.energy is None for level in levels):
        notes.append(
            f"internal energy is ignored: it is printed for {', '.join(energies)}, which do not partition the body"
        )
    forces = sorted({name for one in increments for name in _loaded(one, deck)})
    if len(forces) == 1:
        notes.append(f"force is the total force of set {forces[0]}: for a set of supports the reaction")
    elif forces:
        notes.append(f"total force is ignored: it is printed for several sets ({', '.join(forces)})")
    return notes
