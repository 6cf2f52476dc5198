"""The protocol between models and solvers, and nothing else.

A model turns a problem into a `Potential`; a solver sees potentials and a `Loading`, never a
spring, an element or a mesh.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints

#: Blocks of one row and column a direction, one for each pair of nodes that share an element.
SparseMatrix = sparse.bsr_array[Any]


# Element matrices are held in slices of so many bytes, which stay in the processor's cache.
_SLICE_BYTES = 4 * 2**20
# References to an array of which only its owner knows: the owner's, and that of the question.
_UNREFERENCED = 2
# Threads share the rows of a slice from so many on.
_SMALLEST_SLAB = 256


@runtime_checkable
class Potential(Protocol):
    """Elastic energy of the node positions.

    `energy` may be infinite where the law does not reach (a collapsed element); the others are
    asked only where it is finite.
    """

    @property
    def nodes(self) -> Floats:
        """Reference positions [m], shape (n_nodes, dim): rigid-body modes and rotations come from them."""
        ...

    def energy(self, positions: Floats) -> float:
        """Stored energy [J]."""
        ...

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        ...

    def hessian(self, positions: Floats) -> SparseMatrix:
        """Tangent stiffness [N/m], symmetric, shape (n_dof, n_dof); dof = node * dim + direction."""
        ...


@runtime_checkable
class Projectable(Potential, Protocol):
    """A potential that knows a positive semidefinite neighbour of its Hessian."""

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Sum of the spring or element Hessians, each projected to its nearest semidefinite one [N/m]."""
        ...


@runtime_checkable
class Stressed(Potential, Protocol):
    """A potential whose geometric stiffness can be built from a given stress (MIP Newton).

    Source: Magisano, Leonetti, Garcea, CMAME 313 (2017), mixed integration points.
    """

    def stress(self, positions: Floats) -> Floats:
        """What multiplies the second derivative of the strain: tension [N] of springs, stress [Pa] of elements."""
        ...

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """The stress at `positions` carried on linearly along `step` [m], as if strain were linear in the nodes."""
        ...

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Tangent stiffness [N/m] with the geometric part of `stress`, by default that of the positions."""
        ...


@runtime_checkable
class Stretched(Potential, Protocol):
    """A potential of springs: which nodes they join, and how far they are stretched."""

    @property
    def springs(self) -> Ints:
        """The two nodes of each spring, shape (n_springs, 2)."""
        ...

    def stretch(self, positions: Floats) -> Floats:
        """Length over rest length, shape (n_springs,)."""
        ...


@runtime_checkable
class Visible(Potential, Protocol):
    """A potential that can be drawn: its cells and what lives on them."""

    @property
    def cells(self) -> Mapping[str, Ints]:
        """Node numbers of the cells by VTK's name of their kind, shape (n_cells, k)."""
        ...

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Values on the cells by name, each of shape (n_cells, ...), kind after kind, SI units."""
        ...


class Turn(NamedTuple):
    """Nodes turned as a rigid body: `arms` [m] to them from the centre, a unit `axis` in space, `angle` [rad]."""

    nodes: Ints
    arms: Floats
    axis: Floats
    angle: float

    def motion(self, share: float) -> Floats:
        """Return the displacement of the nodes [m] turned by a share of the angle, by Rodrigues' formula."""
        sine, cosine = np.sin(share * self.angle), np.cos(share * self.angle)
        arms = np.zeros((len(self.arms), 3))
        arms[:, : self.arms.shape[1]] = self.arms
        along = np.outer(arms @ self.axis, self.axis)
        moved = sine * np.cross(self.axis, arms) + (cosine - 1) * (arms - along)
        return np.asarray(moved[:, : self.arms.shape[1]])


@dataclass(frozen=True)
class Loading:
    """What acts on a potential from outside at load factor 1; every part of it scales with the load factor.

    Attributes:
        external_force: dead load [N], shape (n_nodes, dim).
        held: true where the displacement is prescribed, shape (n_nodes, dim).
        displacement: the prescribed displacement [m], zero where free, shape (n_nodes, dim).
        turns: prescribed rotations, which come on top.
        following: loads that follow the body, as potentials: the energy is minus the work of the load [J].
    """

    external_force: Floats
    held: Bools
    displacement: Floats
    turns: tuple[Turn, ...] = ()
    following: tuple[Potential, ...] = ()

    def __post_init__(self) -> None:
        for array in (self.external_force, self.held, self.displacement):
            array.setflags(write=False)

    def motion(self, load_factor: float = 1.0) -> Floats:
        """Return the prescribed displacement at a load factor [m], zero where free, shape (n_nodes, dim)."""
        motion = load_factor * self.displacement
        for turn in self.turns:
            motion[turn.nodes] += turn.motion(load_factor)
        return np.asarray(motion)

    def force(self, positions: Floats, load_factor: float = 1.0) -> Floats:
        """Return the external force on the nodes at these positions [N], shape (n_nodes, dim)."""
        force = load_factor * self.external_force
        for load in self.following:
            force -= load_factor * load.gradient(positions)
        return np.asarray(force)

    def at_rest(self, nodes: Floats) -> "Loading":
        """Return the loading of a linear theory: loads that follow the body act as they do on the body at rest."""
        return replace(self, external_force=self.force(nodes), following=()) if self.following else self

    @property
    def driven_by_motion(self) -> bool:
        """Whether nothing but prescribed displacements loads the body."""
        return not self.external_force.any() and not self.following


