"""Abaqus and CalculiX .inp files: the mesh, its sets and its surfaces; materials, steps and the rest are passed over.

Source: the keywords *NODE, *ELEMENT, *NSET, *ELSET and *SURFACE in the manual of CalculiX CrunchiX,
https://www.dhondt.de, and *PART, *INSTANCE and *ASSEMBLY in that of Abaqus.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from truespring.arrays import Ints
from truespring.errors import MeshError, nearest
from truespring.mesh.files.contents import Cells, Contents, listed
from truespring.mesh.files.inp_assembly import Assembly, Move, Placed, read_move
from truespring.mesh.files.inp_cards import Card, Lines, bare, cards
from truespring.mesh.files.inp_elements import READ, dimension
from truespring.mesh.files.inp_scopes import Scope, counted, found, key_of, totals
from truespring.mesh.files.inp_surfaces import Surfaces

# What makes or moves nodes and elements in a way that is not followed here.
_UNREAD = {"NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM"}
_FLAT = "write the deck flat, with its nodes and elements as *NODE and *ELEMENT (in Abaqus/CAE: File, Export)"


def is_inp(data: bytes) -> bool:
    """Tell whether a file looks like a deck: its first line that is no comment is a keyword of one."""
    first = next((line.strip() for line in data[:10_000].splitlines() if line.strip()[:2] not in (b"", b"**")), b"")
    return first[:1] == b"*" and first[1:2].isalpha()


def read_inp(data: bytes, folder: Path | None = None) -> Contents:
    """Read a .inp file; raise MeshError where it is damaged or makes its mesh in a way that is not read.

    Args:
        data: the file.
        folder: where it lies: files that it includes are read there or below, and nowhere else.
    """
    if b"\0" in data:
        raise MeshError("this is no .inp file: it is binary, not text")
    lines = Lines(data, folder)
    deck = _Deck()
    for card in cards(lines):
        deck.add(card)
    return deck.contents(lines)


class _Deck:
    """Gives each card to the scope that it stands in."""

    def __init__(self) -> None:
        self._root = Scope("")
        self._parts: dict[str, Scope] = {}
        self._instances: dict[str, tuple[Scope, Move | None]] = {}
        self._here = self._root

    def add(self, card: Card) -> None:
        """Take what a card says of the mesh."""
        if card.keyword in _UNREAD:
            raise card.error(f"this is not followed: {_FLAT}")
        match card.keyword:
            case "PART":
                self._here = self._begin(card, self._parts, Scope)
            case "INSTANCE":
                self._here = self._begin_instance(card)
            case "ENDPART" | "ASSEMBLY" | "ENDINSTANCE" | "ENDASSEMBLY":
                self._here = self._root
            case _:
                (self._root if "INSTANCE" in card.parameters else self._here).add(card)

    def _begin(self, card: Card, known: dict[str, Scope], make: Callable[[str], Scope]) -> Scope:
        name = card.parameters.get("NAME", "")
        if not bare(name) or key_of(name) in known:
            raise card.error(f"NAME={bare(name)[:40]}: a name of its own is wanted")
        known[key_of(name)] = make(bare(name))
        return known[key_of(name)]

    def _begin_instance(self, card: Card) -> Scope:
        if "LIBRARY" in card.parameters:
            raise card.error(f"an instance of another run is not read: {_FLAT}")
        scopes = {key: scope for key, (scope, _) in self._instances.items()}
        scope = self._begin(card, scopes, self._part(card).instance)
        self._instances[key_of(card.parameters["NAME"])] = scope, read_move(card)
        return scope

    def _part(self, card: Card) -> Scope:
        name = card.parameters.get("PART", "")
        if not bare(name):
            return Scope("")  # what the instance holds stands in itself
        key = found(self._parts, name)
        if key is None:
            known = [scope.name for scope in self._parts.values()]
            raise card.error(
                f"there is no part '{bare(name)[:40]}'{nearest(bare(name), known)}; there are {', '.join(known) or 'none'}"
            )
        return self._parts[key]

    def contents(self, lines: Lines) -> Contents:
        """Return what the deck holds; raise MeshError where a set names what does not exist."""
        explicit = bool(self._instances)
        instances = list(self._instances.values()) or [(part, None) for part in self._parts.values()]
        assembly = Assembly(lines, self._root, instances, explicit)
        scopes = [one.scope for one in assembly.placed.values()]
        left_out = totals(scopes)
        if not assembly.nodes.numbers.size or not assembly.cells:
            what = f": {counted(left_out)} are left out" if left_out else ""
            missing = "*ELEMENT" if assembly.nodes.numbers.size else "*NODE"
            raise MeshError(
                f"there is no {missing} of a body{what}; a body is made of {READ}"
                if left_out
                else f"there is no {missing}: {'a deck of a body has them' if missing == '*NODE' else _FLAT}"
            )
        groups = _Groups(assembly)
        notes = [note for scope in scopes for note in scope.notes]
        if left_out:
            notes.append(f"elements that the body does not need are left out: {counted(left_out)}")
        if explicit:
            notes += _unused(self._parts, self._instances)
        return Contents(
            node_numbers=assembly.nodes.numbers,
            points=assembly.nodes.points,
            cells=[Cells(block.kind, block.nodes, block.numbers) for block in assembly.cells],
            node_groups=groups.nodes,
            cell_groups=groups.cells,
            facet_groups=groups.facets,
            notes=(*lines.notes, *notes, *_lower(assembly), *assembly.notes, *assembly.lost(), *groups.notes),
        )


def _lower(assembly: Assembly) -> Iterator[str]:
    dim = max(dimension(block.kind) for block in assembly.cells)
    lower = Counter[str]()
    for block in assembly.cells:
        if dimension(block.kind) < dim:
            lower[block.kind] += len(block.numbers)
    if lower:
        yield f"{listed(lower)} are not of the body and only carry sets"
