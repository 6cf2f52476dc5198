"""Protocols between models and solvers.

A model makes a `Potential` from a problem. A solver uses potentials and a `Loading`; it has no access to springs,
elements or meshes.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from scipy import sparse

from truespring.arrays import Floats, Ints, ShortInts

#: Blocks of shape (dim, dim), one for each pair of nodes that share an element.
SparseMatrix = sparse.bsr_array[Any]


def with_diagonal(matrix: SparseMatrix, blocks: Floats, nodes: Ints | None = None) -> SparseMatrix:
    """Return a matrix plus blocks on its diagonal, of the sparsity of the matrix.

    The matrix has all diagonal blocks, or those of the rows of one process; others are left out. `blocks` has shape
    (n, dim, dim), `nodes` (n,), in any order, each once; None for all nodes.
    """
    if not len(blocks):
        return matrix
    rows = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
    diagonal = np.flatnonzero(matrix.indices == rows)
    data = matrix.data.copy()  # the matrix may belong to the potential
    place = np.full(len(matrix.indptr) - 1, -1)
    place[rows[diagonal]] = diagonal
    place = place if nodes is None else place[nodes]
    data[place[place >= 0]] += blocks[place >= 0]
    return sparse.bsr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)


@runtime_checkable
class Potential(Protocol):
    """Elastic energy as a function of the positions of the nodes, shape (n_nodes, dim).

    `energy` may be infinite where the law is not defined (a collapsed element); solvers evaluate the other methods only
    where it is finite.
    """

    @property
    def nodes(self) -> Floats:
        """Undeformed positions [m], shape (n_nodes, dim); rigid-body modes and rotations follow from them."""
        ...

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]."""
        ...

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        ...

    def hessian(self, positions: Floats) -> SparseMatrix:
        """Return the tangent stiffness [N/m], symmetric, shape (n_dof, n_dof); dof = node * dim + direction."""
        ...


@runtime_checkable
class Unsymmetric(Potential, Protocol):
    """A load that follows the body, whose force may have no potential; `energy` then depends on the path.

    `gradient` is minus the force. `hessian` is symmetric in any case: the symmetric part of the tangent.
    """

    @property
    def symmetric(self) -> bool:
        """Whether the tangent of the free directions is symmetric: the force has a potential."""
        ...

    def tangent(self, positions: Floats) -> SparseMatrix:
        """Return the derivative of the gradient [N/m], not symmetric, shape (n_dof, n_dof)."""
        ...


def is_symmetric(load: Potential) -> bool:
    """Return whether the force of a load has a potential, that is, whether its tangent is symmetric."""
    return not isinstance(load, Unsymmetric) or load.symmetric


def tangent_of(load: Potential, positions: Floats) -> SparseMatrix:
    """Return the tangent of a load at positions [m] for Newton's method [N/m], shape (n_dof, n_dof).

    Symmetric if the load has a potential.
    """
    if isinstance(load, Unsymmetric) and not load.symmetric:
        return load.tangent(positions)
    return load.hessian(positions)


