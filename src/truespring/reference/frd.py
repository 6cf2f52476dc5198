"""CalculiX results in .frd files: the displacement of every increment; text in short and long format, and binary.

Source: "Result Format" in the CalculiX GraphiX manual, https://www.dhondt.de, and files of CalculiX 2.20. The
available libraries keep all fields in memory and read damaged values as zeros.
"""

from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ReferenceFileError
from truespring.reference.checks import checked, refuse_repeated, refuse_unreadable, rows_of, without_modes
from truespring.reference.record import Level, Reading, Record
from truespring.reference.scan import CHUNK, Scan, scanning

# Key in CELL_SHAPES, and nodes in VTK's order, by the number of an element type. The midpoints of vertical edges come
# before those of the upper face, in VTK after them.
_TYPES: dict[int, tuple[str, tuple[int, ...]]] = {
    1: ("hexahedron", tuple(range(8))),
    2: ("wedge", tuple(range(6))),
    3: ("tetra", tuple(range(4))),
    4: ("hexahedron20", (*range(12), *range(16, 20), *range(12, 16))),
    5: ("wedge15", (*range(9), *range(12, 15), *range(9, 12))),
    6: ("tetra10", tuple(range(10))),
    7: ("triangle", tuple(range(3))),
    8: ("triangle6", tuple(range(6))),
    9: ("quad", tuple(range(4))),
    10: ("quad8", tuple(range(8))),
    11: ("line", (0, 1)),
    12: ("line3", (0, 1, 2)),
}

# Formats of a block: text with node numbers of 5 or 10 columns, binary with values of 4 or 8 bytes.
_SHORT, _LONG, _SINGLE, _DOUBLE = 0, 1, 2, 3
_ID_WIDTH = {_SHORT: 5, _LONG: 10}
_REAL = {_SINGLE: "<f4", _DOUBLE: "<f8"}
_REAL_WIDTH = 12
_INT = np.dtype("<i4")

# Records that may follow the elements of a binary file.
_RECORDS = (b"    1", b"  100", b" 9999", b"    2", b"    3")
# Records that may be the first of a file.
_BEGINNINGS = (b"    1C", b"    1U", b"    2C")

# Types of analysis whose displacements are mode shapes.
_MODES = ("2", "4")


def is_frd(head: bytes) -> bool:
    """Return whether the beginning of a file is that of a .frd file."""
    return head.startswith(_BEGINNINGS)


def read_frd(file: Path, reading: Reading | None = None) -> Record:
    """Read a .frd file of CalculiX.

    Each block DISP becomes a level; other blocks are skipped. Numbers in text files have six digits. Memory use is that
    of the record and a few MB.

    Args:
        file: the result.
        reading: called with the fraction that has been read.

    Returns a record of kind "frd", whose names are the node numbers. Raises ReferenceFileError, with the line (in a
    binary file the byte), if the file is damaged, truncated within a block, or has no displacement.
    """
    refuse_unreadable(file)
    with scanning(file, reading) as scan:
        return checked(_Result(scan).read())


