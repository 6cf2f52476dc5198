"""Rigid-body modes: translations and infinitesimal rotations of nodes."""

import numpy as np

from truespring.arrays import Floats


def rigid_body_modes(nodes: Floats) -> Floats:
    """Return translations, then rotations about the centre of the nodes, shape (n_dof, 3 or 6), largest component 1.

    `nodes` [m] has shape (n_nodes, dim).
    """
    return modes_at(centred(nodes))


def n_modes(dim: int) -> int:
    """Return the number of rigid-body modes: 3 in the plane, 6 in space."""
    return dim * (dim + 1) // 2


def centred(nodes: Floats) -> Floats:
    """Return positions relative to their centre, divided by the largest coordinate [-], shape (n_nodes, dim).

    Translations and rotations then have the same size.
    """
    places = nodes - nodes.mean(axis=0)
    return np.asarray(places / max(float(np.abs(places).max()), np.finfo(float).tiny))


def modes_at(places: Floats) -> Floats:
    """Return translations, then infinitesimal rotations about the origin [m], shape (n_dof, 3 or 6).

    `places` are positions about the origin, shape (n_nodes, dim).
    """
    n_nodes, dim = places.shape
    turns = [(first, second) for first in range(dim) for second in range(first + 1, dim)]
    modes = np.zeros((n_nodes, dim, dim + len(turns)))
    modes[:, :, :dim] = np.eye(dim)
    for turn, (first, second) in enumerate(turns):
        modes[:, first, dim + turn], modes[:, second, dim + turn] = -places[:, second], places[:, first]
    return modes.reshape(n_nodes * dim, -1)
