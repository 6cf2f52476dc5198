"""The protocol between models and solvers, and nothing else.

A model turns a problem into a `Potential`; a solver sees potentials and a `Loading`, never a
spring, an element or a mesh.
"""

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from scipy import sparse

from truespring.arrays import Floats, Ints

#: Blocks of one row and column a direction, one for each pair of nodes that share an element.
SparseMatrix = sparse.bsr_array[Any]


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