class _Result:
    """Reader of nodes, elements and displacements."""

    def __init__(self, scan: Scan) -> None:
        self._scan = scan
        self._nodes: tuple[Ints, Floats] | None = None
        self._elements: dict[int, array[int]] = {}
        self._levels: list[Level] = []
        self._is_mode: list[bool] = []
        self._notes: list[str] = []
        self._head = b""  # record 100C of the next result
        self._is_open = False  # the header of a result was read, the result was not
        self._is_whole = False

    def read(self) -> Record:
        """Return the record of the file."""
        scan = self._scan
        line = scan.line()
        if not line.startswith(_BEGINNINGS):
            scan.refuse(f"not a .frd file of CalculiX: it must begin with '1C', not with {scan.shown(line)}")
        while line and not self._is_whole:
            self._take(line)
            line = b"" if self._is_whole else scan.line()
        if self._is_open:
            scan.refuse("the file is truncated in the header of a result")
        scan.done()
        return self._gathered()

    def _take(self, line: bytes) -> None:
        """Read the block of a record, given the line of the record."""
        scan = self._scan
        self._is_open = line.startswith((b"    1P", b"  100C"))
        match line[:6]:
            case b"    2C":
                self._read_nodes(line)
            case b"    3C":
                self._read_elements(line)
            case b"  100C":
                self._head = line
            case key if key[:3] == b" -4":
                self._read_result(line)
            case key if key[:5] == b" 9999":
                self._is_whole = True
            case key if key[:5] != b"    1":
                cut = "" if line.endswith(b"\n") else ": the file is truncated"
                scan.refuse(f"{scan.shown(line)} is not a record of a .frd file{cut}")

    def _read_nodes(self, line: bytes) -> None:
        scan = self._scan
        if self._nodes is not None:
            scan.refuse("a second block of nodes is not supported: write one mesh only")
        count, form = self._announced(line)
        rows = list(self._rows(count, form, 3, "nodes (2C)"))
        numbers, points = (np.concatenate(column) for column in zip(*rows, strict=True))
        refuse_repeated(numbers, "2C", scan.file)
        self._nodes = numbers, points

    def _announced(self, line: bytes) -> tuple[int, int]:
        """Return the number of rows that follow and their format."""
        try:
            count, form = [*map(int, line[6:].split()), _LONG][:2]
        except ValueError:
            self._scan.refuse(f"{self._scan.shown(line)} does not give the number of rows")
        self._refuse_form(form)
        if count < 1:
            self._scan.refuse(f"{self._scan.shown(line)} states {count} rows")
        return count, form

    def _refuse_form(self, form: int) -> None:
        if form not in (_SHORT, _LONG, _SINGLE, _DOUBLE):
            self._scan.refuse(f"format {form} is not supported; supported: 0 and 1 (text), 2 and 3 (binary)")

    def _rows(self, count: int, form: int, width: int, what: str = "") -> Iterator[tuple[Ints, Floats]]:
        """Yield node numbers and values, shapes (n,) and (n, width), up to the end of the block.

        A text block may have more rows than stated, up to its end mark; fewer are an error.
        """
        scan = self._scan
        for left in range(count, 0, -CHUNK):
            n = min(left, CHUNK)
            if form in _REAL:
                found = scan.values(np.dtype([("node", _INT), ("values", _REAL[form], (width,))]), n)
                with np.errstate(invalid="ignore"):  # damaged values are reported later
                    values = found["values"].astype(np.float64)
                yield found["node"].astype(np.int64), values
                continue
            lines = scan.lines(n)
            self._refuse_others(lines, n, count - left, count)
            yield self._parsed(lines, form, width)
        n_there = count
        while form not in _REAL and (line := self._further(n_there)):
            yield self._parsed([line], form, width)
            n_there += 1
        self._note_count(what, count, n_there)

    def _parsed(self, lines: list[bytes], form: int, width: int) -> tuple[Ints, Floats]:
        """Return node numbers and values of the last lines read; values with long exponents exceed their columns."""
        scan, begins = self._scan, 3 + _ID_WIDTH[form]
        if max(len(line.rstrip()) for line in lines) <= begins + width * _REAL_WIDTH:
            nodes, values = scan.columns(lines, 3, (1, _ID_WIDTH[form], "int"), (width, _REAL_WIDTH, "float"))
            return nodes[:, 0], values
        return scan.glued(lines, 3, _ID_WIDTH[form], width)

    def _further(self, done: int) -> bytes:
        """Return the next row of a block, empty at its end mark; raise ReferenceFileError for any other line."""
        line = self._scan.line()
        if not line.startswith((b" -1", b" -3")):
            why = f"follows {self._scan.shown(line)}" if line else "the file is truncated"
            self._scan.refuse(f"after {done} rows {why}: a block must end with -3")
        return line if line.startswith(b" -1") else b""

    def _note_count(self, what: str, announced: int, there: int) -> None:
        if what and there != announced:
            self._notes.append(f"{what}: {announced} are stated, {there} were found and read")

    def _refuse_others(self, lines: list[bytes], expected: int, before: int, count: int) -> None:
        """Raise ReferenceFileError if a line is not a row, or lines are missing."""
        scan = self._scan
        for place, line in enumerate(lines):
            if not line.startswith(b" -1"):
                where = scan.line_number - len(lines) + 1 + place
                scan.refuse(f"{count} rows are stated, after {before + place} follows {scan.shown(line)}", where)
        if len(lines) < expected:
            scan.refuse(f"the file is truncated: {count} rows are stated, {before + len(lines)} were found")

    def _read_elements(self, line: bytes) -> None:
        count, form = self._announced(line)
        n_there = 0
        for code, nodes in self._text_elements(form) if form in _ID_WIDTH else self._binary_elements(count):
            self._elements.setdefault(code, array("q")).extend(nodes)
            n_there += 1
        self._note_count("elements (3C)", count, n_there)

    def _text_elements(self, form: int) -> Iterator[tuple[int, list[int]]]:
        """Yield type and nodes of the elements up to the end mark.

        For composite shells CalculiX counts one element per shell and writes one per layer.
        """
        done = 0
        while head := self._further(done):
            yield self._element(head, form)
            done += 1

    def _binary_elements(self, count: int) -> Iterator[tuple[int, list[int]]]:
        """Yield type and nodes of at least `count` elements, up to the next record; there is no end mark."""
        while count > 0 or not self._scan.is_at(*_RECORDS):
            code = int(self._scan.values(_INT, 4)[1])  # number, type, group and material
            yield code, self._scan.values(_INT, self._n_nodes(code)).tolist()
            count -= 1

    def _element(self, head: bytes, form: int) -> tuple[int, list[int]]:
        """Return the type and nodes of an element, which follow its header in one or two lines."""
        scan, width = self._scan, _ID_WIDTH[form]
        try:
            code = int(head[3 + width : 8 + width])
        except ValueError:
            code = -1
        if code < 0:
            cut = "" if head.endswith(b"\n") else ": the file is truncated"
            scan.refuse(f"{scan.shown(head)} is not an element{cut}")
        length = width * self._n_nodes(code)
        text = b""
        while len(text) < length:
            line = scan.line()
            if not line.startswith(b" -2") or not line.endswith(b"\n") or not line[3:].strip():
                scan.refuse(f"{scan.shown(line)} is not a row of an element's nodes, or the file is truncated")
            text += line[3:].rstrip()
        try:
            nodes = [int(text[place : place + width]) for place in range(0, len(text), width)]
        except ValueError:
            scan.refuse(f"{scan.shown(text)}: node numbers in columns of {width} are expected")
        if len(text) != length:
            scan.refuse(f"{len(nodes)} nodes, an element of type {code} has {length // width}")
        return code, nodes

    def _n_nodes(self, code: int) -> int:
        if code not in _TYPES:
            self._scan.refuse(f"element type {code} is not supported; supported: {', '.join(map(str, _TYPES))}")
        return len(_TYPES[code][1])

    def _read_result(self, line: bytes) -> None:
        """Read a block of displacements; skip a block of another quantity."""
        scan, head = self._scan, self._head
        name = line[5:13].strip()
        try:
            n_components = int(line[13:18])
            count, time, form = int(head[24:36]), float(head[12:24]), int(head[73:75] or _LONG)
            if n_components < 1 or count < 0:
                raise ValueError("a count is negative")
        except ValueError:
            scan.refuse(f"the header of {scan.shown(name)} cannot be read: {scan.shown(head)}, {scan.shown(line)}")
        self._refuse_form(form)
        components = scan.lines(n_components)
        if len(components) < n_components or not all(one.startswith(b" -5") for one in components):
            scan.refuse(f"{n_components} rows '-5' are expected below {scan.shown(line)}, or the file is truncated")
        width = sum(one[33:38].strip() in (b"", b"0") for one in components)  # others are not written
        if name == b"DISP":
            self._read_displacement(count, form, width, time, head)
        elif form in _REAL:
            for _ in self._rows(count, form, width):
                pass
        else:
            scan.skip(b" -3")

    def _read_displacement(self, count: int, form: int, width: int, time: float, head: bytes) -> None:
        scan = self._scan
        if width != 3:
            scan.refuse(f"DISP has {width} components instead of 3")
        if self._nodes is None:
            scan.refuse("DISP precedes the nodes")
        numbers, points = self._nodes
        displacement = np.full(points.shape, np.nan)
        is_known = np.zeros(len(points), dtype=bool)
        done = 0
        for nodes, values in self._rows(count, form, 3, f"DISP at time {time:g}"):
            expected = np.arange(done, done + len(nodes))
            if not np.array_equal(nodes, numbers[done : done + len(nodes)]):
                expected = rows_of(numbers, nodes, f"DISP at time {time:g}", scan.file)
            if is_known[expected].any() or len(np.unique(expected)) < len(expected):
                refuse_repeated(np.concatenate([nodes, numbers[is_known]]), f"DISP at time {time:g}", scan.file)
            is_known[expected], displacement[expected] = True, values
            done += len(nodes)
        self._levels.append(Level(time, displacement))
        self._is_mode.append(head[56:58].strip().decode("ascii", errors="replace") in _MODES)

    def _gathered(self) -> Record:
        file = self._scan.file
        if self._nodes is None:
            raise ReferenceFileError(f"{file} has no nodes: is the file truncated?")
        if not self._levels:
            cut = "" if self._is_whole else " and no end mark 9999 (was the run stopped, or the file truncated?)"
            raise ReferenceFileError(f"{file} has no displacement{cut}: request it by *NODE FILE with a line U")
        levels, notes = without_modes(self._levels, self._is_mode)
        notes += tuple(self._notes)
        if not self._is_whole:
            notes += (
                "there is no end mark 9999: the run was stopped, and its last increment may not be an equilibrium; or "
                "the file was truncated",
            )
        numbers, points = self._nodes
        cells = {}
        for code in sorted(self._elements):
            name, order = _TYPES[code]
            nodes = np.frombuffer(self._elements[code], np.int64).reshape(-1, len(order))
            cells[name] = rows_of(numbers, nodes[:, order], f"a {name}", file)
        names = tuple(map(str, numbers.tolist()))
        return Record(file, "frd", points, cells, levels, names, notes, stopped=not self._is_whole)
