"""Scopes of a deck (a part, an instance, the assembly or a flat deck): nodes, elements, sets and surfaces.

Numbers and names are local to a scope: node 1 of a part and node 1 of the assembly differ, and so do two sets of the
same name. Members of sets are resolved after the whole deck is read (`inp_assembly`).
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.files.inp_cards import Card, bare, decoded, fields
from truespring.mesh.files.inp_elements import READ, ElementType, dimension, element_type, is_of_a_body

_WHOLE = re.compile(rb"\s*[+-]?\d+\s*")


class Nodes(NamedTuple):
    """Nodes of one card: numbers and places of shape (n,), points of shape (n, 3)."""

    numbers: Ints
    points: Floats
    places: Ints

    def of(self, which: Bools) -> "Nodes":
        """Return the nodes selected by a mask of shape (n,)."""
        return Nodes(self.numbers[which], self.points[which], self.places[which])


def joined_nodes(nodes: Sequence[Nodes]) -> Nodes:
    """Return the nodes of several cards as those of one."""
    none = Nodes(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros(0, dtype=np.int64))
    every = [none, *nodes]
    return Nodes(
        np.concatenate([one.numbers for one in every]),
        np.concatenate([one.points for one in every]),
        np.concatenate([one.places for one in every]),
    )


class Elements(NamedTuple):
    """Elements of one card: numbers and places of shape (n,), nodes of shape (n, nodes of the type), corners first."""

    type: str
    kind: str
    numbers: Ints
    nodes: Ints
    places: Ints


class Numbers(NamedTuple):
    """Numbers listed in a set, and their place."""

    numbers: Ints
    places: Ints


class Range(NamedTuple):
    """Members by GENERATE: those of first, first + step, ... last that exist."""

    first: int
    last: int
    step: int
    place: int

    def has(self, numbers: Ints) -> Bools:
        """Return which numbers are in the range, shape of `numbers`."""
        inside = (numbers >= self.first) & (numbers <= self.last)
        return np.asarray(inside & ((numbers - self.first) % self.step == 0))


class Named(NamedTuple):
    """A member given by name: a set, or a set, node or element of an instance ("Part-1-1.5")."""

    name: str
    kind: str
    place: int


class Part(NamedTuple):
    """Members that a card adds to a set, the INSTANCE of the card ("" for the scope of the card), and their place."""

    instance: str
    members: tuple[Numbers | Range | Named, ...]
    place: int


class SurfaceRow(NamedTuple):
    """A data line of *SURFACE: elements or nodes, the face label ("" if omitted), and the place."""

    on: Named
    label: str
    place: int


@dataclass
class Surface:
    """A surface of faces (TYPE=ELEMENT) or of nodes; `unread` is the reason if it is not supported."""

    of_nodes: bool
    rows: list[SurfaceRow] = field(default_factory=list)
    unread: str = ""


@dataclass
class Scope:
    """A part, an instance, the assembly or a flat deck.

    Attributes:
        name: of the part or instance, "" for the assembly or a flat deck.
        nodes, elements: one entry per card.
        left_out: numbers of elements that form no body, by type.
        sets: by kind, NSET or ELSET, then by key.
        surfaces: by key.
        names: the first spelling of each key.
        internal: keys of sets that a program generated for its surfaces.
        notes: remarks for the user.
    """

    name: str
    nodes: list[Nodes] = field(default_factory=list)
    elements: list[Elements] = field(default_factory=list)
    left_out: dict[str, list[Ints]] = field(default_factory=dict)
    sets: dict[str, dict[str, list[Part]]] = field(default_factory=lambda: {"NSET": {}, "ELSET": {}})
    surfaces: dict[str, Surface] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    internal: set[str] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)

    def instance(self, name: str) -> "Scope":
        """Return a copy of the scope under the name of an instance; additions do not change the part."""
        sets = {kind: {key: list(parts) for key, parts in ones.items()} for kind, ones in self.sets.items()}
        left_out = {type_: list(numbers) for type_, numbers in self.left_out.items()}
        return Scope(
            *(name, list(self.nodes), list(self.elements), left_out, sets),
            {key: Surface(one.of_nodes, list(one.rows), one.unread) for key, one in self.surfaces.items()},
            *(dict(self.names), set(self.internal)),
        )

    def add(self, card: Card) -> None:
        """Add the mesh data of a card; raise MeshError if it cannot be read."""
        match card.keyword:
            case "NODE":
                self._add_nodes(card)
            case "ELEMENT":
                self._add_elements(card)
            case "NSET" | "ELSET":
                self._add_set(card)
            case "SURFACE":
                self._add_surface(card)

    def _add_nodes(self, card: Card) -> None:
        if card.parameters.get("SYSTEM", "R").upper() != "R":
            raise card.error("only rectangular coordinates are supported: write x, y, z")
        split = [(fields(row)[:4], place) for row, place in zip(_rows(card), card.places, strict=True)]
        split = [one for one in split if one[0]]  # a normal may follow the coordinates
        rows, places = [row for row, _ in split], [place for _, place in split]
        width = max(map(len, rows), default=0)
        short = [(place, row) for row, place in split if len(row) < width]
        for place, row in short[-1:]:
            if place in card.deck.open_ends:
                raise card.error(
                    f"{len(row) - 1} coordinates in the last line, which has no line end: it is truncated", place
                )
        if short:
            self.notes.append(
                f"{len(short)} of {len(rows)} nodes have fewer coordinates than others of their *NODE, the first is "
                f"node {word_of(short[0][1])} in {card.deck.at(short[0][0])}: missing coordinates are 0"
            )
        numbers = card.integers([row[:1] for row in rows], places, "the number of a node")
        at = [[*(one if one.strip() else b"0" for one in row[1:]), *[b"0"] * (4 - len(row))] for row in rows]
        points = card.reals(at, places, "a coordinate").reshape(-1, 3)
        self.nodes.append(Nodes(numbers, points, np.array(places, dtype=np.int64)))
        self._extend("NSET", card, Part("", (Numbers(numbers, np.array(places, dtype=np.int64)),), card.place))

    def _add_elements(self, card: Card) -> None:
        name = card.parameters.get("TYPE", "").strip().upper()
        type_ = element_type(name)
        if type_:
            _rows(card)
        if type_ is None and is_of_a_body(name):
            what = ", axisymmetric," if "AX" in name else ""
            raise card.error(f"TYPE={name[:40]} ({len(card.rows)} lines){what} is not supported; supported: {READ}")
        if type_ is None or dimension(type_.kind) == 1:
            numbers = self._add_lines(card, name, type_)
        else:
            table, places = _whole_elements(card, name, type_.n_nodes)
            numbers = table[:, 0]
            self.elements.append(Elements(name, type_.kind, numbers, table[:, 1:], places))
        self._extend("ELSET", card, Part("", (Numbers(numbers, np.full(len(numbers), card.place)),), card.place))

    def _add_lines(self, card: Card, name: str, type_: ElementType | None) -> Ints:
        """Add line elements, which may define sets, and count other types; return the numbers of all."""
        rows = _joined(card, type_.n_nodes + 1 if type_ else 0)
        known = [] if type_ is None else [row[: type_.n_nodes + 1] for row in rows]  # an orientation may follow
        if type_ is None or not all(len(row) == type_.n_nodes + 1 and all(map(_WHOLE.fullmatch, row)) for row in known):
            firsts = [int(row[0]) for row in rows if row and _WHOLE.fullmatch(row[0]) and len(row[0]) < 19]
            self.left_out.setdefault(name or "no type", []).append(np.array(firsts, dtype=np.int64))
            return np.array(firsts, dtype=np.int64)
        places = [card.place] * len(rows)
        table = card.integers(known, places, f"an element of {name}").reshape(-1, type_.n_nodes + 1)
        nodes = (
            table[:, (1, 3, 2)] if type_.n_nodes == 3 else table[:, 1:]
        )  # the middle node is listed between the ends
        self.elements.append(Elements(name, type_.kind, table[:, 0], nodes, np.array(places, dtype=np.int64)))
        return np.asarray(table[:, 0])

    def _add_set(self, card: Card) -> None:
        kind, parameters = card.keyword, card.parameters
        if not bare(parameters.get(kind, "")):
            raise card.error(f"expected {kind}=NAME")
        instance = parameters.get("INSTANCE", "")
        members: list[Numbers | Range | Named] = []
        if kind == "NSET" and "ELSET" in parameters:
            members.append(Named(parameters["ELSET"], "ELSET", card.place))
        if "GENERATE" in parameters:
            members += [_range(card, row, place) for row, place in zip(card.rows, card.places, strict=True)]
        else:
            members += _listed(card, kind)
        if "INTERNAL" in parameters:
            self.internal.add(key_of(parameters[kind]))
        self._extend(kind, card, Part(instance, tuple(members), card.place))

    def _extend(self, kind: str, card: Card, part: Part) -> None:
        name = card.parameters.get(kind, "")
        if bare(name):
            key = key_of(name)
            self.names.setdefault(key, bare(name))
            self.sets[kind].setdefault(key, []).append(part)

    def _add_surface(self, card: Card) -> None:
        parameters = card.parameters
        name = parameters.get("NAME", "")
        if not bare(name):
            return
        type_ = parameters.get("TYPE", "ELEMENT").upper()
        self.names.setdefault(key_of(name), bare(name))
        surface = self.surfaces.setdefault(key_of(name), Surface(type_ == "NODE"))
        if type_ not in ("NODE", "ELEMENT"):
            surface.unread = f"TYPE={type_[:40]} is not supported"
        elif "COMBINE" in parameters or "CROP" in parameters:
            surface.unread = "surfaces combined from others are not supported"
        kind = "NSET" if surface.of_nodes else "ELSET"
        for row, place in zip(card.rows, card.places, strict=True):
            on, *labels = [decoded(one).strip() for one in fields(row)] or [""]
            surface.rows.append(SurfaceRow(Named(on, kind, place), labels[0].upper() if labels else "", place))


def key_of(name: str) -> str:
    """Return the key of a name: in upper case, or, if it is quoted, without the quotation marks."""
    name = name.strip()
    return bare(name) if name[:1] in ("'", '"') else name.upper()


def found(table: Mapping[str, object], name: str) -> str | None:
    """Return the key of a name in a table; also a single one that differs only in case; else None."""
    key = key_of(name)
    if key in table:
        return key
    alike = [one for one in table if one.upper() == key.upper()]
    return alike[0] if len(alike) == 1 else None


def counted(left_out: Mapping[str, int]) -> str:
    """Return a text of element types with their counts."""
    return ", ".join(f"{count} {name}" for name, count in sorted(left_out.items()))


def word_of(row: list[bytes]) -> str:
    """Return the number at the beginning of a row."""
    return row[0].decode("ascii", errors="replace").strip()[:20] if row else ""


def _rows(card: Card) -> list[bytes]:
    if not card.rows:
        raise card.error("there are no lines of data below: is the file truncated?")
    return card.rows


def _joined(card: Card, width: int) -> list[list[bytes]]:
    """Join the rows of elements with their continuation lines: up to `width` fields; a blank field is 0."""
    rows: list[list[bytes]] = []
    goes_on = False
    for text in card.rows:
        if rows and (len(rows[-1]) < width or (goes_on and not width)):
            rows[-1] = rows[-1] + fields(text)
        else:
            rows.append(fields(text))
        goes_on = text.endswith(b",")
    return rows


def _whole_elements(card: Card, name: str, n_nodes: int) -> tuple[Ints, Ints]:
    """Return number and nodes of each element, shape (n, 1 + n_nodes), and their places."""
    rows: list[list[bytes]] = []
    places: list[int] = []
    width = 1 + n_nodes
    for text, place in zip(card.rows, card.places, strict=True):
        row = fields(text)
        if rows and len(rows[-1]) < width:  # this line continues the element
            rows[-1] = rows[-1] + row
        elif row:
            rows.append(row)
            places.append(place)
    for row, place in zip(rows, places, strict=True):
        if len(row) != width:
            why = f"an element of {name} needs {width} numbers, found {len(row)}"
            raise MeshError(f"{card.deck.at(place)}: {why}")
    return card.integers(rows, places, "an element").reshape(-1, width), np.array(places, dtype=np.int64)


def _range(card: Card, row: bytes, place: int) -> Range:
    values = [*card.integers([fields(row)], [place], "GENERATE").tolist(), 1]
    if len(values) not in (3, 4) or values[1] < values[0] or values[2] < 1:
        raise card.error("GENERATE needs a first number, a last number and a step", place)
    return Range(values[0], values[1], values[2], place)


def _listed(card: Card, kind: str) -> list[Numbers | Range | Named]:
    """Return the members listed in the data lines of a set: numbers, and names of other sets."""
    numbers: list[list[bytes]] = []
    members: list[Numbers | Range | Named] = []
    for row, place in zip(card.rows, card.places, strict=True):
        entries = [entry for entry in fields(row) if entry.strip()]
        whole = [entry for entry in entries if _WHOLE.fullmatch(entry)]
        numbers.append(whole)
        members += [Named(decoded(entry).strip(), kind, place) for entry in entries if entry not in whole]
    places = np.repeat(np.array(card.places, dtype=np.int64), [len(row) for row in numbers])
    return [Numbers(card.integers(numbers, card.places, "a set"), places), *members]


def totals(scopes: list[Scope]) -> Counter[str]:
    """Return the number of elements left out, by type."""
    counts = Counter[str]()
    for scope in scopes:
        for type_, numbers in scope.left_out.items():
            counts[type_] += sum(map(len, numbers))
    return +counts
