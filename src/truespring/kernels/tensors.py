"""Loops of the mass-tensor method: forces from displacements by precomputed tensors."""

from typing import Any

import numpy as np

from truespring.kernels.small import dot, minus, plus, put, row, times, unsigned
from truespring.kernels.threads import kernel


@kernel
def _edges(i: int, here: Any, x: Any, rest: Any, starts: Any, columns: Any, tensors: Any, zero: Any) -> Any:
    """Return the sum over a node's edges of tensor times displacement of the other end relative to the node."""
    total = zero
    for p in range(starts[i], starts[i + 1]):
        j = columns[unsigned(p)]
        there = minus(row(x, j, zero), row(rest, j, zero))
        total = plus(total, times(tensors, p, minus(there, here), zero))
    return total


@kernel
def edge_forces(
    first: int, last: int, x: Any, rest: Any, starts: Any, columns: Any, tensors: Any, force: Any, zero: Any
) -> None:
    """Write the force on each node: the sum of edge tensors times relative displacements.

    Shapes: x, rest, force (n_nodes, dim), starts (n_nodes + 1,), columns (n_edges,), tensors (n_edges, dim, dim).
    """
    for i in range(first, last):
        here = minus(row(x, i, zero), row(rest, i, zero))
        put(force, i, _edges(i, here, x, rest, starts, columns, tensors, zero))


@kernel
def edge_energy(first: int, last: int, x: Any, rest: Any, starts: Any, columns: Any, tensors: Any, zero: Any) -> float:
    """Return half the work of the edge forces on the displacements relative to that of the first node.

    Shapes: x, rest (n_nodes, dim), starts (n_nodes + 1,), columns (n_edges,), tensors (n_edges, dim, dim).
    """
    total, o = 0.0, minus(row(x, 0, zero), row(rest, 0, zero))
    for i in range(first, last):
        here = minus(row(x, i, zero), row(rest, i, zero))
        total += dot(minus(here, o), _edges(i, here, x, rest, starts, columns, tensors, zero)) / 2
    return total


@kernel
def _form(x: Any, rest: Any, nodes: Any, w: Any, z: Any, zero: Any) -> None:
    """Write displacements w relative to a simplex's first node, and z: w, then the products w_a . w_b for a <= b."""
    dim = len(zero)
    o = minus(row(x, nodes[0], zero), row(rest, nodes[0], zero))
    for a in range(dim):
        put(w, a, minus(minus(row(x, nodes[a + 1], zero), row(rest, nodes[a + 1], zero)), o))
    place = dim * dim
    for a in range(dim):
        for c in range(dim):
            z[a * dim + c] = w[a, c]
        for b in range(a, dim):
            z[place] = dot(row(w, a, zero), row(w, b, zero))
            place += 1


@kernel
def _multiply(tensor: Any, z: Any, t: Any) -> None:
    """Write t = T z, T symmetric."""
    t[:] = 0.0
    for r in range(len(z)):
        for s in range(len(z)):
            t[s] += z[r] * tensor[r, s]


@kernel
def energies(first: int, last: int, x: Any, rest: Any, elements: Any, tensors: Any, energy: Any, zero: Any) -> None:
    """Write the energy z . T z / 2 of each simplex, with one T for all or one for each.

    Shapes, with m = dim^2 + dim (dim + 1) / 2: x, rest (n_nodes, dim), elements (n_elements, dim + 1), tensors
    (1 or n_elements, m, m), energy (n_elements,).
    """
    dim, size = len(zero), tensors.shape[1]
    w, z, t = np.empty((dim, dim)), np.empty(size), np.empty(size)
    for e in range(first, last):
        _form(x, rest, elements[e], w, z, zero)
        _multiply(tensors[e % len(tensors)], z, t)
        energy[e] = 0.0
        for s in range(size):
            energy[e] += z[s] * t[s] / 2


@kernel
def forces(first: int, last: int, x: Any, rest: Any, elements: Any, tensors: Any, force: Any, zero: Any) -> None:
    """Write the derivative of each simplex's energy by its nodes.

    Shapes, with m = dim^2 + dim (dim + 1) / 2: x, rest (n_nodes, dim), elements (n_elements, dim + 1), tensors
    (1 or n_elements, m, m), force (n_elements, (dim + 1) * dim).
    """
    dim, size = len(zero), tensors.shape[1]
    w, z, t = np.empty((dim, dim)), np.empty(size), np.empty(size)
    for e in range(first, last):
        _form(x, rest, elements[e], w, z, zero)
        _multiply(tensors[e % len(tensors)], z, t)
        place = dim * dim
        for a in range(dim):
            for b in range(a, dim):
                for c in range(dim):
                    t[a * dim + c] += t[place] * w[b, c]
                    t[b * dim + c] += t[place] * w[a, c]
                place += 1
        for c in range(dim):
            force[e, c] = 0.0
            for a in range(dim):
                force[e, (a + 1) * dim + c] = t[a * dim + c]
                force[e, c] -= t[a * dim + c]
