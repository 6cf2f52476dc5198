"""Assemble a deck: place the instances, make the numbers unique, resolve sets and surfaces.

Source: "Assembly definition" in the manual of Abaqus.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from truespring.arrays import Bools, Ints
from truespring.errors import MeshError, nearest
from truespring.mesh.files.contents import places
from truespring.mesh.files.inp_cards import Lines, bare
from truespring.mesh.files.inp_elements import dimension
from truespring.mesh.files.inp_move import Move
from truespring.mesh.files.inp_scopes import (
    Elements,
    Named,
    Nodes,
    Numbers,
    Part,
    Range,
    Scope,
    found,
    joined_nodes,
    key_of,
)

#: Coordinates above this are taken as damaged, in any unit; their squares are finite.
_FAR = 1e30


class Placed(NamedTuple):
    """A scope with its nodes placed in the assembly.

    Attributes:
        scope: the scope.
        nodes, elements: with the numbers of the scope, without those that are left out.
        numbers, left_out: numbers of nodes (NSET) and elements (ELSET) that are kept, and that are left out.
        add: the offsets of node and element numbers in the assembly.
    """

    scope: Scope
    nodes: Nodes
    elements: tuple[Elements, ...]
    numbers: Mapping[str, Ints]
    left_out: Mapping[str, Ints]
    add: Mapping[str, int]


class Assembly:
    """The instances of a deck, and the nodes and elements outside of them, as one body.

    Attributes:
        placed: by key of the instance; "" for the assembly itself, or a flat deck.
        notes: remarks for the user.
    """

    def __init__(self, lines: Lines, root: Scope, instances: Sequence[tuple[Scope, Move | None]], explicit: bool):
        self._lines = lines
        self._explicit = explicit  # instances were named: plain numbers outside belong to the assembly
        self.notes: list[str] = []
        self.placed: dict[str, Placed] = {}
        for scope, move in instances:
            self._place(scope, move, is_root=False)
        self._place(root, None, is_root=True)
        self._lost: dict[str, tuple[int, int, int]] = {}

    # --- numbers ----------------------------------------------------------------------------------

    def _place(self, scope: Scope, move: Move | None, is_root: bool) -> None:
        nodes = self._nodes(scope)
        if move:
            nodes = nodes._replace(points=move(nodes.points))
        is_kept = np.ones(len(nodes.numbers), dtype=bool)
        if is_root and self.placed:
            is_kept = self._without_reference_points(nodes, scope)
        elements = tuple(self._elements(scope, nodes))
        numbers = {"NSET": nodes.numbers[is_kept], "ELSET": _joined(block.numbers for block in elements)}
        left_out = {
            "NSET": nodes.numbers[~is_kept],
            "ELSET": _joined(numbers for ones in scope.left_out.values() for numbers in ones),
        }
        add = {kind: _above(self._used(kind), numbers[kind]) for kind in numbers}
        if any(add.values()):
            what = f"instance {scope.name}" if scope.name else "the assembly"
            self.notes.append(
                f"{add['NSET']} is added to the numbers of nodes of {what}, and {add['ELSET']} to those of its elements"
            )
        self.placed[key_of(scope.name)] = Placed(scope, nodes.of(is_kept), elements, numbers, left_out, add)

    def _used(self, kind: str) -> Ints:
        return _joined(one.numbers[kind] + one.add[kind] for one in self.placed.values())

    def _nodes(self, scope: Scope) -> Nodes:
        """Return the nodes of all cards; raise MeshError if a node has two positions or a damaged coordinate."""
        if not scope.nodes:
            return joined_nodes([])
        nodes = joined_nodes(scope.nodes)
        lost = ~np.asarray((np.abs(nodes.points) < _FAR).all(axis=1))
        if lost.any():
            row = int(lost.argmax())
            raise MeshError(
                f"{self._lines.at(nodes.places[row])}: {lost.sum()} of {len(lost)} nodes have a coordinate that is not "
                f"finite or beyond {_FAR:g}, the first is node {nodes.numbers[row]}"
            )
        first = np.unique(nodes.numbers, return_index=True)[1]
        again = np.setdiff1d(np.arange(len(nodes.numbers)), first)
        former = places(nodes.numbers[first], nodes.numbers[again])
        for row, other in zip(again.tolist(), first[former].tolist(), strict=True):
            if (nodes.points[row] != nodes.points[other]).any():
                at = self._lines.at(nodes.places[row])
                raise MeshError(f"{at}: node {nodes.numbers[row]} is defined twice, at two positions: remove one")
        if again.size:
            self.notes.append(f"{len(again)} nodes are defined twice at the same position and were read once")
            nodes = nodes.of(np.isin(np.arange(len(nodes.numbers)), first))
        return nodes

    def _without_reference_points(self, nodes: Nodes, scope: Scope) -> Bools:
        """Return which nodes of an assembly belong to an element, shape (n,); add a note about the others."""
        is_kept = np.isin(nodes.numbers, _joined(block.nodes.ravel() for block in scope.elements))
        count = int((~is_kept).sum())
        if count:
            first = int(is_kept.argmin())
            self.notes.append(
                f"{count} reference point{'s' if count > 1 else ''} of the assembly, in no element, left out; the "
                f"first is its node {nodes.numbers[first]} at "
                f"({', '.join(f'{value:.6g}' for value in nodes.points[first])}) in the file's unit"
            )
        return np.asarray(is_kept)

    def _elements(self, scope: Scope, nodes: Nodes) -> Iterator[Elements]:
        """Yield the elements of a scope; raise MeshError if a number is duplicate or a node is unknown."""
        numbers = _joined(block.numbers for block in scope.elements)
        lines = _joined(block.places for block in scope.elements)
        is_first = np.zeros(len(numbers), dtype=bool)
        is_first[np.unique(numbers, return_index=True)[1]] = True
        if not is_first.all():
            row = int(is_first.argmin())
            raise MeshError(
                f"{self._lines.at(lines[row])}: element {numbers[row]} is defined twice: renumber one of them"
            )
        for block in scope.elements:
            unknown = places(nodes.numbers, block.nodes) < 0
            lost = np.asarray(unknown.any(axis=1))
            if lost.any() and dimension(block.kind) > 1:
                row = int(lost.argmax())
                raise MeshError(
                    f"{self._lines.at(block.places[row])}: element {block.numbers[row]} ({block.kind}) names node "
                    f"{block.nodes[row, unknown[row].argmax()]}, which is not in the file"
                )
            if lost.any():
                self.notes.append(
                    f"{lost.sum()} of {lost.size} {block.type} refer to nodes that are not in the file and are left out"
                )
            yield Elements(block.type, block.kind, *(column[~lost] for column in block[2:]))

    # --- sets and names ---------------------------------------------------------------------------

    def owner(self, name: str, place: int) -> Placed:
        """Return the instance of a name; raise MeshError if there is no such instance."""
        key = found(self.placed, name) if bare(name) else None
        if key is None:
            known = [one.scope.name for one in self.placed.values() if one.scope.name]
            raise MeshError(
                f"{self._lines.at(place)}: there is no instance '{bare(name)[:40]}'{nearest(bare(name), known)}; "
                f"there are {', '.join(known) or 'none'}"
            )
        return self.placed[key]

    def set_members(self, owner: Placed, kind: str, key: str, within: tuple[int, ...] = ()) -> Ints:
        """Return the members of a set as numbers of the assembly, shape (n,).

        `within` are the ids of the sets being resolved.
        """
        parts = owner.scope.sets[kind][key]
        if id(parts) in within:  # the set contains itself
            return _joined([])
        within = (*within, id(parts))
        return _joined(one for part in parts for one in self._members(owner, kind, key, part, within))

    def _members(self, owner: Placed, kind: str, key: str, part: Part, within: tuple[int, ...]) -> Iterator[Ints]:
        for member in part.members:
            scope = self.owner(part.instance, part.place) if part.instance else self._plain(owner)
            if isinstance(member, Named):
                yield self.named(scope, member, kind, within)
            else:
                yield self._numbers(scope, kind, member, owner.scope.names[key])

    def _plain(self, owner: Placed) -> Placed:
        """Return the scope of plain numbers; without *ASSEMBLY and with a single instance, that instance."""
        alone = [one for key, one in self.placed.items() if key]
        return alone[0] if not (owner.scope.name or self._explicit) and len(alone) == 1 else owner

    def _numbers(self, owner: Placed, kind: str, member: Numbers | Range, name: str) -> Ints:
        known, left_out = owner.numbers[kind], owner.left_out[kind]
        if isinstance(member, Range):
            found = known[member.has(known)]
            if not found.size and not member.has(left_out).any():
                self._lose(name, member.first, member.place, 1)
            return np.asarray(found + owner.add[kind])
        there = places(known, member.numbers) >= 0
        lost = ~there & ~np.isin(member.numbers, left_out)
        if lost.any():
            first = int(lost.argmax())
            self._lose(name, int(member.numbers[first]), int(member.places[first]), int(lost.sum()))
        return np.asarray(member.numbers[there] + owner.add[kind])

    def _lose(self, name: str, number: int, place: int, count: int) -> None:
        first, where, so_far = self._lost.get(name, (number, place, 0))
        self._lost[name] = first, where, so_far + count

    def lost(self) -> list[str]:
        """Return notes about set members that are not in the file."""
        return [
            f"set '{name}' names {count} that {'are' if count > 1 else 'is'} not in the file and left out, the first "
            f"is number {number} in {self._lines.at(place)}"
            for name, (number, place, count) in self._lost.items()
        ]

    def named(self, owner: Placed, member: Named, kind: str, within: tuple[int, ...] = ()) -> Ints:
        """Resolve a name to numbers: a number or a set, of the scope or of an instance (INSTANCE.NAME).

        Returns numbers of `kind` (NSET or ELSET), shape (n,); for NSET, elements give their nodes. Raises
        MeshError if unknown.
        """
        for scope, name in self._readings(owner, member.name):
            key = found(scope.scope.sets[member.kind], name)
            if key is not None:
                numbers = self.set_members(scope, member.kind, key, within)
            elif name.isdecimal() and len(name) < 19:
                one = Numbers(np.array([int(name)]), np.array([member.place]))
                numbers = self._numbers(scope, member.kind, one, member.name)
            else:
                continue
            return numbers if member.kind == kind else self._nodes_of(numbers)
        shown = "the entry" if self._lines.is_included(member.place) else f"'{member.name[:40]}'"
        raise MeshError(f"{self._lines.at(member.place)}: {shown} is neither a number nor a set that is in the file")

    def _readings(self, owner: Placed, name: str) -> Iterator[tuple[Placed, str]]:
        """Yield the possible meanings of a name: a name of the scope, or of the instance before a dot."""
        plain = self._plain(owner)
        yield owner, name
        if plain is not owner:
            yield plain, name
        for at, letter in enumerate(name):
            key = found(self.placed, name[:at]) if letter == "." and bare(name[:at]) else None
            if key is not None:
                yield self.placed[key], name[at + 1 :]
            elif letter == "." and not owner.scope.name:  # the name of the assembly may precede
                yield from self._readings(owner, name[at + 1 :])

    def _nodes_of(self, elements: Ints) -> Ints:
        return _joined(block.nodes[np.isin(block.numbers, elements)].ravel() for block in self.cells)

    @cached_property
    def cells(self) -> list[Elements]:
        """Return the elements of all scopes, with the numbers of the assembly."""
        return [
            block._replace(numbers=block.numbers + one.add["ELSET"], nodes=block.nodes + one.add["NSET"])
            for one in self.placed.values()
            for block in one.elements
        ]

    @cached_property
    def nodes(self) -> Nodes:
        """Return the nodes of all scopes, with the numbers of the assembly."""
        return joined_nodes(
            [one.nodes._replace(numbers=one.nodes.numbers + one.add["NSET"]) for one in self.placed.values()]
        )

    def all_elements(self, owner: Placed) -> Ints:
        """Return the numbers in the assembly of all elements of a scope, shape (n,).

        For the assembly, those of all scopes.
        """
        scopes = [owner] if owner.scope.name else list(self.placed.values())
        return _joined(one.numbers["ELSET"] + one.add["ELSET"] for one in scopes)


def _joined(arrays: Iterable[Ints]) -> Ints:
    return np.concatenate([np.zeros(0, dtype=np.int64), *arrays])


def _above(used: Ints, numbers: Ints) -> int:
    """Return the offset that makes numbers larger than all used ones; 0 without any."""
    if not used.size or not numbers.size:
        return 0
    return max(0, int(used.max()) - int(numbers.min()) + 1)
