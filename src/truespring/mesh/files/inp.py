"""Abaqus and CalculiX .inp files: the mesh and its sets; materials, steps and the rest are passed over.

Source: the keywords *NODE, *ELEMENT, *NSET and *ELSET in the manual of CalculiX CrunchiX, https://www.dhondt.de
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.files.contents import Cells, Contents, listed, places
from truespring.mesh.files.text import integers, reals, refuse_ragged, word

# By family and number of nodes. The letters behind (reduced integration, hybrid, ...) do not change the geometry.
_PLANE = {3: "triangle", 6: "triangle", 4: "quadrilateral", 8: "quadrilateral", 9: "quadrilateral"}
_SOLID = {
    **{4: "tetrahedron", 10: "tetrahedron", 8: "hexahedron", 20: "hexahedron", 27: "hexahedron"},
    **{6: "wedge", 15: "wedge", 5: "pyramid", 13: "pyramid"},
}
_LINE = {2: "line", 3: "line"}
_SPRING = "SPRINGA"  # of two nodes, the one type of CalculiX whose name does not tell how many
_FAMILIES = {"C3D": _SOLID, "CPS": _PLANE, "CPE": _PLANE, "S": _PLANE, "M3D": _PLANE, "T2D": _LINE, "T3D": _LINE}

# What makes or moves nodes and elements in a way that is not followed here.
_UNREAD = {"INCLUDE", "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM"}


def read_inp(data: bytes) -> Contents:
    """Read a .inp file; raise MeshError where it is damaged or makes its mesh in a way that is not read."""
    if b"\0" in data:
        raise MeshError("this is no .inp file: it is binary, not text")
    deck = _Deck()
    for card in _cards(data):
        deck.add(card)
    return deck.contents()


@dataclass
class _Card:
    """A keyword without blanks, its parameters, and the lines of data below it as fields."""

    line: int
    keyword: str
    parameters: dict[str, str]
    rows: list[list[bytes]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)

    def error(self, why: str, line: int | None = None) -> MeshError:
        return MeshError(f"line {line or self.line}: *{self.keyword}: {why}")


def _cards(data: bytes) -> Iterator[_Card]:
    """Yield the cards of a deck; raise MeshError where it ends within a line or a step."""
    card: _Card | None = None
    head = b""
    in_step = False
    for number, line in enumerate(data.splitlines(), 1):
        text = line.strip()
        if not text or text.startswith(b"**"):
            continue
        if text.startswith(b"*") or head:
            head += text
            if text.endswith(b","):  # the keyword line goes on
                continue
            if card:
                yield card
            card = _head(head, number)
            head = b""
            in_step = card.keyword == "STEP" or (in_step and card.keyword != "ENDSTEP")
        elif card is None:
            raise MeshError(
                f"line {number}: this is no .inp file: a keyword such as *NODE is wanted, not '{word(text)}'"
            )
        else:
            fields = text.split(b",")
            while fields and not fields[-1].strip():
                fields.pop()
            if fields:
                card.rows.append(fields)
                card.lines.append(number)
    if card is None:
        raise MeshError("there is no keyword such as *NODE")
    if head:
        raise MeshError("the last keyword line ends with a comma: the file is cut off")
    yield card
    if in_step:
        raise MeshError("a *STEP has no *END STEP: the file is cut off")
    if not data.endswith((b"\n", b"\r")) and not card.keyword.startswith("END"):
        raise MeshError("the last line has no line end: is the file cut off? If it is whole, add one")


def _head(text: bytes, line: int) -> _Card:
    keyword, *parameters = text.decode("utf-8", errors="replace").split(",")
    pairs = [parameter.partition("=") for parameter in parameters if parameter.strip()]
    for name, _, _ in pairs:
        if not name.strip()[:1].isalpha():  # a comma at the end of the keyword line lets it go on in the next one
            raise MeshError(f"line {line}: '{name.strip()[:40]}' is no parameter of {keyword.strip()[:40]}")
    return _Card(
        line,
        re.sub(r"\s", "", keyword).upper().lstrip("*"),
        {name.strip().upper(): value.strip().strip("\"'") for name, _, value in pairs},
    )


@dataclass(frozen=True)
class _Members:
    """Numbers that a set lists, and their lines."""

    numbers: Ints
    lines: Ints

    def among(self, known: Ints, name: str) -> Ints:
        """Return the numbers; raise MeshError where one is not known."""
        lost = places(known, self.numbers) < 0
        if lost.any():
            raise MeshError(
                f"line {self.lines[lost.argmax()]}: set '{name}' names number {self.numbers[lost.argmax()]}, "
                "which is not in the file"
            )
        return self.numbers


@dataclass(frozen=True)
class _Range:
    """What GENERATE gives: those of first, first + step, ... last that exist."""

    first: int
    last: int
    step: int
    line: int

    def among(self, known: Ints, name: str) -> Ints:
        """Return the known numbers of the range; raise MeshError where there is none."""
        inside: Ints = known[(known >= self.first) & (known <= self.last) & ((known - self.first) % self.step == 0)]
        if not inside.size:
            raise MeshError(
                f"line {self.line}: set '{name}' names {self.first} to {self.last}, none of which is in the file"
            )
        return inside


_Sets = dict[str, list[_Members | _Range]]


class _Deck:
    """Gathers nodes, elements and sets, whatever the order of the cards."""

    def __init__(self) -> None:
        self._nodes: list[tuple[Ints, Floats, Ints]] = []
        self._cells: list[Cells] = []
        self._sets: dict[str, _Sets] = {"NSET": {}, "ELSET": {}}  # by name in capitals
        self._names: dict[str, str] = {}  # the first spelling
        self._parts: dict[str, int] = {"PART": 0, "INSTANCE": 0}
        self._notes: list[str] = []

    def add(self, card: _Card) -> None:
        """Take what a card says of the mesh."""
        if card.keyword in _UNREAD or (card.keyword in ("NODE", "ELEMENT") and "INPUT" in card.parameters):
            what = f" ({card.parameters['INPUT']})" if card.parameters.get("INPUT") else ""
            raise card.error(f"this is not followed{what}: write nodes and elements out, in one file")
        match card.keyword:
            case "NODE":
                self._add_nodes(card)
            case "ELEMENT":
                self._add_elements(card)
            case "NSET" | "ELSET":
                self._add_set(card)
            case "PART" | "INSTANCE":
                self._parts[card.keyword] += 1
                if self._parts[card.keyword] > 1 or card.rows:
                    raise card.error("several parts, or one that is moved, are not supported: write the deck flat")

    def _add_nodes(self, card: _Card) -> None:
        if card.parameters.get("SYSTEM", "R").upper() != "R":
            raise card.error("coordinates that are not rectangular are not supported")
        rows = [row[:4] for row in self._rows(card)]  # behind the coordinates may stand a normal
        width = max(len(row) for row in rows)
        short = [(line, row[0]) for row, line in zip(rows, card.lines, strict=True) if len(row) < width]
        if short:
            self._notes.append(
                f"{len(short)} of {len(rows)} nodes have fewer coordinates than others of their *NODE, the first is "
                f"node {word(short[0][1])} in line {short[0][0]}: what is missing was taken as 0"
            )
        rows = [[*row, *[b"0"] * (4 - len(row))] for row in rows]
        numbers = integers([row[:1] for row in rows], card.lines, "the number of a node")
        points = reals([[at if at.strip() else b"0" for at in row[1:]] for row in rows], card.lines, "a coordinate")
        self._nodes.append((numbers, points.reshape(-1, 3), np.array(card.lines)))
        self._extend("NSET", card, [_Members(numbers, np.array(card.lines))])

    def _add_elements(self, card: _Card) -> None:
        type_ = card.parameters.get("TYPE", "").upper()
        found = re.fullmatch(rf"({'|'.join(_FAMILIES)})(\d+)(?:[A-Z].*)?", type_)
        n_nodes = 2 if type_ == _SPRING else int(found[2]) if found else 0
        kind = "line" if type_ == _SPRING else _FAMILIES[found[1]].get(n_nodes) if found else None
        if kind is None:
            raise card.error(
                f"TYPE={type_} ({len(card.rows)} lines) is not read; C3D4, C3D8, C3D10, C3D20, CPS3, CPS4, CPE3, "
                "CPE4, S3, S4, T3D2, SPRINGA and their variants are"
            )
        width = 1 + n_nodes
        rows: list[list[bytes]] = []
        lines: list[int] = []
        for row, line in zip(self._rows(card), card.lines, strict=True):
            if rows and len(rows[-1]) < width:  # the element goes on in this line
                rows[-1] = rows[-1] + row
            else:
                rows.append(row)
                lines.append(line)
        refuse_ragged(rows, lines, width, f"an element of {type_}")
        table = integers(rows, lines, "an element").reshape(-1, width)
        self._cells.append(Cells(kind, table[:, 1:], table[:, 0], np.array(lines)))
        self._extend("ELSET", card, [_Members(table[:, 0], np.array(lines))])

    def _add_set(self, card: _Card) -> None:
        kind = card.keyword
        if not card.parameters.get(kind) or (kind == "NSET" and "ELSET" in card.parameters):
            raise card.error(f"{kind}=NAME and numbers are wanted")
        rows = self._rows(card)
        if "GENERATE" in card.parameters:
            self._extend(kind, card, [self._range(card, row, line) for row, line in zip(rows, card.lines, strict=True)])
            return
        members: list[_Members | _Range] = []
        for row, line in zip(rows, card.lines, strict=True):
            entries = [entry for entry in row if entry.strip()]
            others = [entry for entry in entries if not re.fullmatch(rb"\s*[+-]?\d+\s*", entry)]
            numbers = integers([[entry for entry in entries if entry not in others]], [line], "a set")
            members.append(_Members(numbers, np.full(len(numbers), line)))
            for other in others:
                known = self._sets[kind].get(word(other).strip("\"'").upper())
                if known is None:
                    raise card.error(f"'{word(other)}' is neither a number nor a set that was defined above", line)
                members.extend(known)
        self._extend(kind, card, members)

    def _range(self, card: _Card, row: Sequence[bytes], line: int) -> _Range:
        values = [*integers([row], [line], "GENERATE").tolist(), 1]
        if len(values) not in (3, 4) or values[1] < values[0] or values[2] < 1:
            raise card.error("GENERATE takes a first number, a last number and a step", line)
        return _Range(values[0], values[1], values[2], line)

    def _rows(self, card: _Card) -> list[list[bytes]]:
        if not card.rows:
            raise card.error("there are no lines of data below: is the file cut off?")
        return card.rows

    def _extend(self, kind: str, card: _Card, members: Sequence[_Members | _Range]) -> None:
        name = card.parameters.get(kind)
        if name:
            self._names.setdefault(name.upper(), name)
            self._sets[kind].setdefault(name.upper(), []).extend(members)

    def contents(self) -> Contents:
        """Return what the deck holds; raise MeshError where a set names what does not exist."""
        if not self._nodes or not self._cells:
            raise MeshError(f"there is no {'*ELEMENT' if self._nodes else '*NODE'}")
        numbers, points, lines = (np.concatenate(column) for column in zip(*self._nodes, strict=True))
        dim = max(cells.dim for cells in self._cells)
        lower = Counter[str]()
        for cells in self._cells:
            if cells.dim < dim:
                lower[cells.kind] += len(cells.nodes)
        if lower:
            self._notes.append(f"{listed(lower)} are not of the body and only carry sets")
        return Contents(
            node_numbers=numbers,
            points=points,
            cells=self._cells,
            node_groups=self._groups("NSET", numbers),
            cell_groups=self._groups("ELSET", np.concatenate([cells.numbers for cells in self._cells])),
            node_lines=lines,
            notes=tuple(self._notes),
        )

    def _groups(self, kind: str, known: Ints) -> dict[str, Ints]:
        return {
            self._names[key]: np.concatenate([some.among(known, self._names[key]) for some in members])
            for key, members in self._sets[kind].items()
        }
