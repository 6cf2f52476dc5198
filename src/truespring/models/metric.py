"""The energy of the change of the metric tensor on a regular grid: squares of products of finite differences."""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.memory import slices
from truespring.potential import Pattern, SparseMatrix
from truespring.problem import Problem


class Component(NamedTuple):
    """Where a cell has a component ij of the metric tensor: the corners from which differences along i and j lead."""

    i: int
    j: int
    corners: Ints


def components(dim: int) -> tuple[Component, ...]:
    """Return the components of the metric tensor of a cell whose corners count x first, then y, then z.

    G_ii lives on every edge along i, G_ij on every face along i and j, at its first corner.
    """
    every = np.arange(2**dim)
    pairs = combinations_with_replacement(range(dim), 2)
    return tuple(Component(i, j, every[(every & (2**i | 2**j)) == 0]) for i, j in pairs)


@dataclass(frozen=True, eq=False)
class MetricPotential:
    """Energy sum w (B . C - B0 . C0)^2 over the products of two differences B, C of the positions of a cell's corners.

    With p = 2 w (B . C - B0 . C0): force p C at the end of B, p B at that of C, the opposite at their origin; Hessian
    2 w dq dq^T and p times that of the product, which is constant.

    Attributes:
        cells: nodes of each cell, corners in the order of `components`, shape (n_cells, 4 or 8).
        weights: [J/m^4], shape (n_cells, n_products), in the order of `components`.
    """

    problem: Problem
    cells_by_corner: Ints
    weights: Floats

    @property
    def nodes(self) -> Floats:
        """Reference positions [m], shape (n_nodes, dim)."""
        return self.problem.mesh.nodes

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.cells_by_corner, *self.nodes.shape)

    @cached_property
    def _differences(self) -> tuple[Floats, Floats]:
        """What the corners give to the two differences of each product, both of shape (n_products, corners)."""
        eye = np.eye(self.cells_by_corner.shape[1])
        parts = components(self.nodes.shape[1])
        first = [eye[one.corners + 2**one.i] - eye[one.corners] for one in parts]
        second = [eye[one.corners + 2**one.j] - eye[one.corners] for one in parts]
        return np.concatenate(first), np.concatenate(second)

    @cached_property
    def _curvature(self) -> Floats:
        """Second derivative of each product along one direction, shape (n_products, corners^2)."""
        first, second = self._differences
        both = np.einsum("sa,sb->sab", first, second)
        return np.asarray((both + both.swapaxes(1, 2)).reshape(len(first), -1))

    def _taken(self, positions: Floats, part: slice) -> tuple[Floats, Floats]:
        """The two differences of each product of some cells [m], both of shape (n, n_products, dim)."""
        at = positions[self.cells_by_corner[part]]
        return self._differences[0] @ at, self._differences[1] @ at

    def _slices(self) -> list[slice]:
        return list(slices(len(self.cells_by_corner), 64 * self.weights.shape[1] * self.nodes.shape[1]))

    @cached_property
    def _at_rest(self) -> Floats:
        """The products at rest [m^2], shape (n_cells, n_products)."""
        return self._products(self.nodes)

    def _products(self, positions: Floats) -> Floats:
        found = np.empty(self.weights.shape)
        for part in self._slices():
            first, second = self._taken(positions, part)
            found[part] = (first * second).sum(axis=2)
        return found

    def energy(self, positions: Floats) -> float:
        """Stored energy [J]."""
        return float(self._cell_energies(positions).sum())

    def _cell_energies(self, positions: Floats) -> Floats:
        return np.asarray((self.weights * (self._products(positions) - self._at_rest) ** 2).sum(axis=1))

    def stress(self, positions: Floats) -> Floats:
        """The derivative p of the energy by each product of differences [N/m], shape (n_cells, n_products)."""
        return 2 * self.weights * (self._products(positions) - self._at_rest)

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """The stress carried on linearly along `step` [m], in N/m, shape (n_cells, n_products)."""
        stress = self.stress(positions)
        for part in self._slices():
            (first, second), (more, other) = self._taken(positions, part), self._taken(step, part)
            stress[part] += 2 * self.weights[part] * (first * other + more * second).sum(axis=2)
        return stress

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        stress, force = self.stress(positions), np.empty((*self.cells_by_corner.shape, self.nodes.shape[1]))
        one, other = self._differences
        for part in self._slices():
            first, second = self._taken(positions, part)
            pull = stress[part, :, None]
            force[part] = one.T @ (pull * second) + other.T @ (pull * first)
        return self._pattern.vector(force.reshape(len(force), -1))

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Tangent stiffness [N/m]; `stress` [N/m] makes the geometric part, by default that of the positions."""
        given = self.stress(positions) if stress is None else stress
        return self._pattern.summed(lambda first, last: self._matrices(positions, given, slice(first, last)))

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Sum of the Hessians of the cells, each with its negative eigenvalues cut off [N/m]."""
        stress = self.stress(positions)

        def positive(first: int, last: int) -> Floats:
            values, vectors = np.linalg.eigh(self._matrices(positions, stress, slice(first, last)))
            return np.asarray((vectors * np.maximum(values, 0.0)[:, None]) @ vectors.swapaxes(1, 2))

        return self._pattern.summed(positive)

    def _matrices(self, positions: Floats, stress: Floats, part: slice) -> Floats:
        """Tangent stiffness of some cells [N/m], shape (n, n_dof, n_dof), dofs corner by corner."""
        first, second = self._taken(positions, part)
        one, other = self._differences
        n, dim, corners = len(first), self.nodes.shape[1], self.cells_by_corner.shape[1]
        change = one[:, :, None] * second[:, :, None] + other[:, :, None] * first[:, :, None]
        change = change.reshape(n, -1, corners * dim)
        matrices = change.swapaxes(1, 2) @ (2 * self.weights[part, :, None] * change)
        along = (stress[part] @ self._curvature).reshape(n, corners, corners)
        blocks = matrices.reshape(n, corners, dim, corners, dim)
        for axis in range(dim):
            blocks[:, :, axis, :, axis] += along
        return matrices

    @property
    def cells(self) -> tuple[str, Ints]:
        """The elements, shape (n_cells, corners)."""
        return self.problem.mesh.kind.vtk, self.problem.mesh.elements

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Strain energy of each element [J]."""
        return {"strain_energy": self._cell_energies(positions)}
