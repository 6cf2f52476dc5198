"""The protocol between models and solvers, and nothing else.

A model turns a problem into a `Potential`; a solver sees potentials and a `Loading`, never a
spring, an element or a mesh.
"""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints

SparseMatrix = sparse.csr_array[Any, tuple[int, int]]


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

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Tangent stiffness [N/m] with the geometric part of `stress`, by default that of the positions."""
        ...


@runtime_checkable
class Stretched(Potential, Protocol):
    """A potential of springs, which can tell how far they are stretched."""

    def stretch(self, positions: Floats) -> Floats:
        """Length over rest length, shape (n_springs,)."""
        ...


@runtime_checkable
class Visible(Potential, Protocol):
    """A potential that can be drawn: its cells and what lives on them."""

    @property
    def cells(self) -> tuple[str, Ints]:
        """VTK name of the cells and their node numbers, shape (n_cells, k)."""
        ...

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Values on the cells by name, each of shape (n_cells, ...), SI units."""
        ...


@dataclass(frozen=True)
class Loading:
    """What acts on a potential from outside at load factor 1; every part of it scales linearly.

    Attributes:
        external_force: dead load [N], shape (n_nodes, dim).
        held: true where the displacement is prescribed, shape (n_nodes, dim).
        displacement: the prescribed displacement [m], zero where free, shape (n_nodes, dim).
    """

    external_force: Floats
    held: Bools
    displacement: Floats

    def __post_init__(self) -> None:
        for array in (self.external_force, self.held, self.displacement):
            array.setflags(write=False)

    @property
    def driven_by_motion(self) -> bool:
        """Whether nothing but prescribed displacements loads the body."""
        return not self.external_force.any()


@runtime_checkable
class Refined(Potential, Protocol):
    """A potential with more nodes than the problem's mesh, whose nodes come first."""

    @property
    def parents(self) -> Ints:
        """The two nodes of the mesh midway between which each further node stands, shape (n_further, 2)."""
        ...

    @property
    def loading(self) -> Loading:
        """The problem's loading on all its nodes."""
        ...


class Pattern:
    """The fixed sparsity of a sum of small dense blocks, built once and filled many times."""

    def __init__(self, elements: Ints, n_nodes: int, dim: int) -> None:
        """Take node numbers of each block, shape (n_blocks, k)."""
        self.dofs = (elements[:, :, None] * dim + np.arange(dim)).reshape(len(elements), -1)
        self.n_dof = n_nodes * dim
        size = self.dofs.shape[1]
        keys = (np.repeat(self.dofs, size, axis=1) * self.n_dof + np.tile(self.dofs, (1, size))).ravel()
        entries, self._place = np.unique(keys, return_inverse=True)
        rows, self._columns = np.divmod(entries, self.n_dof)
        self._starts = np.searchsorted(rows, np.arange(self.n_dof + 1))

    def matrix(self, blocks: Floats) -> SparseMatrix:
        """Sum blocks of shape (n_blocks, k * dim, k * dim) into a matrix."""
        values = np.bincount(self._place, blocks.ravel(), len(self._columns)).astype(np.float64, copy=False)
        return sparse.csr_array((values, self._columns, self._starts), shape=(self.n_dof, self.n_dof))

    def vector(self, blocks: Floats) -> Floats:
        """Sum blocks of shape (n_blocks, k * dim) into a vector of shape (n_dof,)."""
        return np.bincount(self.dofs.ravel(), blocks.ravel(), self.n_dof).astype(np.float64, copy=False)
