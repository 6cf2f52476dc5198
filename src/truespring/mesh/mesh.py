"""The mesh: nodes, elements of one kind, and what follows from them alone."""

from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np

from truespring.arrays import Floats, Ints, frozen_floats, frozen_ints
from truespring.errors import MeshError, nearest


@dataclass(frozen=True)
class ElementKind:
    """The table entry of an element: local node numbers only, no coordinates.

    `edges` and `diagonals` are the pairs that may carry a spring; `sharing` tells for each pair
    (edges first) how many elements of an unbounded regular mesh share it. `facets` bound the
    element, and `corners` lists for each node the neighbours that span its corner Jacobian,
    in right-handed order.
    """

    dim: int
    edges: tuple[tuple[int, int], ...]
    diagonals: tuple[tuple[int, int], ...]
    sharing: tuple[int, ...]
    facets: tuple[tuple[int, ...], ...]
    corners: tuple[tuple[int, ...], ...]
    vtk: str

    @property
    def links(self) -> tuple[tuple[int, int], ...]:
        """All pairs that may carry a spring: edges, then diagonals."""
        return self.edges + self.diagonals


ELEMENT_KINDS: MappingProxyType[str, ElementKind] = MappingProxyType(
    {
        "line": ElementKind(
            dim=1,
            edges=((0, 1),),
            diagonals=(),
            sharing=(1,),
            facets=((0,), (1,)),
            corners=(),
            vtk="line",
        ),
        "quadrilateral": ElementKind(
            dim=2,
            edges=((0, 1), (1, 2), (2, 3), (3, 0)),
            diagonals=((0, 2), (1, 3)),
            sharing=(2, 2, 2, 2, 1, 1),
            facets=((0, 1), (1, 2), (2, 3), (3, 0)),
            corners=((1, 3), (2, 0), (3, 1), (0, 2)),
            vtk="quad",
        ),
    }
)


@dataclass(frozen=True, eq=False, repr=False)
class Mesh:
    """Nodes joined by elements of one kind.

    Attributes:
        nodes: reference positions [m], shape (n_nodes, dim).
        elements: node numbers, shape (n_elements, nodes of the kind).
        element: the kind, a key of ELEMENT_KINDS; "line" in any dimension (networks, trusses).

    Raises MeshError where numbers do not fit each other or an element is inverted or degenerate.
    """

    nodes: Floats
    elements: Ints
    element: str = "quadrilateral"

    def __post_init__(self) -> None:
        if self.element not in ELEMENT_KINDS:
            allowed = ", ".join(ELEMENT_KINDS)
            raise MeshError(
                f"element = '{self.element}' is unknown{nearest(self.element, ELEMENT_KINDS)}; allowed: {allowed}"
            )
        n_corners = 1 + max(max(link) for link in self.kind.links)
        try:
            object.__setattr__(self, "nodes", frozen_floats(self.nodes, (None, None), "nodes"))
            object.__setattr__(self, "elements", frozen_ints(self.elements, (None, n_corners), "elements"))
        except ValueError as error:
            raise MeshError(str(error)) from None
        self._check()

    def __repr__(self) -> str:
        return f"Mesh({self.n_nodes} nodes, {len(self.elements)} {self.element}s)"

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
        bad = np.flatnonzero(self.corner_jacobians(self.nodes).min(axis=1) <= 0)
        if bad.size:
            place = self.nodes[self.elements[bad[0]]].mean(axis=0)
            raise MeshError(
                f"{bad.size} of {len(self.elements)} elements are inverted or degenerate, "
                f"the first is element {bad[0]} at {np.array2string(place, precision=6)} m"
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
        """Every facet of every element, node numbers sorted and each once, shape (n_facets, k)."""
        return np.asarray(self._facets[0])

    @cached_property
    def boundary(self) -> Ints:
        """The facets that belong to one element only, in that element's own order of nodes, shape (n, k)."""
        _, first, count = self._facets
        return np.asarray(self._all_facets[first[count == 1]])

    @cached_property
    def _facets(self) -> tuple[Ints, Ints, Ints]:
        unique, first, count = np.unique(
            np.sort(self._all_facets, axis=1), axis=0, return_index=True, return_counts=True
        )
        return unique, first, count

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
        spans = [at[:, list(ends)] - at[:, [corner]] for corner, ends in enumerate(self.kind.corners)]
        return np.stack([np.linalg.det(span) for span in spans], axis=1)

    def smallest_area_ratio(self, positions: Floats) -> float:
        """Return the smallest corner Jacobian over its rest value: not positive where an element is inverted."""
        return float((self.corner_jacobians(positions) / self._rest_jacobians).min())

    @cached_property
    def _rest_jacobians(self) -> Floats:
        return self.corner_jacobians(self.nodes)

    @cached_property
    def measures(self) -> Floats:
        """Length, area or volume of each element at rest [m^k], shape (n_elements,).

        The mean of the corner Jacobians, exact for parallelograms and for plane quadrilaterals.
        """
        return np.asarray(self._rest_jacobians.mean(axis=1))
