"""Loops of the mass-tensor method: forces from displacements by tensors that were computed once."""

from typing import Any

import numpy as np

from truespring.kernels.small import dot, minus, plus, put, row, times, unsigned
from truespring.kernels.threads import kernel


@kernel
def _edges(i: int, here: Any, x: Any, rest: Any, starts: Any, columns: Any, tensors: Any, zero: Any) -> Any:
    """The sum of the tensors of a node's edges times the displacement of their far ends relative to its own."""
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
    """The force on each node."""
    for i in range(first, last):
        here = minus(row(x, i, zero), row(rest, i, zero))
        put(force, i, _edges(i, here, x, rest, starts, columns, tensors, zero))


@kernel
def edge_energy(first: int, last: int, x: Any, rest: Any, starts: Any, columns: Any, tensors: Any, zero: Any) -> float:
    """Half the work of these forces on the displacements relative to that of the body's first node."""
    total, o = 0.0, minus(row(x, 0, zero), row(rest, 0, zero))
    for i in range(first, last):
        here = minus(row(x, i, zero), row(rest, i, zero))
        total += dot(minus(here, o), _edges(i, here, x, rest, starts, columns, tensors, zero)) / 2
    return total


@kernel
def _form(x: Any, rest: Any, nodes: Any, w: Any, z: Any, zero: Any) -> None:
    """Displacements w relative to a simplex' first node, and z: these, then their scalar products a <= b."""
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
    """t = T z, T symmetric."""
    t[:] = 0.0
    for r in range(len(z)):
        for s in range(len(z)):
            t[s] += z[r] * tensor[r, s]


@kernel
def energies(first: int, last: int, x: Any, rest: Any, elements: Any, tensors: Any, energy: Any, zero: Any) -> None:
    """z . T z / 2 of each simplex; there is one T, or each has its own."""
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
    """The derivative of each simplex' energy by its nodes, shape (n_elements, k * dim)."""
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
