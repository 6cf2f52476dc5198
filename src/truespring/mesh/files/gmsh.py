"""gmsh .msh files, versions 1, 2 to 2.2, 4.0 and 4.1, text and binary.

Source: "File formats" in the reference manual of gmsh, https://gmsh.info/doc/texinfo/gmsh.html
"""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
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

# The last two of ten nodes are swapped in VTK's order.
_TEN = (0, 1, 2, 3, 4, 5, 6, 7, 9, 8)

# Dimension and number of a physical group or of an entity.
_Tag = tuple[int, int]
# Numbers, points and lines of nodes.
_Nodes = tuple[Ints, Floats, Ints | None]
# Of an entity: its number, that of the entity it is a part of, its physical groups.
_Entity = tuple[int, _Tag | None, list[int]]
# Cells and, by physical group, their numbers.
_Elements = tuple[list[Cells], dict[_Tag, list[Ints]]]
# Major and minor number.
_Version = tuple[int, int]
# Of version 2: type, number of tags, rows of a cell's number, tags and nodes, and their lines.
_Table = tuple[int, int, Ints, Ints | None]


def read_msh(data: bytes) -> Contents:
    """Read the bytes of a .msh file; raise MeshError if it is damaged or of an unknown version."""
    version, source = _open(data)
    names: dict[_Tag, str] = {}
    physicals: dict[_Tag, list[int]] = {}
    nodes: _Nodes | None = None
    elements: _Elements | None = None
    while source.next_section():
        match source.section:
            case "PhysicalNames":
                names = _physical_names(source)
            case "Entities" if version >= (4, 0):
                physicals |= _entities(source, version)
            case "PartitionedEntities":
                physicals |= _partitioned(source, version, physicals)
            case "Nodes" | "NOD" | "ParametricNodes" if nodes is None:
                nodes = _nodes_4(source, version) if version >= (4, 0) else source.nodes_2()
            case "Elements" | "ELM" if elements is None:
                elements = _elements_4(source, version, physicals) if version >= (4, 0) else _elements_2(source)
            case "Nodes" | "NOD" | "ParametricNodes" | "Elements" | "ELM":
                source.refuse(f"${source.section} is defined twice: must contain the nodes and elements of one mesh")
            case _:
                source.skip_section()
                continue
        source.end_section()
    if nodes is None or elements is None:
        raise MeshError(f"there is no section ${'Elements' if nodes else 'Nodes'}: is the file truncated?")
    groups: dict[str, list[Ints]] = {}
    for (dim, number), members in elements[1].items():
        groups.setdefault(names.get((dim, number), names.get((_ANY, number), str(number))), []).extend(members)
    return Contents(
        node_numbers=nodes[0],
        points=nodes[1],
        cells=elements[0],
        cell_groups={name: np.concatenate(members) for name, members in groups.items()},
        node_lines=nodes[2],
        notes=tuple(
            f"physical group '{name}' of dimension {dim} has no element in the file"
            for (dim, number), name in names.items()
            if dim != _ANY and (dim, number) not in elements[1]
        ),
        hint="gmsh saves only entities in physical groups: add the body (a volume, or a plane surface) to one, or set "
        "Mesh.SaveAll = 1"
        if groups
        else "mesh the volume too: gmsh -3",
    )


# --- text and binary files -------------- ----------------------------------------------------------


