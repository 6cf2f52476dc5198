"""gmsh .msh files, versions 2 to 2.2 and 4.1, text and binary.

Source: "File formats" in the reference manual of gmsh, https://gmsh.info/doc/texinfo/gmsh.html
"""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, NoReturn

import numpy as np
from numpy.typing import DTypeLike, NDArray

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.files.contents import CELL_KINDS, Cells, Contents
from truespring.mesh.files.text import Rows, integers, reals, refuse_ragged, word

# gmsh's number of an element type: its kind and the number of its nodes.
_TYPES: dict[int, tuple[str, int]] = {
    15: ("vertex", 1),
    1: ("line", 2),
    8: ("line", 3),
    2: ("triangle", 3),
    9: ("triangle", 6),
    3: ("quadrilateral", 4),
    16: ("quadrilateral", 8),
    10: ("quadrilateral", 9),
    4: ("tetrahedron", 4),
    11: ("tetrahedron", 10),
    5: ("hexahedron", 8),
    17: ("hexahedron", 20),
    12: ("hexahedron", 27),
    6: ("wedge", 6),
    18: ("wedge", 15),
    13: ("wedge", 18),
    7: ("pyramid", 5),
    19: ("pyramid", 13),
    14: ("pyramid", 14),
}

# Where the last two of ten nodes change places with VTK's.
_TEN = (0, 1, 2, 3, 4, 5, 6, 7, 9, 8)

# Dimension and number of a physical group or of an entity.
_Tag = tuple[int, int]
# Numbers, points and lines of nodes.
_Nodes = tuple[Ints, Floats, Ints | None]
# Cells and, by physical group, their numbers.
_Elements = tuple[list[Cells], dict[_Tag, list[Ints]]]
# Of version 2: type, number of tags, rows of a cell's number, tags and nodes, and their lines.
_Table = tuple[int, int, Ints, Ints | None]


def read_msh(data: bytes) -> Contents:
    """Read a .msh file; raise MeshError where it is damaged or of another version."""
    version, source = _open(data)
    names: dict[_Tag, str] = {}
    physicals: dict[_Tag, list[int]] = {}
    nodes: _Nodes | None = None
    elements: _Elements | None = None
    while source.next_section():
        match source.section:
            case "PhysicalNames":
                names = _physical_names(source)
            case "Entities" if version == 4:
                physicals = _entities(source)
            case "PartitionedEntities":
                source.refuse("a partitioned mesh is not supported: save it without partitions")
            case "Nodes" if nodes is None:
                nodes = _nodes_4(source) if version == 4 else source.nodes_2()
            case "Elements" if elements is None:
                elements = _elements_4(source, physicals) if version == 4 else _elements_2(source)
            case "Nodes" | "Elements":
                source.refuse(f"${source.section} is there twice")
            case _:
                source.skip_section()
                continue
        source.end_section()
    if nodes is None or elements is None:
        raise MeshError(f"there is no section ${'Elements' if nodes else 'Nodes'}: is the file cut off?")
    groups: dict[str, list[Ints]] = {}
    for (dim, number), members in elements[1].items():
        groups.setdefault(names.get((dim, number), str(number)), []).extend(members)
    return Contents(
        node_numbers=nodes[0],
        points=nodes[1],
        cells=elements[0],
        cell_groups={name: np.concatenate(members) for name, members in groups.items()},
        node_lines=nodes[2],
    )


# --- the two ways that a file is written ----------------------------------------------------------


class _Sections(ABC):
    """What text and binary files share: lines that begin and end a section, and lines between."""

    section = "MeshFormat"

    @abstractmethod
    def line(self) -> bytes:
        """Return the next line that is not blank, stripped; empty at the end of the file."""

    @property
    @abstractmethod
    def where(self) -> str:
        """Where that line stands."""

    def refuse(self, why: str) -> NoReturn:
        """Raise MeshError."""
        raise MeshError(f"{self.where}{why}")

    def next_section(self) -> bool:
        """Enter the next section; tell whether there is one."""
        line = self.line()
        if line and (not line.startswith(b"$") or line.startswith(b"$End")):
            self.refuse(f"a section such as $Nodes is wanted here, not '{word(line)}'")
        self.section = word(line[1:])
        return bool(line)

    def end_section(self) -> None:
        """Leave the section; raise MeshError where it goes on."""
        line = self.line()
        if line != b"$End" + self.section.encode():
            self.refuse(
                f"$End{self.section} is wanted here, not '{word(line)}': the counts do not match"
                if line
                else f"$End{self.section} is missing: the file is cut off"
            )

    def count(self) -> int:
        """Return the count that stands alone on the next line."""
        line = self.line()
        if not re.fullmatch(rb"\d{1,18}", line):
            self.refuse(f"${self.section} begins with a count, not with '{word(line)}'")
        return int(line)

    def known(self, type_: int) -> tuple[str, int]:
        """Return kind and number of nodes of an element type."""
        if type_ not in _TYPES:
            self.refuse(f"gmsh's element type {type_} is not supported: of first and second order only")
        return _TYPES[type_]

    def check_total(self, there: int, announced: int) -> None:
        """Raise MeshError where the blocks of a section do not add up to its count."""
        if there != announced:
            self.refuse(f"${self.section} announces {announced} entries and has {there}")


