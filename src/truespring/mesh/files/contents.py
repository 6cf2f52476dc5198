"""Contents of a mesh file, independent of its format, and their conversion to a Mesh."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.facets import (
    facet_columns,
    facet_keys,
    facet_nodes,
    find_facets,
    folded,
    halved,
    mirrored_facets,
)
from truespring.mesh.joining import distinct_points
from truespring.mesh.kinds import ELEMENT_KINDS, MIRRORED, MIXED, counted
from truespring.mesh.merged import kinds_in, mirrored, repeats, turned
from truespring.mesh.mesh import Mesh
from truespring.mesh.middles import fitting_middles
from truespring.mesh.rows import distinct_rows

#: Dimension and corners of each kind of cell in files; every format names the corners first. Those without a
#: fixed number of corners are listed so that error messages can name them.
CELL_KINDS: dict[str, tuple[int, int]] = {
    "vertex": (0, 1),
    "line": (1, 2),
    "triangle": (2, 3),
    "quadrilateral": (2, 4),
    "tetrahedron": (3, 4),
    "hexahedron": (3, 8),
    "wedge": (3, 6),
    "pyramid": (3, 5),
    "polygon": (2, 0),
    "triangle strip": (2, 0),
    "prism": (3, 0),
    "polyhedron": (3, 0),
}

_SUPPORTED = "a body consists of triangles and quadrilaterals, or of tetrahedra, hexahedra, wedges and pyramids"
_DIVIDE = "divide other cells into these by an option of the mesher, or by ParaView's filter Tetrahedralize"

_AGAIN = "write the file again with the program that made it, or correct it there"
_MEND = "correct the mesh in the program that made it (in gmsh: Mesh.Optimize = 1), or remove such elements"

# Coordinates above this are taken as damaged, in any unit; their squares are finite.
_FAR = 1e30

# Shares of the body's diameter.
_SAME_PLACE = 1e-7  # nodes closer than this coincide: the resolution of float32
_FLAT = 1e-6  # a body thinner than this is plane: files have six digits or more


@dataclass(frozen=True)
class Cells:
    """Cells of one kind.

    Attributes:
        kind: a key of CELL_KINDS.
        nodes: the file's node numbers, corners first, then middles of edges in VTK's order, shape (n_cells, k).
        numbers: the file's cell numbers, shape (n_cells,).
        lines: line numbers in a text file, shape (n_cells,).
    """

    kind: str
    nodes: Ints
    numbers: Ints
    lines: Ints | None = None

    @property
    def dim(self) -> int:
        """The topological dimension of the cells."""
        return CELL_KINDS[self.kind][0]

    @property
    def corners(self) -> Ints:
        """The nodes at the corners, shape (n_cells, corners); all nodes of a kind without a fixed number of corners."""
        return self.nodes[:, : CELL_KINDS[self.kind][1] or None]


@dataclass(frozen=True)
class Contents:
    """The contents of a mesh file, by the file's own numbers of nodes and cells.

    Attributes:
        node_numbers, points: shapes (n,) and (n, 3) [the file's unit of length].
        cells: each block in the file's order.
        node_groups, cell_groups: numbers of nodes and of cells by name. If a name is in both, its nodes are those of
            node_groups, else the nodes of the cells. Cells of one dimension less than the body select the facets
            with the same corners.
        facet_groups: facets by name: the number of a cell and the index of its facet in the `facets` of
            ELEMENT_KINDS, shape (n, 2).
        cell_vectors: vectors of the cells by name, shape (n, 3), in the order of their numbers from 0.
        node_lines: line numbers of the nodes in a text file, shape (n,).
        is_apart: whether the file defines contact between bodies: coincident nodes are then merged only if `join` is
            true.
        notes: remarks about the file for the user.
        hint: if there is no body, how to make the program write one.
    """

    node_numbers: Ints
    points: Floats
    cells: Sequence[Cells]
    node_groups: Mapping[str, Ints] = field(default_factory=dict)
    cell_groups: Mapping[str, Ints] = field(default_factory=dict)
    facet_groups: Mapping[str, Ints] = field(default_factory=dict)
    cell_vectors: Mapping[str, Floats] = field(default_factory=dict)
    node_lines: Ints | None = None
    is_apart: bool = False
    notes: tuple[str, ...] = ()
    hint: str = ""

    def mesh(self, scale: float, join: bool | None = None) -> Mesh:
        """Return the mesh of the body; `scale` is the file's unit of length in metres.

        `join` merges coincident nodes; by default only if no two elements share a node and the file defines no
        contact between bodies. Raises MeshError if there is no body.
        """
        with np.errstate(all="ignore"):  # damaged coordinates may underflow: the element is then degenerate
            return self._mesh(scale, join)

    def _mesh(self, scale: float, join: bool | None) -> Mesh:
        self._check_nodes()
        cells = _by_kind(self.cells)
        body = _body(cells, self.hint)
        for block in cells:
            self._check_cells(block)
        if join or (join is None and not self.is_apart):
            whole = self._joined(body, always=bool(join))
            if whole is not self:
                return whole._mesh(scale, join=False)
        kind, table = _table(body)
        corners = self._rows(table)
        nodes = np.unique(corners)
        positions = _in_their_dimensions(self.points[nodes] * scale, body[0], self.hint)
        elements = np.searchsorted(nodes, corners)
        is_turned = _is_inverted(positions, elements, kind)
        facet_groups, facet_notes = self._facet_groups(cells, body, nodes, elements, kind)
        for name, numbers, _ in kinds_in(elements, kind):
            here = np.zeros(len(elements), dtype=bool)
            here[numbers] = is_turned[numbers]
            for facets in facet_groups.values():
                of_turned = here[facets[:, 0]]
                facets[of_turned, 1] = mirrored_facets(name)[facets[of_turned, 1]]
        elements = mirrored(elements, kind, is_turned)
        element_groups, node_groups = self._groups(cells, body, nodes)
        for name, facets in facet_groups.items():
            if name in self.node_groups:
                continue
            there = node_groups.get(name, np.zeros(0, dtype=np.int64))
            node_groups[name] = np.union1d(there, facet_nodes(elements, kind, facets))
        notes = [
            *self.notes,
            *(
                f"group '{name}' has elements and facets: loads act on its facets, supports hold the nodes of both"
                for name, facets in facet_groups.items()
                if facets.size and element_groups.get(name, facets[:0]).size
            ),
            *self._second_order(body, nodes),
            *_made_of_bricks(body),
            *self._unreferenced(body, scale),
            *_coincident(positions, self.node_numbers[nodes]),
            *_turned(is_turned, elements, kind, positions),
            *facet_notes,
            *_halved(elements, kind),
            *(
                f"group '{name}' has {self._none_of(name, body)} and was left out"
                for name in node_groups
                if not node_groups[name].size
            ),
        ]
        try:
            mesh = Mesh(
                positions,
                elements,
                kind,
                node_groups=_not_empty(node_groups),
                element_groups=_not_empty(element_groups),
                facet_groups=_not_empty(facet_groups),
                notes=tuple(notes),
                element_vectors=self._vectors(body),
            )
            return self._curved(mesh, body, nodes, scale)
        except MeshError as error:
            raise MeshError(f"{error}; elements are counted from 0 in the file's order: {_MEND}") from None

    def _facet_groups(
        self, cells: Sequence[Cells], body: Sequence[Cells], nodes: Ints, elements: Ints, kind: str
    ) -> tuple[dict[str, Ints], list[str]]:
        """Return facets by name, as (element, local facet), and notes about those that bound no element."""
        numbers = np.concatenate([block.numbers for block in body])
        found: dict[str, list[Ints]] = {}
        for name, given in self.facet_groups.items():
            found[name] = [np.stack([places(numbers, given[:, 0]), given[:, 1]], axis=1)]
            for block in body:  # facets of collapsed bricks are found by their corners
                at = places(block.numbers, given[:, 0])
                other = np.flatnonzero((at >= 0) & _collapsed(block)[at])
                if other.size:
                    local = np.array(ELEMENT_KINDS[block.kind].facets)[given[other, 1]]
                    facets = np.take_along_axis(block.corners[at[other]], local, axis=1)
                    found[name][0][other] = find_facets(elements, kind, places(nodes, self._rows(facets)))
        for block in cells:
            if block.dim == body[0].dim - 1 and self.cell_groups:
                facets = find_facets(elements, kind, places(nodes, self._rows(block.corners)))
                for name, group in self.cell_groups.items():
                    found.setdefault(name, []).append(facets[_found(block.numbers, group)])
        groups, notes = {}, []
        for name, parts in found.items():
            facets = np.concatenate(parts)
            groups[name] = facets[facets[:, 0] >= 0]
            n_lost = len(facets) - len(groups[name])
            if n_lost:
                left = "no load acts on them" if n_lost < len(facets) else "only their nodes are used"
                notes.append(f"{n_lost} of {len(facets)} facets of group '{name}' bound no element of the body: {left}")
        return groups, notes

    def _joined(self, body: Sequence[Cells], always: bool) -> "Contents":
        """Return the contents with coincident nodes merged, if `always` or no two elements share a node."""
        used = self._rows(np.concatenate([block.nodes.ravel() for block in body]))
        if not always and len(np.unique(used)) < len(used):
            return self
        near = _SAME_PLACE * float(np.linalg.norm(np.ptp(self.points[used], axis=0)))
        first, place = distinct_points(self.points, near)
        n_before, n_after = len(np.unique(used)), len(np.unique(place[used]))
        if n_after == n_before:
            return self
        number = self.node_numbers[first][place]  # of each node, the number of the node that replaces it
        why = "were joined" if always else "were merged, because no two elements share a node"
        return replace(
            self,
            node_numbers=self.node_numbers[first],
            points=self.points[first],
            cells=[replace(block, nodes=number[self._rows(block.nodes)]) for block in self.cells],
            node_groups={
                name: np.unique(number[_found(self.node_numbers, group)]) for name, group in self.node_groups.items()
            },
            node_lines=None if self.node_lines is None else self.node_lines[first],
            notes=(*self.notes, f"{n_before} nodes at {n_after} places {why}"),
        )

    def _rows(self, node_numbers: Ints) -> Ints:
        return places(self.node_numbers, node_numbers)

    def _check_nodes(self) -> None:
        twice = _repeated(self.node_numbers)
        if twice is not None:
            raise MeshError(f"{_at(self.node_lines, twice)}node {self.node_numbers[twice]} is defined twice: {_AGAIN}")
        lost = ~np.asarray((np.abs(self.points) < _FAR).all(axis=1))
        if lost.any():
            row = int(lost.argmax())
            raise MeshError(
                f"{_at(self.node_lines, row)}{lost.sum()} of {len(lost)} nodes have a coordinate that is not finite "
                f"or beyond {_FAR:g}, the first is node {self.node_numbers[row]}: {_AGAIN}"
            )

    def _check_cells(self, cells: Cells) -> None:
        unknown = (self._rows(cells.nodes) < 0).any(axis=1)
        if unknown.any():
            row = int(unknown.argmax())
            node = next(node for node in cells.nodes[row] if self._rows(np.array([node]))[0] < 0)
            raise MeshError(
                f"{_at(cells.lines, row)}element {cells.numbers[row]} ({cells.kind}) names node {node}, "
                f"which is not in the file: {_AGAIN}"
            )

    def _groups(
        self, cells: Sequence[Cells], body: Sequence[Cells], nodes: Ints
    ) -> tuple[dict[str, Ints], dict[str, Ints]]:
        """Return groups of elements and of nodes as indices into the body; some may be empty."""
        elements = np.concatenate([block.numbers for block in body])
        element_groups: dict[str, Ints] = {}
        members = {name: [group] for name, group in self.node_groups.items()}
        for name, group in self.cell_groups.items():
            element_groups[name] = _found(elements, group)
            if name not in self.node_groups:
                there = members.setdefault(name, [])
                there.extend(block.corners[_found(block.numbers, group)].ravel() for block in cells)
        return element_groups, {
            name: _found(self.node_numbers[nodes], np.unique(np.concatenate(group))) for name, group in members.items()
        }

    def _vectors(self, body: Sequence[Cells]) -> dict[str, Floats]:
        """Return the vectors of the body's elements by name, shape (n_elements, 3)."""
        numbers = np.concatenate([block.numbers for block in body])
        return {name: vectors[numbers] for name, vectors in self.cell_vectors.items()}

    def _none_of(self, name: str, body: Sequence[Cells]) -> str:
        """Return a phrase for a note about a group that has no corner node of the body."""
        between = np.isin(self.node_groups.get(name, np.zeros(0)), np.concatenate([one.nodes.ravel() for one in body]))
        return "only nodes between the corners of the body" if between.any() else "no node of the body"

    def _second_order(self, body: Sequence[Cells], nodes: Ints) -> list[str]:
        high = [block for block in body if block.nodes.shape[1] > block.corners.shape[1]]
        if not high:
            return []
        count = sum(len(block.nodes) for block in high)
        between = len(np.setdiff1d(np.concatenate([block.nodes.ravel() for block in high]), self.node_numbers[nodes]))
        if len(_with_middles(body)) == len(high):
            return [
                f"{count} elements of second order: finite elements use their {between} mid-edge "
                "nodes, springs and first-order elements only the corners"
            ]
        left = f"{between} nodes between the corners were left out"
        return [f"{count} elements of second order were reduced to their corners; {left}"]

    def _curved(self, mesh: Mesh, body: Sequence[Cells], nodes: Ints, scale: float) -> Mesh:
        """Return the mesh with the nodes in the middle of the edges of triangles and tetrahedra."""
        high = _with_middles(body)
        if not high:
            return mesh
        rows = self._rows(np.concatenate([block.nodes for block in high]))
        pairs = np.searchsorted(nodes, rows[:, np.array(mesh.kind.edges)]).reshape(-1, 2)
        places = self.points[rows[:, mesh.kind.n_nodes :].ravel(), : mesh.dim] * scale
        middles, n_folded = fitting_middles(mesh, pairs, places)
        if middles is None:
            return mesh
        note = (
            f"{n_folded} elements of second order are folded by their mid-edge nodes: these edges are straight instead"
        )
        return replace(mesh, middles=middles, notes=(*mesh.notes, *([note] if n_folded else [])))

    def _unreferenced(self, body: Sequence[Cells], scale: float) -> list[str]:
        has_element = np.zeros(len(self.points), dtype=bool)
        for block in body:
            has_element[self._rows(block.nodes)] = True
        if has_element.all():
            return []
        first = int(has_element.argmin())
        return [
            f"{(~has_element).sum()} of {len(has_element)} nodes belong to no element and were left "
            f"out; the first is node {self.node_numbers[first]} at {_place(self.points[first] * scale)} m"
        ]


def places(numbers: Ints, expected: Ints) -> Ints:
    """Return the index in `numbers` of each of `expected`, -1 if it is not there; shape of `expected`."""
    if not len(numbers):
        return np.full(expected.shape, -1, dtype=np.int64)
    order = np.argsort(numbers, kind="stable")
    found = order[np.searchsorted(numbers, expected, sorter=order).clip(max=len(numbers) - 1)]
    return np.where(numbers[found] == expected, found, -1)


def _found(numbers: Ints, expected: Ints) -> Ints:
    """Return the indices in `numbers` of those of `expected` that are there."""
    where = places(numbers, expected)
    return np.asarray(where[where >= 0])


def _repeated(numbers: Ints) -> int | None:
    """Return the index of the first duplicate number, None if all are distinct."""
    first = np.zeros(len(numbers), dtype=bool)
    first[np.unique(numbers, return_index=True)[1]] = True
    return None if first.all() else int(first.argmin())


def _at(lines: Ints | None, row: int) -> str:
    """Return "line 5: " for the line of a row, empty if unknown."""
    return "" if lines is None else f"line {lines[row]}: "


def _not_empty(groups: Mapping[str, Ints]) -> dict[str, Ints]:
    return {name: members for name, members in groups.items() if members.size}


def _by_kind(cells: Sequence[Cells]) -> list[Cells]:
    """Join the blocks of the same kind and number of nodes; raise MeshError if a cell number is duplicate."""
    blocks: dict[tuple[str, int], list[Cells]] = {}
    for block in cells:
        if len(block.nodes):
            blocks.setdefault((block.kind, block.nodes.shape[1]), []).append(block)
    joined = [
        Cells(
            kind,
            np.concatenate([block.nodes for block in same]),
            np.concatenate([block.numbers for block in same]),
            _lines(same),
        )
        for (kind, _), same in blocks.items()
    ]
    numbers = np.concatenate([block.numbers for block in joined] or [np.zeros(0, dtype=np.int64)])
    twice = _repeated(numbers)
    if twice is not None:
        raise MeshError(f"{_at(_lines(joined), twice)}element {numbers[twice]} is defined twice: {_AGAIN}")
    return joined


def _lines(cells: Sequence[Cells]) -> Ints | None:
    lines = [block.lines for block in cells if block.lines is not None]
    return np.concatenate(lines) if len(lines) == len(cells) else None


def _body(cells: Sequence[Cells], hint: str) -> list[Cells]:
    """Return the blocks of the highest dimension; raise MeshError if they form no body."""
    counts = Counter[str]()
    for block in cells:
        counts[block.kind] += len(block.nodes)
    dim = max((block.dim for block in cells), default=0)
    if dim < 2:
        there = f"there are only {listed(counts)}" if counts else "there are no elements"
        raise MeshError(f"{there}: {_joined(hint, _SUPPORTED)}")
    body = {kind: count for kind, count in counts.items() if CELL_KINDS[kind][0] == dim}
    unread = {kind: count for kind, count in body.items() if kind not in MIRRORED}
    if unread:
        raise MeshError(f"not supported: {listed(unread)}; {_SUPPORTED}: {_DIVIDE}")
    return [block for block in cells if block.dim == dim]


def _table(body: Sequence[Cells]) -> tuple[str, Ints]:
    """Return the element kind of the body and the element table, with the file's node numbers.

    Bricks and quadrilaterals with coincident corners become wedges, pyramids or simplices.
    """
    kind = body[0].kind
    alone = len({block.kind for block in body}) == 1
    if alone and not any(_collapsed(block).any() for block in body):
        return kind, np.concatenate([block.corners for block in body])
    table = turned(np.concatenate([block.corners[:, ELEMENT_KINDS[block.kind].merged] for block in body]))
    kinds = kinds_in(table, MIXED)
    return (kinds[0][0], kinds[0][2]) if len(kinds) == 1 else (MIXED, table)


def _with_middles(body: Sequence[Cells]) -> list[Cells]:
    """Return the blocks of triangles and tetrahedra that have a node in the middle of each edge and no other."""
    if len({block.kind for block in body}) > 1:  # in a mesh of several kinds all elements are of first order
        return []
    simplices = [block for block in body if block.kind in ("triangle", "tetrahedron")]
    kinds = [ELEMENT_KINDS[block.kind] for block in simplices]
    return [
        block
        for block, kind in zip(simplices, kinds, strict=True)
        if block.nodes.shape[1] == kind.n_nodes + len(kind.edges)
    ]


def _joined(*advice: str) -> str:
    return "; ".join(filter(None, advice))


def _in_their_dimensions(positions: Floats, cells: Cells, hint: str) -> Floats:
    if cells.dim == 3:
        return positions
    kind = cells.kind
    spans = np.ptp(positions, axis=0)
    if spans[2] <= _FLAT * np.linalg.norm(spans):
        return positions[:, :2]
    z = positions[:, 2]
    if spans.min() <= _FLAT * np.linalg.norm(spans):
        raise MeshError(
            f"the {kind}s lie in a plane of constant {'xyz'[spans.argmin()]}: "
            + _joined(hint, "a plane body needs a constant z: rotate it")
        )
    raise MeshError(
        f"the {kind}s are a surface in space (z from {z.min():.6g} to {z.max():.6g} m): a shell is not supported; "
        + _joined(
            hint,
            "use a plane of constant z for a plane body, or fill a closed surface with tetrahedra or hexahedra by a "
            "mesher",
        )
    )


def _is_inverted(positions: Floats, elements: Ints, kind: str) -> Bools:
    """Return which elements have no positive corner, shape (n_elements,); Mesh rejects those of mixed signs."""
    found = np.zeros(len(elements), dtype=bool)
    for name, numbers, own in kinds_in(elements, kind):
        corners = np.array(ELEMENT_KINDS[name].corners)
        at = positions[own]
        jacobians = np.linalg.det(at[:, corners[:, 1:]] - at[:, corners[:, :1]])
        found[numbers] = (jacobians <= 0).all(axis=1) & (jacobians < 0).any(axis=1)
    return found


def _turned(is_turned: Bools, elements: Ints, kind: str, positions: Floats) -> list[str]:
    """Return a note about the mirrored elements; raise MeshError if mirrored elements overlap their neighbours."""
    if not is_turned.any():
        return []
    if is_turned.all():
        return [f"all {len(elements)} elements are inverted in the file and were mirrored"]
    over = folded(elements, kind)
    if over.any():
        first = int((over & is_turned).argmax())
        raise MeshError(
            f"{is_turned.sum()} of {len(elements)} elements are inverted, and {over.sum()} would overlap their "
            f"neighbours if these were mirrored; the first is element {first}, counted from 0 in the file's order, at "
            f"{_place(positions[elements[first]].mean(axis=0))} m: the mesh is folded there; {_MEND}"
        )
    return [f"{is_turned.sum()} of {len(elements)} elements are inverted in the file and were mirrored"]


def _made_of_bricks(body: Sequence[Cells]) -> list[str]:
    """Return notes about the elements with coincident corners."""
    count = sum(int(_collapsed(block).sum()) for block in body)
    if not count:
        return []
    kind = ("quadrilateral", "hexahedron")[body[0].dim - 2]
    return [f"{count} {kind} cell{'s' * (count != 1)} with coincident corners became wedges, pyramids or simplices"]


def _collapsed(block: Cells) -> Bools:
    """Return which cells are quadrilaterals or hexahedra with coincident corners, shape (n_cells,)."""
    if block.kind not in ("quadrilateral", "hexahedron"):
        return np.zeros(len(block.nodes), dtype=bool)
    return repeats(block.corners)


def _halved(elements: Ints, kind: str) -> list[str]:
    """Return a note about quadrilateral faces that adjoin two triangles: the joint has gaps."""
    if kind != MIXED:
        return []
    facets = facet_columns(elements, kind)
    found = distinct_rows(facet_keys(facets))
    n_whole = int(halved(facets[:, found.first[found.count == 1]].T).sum()) // 3
    if not n_whole:
        return []
    return [
        f"{n_whole} quadrilateral face{'s' * (n_whole != 1)} {'lie' if n_whole > 1 else 'lies'} on two triangles of "
        "other elements: they are joined at the corners, with gaps between; pyramids would close the gaps"
    ]


def _coincident(positions: Floats, numbers: Ints) -> list[str]:
    from scipy.spatial import KDTree

    near = _SAME_PLACE * float(np.linalg.norm(np.ptp(positions, axis=0)))
    apart, nearest = map(np.asarray, KDTree(positions).query(positions, k=2, distance_upper_bound=near))
    twins = np.flatnonzero(np.isfinite(apart[:, 1]))
    if not twins.size:
        return []
    first = twins[0]
    other = next(node for node in nearest[first] if node != first)
    return [
        f"{len(twins)} of {len(positions)} nodes coincide with another node, the first are nodes "
        f"{numbers[first]} and {numbers[other]} at {_place(positions[first])} m: the mesh may be torn there; "
        "join = true merges them"
    ]


def listed(counts: Mapping[str, int]) -> str:
    """Return a text such as "1 vertex and 2 lines": the kinds of cells with their counts."""
    words = [counted(count, kind) for kind, count in counts.items()]
    return " and ".join([*([", ".join(words[:-1])] if words[1:] else []), *words[-1:]])


def _place(position: Floats) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in position) + ")"