class _Sections(ABC):
    """Base of text and binary files: the lines that begin and end a section, and the lines in it."""

    section = "MeshFormat"

    @abstractmethod
    def line(self) -> bytes:
        """Return the next line that is not blank, stripped; empty at the end of the file."""

    @property
    @abstractmethod
    def where(self) -> str:
        """Return the place of the last line or value read, to begin a message with."""

    def refuse(self, why: str) -> NoReturn:
        """Raise MeshError with the place and the reason."""
        raise MeshError(f"{self.where}{why}")

    def next_section(self) -> bool:
        """Enter the next section; return whether there is one."""
        line = self.line()
        if line and (not line.startswith(b"$") or line.lower().startswith(b"$end")):
            self.refuse(f"expected a section such as $Nodes, found '{word(line)}'")
        self.section = word(line[1:])
        return bool(line)

    def end_section(self) -> None:
        """Leave the section; raise MeshError if its end mark does not follow."""
        line = self.line()
        if line.lower() != b"$end" + self.section.lower().encode():
            self.refuse(
                f"expected $End{self.section}, found '{word(line)}': the counts do not match"
                if line
                else f"$End{self.section} is missing: the file is truncated"
            )

    def count(self) -> int:
        """Return the count on the next line; raise MeshError if the line has anything else."""
        line = self.line()
        if not re.fullmatch(rb"\d{1,18}", line):
            self.refuse(f"${self.section} must begin with a count, not with '{word(line)}'")
        return int(line)

    def known(self, type_: int) -> tuple[str, int]:
        """Return kind and number of nodes of an element type; raise MeshError if it is not supported."""
        if type_ not in _TYPES:
            self.refuse(_unsupported(type_))
        return _TYPES[type_]

    def check_total(self, there: int, announced: int) -> None:
        """Raise MeshError if the blocks of a section do not add up to its count."""
        if there != announced:
            self.refuse(f"${self.section} states {announced} entries and has {there}")


def _unsupported(type_: int) -> str:
    return (
        f"an element of gmsh's type {type_} is not supported; supported: first and second order: "
        "mesh with Mesh.ElementOrder = 1 or 2"
    )


class _Text(_Sections):
    """A .msh file in text form."""

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
        """Skip the section."""
        end = b"$end" + self.section.lower().encode()
        while (line := self.line()).lower() != end:
            if not line:
                self.refuse(f"$End{self.section} is missing: the file is truncated")

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
        """Return the header of a table of version 4: `n_ints` integers, then `n_sizes` counts of nodes or elements."""
        counts: list[int] = self.integers(1, n_ints + n_sizes)[0][0].tolist()
        if min(counts[n_ints:], default=0) < 0:
            self.refuse(f"${self.section}: a count is negative")
        return counts

    def integers(self, n_rows: int, n_columns: int) -> tuple[Ints, Ints | None]:
        """Return a table of node and element numbers, shape (n_rows, n_columns), and its lines."""
        rows, lines = self._table(n_rows, n_columns)
        return integers(rows, lines, f"${self.section}").reshape(n_rows, n_columns), np.array(lines, dtype=np.int64)

    def reals(self, n_rows: int, n_columns: int) -> tuple[Floats, Ints | None]:
        """Return a table of coordinates, shape (n_rows, n_columns), and its lines."""
        rows, lines = self._table(n_rows, n_columns)
        return reals(rows, lines, f"${self.section}").reshape(n_rows, n_columns), np.array(lines, dtype=np.int64)

    def _table(self, n_rows: int, n_columns: int) -> tuple[Rows, list[int]]:
        rows, lines = self.rows(n_rows)
        refuse_ragged(rows, lines, n_columns, f"${self.section}")
        return rows, lines

    def entity(self, dim: int, version: _Version, is_part: bool) -> _Entity:
        """Return an entity of version 4 from the next line."""
        (row,), lines = self.rows(1)
        n_reals = 3 if dim == 0 and version > (4, 0) else 6  # its position, or two corners of its bounding box
        before = 1  # its number; of a part then its parent's dimension and number, and its partitions
        if is_part:
            before += 3 + int(integers([row[3:4]], lines, "$PartitionedEntities").sum())
        values = integers([[*row[:before], *row[before + n_reals :]]], lines, f"${self.section}").tolist()
        groups = values[before + 1 :]
        if len(values) <= before or not 0 <= values[before] <= len(groups):
            self.refuse("an entity has too few numbers")
        return values[0], (values[1], values[2]) if is_part else None, groups[: values[before]]

    def nodes_2(self) -> _Nodes:
        """Return the nodes of version 1 or 2; an entity and parameters on it may follow the coordinates."""
        n_nodes = self.count()
        rows, lines = self.rows(n_nodes)
        if self.section != "Nodes":  # entity and parameters follow, in $NOD too
            rows = [row[:4] for row in rows]
        refuse_ragged(rows, lines, 4, f"${self.section}")
        numbers = integers([row[:1] for row in rows], lines, "the number of a node")
        points = reals([row[1:] for row in rows], lines, "a coordinate").reshape(-1, 3)
        return numbers, points, np.array(lines, dtype=np.int64)

    def elements_2(self) -> Iterator[_Table]:
        """Yield the cells of version 2, those of one type and number of tags together."""
        rows, lines = self.rows(self.count())
        if self.section == "ELM":
            rows = [_of_version_2(row, line) for row, line in zip(rows, lines, strict=True)]
        for row, line in zip(rows, lines, strict=True):
            if len(row) < 3:
                raise MeshError(f"line {line}: an element has too few numbers")
        values = integers(rows, lines, "$Elements")
        at, width = np.array(lines, dtype=np.int64), np.array([len(row) for row in rows], dtype=np.int64)
        start = np.cumsum(width) - width
        heads = np.stack([values[start + 1], values[start + 2]], axis=1)
        for head in np.sort(np.unique(heads, axis=0, return_index=True)[1]):
            type_, n_tags = heads[head].tolist()
            same = np.flatnonzero((heads == heads[head]).all(axis=1))
            expected = 3 + n_tags + _TYPES[type_][1] if type_ in _TYPES and n_tags >= 0 else -1
            wrong = same[width[same] != expected]
            if expected < 0 or wrong.size:
                raise MeshError(
                    f"line {at[wrong[0]]}: "
                    + (
                        f"an element of gmsh's type {type_} with {n_tags} tags needs {expected} numbers, found "
                        f"{width[wrong[0]]}"
                        if expected >= 0
                        else _unsupported(type_)
                    )
                )
            yield type_, n_tags, values[start[same, None] + np.array([0, *range(3, expected)])], at[same]


