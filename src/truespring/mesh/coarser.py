"""Coarser meshes: a lattice of cells twice as large, and the interpolation of nodes.

A lattice is a set of equal cells in a regular arrangement: a rectangle or box of any numbers of cells, halved
rectangles, wedges, or six tetrahedra a cube; and the voxels of a label image. It may be turned or skewed.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Floats, Ints
from truespring.mesh.kinds import MIXED
from truespring.mesh.mesh import Mesh
from truespring.remembering import remembered

# Largest distance of a node from its place in the lattice, in cells.
_ON_THE_LATTICE = 1e-6


@dataclass(frozen=True, eq=False)
class Coarser:
    """A mesh of cells twice as large along each axis, and the interpolation from it.

    Each coarse cell takes the place of two cells along each axis. At an uneven end it extends beyond the finer mesh, by
    one layer of cells; coarse cells at a stepped surface are filled in part.

    Attributes:
        mesh: the coarser mesh, without groups; elements cell by cell, those of a cell divided as in the finer mesh.
        weights: interpolation of the nodes of the finer mesh from those of the coarser one, linear along each axis:
            sparse, shape (finer n_nodes, coarser n_nodes), columns of each row ascending. Rows sum to 1, and linear
            fields are exact; a row has 1, 2, 4 or 8 entries.
        parents: coarse cell of each element of the finer mesh, shape (finer n_elements,).
        cells: coarse cell of each element of the coarser mesh, shape (coarser n_elements,).
        counts: number of coarse cells along each axis of the lattice, between its ends.
        thickness: smallest number of cells of the finer mesh along an axis of the lattice.
    """

    mesh: Mesh
    weights: "sparse.csr_array[Any]"
    parents: Ints
    cells: Ints
    counts: tuple[int, ...]
    thickness: int


class _Lattice(NamedTuple):
    """The places of a mesh in a lattice, counted in cells.

    Attributes:
        origin: position of the place 0 [m], shape (dim,).
        basis: edges of a cell [m], one a row, shape (dim, dim).
        places: place of each node, from 0, shape (n_nodes, dim).
        lowest: place of the first corner of the cell of each element, shape (n_elements, dim).
        ends: 1 for nodes of an element at the upper end of its cell along an axis, else 0; shape (n_elements, k, dim).
    """

    origin: Floats
    basis: Floats
    places: Ints
    lowest: Ints
    ends: Ints


@remembered
def coarser(mesh: Mesh) -> Coarser | None:
    """Return a mesh of cells twice as large; None unless the mesh is a lattice whose cells are divided alike.

    The division into elements may alternate from cell to cell along each axis.
    """
    lattice = _lattice(mesh)
    divisions = None if lattice is None else _divisions(lattice)
    if lattice is None or divisions is None:
        return None
    shape = lattice.places.max(axis=0) // 2 + 2  # places of coarse nodes along each axis
    keys, parents = np.unique(_keys(lattice.lowest // 2, shape), return_inverse=True)
    lowest = np.stack(np.unravel_index(keys, tuple(shape), order="F"), axis=1)
    corners = lowest[:, None, None] + divisions[_parity(lowest)]
    used, elements = np.unique(_keys(corners, shape), return_inverse=True)
    places = np.stack(np.unravel_index(used, tuple(shape), order="F"), axis=1)
    nodes = lattice.origin + 2.0 * places @ lattice.basis
    made = Mesh(nodes, elements.reshape(-1, corners.shape[2]), mesh.element)
    counts = tuple(int(count) for count in lowest.max(axis=0) + 1)
    weights = _weights(lattice.places, used, shape)
    cells = np.repeat(np.arange(len(keys)), corners.shape[1])
    return Coarser(made, weights, parents.ravel(), cells, counts, int(lattice.places.max(axis=0).min()))


def interpolations(mesh: Mesh, n_smallest: int) -> "tuple[sparse.csr_array[Any], ...]":
    """Return the weights of the nodes of a mesh from those of a coarser one, of these from a still coarser one, ...

    Each is as `Coarser.weights`. The last mesh has at most `n_smallest` nodes, or is at most two cells thick: still
    larger cells would be far too stiff in bending. Empty unless the mesh is a lattice.
    """
    found: list[sparse.csr_array[Any]] = []
    while mesh.n_nodes > n_smallest and (step := coarser(mesh)) is not None and step.thickness > 2:
        found.append(step.weights)
        mesh = step.mesh
    return tuple(found)


def _keys(places: Ints, shape: Ints) -> Ints:
    """Return a number for each place, x fastest, of the shape of `places` without its last axis."""
    return np.asarray(places @ np.concatenate([[1], np.cumprod(shape[:-1])]))


def _parity(lowest: Ints) -> Ints:
    """Return which axes have an odd place, as a number of dim bits, shape (n,)."""
    return np.asarray((lowest % 2) @ (1 << np.arange(lowest.shape[1])))


def _lattice(mesh: Mesh) -> _Lattice | None:
    """Return the places of a mesh in a lattice, None if its nodes or elements are not in one."""
    if mesh.element in ("line", MIXED) or mesh.middles is not None:
        return None
    first = mesh.nodes[mesh.elements[0]]
    if len(first) == 2**mesh.dim:  # a cell, of any shape
        corner, *others = mesh.kind.corners[0]
        basis = first[others] - first[corner]
    else:
        basis = np.diag(np.ptp(first, axis=0))
    exact = (mesh.nodes - first[0]) @ np.linalg.inv(basis)
    places = np.rint(exact).astype(np.int64)
    if np.abs(exact - places).max() > _ON_THE_LATTICE:
        return None
    smallest = places.min(axis=0)
    places -= smallest
    of_elements = places[mesh.elements]
    lowest = of_elements.min(axis=1)
    ends = of_elements - lowest[:, None]
    return _Lattice(first[0] + smallest @ basis, basis, places, lowest, ends) if ends.max() == 1 else None


def _divisions(lattice: _Lattice) -> Ints | None:
    """Return the corners of the elements of a cell by the parity of its place, shape (2^dim, elements, k, dim).

    None if cells of one parity are divided differently.
    """
    keys = _keys(lattice.lowest, lattice.places.max(axis=0) + 1)
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    counts = np.diff(starts, append=len(keys))
    if (counts != counts[0]).any():
        return None
    ends = lattice.ends[order].reshape(len(starts), counts[0], *lattice.ends.shape[1:])
    parity = _parity(lattice.lowest[order[starts]])
    found = np.repeat(ends[:1], 2 ** lattice.lowest.shape[1], axis=0)
    there, first = np.unique(parity, return_index=True)
    found[there] = ends[first]
    return found if (ends == found[parity]).all() else None


def _weights(places: Ints, used: Ints, shape: Ints) -> "sparse.csr_array[Any]":
    """Return the interpolation at places of the finer lattice from the coarse nodes with the keys `used`."""
    lower, odd = np.divmod(places, 2)
    rows, columns, values = [], [], []
    for end in np.ndindex(*(2,) * places.shape[1]):
        upper = np.array(end)
        shares = np.where(odd == 1, 0.5, 1.0 - upper).prod(axis=1)
        there = np.flatnonzero(shares)
        rows.append(there)
        columns.append(np.searchsorted(used, _keys(lower[there] + upper, shape)))
        values.append(shares[there])
    at = np.concatenate(rows), np.concatenate(columns)
    return sparse.csr_array((np.concatenate(values), at), shape=(len(places), len(used)))
