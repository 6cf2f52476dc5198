"""Loops over elements whose volume is a weighted sum of determinants over their simplices.

The determinant is that of the edges from a simplex's first node; of a triangle, that of its two edges and the unit
vector normal to the plane. Its second derivative by two nodes a, b maps v to v x w, with w that unit vector, or the
edge d - c of a tetrahedron abcd.
"""

from typing import Any

import numpy as np
from numba.extending import overload

from truespring.kernels.small import dot, minus
from truespring.kernels.threads import kernel

# Pairs of nodes of a triangle; pairs of nodes of a tetrahedron, each followed by the other two in even permutation.
_CYCLE = ((0, 1), (1, 2), (2, 0))
_OPPOSITE = ((0, 1, 2, 3), (0, 2, 3, 1), (0, 3, 1, 2), (1, 2, 0, 3), (1, 3, 2, 0), (2, 3, 0, 1))


def _place(x, i, zero):
    """Return row i of an array of shape (n, len(zero)) as a vector in space."""


@overload(_place)
def _place_in_space(x, i, zero):
    return {2: lambda x, i, zero: (x[i, 0], x[i, 1], 0.0), 3: lambda x, i, zero: (x[i, 0], x[i, 1], x[i, 2])}[len(zero)]


@kernel
def _cross(a: Any, b: Any) -> Any:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def _edges(x: Any, nodes: Any, simplex: Any, zero: Any) -> Any:
    """Return the edges from a simplex's first node; the third one of a triangle is the normal."""
    o = _place(x, nodes[simplex[0]], zero)
    first = minus(_place(x, nodes[simplex[1]], zero), o)
    second = minus(_place(x, nodes[simplex[2]], zero), o)
    third = minus(_place(x, nodes[simplex[-1]], zero), o) if len(zero) == 3 else (0.0, 0.0, 1.0)
    return first, second, third


@kernel
def _add(rows: Any, i: int, factor: float, v: Any) -> None:
    """Add factor v to row i."""
    rows[i, 0] += factor * v[0]
    rows[i, 1] += factor * v[1]
    rows[i, 2] += factor * v[2]


@kernel
def slopes(x: Any, nodes: Any, simplices: Any, weight: float, slope: Any, zero: Any) -> None:
    """Write the derivative of an element's volume by its nodes, shape (k, 3)."""
    slope[:] = 0.0
    for simplex in simplices:
        first, second, third = _edges(x, nodes, simplex, zero)
        by_first, by_second = _cross(second, third), _cross(third, first)
        _add(slope, simplex[1], weight, by_first)
        _add(slope, simplex[2], weight, by_second)
        _add(slope, simplex[0], -weight, by_first)
        _add(slope, simplex[0], -weight, by_second)
        if len(zero) == 3:
            by_third = _cross(first, second)
            _add(slope, simplex[3], weight, by_third)
            _add(slope, simplex[0], -weight, by_third)


@kernel
def volumes(
    first: int, last: int, x: Any, elements: Any, simplices: Any, weight: float, volume: Any, zero: Any
) -> None:
    """Write the volume of each element.

    Shapes: x (n_nodes, dim), elements (n_elements, k), simplices (n_simplices, dim + 1), volume (n_elements,).
    """
    for e in range(first, last):
        total = 0.0
        for simplex in simplices:
            one, two, three = _edges(x, elements[e], simplex, zero)
            total += dot(one, _cross(two, three))
        volume[e] = weight * total


@kernel
def growths(
    first: int, last: int, x: Any, step: Any, elements: Any, simplices: Any, weight: float, growth: Any, zero: Any
) -> None:
    """Write the change of each element's volume that is linear in a step.

    Shapes: x, step (n_nodes, dim), elements (n_elements, k), simplices (n_simplices, dim + 1), growth (n_elements,).
    """
    dim, k = len(zero), elements.shape[1]
    slope = np.empty((k, 3))
    for e in range(first, last):
        slopes(x, elements[e], simplices, weight, slope, zero)
        growth[e] = 0.0
        for a in range(k):
            for c in range(dim):
                growth[e] += slope[a, c] * step[elements[e, a], c]


@kernel
def forces(
    first: int, last: int, x: Any, elements: Any, simplices: Any, weight: float, pressure: Any, force: Any, zero: Any
) -> None:
    """Write the pressure times the derivative of each element's volume by its nodes.

    Shapes: x (n_nodes, dim), elements (n_elements, k), simplices (n_simplices, dim + 1), pressure (n_elements,), force
    (n_elements, k * dim).
    """
    dim, k = len(zero), elements.shape[1]
    slope = np.empty((k, 3))
    for e in range(first, last):
        slopes(x, elements[e], simplices, weight, slope, zero)
        for a in range(k):
            for c in range(dim):
                force[e, a * dim + c] = pressure[e] * slope[a, c]


@kernel
def turns(x: Any, nodes: Any, simplices: Any, weight: float, turn: Any, zero: Any) -> None:
    """Write the vector w of each pair of an element's nodes, shape (k, k, 3)."""
    turn[:] = 0.0
    for simplex in simplices:
        if len(zero) == 2:
            for a, b in _CYCLE:
                turn[simplex[a], simplex[b], 2] += weight
                turn[simplex[b], simplex[a], 2] -= weight
        else:
            for a, b, c, d in _OPPOSITE:
                w = minus(_place(x, nodes[simplex[d]], zero), _place(x, nodes[simplex[c]], zero))
                _add(turn[simplex[a]], simplex[b], weight, w)
                _add(turn[simplex[b]], simplex[a], -weight, w)


@kernel
def stiffnesses(
    first: int,
    last: int,
    x: Any,
    elements: Any,
    simplices: Any,
    weight: float,
    stiffness: Any,
    pressure: Any,
    blocks: Any,
    zero: Any,
) -> None:
    """Write the stiffness of each element: stiffness s s^T, s the derivative of the volume, plus the geometric part.

    Shapes: x (n_nodes, dim), elements (n_elements, k), simplices (n_simplices, dim + 1), stiffness, pressure
    (n_elements,), blocks (n_elements, k * dim, k * dim).
    """
    dim, k = len(zero), elements.shape[1]
    slope, turn = np.empty((k, 3)), np.empty((k, k, 3))
    for e in range(first, last):
        slopes(x, elements[e], simplices, weight, slope, zero)
        turns(x, elements[e], simplices, weight * pressure[e], turn, zero)
        for a in range(k):
            for b in range(k):
                for i in range(dim):
                    for j in range(dim):
                        blocks[e, a * dim + i, b * dim + j] = stiffness[e] * slope[a, i] * slope[b, j]
                for c in range(3):
                    i, j = (c + 1) % 3, (c + 2) % 3
                    if i < dim and j < dim:
                        blocks[e, a * dim + i, b * dim + j] += turn[a, b, c]
                        blocks[e, a * dim + j, b * dim + i] -= turn[a, b, c]