@runtime_checkable
class Projectable(Potential, Protocol):
    """A potential with a positive semidefinite approximation of its Hessian."""

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return a sum of semidefinite matrices of springs or elements that are near their Hessians [N/m].

        Symmetric, shape (n_dof, n_dof).
        """
        ...


@runtime_checkable
class Stressed(Potential, Protocol):
    """A potential whose geometric stiffness can be built from a given stress (mixed integration points).

    Source: Magisano, Leonetti, Garcea, CMAME 313 (2017).
    """

    def stress(self, positions: Floats) -> Floats:
        """Return the stress conjugate to the strain: tension [N], shape (n_springs,), or stress [Pa] at Gauss points.

        The shape of the latter is (components, n_elements, n_points)."""
        ...

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return the stress at `positions` plus its linear change along `step` [m], shaped as `stress` returns it."""
        ...

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Return the tangent stiffness [N/m] with the geometric part of `stress`, by default that of the positions.

        Symmetric, shape (n_dof, n_dof).
        """
        ...


@runtime_checkable
class Scaled(Potential, Protocol):
    """A potential of several parts, whose forces cancel in balance, as those of inertia and of elasticity."""

    def force_scale(self) -> float:
        """Return the size of the parts of the last gradient [N], to which an unbalanced force is compared."""
        ...


@runtime_checkable
class Damper(Protocol):
    """Dashpots beside springs or elements."""

    def measure(self, positions: Floats) -> Sequence[Floats]:
        """Return the lengths or strains of the dashpots at positions [m], shape (n_nodes, dim)."""
        ...

    def since(self, measures: Sequence[Floats], time: float) -> tuple[Potential, ...]:
        """Return the dashpots as springs of `time` [-] times their elastic stiffness, relaxed at `measures`."""
        ...


@runtime_checkable
class Massive(Protocol):
    """A model with the mass of its nodes."""

    @property
    def mass(self) -> Floats:
        """Mass of the nodes [kg], shape (n_nodes,); empty for that of the problem."""
        ...


@runtime_checkable
class Unstressed(Potential, Protocol):
    """A potential that may state without an eigenvalue problem that its undeformed body is stable."""

    @property
    def semidefinite_at_rest(self) -> bool:
        """Whether the Hessian at `nodes` is known to have no negative eigenvalue, but for rounding errors."""
        ...


class ConstantCells(NamedTuple):
    """Elements of one kind with springs of zero rest length and constant stiffness, and a pressure in each.

    The energy of an element is shear / 2 times the quadratic form of its matrix, plus its undeformed volume times the
    law of the volume, whose derivative by ln J is offset + slope ln J in space; see `kernels.pressures`.

    Attributes:
        elements: node numbers, shape (n_elements, k).
        matrices: quadratic forms by class [m], shape (n_classes, k, k); rows sum to zero.
        of: the class of each element, shape (n_elements,).
        shear: shear modulus [Pa], shape (n_elements,).
        undeformed: undeformed volume [m^3], area times thickness in 2D, shape (n_elements,).
        across: shear modulus in plane stress, else 0 [Pa], shape (n_elements,).
        offset, slope: of the derivative of the energy density by ln J [Pa], shape (n_elements,).
        simplices: simplices of an element, whose weighted sum is its volume, shape (n_simplices, dim + 1).
        weight: factor of the sum of their determinants [-], or [m] in 2D.
    """

    elements: ShortInts
    matrices: Floats
    of: Ints
    shear: Floats
    undeformed: Floats
    across: Floats
    offset: Floats
    slope: Floats
    simplices: Ints
    weight: float


@runtime_checkable
class Explicit(Potential, Protocol):
    """A potential whose force compiled loops may compute."""

    @property
    def constant_springs(self) -> tuple[ConstantCells, ...] | None:
        """The elements by kind; None if the potential has another form."""
        ...


class VolumeStiffness(NamedTuple):
    """The stiffness of cells of one kind against changes of their volume.

    The tangent contains stiffness s s^T of each cell, s its slope.

    Attributes:
        elements: nodes of each cell, shape (n_cells, k).
        slope: derivative of the volume by the nodes [m^2], shape (n_cells, k, dim).
        stiffness: second derivative of the energy by the volume [N/m^5], shape (n_cells,).
        shear: shear modulus in the same form, that is times the undeformed over the squared volume [N/m^5].
    """

    elements: ShortInts
    slope: Floats
    stiffness: Floats
    shear: Floats


@runtime_checkable
class Volumetric(Potential, Protocol):
    """A potential that knows how much of its tangent is a stiffness against changes of volume."""

    def volume_stiffness(self, positions: Floats) -> tuple[VolumeStiffness, ...]:
        """Return the stiffness of the cells by kind; empty if the law has none of this form."""
        ...


def volumes_of(potential: Potential) -> Callable[[Floats], tuple[VolumeStiffness, ...]] | None:
    """Return the function that gives the stiffness against changes of volume; None if a potential has none."""
    return potential.volume_stiffness if isinstance(potential, Volumetric) else None


@runtime_checkable
class Stretched(Potential, Protocol):
    """A potential of springs."""

    @property
    def springs(self) -> Ints:
        """The two nodes of each spring, shape (n_springs, 2)."""
        ...

    def stretch(self, positions: Floats) -> Floats:
        """Return length over rest length [-], shape (n_springs,)."""
        ...


@runtime_checkable
class Noted(Protocol):
    """A potential whose fields need an explanation."""

    @property
    def cell_note(self) -> str:
        """A sentence on the fields of `cell_fields`, without a full stop."""
        ...


@runtime_checkable
class Visible(Potential, Protocol):
    """A potential that can be drawn: cells, and fields on them."""

    @property
    def cells(self) -> Mapping[str, Ints]:
        """Node numbers of the cells, shape (n_cells, k), by VTK's name of their kind."""
        ...

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return values on the cells in SI units, by name, each of shape (n_cells, ...), in the order of `cells`."""
        ...
