"""Strain components in Voigt's order, and displacements of uniform strains."""

import numpy as np

from truespring.arrays import Floats


def voigt_pairs(dim: int) -> tuple[tuple[int, int], ...]:
    """Return the axes of each component of a strain in Voigt's order: xx, yy, xy, or xx, yy, zz, yz, xz, xy."""
    return ((0, 0), (1, 1), (0, 1)) if dim == 2 else ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def uniform_strain(nodes: Floats, i: int, j: int) -> Floats:
    """Return the displacement of a unit strain ij without rotation [m], shape (n_nodes, dim); engineering shear."""
    moved = np.zeros_like(nodes)
    moved[:, i] += nodes[:, j] / 2
    moved[:, j] += nodes[:, i] / 2
    return moved
