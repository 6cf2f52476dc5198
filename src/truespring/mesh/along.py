"""Quadratic forms of the nodes' positions that are the mean square stretch of elements along given directions."""

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.memory import slices
from truespring.mesh.cells import CELL_SHAPES, quadrature


def square_stretch_forms(name: str, nodes: Floats, cells: Ints, along: Floats) -> Floats:
    """Return the integral of (grad N_i . a)(grad N_j . a) over undeformed cells [m^(dim - 2)], shape (n, k, k).

    With positions x of the nodes, the sum of x_i . x_j times the entries is the volume of the cell times the mean of
    a . F^T F a, the square of the stretch along a. Rows sum to zero.

    Args:
        name: a key of CELL_SHAPES.
        nodes: undeformed positions of all nodes [m], shape (n_nodes, dim).
        cells: node numbers, shape (n, k).
        along: the vector a of each cell [-], shape (n, dim).
    """
    shape = CELL_SHAPES[name]
    at, weights = quadrature(shape.base, 2)
    slopes = shape.slopes(at)
    k = cells.shape[1]
    found = np.empty((len(cells), k, k))
    for part in slices(len(cells), 8 * len(at) * k * (shape.dim + 2)):
        jacobian = np.einsum("nki,qka->nqia", nodes[cells[part]], slopes)
        local = np.linalg.solve(jacobian, along[part][:, None, :, None])[..., 0]  # a in reference coordinates
        slope = np.einsum("qka,nqa->nqk", slopes, local)
        volumes = weights * np.linalg.det(jacobian)
        found[part] = (slope * volumes[..., None]).swapaxes(1, 2) @ slope
    return found