class _Text(_Sections):
    """A .msh file of text."""

    def __init__(self, data: bytes, n_before: int) -> None:
        numbered = [(line, number) for number, line in enumerate(data.splitlines(), n_before + 1) if line.strip()]
        self._lines = [line for line, _ in numbered]
        self._numbers = [number for _, number in numbered]
        self._next = 0

    def line(self) -> bytes:
        self._next += 1
        return self._lines[self._next - 1].strip() if self._next <= len(self._lines) else b""

    @property
    def where(self) -> str:
        return f"line {self._numbers[min(self._next, len(self._lines)) - 1]}: " if self._lines else ""

    def skip_section(self) -> None:
        """Go behind the section, which is not read."""
        end = b"$End" + self.section.encode()
        while (line := self.line()) != end:
            if not line:
                self.refuse(f"$End{self.section} is missing: the file is cut off")

    def rows(self, count: int) -> tuple[Rows, list[int]]:
        """Return the fields and the numbers of the next `count` lines of the section."""
        lines = self._lines[self._next : self._next + count]
        there = next((place for place, line in enumerate(lines) if line.startswith(b"$")), len(lines))
        if there < count:
            self._next += there + 1
            self.refuse(f"${self.section} ends here, {count - there} lines before its count is reached")
        numbers = self._numbers[self._next : self._next + count]
        self._next += count
        return [line.split() for line in lines], numbers

    def counts(self, n_ints: int, n_sizes: int) -> list[int]:
        """Return what heads a table of version 4: plain integers, then counts and numbers of nodes or elements."""
        counts: list[int] = self.integers(1, n_ints + n_sizes)[0][0].tolist()
        if min(counts[n_ints:]) < 0:
            self.refuse(f"${self.section}: a count is negative")
        return counts

    def integers(self, n_rows: int, n_columns: int) -> tuple[Ints, Ints | None]:
        """Return a table of numbers of nodes and elements, and its lines."""
        rows, lines = self._table(n_rows, n_columns)
        return integers(rows, lines, f"${self.section}").reshape(n_rows, n_columns), np.array(lines, dtype=np.int64)

    def reals(self, n_rows: int, n_columns: int) -> tuple[Floats, Ints | None]:
        """Return a table of coordinates, and its lines."""
        rows, lines = self._table(n_rows, n_columns)
        return reals(rows, lines, f"${self.section}").reshape(n_rows, n_columns), np.array(lines, dtype=np.int64)

    def _table(self, n_rows: int, n_columns: int) -> tuple[Rows, list[int]]:
        rows, lines = self.rows(n_rows)
        refuse_ragged(rows, lines, n_columns, f"${self.section}")
        return rows, lines

    def entity(self, dim: int) -> tuple[int, list[int]]:
        """Return the number of an entity of version 4 and those of its physical groups."""
        rows, lines = self.rows(1)
        before = 4 if dim == 0 else 7  # its number; its place, or two corners of the box around it
        values = integers([[*rows[0][:1], *rows[0][before:]]], lines, "$Entities").tolist()
        if len(values) < 2 or not 0 <= values[1] <= len(values) - 2:
            self.refuse("an entity lacks some of its numbers")
        return values[0], values[2 : 2 + values[1]]

    def nodes_2(self) -> _Nodes:
        """Return the nodes of version 2."""
        rows, lines = self._table(self.count(), 4)
        numbers = integers([row[:1] for row in rows], lines, "the number of a node")
        points = reals([row[1:] for row in rows], lines, "a coordinate").reshape(-1, 3)
        return numbers, points, np.array(lines, dtype=np.int64)

    def elements_2(self) -> Iterator[_Table]:
        """Yield the cells of version 2, those of one type and number of tags together."""
        rows, lines = self.rows(self.count())
        for row, line in zip(rows, lines, strict=True):
            if len(row) < 3:
                raise MeshError(f"line {line}: an element lacks some of its numbers")
        values = integers(rows, lines, "$Elements")
        at, width = np.array(lines, dtype=np.int64), np.array([len(row) for row in rows], dtype=np.int64)
        start = np.cumsum(width) - width
        heads = np.stack([values[start + 1], values[start + 2]], axis=1)
        for head in np.sort(np.unique(heads, axis=0, return_index=True)[1]):
            type_, n_tags = heads[head].tolist()
            same = np.flatnonzero((heads == heads[head]).all(axis=1))
            wanted = 3 + n_tags + _TYPES[type_][1] if type_ in _TYPES and n_tags >= 0 else -1
            wrong = same[width[same] != wanted]
            if wanted < 0 or wrong.size:
                raise MeshError(
                    f"line {at[wrong[0]]}: an element of gmsh's type {type_} with {n_tags} tags "
                    + ("is not supported" if wanted < 0 else f"takes {wanted} numbers, here are {width[wrong[0]]}")
                )
            yield type_, n_tags, values[start[same, None] + np.array([0, *range(3, wanted)])], at[same]


