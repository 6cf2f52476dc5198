"""Benchmark cases: two bodies, two loads, several mesh sizes, the same for all programs.

A rectangle of 8 m by 1 m in plane stress (squares, Poisson's ratio 1/3) and a box of 8 m by 1 m by 1 m (cubes, 1/4),
E = 1 MPa, fixed on the left, with a dead force on the right, distributed consistently over that face. They are slender,
so that the stress singularities at the corners of the fixed face have little effect. The module needs NumPy only, for
the environment of the peers.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

LENGTH = 8.0
YOUNG = 1e6
POISSON = {2: 1 / 3, 3: 1 / 4}

#: Numbers of elements over the height (`depth`), with eight times as many over the length: about 1.3k, 5.2k, 52k, 502k
#: and 1.0M nodes in the plane, 2.4k, 9.8k, 31k, 107k and 306k in space.
SIZES = {2: (12, 25, 80, 250, 354), 3: (6, 10, 15, 23, 33)}

#: Depth of the mesh that springs are solved on before they are timed: large enough to use all threads.
WARM_UP = {2: 25, 3: 10}

#: Depth of the mesh on which peers and springs are compared.
REFERENCE = {2: 80, 3: 15}

#: Depths of the meshes of the second table (time to the same error).
LADDER = {2: (1, 2, 4, 8, 12, 18), 3: (1, 2, 4, 6, 10)}

#: Largest depth of the bodies in tension, which is like bending for all programs, but easier.
STRETCHED = {2: 25, 3: 10}

#: Displacement of the end over the length, of the springs SPRINGS on the smallest mesh: down, or along the axis.
MOVED = {"bending": 0.5, "stretching": 0.25}
SPRINGS = {2: "lloyd", 3: "isotropic"}

#: Total force [N] of that displacement, by benchmarks/find_loads.py, with five digits.
LOADS = {(2, "bending"): -2335.5, (2, "stretching"): 245880.0, (3, "bending"): -2708.8, (3, "stretching"): 286990.0}


@dataclass(frozen=True)
class Case:
    """A body and its load, as plain arrays.

    Attributes:
        nodes: [m], shape (n_nodes, dim), x varies fastest.
        elements: corner nodes in VTK's order, shape (n_elements, 4 or 8).
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


def n_nodes(dim: int, depth: int) -> int:
    """Return the number of nodes of `bar`."""
    return (8 * depth + 1) * (depth + 1) ** (dim - 1)


def bar(dim: int, load: str, depth: int, force: float | None = None) -> Case:
    """Return the body with `depth` elements over its height under a load of MOVED; `force` [N] replaces its size."""
    counts = (8 * depth, *(depth,) * (dim - 1))
    nodes, elements = grid([LENGTH, *(1.0,) * (dim - 1)], counts)
    held = np.repeat(nodes[:, :1] == 0.0, dim, axis=1)
    total = np.zeros(dim)
    total[0 if load == "stretching" else 1] = LOADS[dim, load] if force is None else force
    end = nodes[:, 0] == LENGTH
    shares = np.ones(end.sum())
    for axis in range(1, dim):  # consistent with linear elements: half the weight at the ends
        outer = np.isin(nodes[end, axis], (0.0, 1.0))
        shares *= np.where(outer, 0.5, 1.0) / depth
    applied = np.zeros_like(nodes)
    applied[end] = shares[:, None] * total
    return Case(nodes, elements, held, applied, YOUNG, POISSON[dim])


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
