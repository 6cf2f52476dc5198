"""Benchmark cases: bodies of squares and cubes under one force, several mesh sizes, the same for all programs.

Each body is fixed on the left, with a dead force on the right, distributed consistently over that face; E = 1 MPa. A
rectangle of 8 m by 1 m in plane stress (Poisson's ratio 1/3) and a box of 8 m by 1 m by 1 m (1/4) are slender, so that
the stress singularities at the corners of the fixed face have little effect; a block of 4 m by 1 m by 1 m is nearly
incompressible (0.45). The module needs NumPy only, for the environment of the peers.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

YOUNG = 1e6


@dataclass(frozen=True)
class Body:
    """A body and its load.

    Attributes:
        length: over height [-]; the height is 1 m.
        poisson: Poisson's ratio [-].
        force: total force [N], by benchmarks/find_loads.py, with five digits.
        axis: direction of the force.
        moved: displacement of the end over the length, of Gaussian springs on the smallest mesh.
    """

    length: int
    poisson: float
    force: float
    axis: int
    moved: float


#: Bodies by dimension and name of the load.
BODIES = {
    (2, "bending"): Body(8, 1 / 3, -2596.1, 1, 0.5),
    (3, "bending"): Body(8, 1 / 4, -2613.9, 1, 0.5),
    (3, "soft block"): Body(4, 0.45, -10000.0, 1, 0.5),
    (2, "stretching"): Body(8, 1 / 3, 211550.0, 0, 0.25),
    (3, "stretching"): Body(8, 1 / 4, 215240.0, 0, 0.25),
}

#: Numbers of elements over the height (`depth`), with eight times as many over the length: about 1.3k, 5.2k, 52k, 502k
#: and 1.0M nodes in the plane, 2.4k, 9.8k, 31k, 107k, 306k and 983k in space.
SIZES = {2: (12, 25, 80, 250, 354), 3: (6, 10, 15, 23, 33, 49)}

#: Depth of the mesh that is solved before a solve is timed: large enough to use all threads.
WARM_UP = {2: 25, 3: 10}

#: Depth of the mesh on which peers and springs are compared.
REFERENCE = {2: 80, 3: 15}

#: Depth of the mesh on which an older commit is compared.
OLDER = {2: 354, 3: 33}

#: Depths of the meshes of the tables of the time to the same error.
LADDER = {
    (2, "bending"): (1, 2, 4, 8, 12, 18),
    (3, "bending"): (1, 2, 4, 6, 10),
    (3, "soft block"): (1, 2, 3, 4, 6, 8, 12),
}

#: Largest depth of the bodies in tension, which is like bending for all programs, but easier.
STRETCHED = {2: 25, 3: 10}


@dataclass(frozen=True)
class Case:
    """A body and its load, as plain arrays.

    Attributes:
        nodes: [m], shape (n_nodes, dim), x varies fastest.
        elements: nodes in VTK's order, shape (n_elements, 4, 8 or 20).
        held: true for fixed directions, shape (n_nodes, dim).
        force: dead load [N], shape (n_nodes, dim).
        young, poisson: [Pa], [-]; the thickness in the plane is 1 m.
    """

    nodes: NDArray[np.float64]
    elements: NDArray[np.int64]
    held: NDArray[np.bool_]
    force: NDArray[np.float64]
    young: float
    poisson: float

    @classmethod
    def read(cls, file: Path | str) -> Self:
        """Read a file of `write`."""
        with np.load(file) as stored:
            arrays = dict(stored)
        return cls(**arrays | {name: float(arrays[name]) for name in ("young", "poisson")})

    def write(self, file: Path) -> None:
        """Write the arrays to an .npz file."""
        np.savez(file, **vars(self))

    @property
    def dim(self) -> int:
        """2 or 3."""
        return self.nodes.shape[1]

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé constants lambda, mu [Pa]."""
        mu = self.young / (2 * (1 + self.poisson))
        return self.young * self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson)), mu

    @property
    def lam_within(self) -> float:
        """First Lamé constant of St. Venant-Kirchhoff [Pa]; in plane stress that of the two-dimensional law."""
        lam, mu = self.lame
        return lam if self.dim == 3 else 2 * lam * mu / (lam + 2 * mu)

    def tip(self, displacement: NDArray[np.float64]) -> float:
        """Return the mean displacement of the loaded end along the load [m], weighted by the nodal forces.

        `displacement` [m] has shape (n_nodes, dim).
        """
        total = np.linalg.norm(self.force.sum(axis=0))
        return float((self.force * displacement).sum() / total)

    @property
    def at_samples(self) -> NDArray[np.bool_]:
        """True for the nodes that every mesh of the body has, the fixed ones excepted, shape (n_nodes,)."""
        return np.isclose(self.nodes, np.round(self.nodes)).all(axis=1) & ~self.held.any(axis=1)

    def sampled(self, displacement: NDArray[np.float64]) -> list[list[float]]:
        """Return the displacement [m] at `at_samples`, x varying fastest; `displacement` has shape (n_nodes, dim)."""
        order = np.lexsort(np.round(self.nodes[self.at_samples]).T)
        return displacement[self.at_samples][order].tolist()