class _Binary(_Sections):
    """A .msh file whose tables are binary, between lines of text."""

    def __init__(self, data: bytes, begin: int, order: str, size: int) -> None:
        self._data = data
        self._next = begin
        self._int, self._size, self._real = (np.dtype(f"{order}{code}") for code in ("i4", f"u{size}", "f8"))

    def line(self) -> bytes:
        line = b""
        while not line and self._next < len(self._data):
            end = self._data.find(b"\n", self._next) + 1 or len(self._data)
            line = self._data[self._next : end].strip()
            self._next = end
        return line

    @property
    def where(self) -> str:
        return f"byte {self._next}: "

    def skip_section(self) -> None:
        """Go behind the section, which is not read."""
        end = b"$End" + self.section.encode()
        found = re.compile(rb"^" + re.escape(end) + rb"\s*?$", re.MULTILINE).search(self._data, self._next)
        if found is None:
            self.refuse(f"$End{self.section} is missing: the file is cut off")
        self._next = found.end()

    def take(self, dtype: DTypeLike, count: int) -> NDArray[Any]:
        """Return the next `count` values."""
        size, left = count * np.dtype(dtype).itemsize, len(self._data) - self._next
        if not 0 <= size <= left:
            self.refuse(f"${self.section} wants {size} bytes, the file has {left} more")
        values = np.frombuffer(self._data, dtype, count, self._next)
        self._next += size
        return values

    def counts(self, n_ints: int, n_sizes: int) -> list[int]:
        """Return what heads a table of version 4: plain integers, then counts and numbers of nodes or elements."""
        return [*self.take(self._int, n_ints).tolist(), *self.take(self._size, n_sizes).tolist()]

    def integers(self, n_rows: int, n_columns: int) -> tuple[Ints, Ints | None]:
        """Return a table of numbers of nodes and elements."""
        return self.take(self._size, n_rows * n_columns).reshape(n_rows, n_columns).astype(np.int64), None

    def reals(self, n_rows: int, n_columns: int) -> tuple[Floats, Ints | None]:
        """Return a table of coordinates."""
        return self.take(self._real, n_rows * n_columns).reshape(n_rows, n_columns).astype(np.float64), None

    def entity(self, dim: int) -> tuple[int, list[int]]:
        """Return the number of an entity of version 4 and those of its physical groups."""
        number = int(self.take(self._int, 1)[0])
        self.take(self._real, 3 if dim == 0 else 6)
        physicals: list[int] = self.take(self._int, int(self.take(self._size, 1)[0])).tolist()
        if dim:
            self.take(self._int, int(self.take(self._size, 1)[0]))
        return number, physicals

    def nodes_2(self) -> _Nodes:
        """Return the nodes of version 2."""
        nodes = self.take(np.dtype([("number", self._int), ("point", self._real, 3)]), self.count())
        return nodes["number"].astype(np.int64), nodes["point"].astype(np.float64), None

    def elements_2(self) -> Iterator[_Table]:
        """Yield the cells of version 2, those of one type and number of tags together."""
        blocks: dict[tuple[int, int], list[Ints]] = {}
        left = self.count()
        while left > 0:
            type_, count, n_tags = self.take(self._int, 3).tolist()
            columns = 1 + n_tags + self.known(type_)[1]
            if not 0 < count <= left or n_tags < 0:
                self.refuse(f"{count} elements with {n_tags} tags, {left} elements are left")
            blocks.setdefault((type_, n_tags), []).append(self.take(self._int, count * columns).reshape(count, columns))
            left -= count
        for (type_, n_tags), tables in blocks.items():
            yield type_, n_tags, np.concatenate(tables).astype(np.int64), None


_Source = _Text | _Binary


