"""Mechanisms of a network: motions of nodes that change no length of a spring.

Mechanisms that a state of self-stress stiffens are allowed, others are errors (Pellegrino and Calladine, Int. J. Solids
Structures 22, 1986).
"""

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.errors import ModelError
from truespring.models.spring_data import PlainSprings

# Singular values below this share of the largest are zero; networks with more degrees of freedom are not tested.
_ZERO, _MOST = 1e-9, 1000
# Nodes that move at least this share of the largest motion are listed; the largest number of listed nodes.
_NAMED, _SOME = 0.1, 6


def check_mechanism(network: PlainSprings, held: Bools) -> None:
    """Raise ModelError if nodes of an undeformed network can move freely; `held` has shape (n_nodes, dim)."""
    n_nodes, dim = network.nodes.shape
    if max(n_nodes * dim, len(network.springs)) > _MOST:
        return
    loose = _loose_motion(network, ~held)
    if loose is None:
        return
    moved = np.linalg.norm(loose, axis=1)
    nodes = np.flatnonzero(moved > _NAMED * moved.max())
    some = ", ".join(map(str, nodes[:_SOME])) + (", ..." if len(nodes) > _SOME else "")
    raise ModelError(
        f"the network is a mechanism: node{'s' * (len(nodes) != 1)} {some} can move without a change of length of any "
        "spring, and no tension prevents it; add springs or supports"
    )


def _loose_motion(network: PlainSprings, free: Bools) -> Floats | None:
    """Return a motion that strains no spring and that no self-stress stiffens, shape (n_nodes, dim), or None."""
    ends, carrying = network.springs, network.stiffness > 0
    along = network.nodes[ends[:, 1]] - network.nodes[ends[:, 0]]
    length = np.linalg.norm(along, axis=1)
    if np.abs(network.rest_length - length).max() > _ZERO * length.max() or not free.any():
        return None  # springs are prestressed
    ends, along, length = ends[carrying], along[carrying], length[carrying]
    columns = np.flatnonzero(free.ravel())
    lengthening = np.zeros((len(ends), free.size)).reshape(len(ends), *free.shape)
    for side, end in ((-1.0, 0), (1.0, 1)):
        lengthening[np.arange(len(ends)), ends[:, end]] = side * along / length[:, None]
    left, values, right = np.linalg.svd(lengthening.reshape(len(ends), -1)[:, columns])
    rank = int((values > _ZERO * max(values.max(initial=0.0), 1.0)).sum())
    motions, stresses = right[rank:].T, left[:, rank:]
    if not motions.shape[1]:
        return None
    whole = np.zeros((free.size, motions.shape[1]))
    whole[columns] = motions
    apart = whole.reshape(*free.shape, -1)
    apart = apart[ends[:, 1]] - apart[ends[:, 0]]  # relative motion of the ends of each spring
    stiffened = [np.einsum("s,sia,sib->ab", stress / length, apart, apart) for stress in stresses.T]
    _, sizes, modes = np.linalg.svd(np.concatenate([np.zeros((1, motions.shape[1])), *stiffened]))
    sizes = np.append(sizes, np.zeros(len(modes) - len(sizes)))
    loose = modes[sizes <= 1e-7 * max(sizes.max(), 1e-3 / length.max())]
    return None if not len(loose) else (whole @ loose[0]).reshape(free.shape)
