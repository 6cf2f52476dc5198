"""Elements of second order: triangles and tetrahedra with a node in the middle of each edge, straight or curved."""

from typing import NamedTuple

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.mesh.cells import CELL_SHAPES, CellShape
from truespring.mesh.measures import quadrature
from truespring.mesh.mesh import Mesh

# The cell of second order that has so many corners: an edge, a triangle, a tetrahedron.
_SHAPES = {2: CELL_SHAPES["line3"], 3: CELL_SHAPES["triangle6"], 4: CELL_SHAPES["tetra10"]}
# Gauss points along each axis: what a shape function and the Jacobian of a curved tetrahedron make is of fifth order.
_GAUSS = 3


class SecondOrder(NamedTuple):
    """The nodes of a mesh of elements of second order: those of `mesh`, then one in the middle of each of its edges."""

    mesh: Mesh

    @property
    def nodes(self) -> Floats:
        """Positions at rest [m], shape (n_nodes + n_edges, dim)."""
        return np.concatenate([self.mesh.nodes, self.middles])

    @property
    def middles(self) -> Floats:
        """Positions of the nodes on the edges [m], shape (n_edges, dim): the mesh's own, else halfway."""
        own = self.mesh.middles
        return self.mesh.nodes[self.mesh.edges].mean(axis=1) if own is None else own

    def of(self, cells: Ints) -> Ints:
        """Return the nodes of edges, triangles or tetrahedra given by their corners, in VTK's order; nodes as they are."""
        shape = _SHAPES.get(cells.shape[1])
        if shape is None:
            return cells
        middles = self.mesh.n_nodes + edge_numbers(self.mesh, cells[:, np.array(shape.between)])
        return np.concatenate([cells, middles], axis=1)

    def shares(self, cells: Ints) -> Floats:
        """Integrate each shape function over cells as `of` returns them [m^k], shape (n, k); of nodes alone 1."""
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
    """Return the number in `mesh.edges` of pairs of nodes that are edges, shape (..., 2) to (...)."""
    low, high = pairs.min(axis=-1), pairs.max(axis=-1)
    keys = mesh.edges[:, 0] * mesh.n_nodes + mesh.edges[:, 1]  # ascending, as the edges are
    return np.asarray(np.searchsorted(keys, low * mesh.n_nodes + high))