def n_nodes(dim: int, load: str, depth: int) -> int:
    """Return the number of nodes of `bar`."""
    return (BODIES[dim, load].length * depth + 1) * (depth + 1) ** (dim - 1)


def bar(dim: int, load: str, depth: int, force: float | None = None) -> Case:
    """Return a body of BODIES with `depth` elements over its height; `force` [N] replaces the size of its load."""
    body = BODIES[dim, load]
    counts = (body.length * depth, *(depth,) * (dim - 1))
    nodes, elements = grid([body.length, *(1.0,) * (dim - 1)], counts)
    held = np.repeat(nodes[:, :1] == 0.0, dim, axis=1)
    total = np.zeros(dim)
    total[body.axis] = body.force if force is None else force
    end = nodes[:, 0] == body.length
    shares = np.ones(end.sum())
    for axis in range(1, dim):  # consistent with linear elements: half the weight at the ends
        outer = np.isin(nodes[end, axis], (0.0, 1.0))
        shares *= np.where(outer, 0.5, 1.0) / depth
    applied = np.zeros_like(nodes)
    applied[end] = shares[:, None] * total
    return Case(nodes, elements, held, applied, YOUNG, body.poisson)


# Edges of a hexahedron, in the order of the middle nodes of 20-node elements in VTK.
_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
# Face on the right: of these corners in the order around it and the middles of its edges.
_RIGHT = ((1, 2, 6, 5), (9, 18, 13, 17))


def serendipity(case: Case) -> Case:
    """Return a case in space with 20-node elements of the same corners, and the force consistent with them."""
    ends = np.sort(case.elements[:, _EDGES].reshape(-1, 2), axis=1)
    edges, place = np.unique(ends, axis=0, return_inverse=True)
    nodes = np.concatenate([case.nodes, case.nodes[edges].mean(axis=1)])
    elements = np.concatenate([case.elements, len(case.nodes) + place.reshape(-1, len(_EDGES))], axis=1)
    held = np.concatenate([case.held, case.held[edges].all(axis=1)])
    corners, middles = (elements[:, list(face)] for face in _RIGHT)
    loaded = nodes[corners, 0].min(axis=1) == nodes[:, 0].max()
    shares = np.zeros(len(nodes))
    np.add.at(shares, corners[loaded], -1 / 12)
    np.add.at(shares, middles[loaded], 1 / 3)
    force = (shares / loaded.sum())[:, None] * case.force.sum(axis=0)
    return replace(case, nodes=nodes, elements=elements, held=held, force=force)


def grid(size: Sequence[float], counts: Sequence[int]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return nodes [m], shape (n_nodes, dim), and elements, shape (n_elements, 4 or 8), of a regular grid."""
    axes = [np.linspace(0, length, count + 1) for length, count in zip(size, counts, strict=True)]
    nodes = np.stack([axis.ravel() for axis in np.meshgrid(*axes[::-1], indexing="ij")][::-1], axis=1)
    numbers = np.arange(len(nodes)).reshape([count + 1 for count in counts[::-1]])
    ring = ((0, 0), (0, 1), (1, 1), (1, 0))  # of y and x, counter-clockwise
    corners = ring if len(counts) == 2 else [(layer, *corner) for layer in (0, 1) for corner in ring]
    cells = [
        numbers[tuple(slice(start, start + count) for start, count in zip(corner, counts[::-1], strict=True))].ravel()
        for corner in corners
    ]
    return nodes, np.stack(cells, axis=1)
