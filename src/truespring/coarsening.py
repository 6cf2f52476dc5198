"""Coarser problems: the body, its supports and its loads on a mesh of cells twice as large.

Supports and loads are restated by the interpolation P of the fine nodes from the coarse ones, whatever their kind: the
force on the coarse nodes is P^T times that on the fine nodes, whose displacement is P times the coarse one; coarse
nodes are held where the fine ones are.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints
from truespring.conditions import Loading, Turn
from truespring.material import Material
from truespring.mesh import Mesh, coarser
from truespring.models import LAWS
from truespring.potential import Potential, SparseMatrix, is_symmetric, tangent_of
from truespring.problem import Problem, Region

# Shares of a coarse cell that the body fills are rounded to multiples of this, and are at least this.
_SHARE = 1 / 8


@dataclass(frozen=True, eq=False)
class CoarseBody:
    """A body on a coarser mesh, with the interpolation of the nodes of the next finer one.

    The material of a coarse element is that of most of the finer ones in its place; where these fill it in part, its
    moduli are multiplied by their share.

    Attributes:
        original: the problem on the finest mesh.
        mesh: the coarser mesh.
        weights: displacement of the finer nodes from the coarse ones, see `mesh.Coarser`.
        stands_for: number of the element of the original mesh whose material and fibres each element has, shape
            (n_elements,).
        filled: share of each element that the body fills, shape (n_elements,).
        loading: supports and loads on the coarse nodes.
        counts: number of cells along each axis of a coarser mesh, see `mesh.Coarser`.
    """

    original: Problem
    mesh: Mesh
    weights: "sparse.csr_array[Any]"
    stands_for: Ints
    filled: Floats
    loading: Loading
    counts: tuple[int, ...] = ()

    @classmethod
    def finest(cls, problem: Problem, loading: Loading) -> Self:
        """Return a problem on its own mesh; `loading` is that of the problem, or its variant of a linear theory."""
        n_elements = len(problem.mesh.elements)
        weights = sparse.csr_array(sparse.eye_array(problem.mesh.n_nodes))
        return cls(problem, problem.mesh, weights, np.arange(n_elements), np.ones(n_elements), loading)

    def coarser(self) -> "CoarseBody | None":
        """Return the body on a mesh of cells twice as large; None unless the mesh is a lattice, see `mesh.coarser`."""
        found = coarser(self.mesh)
        if found is None:
            return None
        volume = self.filled * np.abs(self.mesh.measures)
        first = np.bincount(found.parents, volume) / np.bincount(found.cells, np.abs(found.mesh.measures))
        filled = np.maximum(np.round(first / _SHARE) * _SHARE, _SHARE)
        stands_for = self.stands_for[_of_the_most(found.parents, self._numbers, volume)]
        return CoarseBody(
            self.original,
            _with_vectors(found.mesh, self.original.mesh, stands_for[found.cells]),
            found.weights,
            stands_for[found.cells],
            filled[found.cells],
            restated(self.loading, self.mesh.nodes, found.mesh.nodes, found.weights),
            found.counts,
        )

    @property
    def _numbers(self) -> Ints:
        """Index of the material of each element in the original problem's `materials`, shape (n_elements,)."""
        return self.original.material_numbers[self.stands_for]

    @cached_property
    def problem(self) -> Problem:
        """The coarse problem without supports and loads, which `loading` has."""
        materials, n_materials = self.original.materials, len(self.original.materials)
        shares, share = np.unique(self.filled, return_inverse=True)
        kinds = share.ravel() * n_materials + self._numbers
        regions = []
        for kind in np.unique(kinds) if materials else ():
            of: Any = np.flatnonzero(kinds == kind)
            share_of_it = float(shares[kind // n_materials])
            regions.append(Region(of, weaker(materials[kind % n_materials], share_of_it)))
        return replace(self.original, mesh=self.mesh, supports=(), loads=(), regions=regions, stated=False)


def _of_the_most(parents: Ints, numbers: Ints, volume: Floats) -> Ints:
    """Return for each parent an element of the material that has the largest volume in it, shape (n_parents,)."""
    n_materials = int(numbers.max()) + 1
    by_material = np.bincount(parents * n_materials + numbers, volume, (int(parents.max()) + 1) * n_materials)
    most = by_material.reshape(-1, n_materials).argmax(axis=1)
    those = np.flatnonzero(numbers == most[parents])
    return np.asarray(those[np.unique(parents[those], return_index=True)[1]])


def _with_vectors(mesh: Mesh, original: Mesh, elements: Ints) -> Mesh:
    """Return a mesh with the vectors of `elements` of the original one."""
    return replace(mesh, element_vectors=original.vectors_of(elements)) if original.element_vectors else mesh


def weaker(material: Material, share: float) -> Material:
    """Return a material with all its moduli multiplied by a share: a cell filled in part."""
    if share == 1.0:
        return material
    constants = {
        name: value * (share if name in _stresses() else 1.0) for name, value in dict(material.constants).items()
    }
    fibres = None if material.fibres is None else replace(material.fibres, k1=share * material.fibres.k1)
    return replace(material, young=share * material.young, constants=constants, fibres=fibres)


def _stresses() -> set[str]:
    """Return the names of the constants of laws that are stresses."""
    return {name for law in LAWS.values() for name, one in law.constants.items() if one.dimension == "stress"}


def restated(loading: Loading, nodes: Floats, coarse_nodes: Floats, weights: "sparse.csr_array[Any]") -> Loading:
    """Return a loading of fine nodes, without interactions, on coarse ones, which interpolate them.

    A coarse direction is held where a held fine one depends on it the most, and moves as the nearest of these do.

    Args:
        loading: that of the fine nodes.
        nodes: fine nodes [m], shape (n_fine, dim).
        coarse_nodes: coarse nodes [m], shape (n_coarse, dim).
        weights: interpolation, sparse, shape (n_fine, n_coarse).
    """
    by_axis = [_means(weights, held) for held in loading.held.T]
    held = np.stack([np.diff(means.indptr) > 0 for means in by_axis], axis=1)

    def coarse(part: Loading) -> Loading:
        displacement = [means @ moved for means, moved in zip(by_axis, part.displacement.T, strict=True)]
        return replace(
            part,
            external_force=weights.T @ part.external_force,
            held=held,
            displacement=np.stack(displacement, axis=1),
            turns=tuple(_turn(turn, weights) for turn in part.turns),
            following=tuple(Interpolated(load, nodes, coarse_nodes, weights) for load in part.following),
        )

    return loading.mapped(coarse)


def _turn(turn: Turn, weights: "sparse.csr_array[Any]") -> Turn:
    """Return the rotation of the coarse nodes that the turned fine nodes hold."""
    turned = np.zeros(weights.shape[0], dtype=bool)
    turned[turn.nodes] = True
    means = _means(weights, turned)
    nodes = np.flatnonzero(np.diff(means.indptr))
    arms = np.zeros((weights.shape[0], turn.arms.shape[1]))
    arms[turn.nodes] = turn.arms
    return turn._replace(nodes=nodes, arms=(means @ arms)[nodes])


def _means(weights: "sparse.csr_array[Any]", chosen: Bools) -> "sparse.csr_array[Any]":
    """Return means over chosen fine nodes for each coarse node that one of them depends on the most.

    Shape (n_coarse, n_fine). The means are over the fine nodes of largest weight; rows of other coarse nodes are empty.
    """
    rows = np.repeat(np.arange(weights.shape[0]), np.diff(weights.indptr))
    strongest = np.maximum.reduceat(weights.data, weights.indptr[:-1])
    most = np.flatnonzero(chosen[rows] & (weights.data >= strongest[rows]))
    largest = np.zeros(weights.shape[1])
    np.maximum.at(largest, weights.indices[most], weights.data[most])
    most = most[weights.data[most] >= largest[weights.indices[most]]]
    coarse, fine = weights.indices[most], rows[most]
    share = 1.0 / np.bincount(coarse, minlength=weights.shape[1])[coarse]
    return sparse.csr_array((share, (coarse, fine)), shape=weights.shape[::-1])


class Interpolated:
    """A potential of fine nodes as a function of the coarse nodes that interpolate their displacement."""

    def __init__(
        self, potential: Potential, fine_nodes: Floats, nodes: Floats, weights: "sparse.csr_array[Any]"
    ) -> None:
        """Store a potential of `fine_nodes` [m], (n_fine, dim), and coarse `nodes` [m]; see `restated`."""
        self.nodes, self._potential, self._fine, self._weights = nodes, potential, fine_nodes, weights

    def _places(self, positions: Floats) -> Floats:
        return np.asarray(self._fine + self._weights @ (positions - self.nodes))

    def energy(self, positions: Floats) -> float:
        """Return the energy [J]."""
        return self._potential.energy(self._places(positions))

    def gradient(self, positions: Floats) -> Floats:
        """Return the derivative by the coarse positions [N], shape (n_nodes, dim)."""
        return np.asarray(self._weights.T @ self._potential.gradient(self._places(positions)))

    def hessian(self, positions: Floats) -> SparseMatrix:
        """Return the second derivative by the coarse positions [N/m], shape (n_dof, n_dof)."""
        return self._interpolated(self._potential.hessian(self._places(positions)))

    @property
    def symmetric(self) -> bool:
        """Whether the fine nodes' force has a potential."""
        return is_symmetric(self._potential)

    def tangent(self, positions: Floats) -> SparseMatrix:
        """Return the derivative of the gradient by the coarse positions [N/m], shape (n_dof, n_dof)."""
        return self._interpolated(tangent_of(self._potential, self._places(positions)))

    def _interpolated(self, fine: SparseMatrix) -> SparseMatrix:
        """Return a matrix of the fine nodes as one of the coarse nodes, shape (n_dof, n_dof)."""
        dim = self.nodes.shape[1]
        moved = sparse.csr_array(sparse.kron(self._weights, sparse.eye_array(dim)))
        matrix = moved.T @ (sparse.csr_array(fine) @ moved)
        return sparse.bsr_array(matrix, blocksize=(dim, dim))