def _open(data: bytes) -> tuple[int, _Source]:
    """Return the version, 2 or 4, and the source of the sections behind the header."""
    comments, field = rb"(?:\s*\$Comments.*?\$EndComments)?\s*", rb"[ \t]+(\S+)"
    header = re.match(comments + rb"\$MeshFormat\s+(\S+)" + 2 * field + rb"[ \t\r]*\n", data, re.DOTALL)
    if header is None:
        raise MeshError("this is no .msh file: it begins with $MeshFormat, then version, file type and data size")
    version, file_type, size = (word(field) for field in header.groups())
    if version not in ("2", "2.1", "2.2", "4.1"):
        raise MeshError(f"version {version} of .msh is not read, 2.2 and 4.1 are: save it with -format msh41")
    if file_type not in ("0", "1") or size not in ("4", "8"):
        raise MeshError(f"$MeshFormat: file type {file_type} is not 0 or 1, or data size {size} is not 4 or 8")
    source: _Source
    if file_type == "0":
        source = _Text(data[header.end() :], data.count(b"\n", 0, header.end()))
    else:
        one = data[header.end() : header.end() + 4]
        if one not in (b"\1\0\0\0", b"\0\0\0\1"):
            raise MeshError("$MeshFormat: the binary 1 that tells the order of bytes is missing")
        source = _Binary(data, header.end() + 4, "<" if one[0] else ">", int(size))
    source.end_section()
    return int(version[0]), source


# --- the sections ---------------------------------------------------------------------------------


def _physical_names(source: _Source) -> dict[_Tag, str]:
    names = {}
    for _ in range(source.count()):
        line = source.line()
        found = re.fullmatch(rb'(\d)\s+(\d{1,18})\s+"(.*)"', line)
        if found is None:
            source.refuse(f"a physical group is dimension, number and \"name\", not '{word(line)}'")
        names[int(found[1]), int(found[2])] = found[3].decode("utf-8", errors="replace")
    return names


def _entities(source: _Source) -> dict[_Tag, list[int]]:
    """Return the physical groups of each entity; the sign of their numbers is but an orientation."""
    physicals = {}
    for dim, count in enumerate(source.counts(0, 4)):
        for _ in range(count):
            number, groups = source.entity(dim)
            physicals[dim, number] = [abs(group) for group in groups]
    return physicals


def _nodes_4(source: _Source) -> _Nodes:
    n_blocks, n_nodes, _, _ = source.counts(0, 4)
    numbers, points, lines = [np.zeros((0, 1), np.int64)], [np.zeros((0, 3))], [np.zeros(0, np.int64)]
    for _ in range(n_blocks):
        dim, _, parametric, count = source.counts(3, 1)
        if dim not in range(4):
            source.refuse(f"$Nodes: an entity of dimension {dim}")
        numbers.append(source.integers(count, 1)[0])
        table, at = source.reals(count, 3 + dim if parametric else 3)  # parameters on the entity follow the place
        points.append(table[:, :3])
        if at is not None:
            lines.append(at)
    source.check_total(sum(map(len, points)), n_nodes)
    has_lines = len(lines) == len(points)
    return np.concatenate(numbers)[:, 0], np.concatenate(points), np.concatenate(lines) if has_lines else None


def _elements_4(source: _Source, physicals: dict[_Tag, list[int]]) -> _Elements:
    n_blocks, n_elements, _, _ = source.counts(0, 4)
    cells: list[Cells] = []
    groups: dict[_Tag, list[Ints]] = {}
    for _ in range(n_blocks):
        dim, entity, type_, count = source.counts(3, 1)
        kind, n_nodes = source.known(type_)
        table, lines = source.integers(count, 1 + n_nodes)
        cells.append(Cells(kind, _in_vtk_order(table[:, 1:], kind), table[:, 0], lines))
        for group in physicals.get((dim, entity), []):
            groups.setdefault((dim, group), []).append(table[:, 0])
    source.check_total(sum(len(block.nodes) for block in cells), n_elements)
    return cells, groups


def _elements_2(source: _Source) -> _Elements:
    """Return each cell once: version 2 lists it again, with another number, for each of its physical groups."""
    cells: list[Cells] = []
    groups: dict[_Tag, list[Ints]] = {}
    for type_, n_tags, table, lines in source.elements_2():
        kind, _ = _TYPES[type_]
        group = np.abs(table[:, 1]) if n_tags else np.zeros(len(table), dtype=np.int64)
        nodes, numbers = table[:, 1 + n_tags :], table[:, 0]
        _, first, cell = np.unique(nodes, axis=0, return_index=True, return_inverse=True)
        cell = cell.ravel()
        if len(np.unique(np.stack([cell, group], axis=1), axis=0)) == len(table):
            numbers, once = numbers[first[cell]], np.sort(first)
        else:  # a cell is twice in one group: the mesh refuses it
            once = np.arange(len(table))
        cells.append(
            Cells(kind, _in_vtk_order(nodes[once], kind), numbers[once], None if lines is None else lines[once])
        )
        for number in np.unique(group[group > 0]).tolist():
            groups.setdefault((CELL_KINDS[kind][0], number), []).append(numbers[group == number])
    return cells, groups


def _in_vtk_order(nodes: Ints, kind: str) -> Ints:
    return nodes[:, _TEN] if kind == "tetrahedron" and nodes.shape[1] == len(_TEN) else nodes
