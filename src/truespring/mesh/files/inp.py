"""Read the mesh, sets and surfaces of Abaqus and CalculiX .inp files; materials, steps and the rest are skipped.

Source: the keywords *NODE, *ELEMENT, *NSET, *ELSET and *SURFACE in the manual of CalculiX CrunchiX,
https://www.dhondt.de, and *PART, *INSTANCE and *ASSEMBLY in that of Abaqus.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from truespring.arrays import Ints
from truespring.errors import MeshError, nearest
from truespring.mesh.files.contents import Cells, Contents, listed
from truespring.mesh.files.inp_assembly import Assembly, Placed
from truespring.mesh.files.inp_cards import Card, Lines, bare, cards
from truespring.mesh.files.inp_elements import READ, dimension
from truespring.mesh.files.inp_move import Move, read_move
from truespring.mesh.files.inp_scopes import Scope, counted, found, key_of, totals
from truespring.mesh.files.inp_surfaces import Surfaces

# Keywords that generate or transform nodes and elements, which are not supported.
_UNREAD = {"NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM"}
# Keywords of contact between bodies.
_BETWEEN = {"CONTACT", "CONTACTPAIR", "TIE", "GAP"}
_FLAT = "write nodes and elements out, as *NODE and *ELEMENT (Abaqus/CAE does: import the model, write a job's input)"


def read_inp(data: bytes, folder: Path | None = None) -> Contents:
    """Read a .inp file; raise MeshError if it is damaged or generates its mesh by an unsupported keyword.

    Args:
        data: the bytes of the file.
        folder: the folder of the file; included files must lie in it or below.
    """
    if b"\0" in data:
        raise MeshError("this is no .inp file: it is binary, not text")
    lines = Lines(data, folder)
    deck = _Deck()
    for card in cards(lines):
        deck.add(card)
    return deck.contents(lines)


class _Deck:
    """Collects the cards of a deck in their scopes: parts, instances, the assembly."""

    def __init__(self) -> None:
        self._root = Scope("")
        self._parts: dict[str, Scope] = {}
        self._instances: dict[str, tuple[Scope, Move | None]] = {}
        self._used: set[str] = set()  # keys of parts with an instance
        self._here = self._root
        self._is_apart = False

    def add(self, card: Card) -> None:
        """Add the mesh data of a card to its scope; raise MeshError if the keyword is not supported."""
        if card.keyword in _UNREAD:
            raise card.error(f"this keyword is not supported: {_FLAT}")
        self._is_apart = self._is_apart or card.keyword in _BETWEEN
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
            raise card.error(f"NAME={bare(name)[:40]}: expected a unique name")
        known[key_of(name)] = make(bare(name))
        return known[key_of(name)]

    def _begin_instance(self, card: Card) -> Scope:
        if "LIBRARY" in card.parameters:
            raise card.error(f"an instance of another analysis is not supported: {_FLAT}")
        scopes = {key: scope for key, (scope, _) in self._instances.items()}
        scope = self._begin(card, scopes, self._part(card).instance)
        self._instances[key_of(card.parameters["NAME"])] = scope, read_move(card)
        return scope

    def _part(self, card: Card) -> Scope:
        name = card.parameters.get("PART", "")
        if not bare(name):
            return Scope("")  # the instance itself holds the mesh
        key = found(self._parts, name)
        if key is None:
            known = [scope.name for scope in self._parts.values()]
            there = f"{nearest(bare(name), known)}; there are {', '.join(known) or 'none'}"
            raise card.error(f"there is no part '{bare(name)[:40]}'{there}")
        self._used.add(key)
        return self._parts[key]

    def contents(self, lines: Lines) -> Contents:
        """Return the contents of the deck; raise MeshError if a set names an unknown instance or set."""
        explicit = bool(self._instances)
        instances = list(self._instances.values()) or [(part, None) for part in self._parts.values()]
        assembly = Assembly(lines, self._root, instances, explicit)
        scopes = [one.scope for one in assembly.placed.values()]
        left_out = totals(scopes)
        if not assembly.nodes.numbers.size or not assembly.cells:
            raise MeshError(_no_body(assembly, left_out))
        groups = _Groups(assembly)
        notes = [note for scope in scopes for note in scope.notes]
        if left_out:
            notes.append(f"elements that the body does not need are left out: {counted(left_out)}")
        unused = [part.name for key, part in self._parts.items() if key not in self._used]
        if explicit and unused:
            notes.append(f"parts without an instance are left out: {', '.join(unused)}")
        return Contents(
            node_numbers=assembly.nodes.numbers,
            points=assembly.nodes.points,
            cells=[Cells(block.kind, block.nodes, block.numbers) for block in assembly.cells],
            node_groups=groups.nodes,
            cell_groups=groups.cells,
            facet_groups=groups.facets,
            is_apart=self._is_apart or len(instances) > 1,
            notes=(*lines.notes, *notes, *_lower(assembly), *assembly.notes, *assembly.lost(), *groups.notes),
        )


def _no_body(assembly: Assembly, left_out: Mapping[str, int]) -> str:
    if not assembly.nodes.numbers.size and not left_out:
        return "there is no *NODE: is the deck complete, and does it include the file of its mesh?"
    what = f": {counted(left_out)} {'makes' if sum(left_out.values()) == 1 else 'make'} none" if left_out else ""
    return f"there is no *ELEMENT of a body{what}; a body consists of {READ}"


def _lower(assembly: Assembly) -> Iterator[str]:
    dim = max(dimension(block.kind) for block in assembly.cells)
    lower = Counter[str]()
    for block in assembly.cells:
        if dimension(block.kind) < dim:
            lower[block.kind] += len(block.numbers)
    if lower:
        verbs = ("are", "carry") if lower.total() > 1 else ("is", "carries")
        yield f"{listed(lower)} {verbs[0]} not part of the body and only {verbs[1]} sets"


class _Groups:
    """The sets and surfaces of a deck by the names of groups.

    Those of the assembly, or of a flat deck, keep their name. Those of an instance become INSTANCE.NAME, and also NAME
    if no other scope uses that name.
    """

    def __init__(self, assembly: Assembly) -> None:
        self._assembly = assembly
        self._surfaces = Surfaces(assembly)
        self.nodes: dict[str, Ints] = {}
        self.cells: dict[str, Ints] = {}
        self.facets: dict[str, Ints] = {}
        self.notes: list[str] = []
        scopes = sorted(assembly.placed.values(), key=lambda one: one.scope.name != "")
        owners = Counter(key.upper() for one in scopes for key in one.scope.names)
        hidden: list[str] = []
        for one in scopes:
            for key, name in one.scope.names.items():
                names = [name]
                if one.scope.name:
                    names.insert(0, f"{one.scope.name}.{name}")
                    if owners[key.upper()] > 1:
                        hidden.append(names[0])
                        names.pop()
                self._take(one, key, names)
        if hidden:
            self.notes.append(f"names used in several scopes are qualified by their instance: {', '.join(hidden)}")

    def _take(self, owner: Placed, key: str, names: list[str]) -> None:
        """Add the sets and the surface of a key as groups, under each of `names`."""
        scope = owner.scope
        surface = scope.surfaces.get(key)
        if surface and surface.of_nodes:
            members = [self._assembly.named(owner, row.on, "NSET") for row in surface.rows]
            self._put(self.nodes, names, np.concatenate([*members, np.zeros(0, dtype=np.int64)]))
        elif surface:
            self._put_facets(owner, key, names)
        if key in scope.sets["NSET"]:
            self._put(self.nodes, names, self._assembly.set_members(owner, "NSET", key))
        if key in scope.sets["ELSET"] and not (key in scope.internal and self._put_side(owner, key, names)):
            self._put(self.cells, names, self._assembly.set_members(owner, "ELSET", key))

    @staticmethod
    def _put(groups: dict[str, Ints], names: list[str], members: Ints) -> None:
        for name in names:
            groups[name] = members

    def _put_facets(self, owner: Placed, key: str, names: list[str]) -> None:
        try:
            self._put(self.facets, names, self._surfaces.facets(owner, owner.scope.surfaces[key]))
        except MeshError as error:
            self.notes.append(f"surface '{names[0]}' is left out: {error}")

    def _put_side(self, owner: Placed, key: str, names: list[str]) -> bool:
        """Add an internal element set as facets if a surface uses it with one face label; return whether it does."""
        rows = [
            row
            for surface in owner.scope.surfaces.values()
            for row in surface.rows
            if not surface.of_nodes and row.label and key_of(row.on.name) == key
        ]
        if len({row.label for row in rows}) != 1:
            return False
        try:
            self._put(self.facets, names, self._surfaces.row(owner, rows[0]))
        except MeshError:
            return False
        return True
