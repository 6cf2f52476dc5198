"""Potentials whose elements are shared among processes.

Each process owns nodes. It computes the elements of its nodes, those of the boundary on several processes, and from
them the complete forces and rows of the tangent at its nodes. The stored energy counts each element once, on the
process of the lowest rank among its nodes. Positions and forces of all nodes are on all processes.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from scipy import sparse

from truespring.arrays import Floats, Ints, ShortInts
from truespring.conditions import Loading
from truespring.errors import ModelError
from truespring.models import Model
from truespring.potential import (
    Potential,
    Projectable,
    SparseMatrix,
    Stressed,
    Unstressed,
    is_symmetric,
    tangent_of,
)
from truespring.problem import Problem
from truespring.ranks import Communicator, Layout, bisected


@runtime_checkable
class _Part(Stressed, Projectable, Protocol):
    """A potential of some elements."""


class Piece:
    """The part of a potential at the nodes of one process; nothing is exchanged.

    Attributes:
        layout: the nodes of each process.
        n_elements, n_ghosts: number of elements, and of those among them whose energy another process counts.
    """

    def __init__(self, model: Model, problem: Problem, layout: Layout) -> None:
        """Build the potential of the elements at the nodes of this process; `model` is one of `Model.on_pieces`."""
        self.layout, self._shape = layout, problem.mesh.nodes.shape
        elements, rank = problem.mesh.elements, layout.ranks.rank
        owners = layout.owner[elements]
        touching = (owners == rank).any(axis=1)
        own, ghosts = np.flatnonzero(touching), np.flatnonzero(touching & (owners.min(axis=1) < rank))
        del owners, touching
        others = np.unique(elements[own])
        others = others[layout.owner[others] != rank]
        self._nodes = np.concatenate([layout.owned, others])
        self._part = _built(model, problem, own, self._nodes)
        self._ghost_nodes = np.unique(elements[ghosts])
        self._ghosts = _built(model, problem, ghosts, self._ghost_nodes) if len(ghosts) else None
        self.n_elements, self.n_ghosts = len(own), len(ghosts)
        self._known: tuple[ShortInts, ShortInts, ShortInts] | None = None

    def energy(self, positions: Floats) -> float:
        """Return the stored energy of the elements that this process counts [J]."""
        whole = self._part.energy(positions[self._nodes])
        if self._ghosts is None or not np.isfinite(whole):
            return whole
        return whole - self._ghosts.energy(positions[self._ghost_nodes])

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force at the own nodes [N], shape (n_nodes, dim), zero elsewhere."""
        found = np.zeros(self._shape)
        found[self.layout.owned] = self._part.gradient(positions[self._nodes])[: len(self.layout.owned)]
        return found

    def hessian(self, positions: Floats, *stress: Floats) -> SparseMatrix:
        """Return the rows of the own nodes of the tangent [N/m], shape (n_dof, n_dof), the others empty."""
        return self._rows(self._part.hessian(positions[self._nodes], *stress))

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the rows of the own nodes of the projected tangent [N/m], shape (n_dof, n_dof), the others empty."""
        return self._rows(self._part.projected_hessian(positions[self._nodes]))

    def stress(self, positions: Floats) -> Floats:
        """Return the stress of the elements of this process, see Stressed."""
        return self._part.stress(positions[self._nodes])

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return the stress of the elements of this process, extrapolated along `step` [m], see Stressed."""
        return self._part.extrapolated_stress(positions[self._nodes], step[self._nodes])

    @property
    def semidefinite_at_rest(self) -> bool:
        """Whether the elements of this process are known to have no negative eigenvalue without deformation."""
        return isinstance(self._part, Unstressed) and self._part.semidefinite_at_rest

    def _rows(self, matrix: SparseMatrix) -> SparseMatrix:
        """Return the rows of the own nodes with the numbers of all nodes; values are not copied."""
        n_dof = self._shape[0] * self._shape[1]
        starts, columns = self._sparsity(matrix.indptr, matrix.indices)
        return sparse.bsr_array((matrix.data[: len(columns)], columns, starts), shape=(n_dof, n_dof))

    def _sparsity(self, starts: ShortInts, columns: ShortInts) -> tuple[ShortInts, ShortInts]:
        """Return the blocks of the own rows with the numbers of all nodes, computed once for the same columns."""
        owned = self.layout.owned
        n_blocks = int(starts[len(owned)])
        if self._known is None or (self._known[0] is not columns and not np.array_equal(self._known[0], columns)):
            counts = np.zeros(self._shape[0] + 1, np.int32)
            counts[1 + owned] = np.diff(starts[: len(owned) + 1])
            self._known = (columns, np.cumsum(counts, dtype=np.int32), self._nodes[columns[:n_blocks]].astype(np.int32))
        return self._known[1:]