@runtime_checkable
class Refined(Potential, Protocol):
    """A potential with more nodes than the problem's mesh, whose nodes come first."""

    @property
    def parents(self) -> Ints:
        """The two nodes of the mesh midway between which each further node stands, shape (n_further, 2)."""
        ...

    @property
    def elements(self) -> Ints:
        """The nodes of each element, corners first, in VTK's order, shape (n_elements, k)."""
        ...

    @property
    def loading(self) -> Loading:
        """The problem's loading on all its nodes."""
        ...


def on_the_mesh(force: Floats, parents: Ints) -> Floats:
    """Return forces on all nodes of a refined potential [N] as forces on those of the mesh, shape (n_nodes, dim).

    What acts between two nodes of the mesh acts on both by half.
    """
    n_nodes = len(force) - len(parents)
    found, further = force[:n_nodes].copy(), force[n_nodes:]
    for end in (0, 1):
        np.add.at(found, parents[:, end], further / 2)
    return found


class Pattern:
    """The fixed sparsity of a sum of element matrices, built once and filled many times.

    Attributes:
        starts, columns: the nodes that share an element with each node, itself included, ascending.
        slots: the place of each element's blocks among them, shape (n_elements, k, k).
        at_starts, at: the elements at each node, as element * k + its place there.
        zero: as many zeros as there are directions, which tells compiled loops the dimension.
    """

    def __init__(self, elements: Ints, n_nodes: int, dim: int) -> None:
        """Take the node numbers of each element, shape (n_elements, k)."""
        from truespring.kernels import sparsity
        from truespring.kernels.threads import run

        self._room: Floats | None = None
        self.elements = np.ascontiguousarray(elements, dtype=np.int32)
        self.n_nodes, self.dim, self.zero = n_nodes, dim, (0.0,) * dim
        self.at_starts, self.at = sparsity.incidence(self.elements, n_nodes)
        counts = np.zeros(n_nodes, np.int32)
        around = (self.elements, self.at_starts, self.at)
        run(sparsity.count_neighbours, n_nodes, *around, counts)
        self.starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int32)], dtype=np.int32)
        self.columns = np.empty(self.starts[-1], np.int32)
        run(sparsity.fill_neighbours, n_nodes, *around, self.starts, self.columns)
        self.slots = np.empty((*elements.shape, elements.shape[1]), np.int32)
        run(sparsity.fill_slots, len(elements), self.elements, self.starts, self.columns, self.slots)

    def values(self) -> Floats:
        """Return room for the values of a matrix, one block of shape (dim, dim) a pair of nodes; not filled."""
        # Room that nothing refers to any more is used again: the system takes long to give large arrays.
        if self._room is None or sys.getrefcount(self._room) > _UNREFERENCED:
            self._room = np.empty((len(self.columns), self.dim, self.dim))
        return self._room

    def matrix(self, values: Floats) -> SparseMatrix:
        """Return values of shape (n_blocks, dim, dim) as a sparse matrix, without a copy."""
        size = self.n_nodes * self.dim
        return sparse.bsr_array((values, self.columns, self.starts), shape=(size, size))

    def summed(self, blocks: Callable[[int, int], Floats]) -> SparseMatrix:
        """Sum element matrices, which `blocks(first, last)` gives for a slice of the elements, see `add`."""
        values = self.values()
        values[:] = 0.0
        self.add(blocks, values)
        return self.matrix(values)

    def add(self, blocks: Callable[[int, int], Floats], values: Floats) -> None:
        """Add element matrices to the values of a matrix of this pattern, shape (n_blocks, dim, dim).

        `blocks(first, last)` gives those of a slice of the elements, shape (last - first, k * dim, k * dim).
        A slice at a time is held; each thread adds to rows of its own, in the order of the elements.
        """
        from truespring.kernels import sparsity
        from truespring.kernels.threads import run

        n_elements, k = self.elements.shape
        step = max(1, _SLICE_BYTES // (8 * (k * self.dim) ** 2))
        for first in range(0, n_elements, step):
            last = min(first + step, n_elements)
            given = np.ascontiguousarray(blocks(first, last))
            low = int(self.elements[first:last].min())
            rows = int(self.elements[first:last].max()) + 1 - low

            def add(
                begin: int, end: int, first: int = first, last: int = last, given: Floats = given, low: int = low
            ) -> None:
                sparsity.add_blocks(
                    first, last, first, self.elements, self.slots, given, low + begin, low + end, values
                )

            run(add, rows, smallest=_SMALLEST_SLAB)

    def vector(self, values: Floats) -> Floats:
        """Sum vectors of the elements' nodes, shape (n_elements, k * dim), into one of shape (n_nodes, dim)."""
        from truespring.kernels import sparsity
        from truespring.kernels.threads import run

        result = np.zeros((self.n_nodes, self.dim))
        by_node = np.ascontiguousarray(values).reshape(-1, self.dim)
        run(sparsity.add_rows, self.n_nodes, self.elements.shape[1], self.at_starts, self.at, by_node, result)
        return result


def rigid_body_modes(nodes: Floats) -> Floats:
    """Return translations, then infinitesimal rotations about the centre, shape (n_dof, 3 or 6), each of size 1."""
    n_nodes, dim = nodes.shape
    centred = nodes - nodes.mean(axis=0)
    centred = centred / max(float(np.abs(centred).max()), np.finfo(float).tiny)
    modes = [np.tile(np.eye(dim)[axis], n_nodes) for axis in range(dim)]
    for first in range(dim):
        for second in range(first + 1, dim):
            turn = np.zeros((n_nodes, dim))
            turn[:, first], turn[:, second] = -centred[:, second], centred[:, first]
            modes.append(turn.ravel())
    return np.stack(modes, axis=1)