def _of_version_2(row: Sequence[bytes], line: int) -> Sequence[bytes]:
    """Convert the row of an element from version 1 to 2: add the number of tags, drop the number of nodes."""
    if len(row) < 5 or not row[4].isdigit() or int(row[4]) != len(row) - 5:
        raise MeshError(
            f"line {line}: an element has {word(b' '.join(row[4:5])) or 'no'} nodes according to the count in its line"
        )
    return [*row[:2], b"2", *row[2:4], *row[5:]]


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
        """Skip the section: by its length if known, else to its end mark."""
        begin = self._next
        try:
            self._pass_over()
        except MeshError:  # the content does not fit the section's name
            self._next = begin
        end = rb"\$End" + re.escape(self.section.encode()) + rb"[ \t\r]*(?:\n|\Z)"  # it may follow without a line end
        found = re.compile(end, re.IGNORECASE).search(self._data, self._next)
        if found is None:
            self.refuse(f"$End{self.section} is missing: the file is truncated")
        self._next = found.end()

    def _pass_over(self) -> None:
        """Skip the binary data of a section of known length."""
        match self.section:
            case "NodeData" | "ElementData" | "ElementNodeData":
                tags = [[self.line() for _ in range(self.count())] for _ in range(3)]  # texts, reals, integers
                _, n_components, n_rows = integers([tags[2][:3]], [0], f"${self.section}").tolist()
                row = np.dtype([("number", self._int), ("values", self._real, n_components)])
                if self.section != "ElementNodeData":
                    self.take(row, n_rows)
                    return
                for _ in range(n_rows):
                    _, n_nodes = self.take(self._int, 2).tolist()
                    self.take(self._real, n_nodes * n_components)
            case "Periodic":
                for _ in range(self.sizes(1)[0]):
                    self.take(self._int, 3)
                    self.take(self._real, self.sizes(1)[0])
                    self.sizes(2 * self.sizes(1)[0])

    def take(self, dtype: DTypeLike, count: int) -> NDArray[Any]:
        """Return the next `count` values; raise MeshError at the end of the file."""
        size, left = count * np.dtype(dtype).itemsize, len(self._data) - self._next
        if not 0 <= size <= left:
            self.refuse(f"${self.section} needs {size} more bytes, the file has {left}")
        values = np.frombuffer(self._data, dtype, count, self._next)
        self._next += size
        return values

    def counts(self, n_ints: int, n_sizes: int) -> list[int]:
        """Return the header of a table of version 4: `n_ints` integers, then `n_sizes` counts of nodes or elements."""
        return [*self.take(self._int, n_ints).tolist(), *self.sizes(n_sizes)]

    def sizes(self, count: int) -> list[int]:
        """Return the next `count` numbers or counts of nodes or elements."""
        sizes: list[int] = self.take(self._size, count).tolist()
        return sizes

    def integers(self, n_rows: int, n_columns: int) -> tuple[Ints, Ints | None]:
        """Return a table of node and element numbers, shape (n_rows, n_columns), and None."""
        return self.take(self._size, n_rows * n_columns).reshape(n_rows, n_columns).astype(np.int64), None

    def reals(self, n_rows: int, n_columns: int) -> tuple[Floats, Ints | None]:
        """Return a table of coordinates, shape (n_rows, n_columns), and None."""
        return self.take(self._real, n_rows * n_columns).reshape(n_rows, n_columns).astype(np.float64), None

    def entity(self, dim: int, version: _Version, is_part: bool) -> _Entity:
        """Return an entity of version 4."""
        number, *parent = self.take(self._int, 3 if is_part else 1).tolist()
        if is_part:
            self.take(self._int, self.sizes(1)[0])
        self.take(self._real, 3 if dim == 0 and version > (4, 0) else 6)
        physicals: list[int] = self.take(self._int, self.sizes(1)[0]).tolist()
        if dim:
            self.take(self._int, self.sizes(1)[0])
        return number, (parent[0], parent[1]) if is_part else None, physicals

    def nodes_2(self) -> _Nodes:
        """Return the nodes of version 2; an entity and parameters on it may follow the coordinates."""
        row = np.dtype([("number", self._int), ("point", self._real, 3)])
        if self.section != "ParametricNodes":
            nodes = self.take(row, self.count())
        else:
            found = []
            for _ in range(self.count()):
                found.append(self.take(row, 1))
                dim, _ = self.take(self._int, 2).tolist()
                self.take(self._real, dim if dim in (1, 2) else 0)
            nodes = np.concatenate([np.zeros(0, row), *found])
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