def _built(model: Model, problem: Problem, numbers: Ints, nodes: Ints) -> _Part:
    """Return the potential of some elements on their nodes."""
    potential = model.potential(problem.part(numbers, nodes))
    assert isinstance(potential, _Part)  # what `Model.on_pieces` returns has such potentials
    return potential


class Piecewise:
    """A potential that processes share, each with its Piece.

    All processes call the same functions in the same order. An exception on one is raised on all.

    Attributes:
        layout: the nodes of each process.
        nodes: undeformed positions of all nodes [m], shape (n_nodes, dim).
    """

    def __init__(self, model: Model, problem: Problem, ranks: Communicator) -> None:
        """Divide the nodes among the processes, and build the part of this one.

        Raises ModelError if the energy of the model is not a sum over elements on the nodes of the mesh, or if there
        are fewer nodes than processes.
        """
        self._ranks = ranks
        self._piece = ranks.together(lambda: _own_piece(model, problem, ranks))
        self.layout = self._piece.layout
        self.nodes = problem.mesh.nodes

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]."""
        return self._ranks.sum(self._ranks.together(lambda: self._piece.energy(positions)))

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        return self._ranks.joined(self._ranks.together(lambda: self._piece.gradient(positions)))

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Return the rows of the own nodes of the tangent [N/m], shape (n_dof, n_dof), see Stressed."""
        given = () if stress is None else (stress,)
        return self._ranks.together(lambda: self._piece.hessian(positions, *given))

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the rows of the own nodes of the projected tangent [N/m], shape (n_dof, n_dof)."""
        return self._ranks.together(lambda: self._piece.projected_hessian(positions))

    def stress(self, positions: Floats) -> Floats:
        """Return the stress of the elements of this process, see Stressed."""
        return self._ranks.together(lambda: self._piece.stress(positions))

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return the stress of the elements of this process, extrapolated along `step` [m], see Stressed."""
        return self._ranks.together(lambda: self._piece.extrapolated_stress(positions, step))

    @cached_property
    def semidefinite_at_rest(self) -> bool:
        """Whether the tangent without deformation is known to have no negative eigenvalue."""
        known = self._ranks.together(lambda: self._piece.semidefinite_at_rest)
        return self._ranks.largest(float(not known)) == 0.0


def _own_piece(model: Model, problem: Problem, ranks: Communicator) -> Piece:
    """Return the piece of this process; raise ModelError if the body cannot be divided."""
    nodes = problem.mesh.nodes
    if len(nodes) < ranks.size:
        raise ModelError(f"{len(nodes)} nodes cannot be shared among {ranks.size} processes: start fewer")
    summed = model.on_pieces(problem)
    if summed is None:
        raise ModelError(
            f"{model.label_on(problem)}: several processes need an energy that is a sum over elements of first order: "
            'start one process, set element = "linear" for finite elements, or use springs by a rule with sharing = '
            '"summed" and without volume'
        )
    return Piece(summed, problem, Layout(ranks, bisected(nodes, ranks.size)))


@dataclass(frozen=True, eq=False)
class _OwnRows:
    """A load that follows the body, with the rows of the own nodes of its tangent.

    Attributes:
        load: the load on all nodes.
        layout: the nodes of each process.
    """

    load: Potential
    layout: Layout

    @property
    def nodes(self) -> Floats:
        """Undeformed positions [m], shape (n_nodes, dim)."""
        return self.load.nodes

    def energy(self, positions: Floats) -> float:
        """Return minus the work of the load [J]."""
        return self.load.energy(positions)

    def gradient(self, positions: Floats) -> Floats:
        """Return minus the force of the load [N], shape (n_nodes, dim)."""
        return self.load.gradient(positions)

    def hessian(self, positions: Floats) -> SparseMatrix:
        """Return the rows of the own nodes [N/m], shape (n_dof, n_dof), the others empty."""
        return self._own(self.load.hessian(positions))

    @property
    def symmetric(self) -> bool:
        """Whether the load has a potential."""
        return is_symmetric(self.load)

    def tangent(self, positions: Floats) -> SparseMatrix:
        """Return the rows of the own nodes of the tangent [N/m], shape (n_dof, n_dof), the others empty."""
        return self._own(tangent_of(self.load, positions))

    def _own(self, matrix: SparseMatrix) -> SparseMatrix:
        """Return the rows of the own nodes of a matrix, the others empty."""
        dim = self.nodes.shape[1]
        own = np.repeat((self.layout.owner == self.layout.ranks.rank).astype(np.float64), dim)
        return sparse.bsr_array(sparse.diags_array(own) @ sparse.csr_array(matrix), blocksize=(dim, dim))


def own_rows(loading: Loading, layout: Layout) -> Loading:
    """Return a loading whose following loads have the rows of the own nodes of their tangents."""
    return loading.mapped(
        lambda part: replace(part, following=tuple(_OwnRows(load, layout) for load in part.following))
    )
