"""The mesh: nodes, elements of one kind, and what follows from them alone."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from truespring.arrays import Bools, Floats, Ints, frozen_floats, frozen_ints
from truespring.errors import MeshError, nearest
from truespring.mesh.kinds import ELEMENT_KINDS, ElementKind

# An element is degenerate where its corner Jacobian is below this share of its longest edge to the power of its
# dimension: elements a thousand times longer than wide, as shapes allow, are well above.
_DEGENERATE = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Mesh:
    """Nodes joined by elements of one kind.

    Attributes:
        nodes: reference positions [m], shape (n_nodes, dim).
        elements: node numbers, shape (n_elements, nodes of the kind).
        element: the kind, a key of ELEMENT_KINDS; "line" in any dimension (networks, trusses).
        node_groups: node numbers by name, ascending; names for supports, loads and probes.
        element_groups: element numbers by name, ascending; names for regions of another material.
        notes: what should be known of a mesh that was read, in words.

    Raises MeshError where numbers do not fit each other, an element is inverted, degenerate or there
    twice, or a node belongs to no element.
    """

    nodes: Floats
    elements: Ints
    element: str = "quadrilateral"
    node_groups: Mapping[str, Ints] = field(default_factory=dict)
    element_groups: Mapping[str, Ints] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.element not in ELEMENT_KINDS:
            allowed = ", ".join(ELEMENT_KINDS)
            raise MeshError(
                f"element = '{self.element}' is unknown{nearest(self.element, ELEMENT_KINDS)}; allowed: {allowed}"
            )
        try:
            object.__setattr__(self, "nodes", frozen_floats(self.nodes, (None, None), "nodes"))
            object.__setattr__(self, "elements", frozen_ints(self.elements, (None, self.kind.n_nodes), "elements"))
        except ValueError as error:
            raise MeshError(str(error)) from None
        object.__setattr__(self, "node_groups", _groups(self.node_groups, self.n_nodes, "node"))
        object.__setattr__(self, "element_groups", _groups(self.element_groups, len(self.elements), "element"))
        self._check()

    def __repr__(self) -> str:
        return f"Mesh({self.n_nodes} nodes, {len(self.elements)} elements: {self.element})"

    def _check(self) -> None:
        if not len(self.nodes) or not len(self.elements):
            raise MeshError(f"a mesh of {len(self.nodes)} nodes and {len(self.elements)} elements is empty")
        if self.element != "line" and self.dim != self.kind.dim:
            raise MeshError(f"a {self.element} has {self.kind.dim} dimensions, the nodes have {self.dim}")
        if self.elements.min() < 0 or self.elements.max() >= len(self.nodes):
            raise MeshError(
                f"elements name nodes {self.elements.min()} to {self.elements.max()}, "
                f"there are 0 to {len(self.nodes) - 1}"
            )
        used = np.zeros(self.n_nodes, dtype=bool)
        used[self.elements] = True
        self._refuse(~used, "nodes", "unreferenced: no element has them", self.nodes)
        centres = self.nodes[self.elements].mean(axis=1)
        smallest = self._rest_jacobians.min(axis=1)
        self._refuse(smallest <= -self._degenerate, "elements", "inverted: their corner Jacobian is negative", centres)
        self._refuse(
            ~(smallest > self._degenerate), "elements", "degenerate: flat or with nodes that coincide", centres
        )
        if self.element != "line":  # springs may be parallel
            _, first = np.unique(np.sort(self.elements, axis=1), axis=0, return_index=True)
            twice = np.ones(len(self.elements), dtype=bool)
            twice[first] = False
            self._refuse(twice, "elements", "duplicate: others have the same nodes", centres)

    @property
    def _degenerate(self) -> Floats:
        """The corner Jacobian below which an element is degenerate [m^dim], shape (n_elements,)."""
        edges = np.array(self.kind.edges)
        at = self.nodes[self.elements]
        longest = np.linalg.norm(at[:, edges[:, 1]] - at[:, edges[:, 0]], axis=2).max(axis=1)
        return np.asarray(_DEGENERATE * longest**self.kind.dim if self.element != "line" else 0.0 * longest)

    def _refuse(self, bad: Bools, what: str, why: str, places: Floats) -> None:
        """Name, count and locate what is wrong."""
        if bad.any():
            first = int(bad.argmax())
            place = ", ".join(f"{coordinate:.6g}" for coordinate in places[first])
            raise MeshError(
                f"{int(bad.sum())} of {len(bad)} {what} are {why}; the first is {what[:-1]} {first} at ({place}) m"
            )

    @property
    def kind(self) -> ElementKind:
        """The table entry of the elements."""
        return ELEMENT_KINDS[self.element]

    @property
    def dim(self) -> int:
        """The number of directions."""
        return int(self.nodes.shape[1])

    @property
    def n_nodes(self) -> int:
        """The number of nodes."""
        return len(self.nodes)

    @property
    def lower(self) -> Floats:
        """The smallest coordinates [m], shape (dim,)."""
        return np.asarray(self.nodes.min(axis=0))

    @property
    def upper(self) -> Floats:
        """The largest coordinates [m], shape (dim,)."""
        return np.asarray(self.nodes.max(axis=0))

    @property
    def diameter(self) -> float:
        """The diagonal of the bounding box [m]: the length that tolerances are relative to."""
        return float(np.linalg.norm(self.upper - self.lower))

    @cached_property
    def edges(self) -> Ints:
        """Every edge of the elements once, shape (n_edges, 2)."""
        return np.unique(np.sort(self.elements[:, np.array(self.kind.edges)].reshape(-1, 2), axis=1), axis=0)

    @cached_property
    def facets(self) -> Ints:
        """Every facet of every element once, in one element's own order of nodes, shape (n_facets, k)."""
        return np.asarray(self._all_facets[self._facets[0]])

    @cached_property
    def boundary(self) -> Ints:
        """The facets that belong to one element only, in that element's own order of nodes, shape (n, k)."""
        first, count = self._facets
        return np.asarray(self._all_facets[first[count == 1]])

    @cached_property
    def _facets(self) -> tuple[Ints, Ints]:
        """Where each facet stands first among all, and how many elements have it."""
        _, first, count = np.unique(np.sort(self._all_facets, axis=1), axis=0, return_index=True, return_counts=True)
        return first, count

    @cached_property
    def _all_facets(self) -> Ints:
        local = np.array(self.kind.facets)
        return self.elements[:, local].reshape(-1, local.shape[1])

    def corner_jacobians(self, positions: Floats) -> Floats:
        """Return the Jacobian at each corner of each element [m^dim], shape (n_elements, corners).

        For lines, whose Jacobian has no sign, the length. The element is inverted where one is not positive.
        """
        at = positions[self.elements]
        if self.element == "line":
            return np.asarray(np.linalg.norm(at[:, 1] - at[:, 0], axis=1)[:, None])
        return _determinants(at, self.kind.corners)

    def smallest_area_ratio(self, positions: Floats) -> float:
        """Return the smallest corner Jacobian over its rest value: not positive where an element is inverted.

        In space it is a ratio of volumes.
        """
        return float((self.corner_jacobians(positions) / self._rest_jacobians).min())

    @cached_property
    def _rest_jacobians(self) -> Floats:
        return self.corner_jacobians(self.nodes)

    @cached_property
    def measures(self) -> Floats:
        """Length, area or volume of each element at rest [m^dim of the kind], shape (n_elements,)."""
        if self.element == "line":
            return np.asarray(self._rest_jacobians[:, 0])
        return self.measures_at(self.nodes)

    def measures_at(self, positions: Floats) -> Floats:
        """Signed area or volume of each element at `positions` [m^dim], shape (n_elements,); exact for each kind."""
        determinants = _determinants(positions[self.elements], self.kind.simplices)
        return np.asarray(determinants.sum(axis=1) * self.kind.simplex_weight / math.factorial(self.kind.dim))

    @cached_property
    def parts(self) -> Ints:
        """The connected part of the mesh that each node belongs to, numbered from 0, shape (n_nodes,)."""
        first, others = self.elements[:, :1], self.elements[:, 1:]
        pairs = np.stack(np.broadcast_arrays(first, others), axis=-1).reshape(-1, 2)
        graph = sparse.coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(self.n_nodes, self.n_nodes))
        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _determinants(at: Floats, simplices: Sequence[tuple[int, ...]]) -> Floats:
    """Determinant spanned at the first of each simplex' nodes by the others, shape (n_elements, simplices)."""
    local = np.array(simplices)
    return np.asarray(np.linalg.det(at[:, local[:, 1:]] - at[:, local[:, :1]]))


def _groups(groups: Mapping[str, Ints], n_there: int, what: str) -> Mapping[str, Ints]:
    """Freeze groups: numbers ascending and each once; raise MeshError for one that is empty or does not exist."""
    frozen = {}
    for name, numbers in groups.items():
        given = np.asarray(numbers)
        if given.ndim != 1 or not np.issubdtype(given.dtype, np.integer):
            raise MeshError(f"{what} group '{name}' = {numbers!r}: a list of {what} numbers is wanted")
        members = np.unique(given.astype(np.int64))
        if not members.size or members[0] < 0 or members[-1] >= n_there:
            raise MeshError(f"{what} group '{name}' is empty or has a number that no {what} has: 0 to {n_there - 1}")
        members.setflags(write=False)
        frozen[name] = members
    return MappingProxyType(frozen)