def _open(data: bytes) -> tuple[_Version, _Source]:
    """Return the version, and the source positioned after the header."""
    comments, field = rb"(?:\s*\$Comments.*?\$EndComments)?\s*", rb"[ \t]+(\S+)"
    header = re.match(comments + rb"\$MeshFormat\s+(\S+)" + 2 * field + rb"[ \t\r]*\n", data, re.DOTALL)
    if header is None:
        if re.match(comments + rb"\$NOD\s", data, re.DOTALL):
            return (1, 0), _Text(data, 0)
        raise MeshError(
            "this is no .msh file: it must begin with $MeshFormat, then version, file type and data size, or with $NOD"
        )
    named, file_type, size = (word(field) for field in header.groups())
    numbers = re.fullmatch(r"(\d{1,9})(?:\.(\d{1,9}))?", named)
    version = (int(numbers[1]), int(numbers[2] or 0)) if numbers else (0, 0)
    if version[0] != 2 and version not in ((4, 0), (4, 1)):
        raise MeshError(f"version {named} of .msh is not supported; supported: 1, 2 to 2.2, 4 and 4.1")
    if version == (4, 0) and file_type == "1":
        raise MeshError(f"version {named} of .msh is supported as text only, this file is binary")
    if file_type not in ("0", "1") or size not in ("4", "8"):
        raise MeshError(
            f"$MeshFormat: file type {file_type} is not 0 or 1, or data size {size} is not 4 or 8: is the file damaged?"
        )
    source: _Source
    if file_type == "0":
        source = _Text(data[header.end() :], data.count(b"\n", 0, header.end()))
    else:
        one = data[header.end() : header.end() + 4]
        if one not in (b"\1\0\0\0", b"\0\0\0\1"):
            raise MeshError(
                "$MeshFormat: the binary 1 that gives the byte order is missing: was the file transferred as text? "
                "Transfer it as binary, or save it as text (Mesh.Binary = 0)"
            )
        source = _Binary(data, header.end() + 4, "<" if one[0] else ">", int(size))
    source.end_section()
    return version, source


# --- the sections ---------------------------------------------------------------------------------

# The dimension of a physical group if the file gives none.
_ANY = -1


def _physical_names(source: _Source) -> dict[_Tag, str]:
    names = {}
    for _ in range(source.count()):
        line = source.line()
        found = re.fullmatch(rb'(?:(\d)\s+)?(\d{1,18})\s+"(.*)"', line)  # version 2.0 gives no dimension
        if found is None:
            source.refuse(f"a physical group must have dimension, number and \"name\", not '{word(line)}'")
        dim = _ANY if found[1] is None else int(found[1])
        names[dim, int(found[2])] = found[3].decode("utf-8", errors="replace")
    return names


