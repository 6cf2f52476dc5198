"""Shapes that are made here, each a function that returns a Mesh."""

import math
from collections.abc import Sequence

import numpy as np
import psutil

from truespring.errors import MeshError
from truespring.mesh.mesh import Mesh

# What a solve takes at its peak, by the direct factorisation of a plane lattice: its fill grows
# with n log n (physics: 25 million entries at 1e5 nodes, 433 million at 1e6).
_BYTES_PER_NODE_AND_DOUBLING = 450.0


def rectangle(size: Sequence[float], elements: Sequence[int]) -> Mesh:
    """Return a rectangle of quadrilaterals with its lower left corner in the origin.

    Args:
        size: length along x and y [m].
        elements: number of elements along x and y.

    Raises MeshError for sizes that are not positive, counts below one, elements flatter than
    1000:1 and a mesh that cannot fit in memory.
    """
    lengths = _pair(size, "size")
    counts = _pair(elements, "elements")
    if not all(math.isfinite(length) and length > 0 for length in lengths):
        raise MeshError(f"size = {list(size)}: lengths must be positive and finite")
    if not all(float(count).is_integer() and count >= 1 for count in counts):
        raise MeshError(f"elements = {list(elements)}: counts must be whole numbers of at least 1")
    n_x, n_y = int(counts[0]), int(counts[1])
    flatness = (lengths[0] / n_x) / (lengths[1] / n_y)
    if not 1e-3 <= flatness <= 1e3:
        raise MeshError(f"elements of {lengths[0] / n_x:g} m by {lengths[1] / n_y:g} m are flatter than 1000:1")
    refuse_too_large((n_x + 1) * (n_y + 1))
    x, y = np.meshgrid(np.linspace(0, lengths[0], n_x + 1), np.linspace(0, lengths[1], n_y + 1))
    column, row = np.meshgrid(np.arange(n_x), np.arange(n_y))
    first = (row * (n_x + 1) + column).ravel()
    quadrilaterals = np.stack([first, first + 1, first + n_x + 2, first + n_x + 1], axis=1)
    return Mesh(np.stack([x.ravel(), y.ravel()], axis=1), quadrilaterals, "quadrilateral")


def refuse_too_large(n_nodes: int) -> None:
    """Raise MeshError where a plane mesh of `n_nodes` cannot be solved in the memory of this machine."""
    needed = _BYTES_PER_NODE_AND_DOUBLING * n_nodes * max(1.0, math.log2(n_nodes))
    there = psutil.virtual_memory().total
    if needed > there:
        raise MeshError(
            f"a mesh of {n_nodes:,} nodes needs about {needed / 2**30:,.0f} GiB to be solved, "
            f"this machine has {there / 2**30:,.1f} GiB: take fewer elements"
        )


def _pair(values: Sequence[float], name: str) -> tuple[float, float]:
    if len(values) != 2:
        raise MeshError(f"{name} = {list(values)}: a rectangle takes two values, along x and y")
    try:
        return float(values[0]), float(values[1])
    except (TypeError, ValueError):
        raise MeshError(f"{name} = {list(values)}: numbers are wanted, lengths in metres") from None
