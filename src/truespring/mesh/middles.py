"""Second-order triangles and tetrahedra: a node in the middle of each edge, straight or curved."""

from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.mesh.cells import CELL_SHAPES, quadrature
from truespring.mesh.mesh import Mesh

# Second-order cells by number of corners: edge, triangle, tetrahedron.
_SHAPES = {2: CELL_SHAPES["line3"], 3: CELL_SHAPES["triangle6"], 4: CELL_SHAPES["tetra10"]}
# Tolerance of straight edges as a fraction of the body's diameter.
_STRAIGHT = 1e-9
# Gauss points along each axis: shape function times Jacobian of a curved tetrahedron is of fifth order.
_GAUSS = 3


class SecondOrder(NamedTuple):
    """Nodes of a second-order mesh: those of `mesh`, then one in the middle of each edge."""

    mesh: Mesh

    @property
    def nodes(self) -> Floats:
        """Undeformed positions [m], shape (n_nodes + n_edges, dim)."""
        return np.concatenate([self.mesh.nodes, self.middles])

    @property
    def middles(self) -> Floats:
        """Positions of the nodes on the edges [m], shape (n_edges, dim): those of the mesh, else halfway."""
        own = self.mesh.middles
        return self.mesh.nodes[self.mesh.edges].mean(axis=1) if own is None else own

    def of(self, cells: Ints) -> Ints:
        """Return the nodes of cells given by corners, shape (n, k), in VTK's order, shape (n, n_nodes)."""
        shape = _SHAPES.get(cells.shape[1])
        if shape is None:
            return cells
        middles = self.mesh.n_nodes + edge_numbers(self.mesh, cells[:, np.array(shape.between)])
        return np.concatenate([cells, middles], axis=1)

    def shares(self, cells: Ints) -> Floats:
        """Return the integral of each shape function over cells from `of` [m^k], shape (n, k); 1 for single nodes."""
        if cells.shape[1] == 1:
            return np.ones(cells.shape)
        shape = next(one for one in _SHAPES.values() if len(one.powers) == cells.shape[1])
        at, weights = quadrature(shape.base, _GAUSS)
        places, found = self.nodes[cells], np.zeros(cells.shape)
        for functions, slopes, weight in zip(shape.shapes(at), shape.slopes(at), weights, strict=True):
            along = np.einsum("nki,ka->nai", places, slopes)
            measure = np.sqrt(np.maximum(np.linalg.det(along @ along.swapaxes(1, 2)), 0.0))
            found += (weight * measure)[:, None] * functions
        return found


def edge_numbers(mesh: Mesh, pairs: Ints) -> Ints:
    """Return the number in `mesh.edges` of edges given by their ends, shape (..., 2); the result has shape (...)."""
    low, high = pairs.min(axis=-1), pairs.max(axis=-1)
    keys = mesh.edges[:, 0] * mesh.n_nodes + mesh.edges[:, 1]  # ascending, as the edges are
    return np.asarray(np.searchsorted(keys, low * mesh.n_nodes + high))


def fitting_middles(mesh: Mesh, pairs: Ints, places: Floats) -> tuple[Floats | None, int]:
    """Return the middle nodes of the edges of a mesh [m], and the number of elements that they would fold.

    The middle nodes have shape (n_edges, dim), None if all edges are straight. Edges of elements that would be folded,
    and edges without a given middle, are straight.

    Args:
        mesh: a mesh of triangles or tetrahedra.
        pairs: ends of edges, shape (n, 2); of repeated edges the last one is used.
        places: position of the middle node of each [m], shape (n, dim).
    """
    straight = mesh.nodes[mesh.edges].mean(axis=1)
    middles = straight.copy()
    middles[edge_numbers(mesh, pairs)] = places
    shape, elements = _SHAPES[mesh.elements.shape[1]], SecondOrder(mesh).of(mesh.elements)
    edges = elements[:, mesh.elements.shape[1] :] - mesh.n_nodes
    unfit = np.zeros(len(elements), dtype=bool)
    while np.abs(middles - straight).max() > _STRAIGHT * mesh.diameter:
        folded = shape.smallest_jacobian(np.concatenate([mesh.nodes, middles])[elements]) <= 0
        if not folded.any():
            return middles, int(unfit.sum())
        unfit |= folded
        middles[edges[folded]] = straight[edges[folded]]  # which may fold a neighbour, in the next round
    return None, int(unfit.sum())