def _entities(source: _Source, version: _Version) -> dict[_Tag, list[int]]:
    """Return the physical groups of each entity; the sign of a number is an orientation and is dropped."""
    physicals = {}
    for dim, count in enumerate(source.counts(0, 4)):
        for _ in range(count):
            number, _, groups = source.entity(dim, version, is_part=False)
            physicals[dim, number] = [abs(group) for group in groups]
    return physicals


def _partitioned(source: _Source, version: _Version, whole: dict[_Tag, list[int]]) -> dict[_Tag, list[int]]:
    """Return the physical groups of each partition of an entity; those of the parent entity if it has none."""
    source.counts(0, 1)  # of partitions
    for _ in range(source.counts(0, 1)[0]):
        source.counts(2, 0)  # of ghosts: number and partition
    physicals = {}
    for dim, count in enumerate(source.counts(0, 4)):
        for _ in range(count):
            number, parent, groups = source.entity(dim, version, is_part=True)
            if parent and parent[0] == dim:  # else an interface between partitions, which has the names of its parent
                physicals[dim, number] = [abs(group) for group in groups] or whole.get(parent, [])
    return physicals


def _nodes_4(source: _Source, version: _Version) -> _Nodes:
    n_blocks, n_nodes, *_ = source.counts(0, 2 if version == (4, 0) else 4)
    blocks: list[_Nodes] = [(np.zeros(0, np.int64), np.zeros((0, 3)), None)]
    for _ in range(n_blocks):
        one, other, parametric, count = source.counts(3, 1)
        dim = other if version == (4, 0) else one
        if dim not in range(4):
            source.refuse(f"$Nodes: an entity of dimension {dim}")
        n_parameters = dim if parametric else 0  # on the entity, after the coordinates
        if version == (4, 0):  # each node is preceded by its number
            table, lines = source.reals(count, 4 + n_parameters)
            numbers, table = table[:, 0].astype(np.int64), table[:, 1:]
        else:
            numbers = source.integers(count, 1)[0][:, 0]
            table, lines = source.reals(count, 3 + n_parameters)
        blocks.append((numbers, table[:, :3], lines))
    numbers, points = np.concatenate([block[0] for block in blocks]), np.concatenate([block[1] for block in blocks])
    source.check_total(len(points), n_nodes)
    at = [block[2] for block in blocks if block[2] is not None]
    return numbers, points, np.concatenate(at) if at else None


def _elements_4(source: _Source, version: _Version, physicals: dict[_Tag, list[int]]) -> _Elements:
    n_blocks, n_elements, *_ = source.counts(0, 2 if version == (4, 0) else 4)
    cells: list[Cells] = []
    groups: dict[_Tag, list[Ints]] = {}
    for _ in range(n_blocks):
        one, other, type_, count = source.counts(3, 1)
        entity = (other, one) if version == (4, 0) else (one, other)
        kind, n_nodes = source.known(type_)
        table, lines = source.integers(count, 1 + n_nodes)
        cells.append(Cells(kind, _in_vtk_order(table[:, 1:], kind), table[:, 0], lines))
        for group in physicals.get(entity, []):
            groups.setdefault((entity[0], group), []).append(table[:, 0])
    source.check_total(sum(len(block.nodes) for block in cells), n_elements)
    return cells, groups


def _elements_2(source: _Source) -> _Elements:
    """Return each cell once: version 2 repeats it, with a new number, for each of its physical groups."""
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
        else:  # a cell is twice in one group: Mesh raises an error
            once = np.arange(len(table))
        cells.append(
            Cells(kind, _in_vtk_order(nodes[once], kind), numbers[once], None if lines is None else lines[once])
        )
        for number in np.unique(group[group > 0]).tolist():
            groups.setdefault((CELL_KINDS[kind][0], number), []).append(numbers[group == number])
    return cells, groups


def _in_vtk_order(nodes: Ints, kind: str) -> Ints:
    return nodes[:, _TEN] if kind == "tetrahedron" and nodes.shape[1] == len(_TEN) else nodes
