"""The energy of the change of the metric tensor on a regular grid, by finite differences."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints, ShortInts
from truespring.assembly import Pattern
from truespring.models.semidefinite import semidefinite
from truespring.potential import SparseMatrix
from truespring.problem import Problem

# Smallest number of cells for which threads share the work.
_SMALLEST_PIECE = 64


class Component(NamedTuple):
    """A component ij of the metric tensor of a cell: the corners at which the differences along i and j start."""

    i: int
    j: int
    corners: Ints


def components(dim: int) -> tuple[Component, ...]:
    """Return the components of the metric tensor of a cell; corners are numbered along x first, then y, then z.

    G_ii is defined on every edge along i, G_ij on every face along i and j, at its first corner.
    """
    every = np.arange(2**dim)
    pairs = combinations_with_replacement(range(dim), 2)
    return tuple(Component(i, j, every[(every & (2**i | 2**j)) == 0]) for i, j in pairs)


@dataclass(frozen=True, eq=False)
class MetricPotential:
    """The energy sum w (B . C - B0 . C0)^2 over products of differences B, C of the corner positions of a cell.

    With p = 2 w (B . C - B0 . C0): force p C at the end of B, p B at the end of C, the opposite at their common start;
    Hessian 2 w dq dq^T plus p times the constant Hessian of the product q = B . C. Source: Terzopoulos, Platt, Barr and
    Fleischer (SIGGRAPH 1987).

    Attributes:
        cells_by_corner: nodes of each cell, corners in the order of `components`, shape (n_cells, 4 or 8).
        weights: w [J/m^4], shape (n_cells, n_products), in the order of `components`.
    """

    problem: Problem
    cells_by_corner: Ints
    weights: Floats

    @property
    def nodes(self) -> Floats:
        """Undeformed positions [m], shape (n_nodes, dim)."""
        return self.problem.mesh.nodes

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.cells_by_corner, *self.nodes.shape)

    @cached_property
    def _ends(self) -> Ints:
        """Corners of each product of differences: common start and two ends, shape (n_products, 3)."""
        parts = components(self.nodes.shape[1])
        ends = [np.stack([one.corners, one.corners + 2**one.i, one.corners + 2**one.j], axis=1) for one in parts]
        return np.concatenate(ends)

    def _run(self, kernel: Callable[..., Any], *arguments: Any) -> None:
        """Run a kernel on all cells in parallel."""
        from truespring.kernels.threads import run

        run(kernel, len(self.weights), *arguments, self._pattern.zero, smallest=_SMALLEST_PIECE)

    @property
    def _place(self) -> tuple[ShortInts, Ints]:
        """Arguments of kernels: nodes of the cells, and corners of the products."""
        return self._pattern.elements, self._ends

    @cached_property
    def _at_rest(self) -> Floats:
        """The undeformed products [m^2], shape (n_cells, n_products)."""
        return self._products(self.nodes)

    def _products(self, positions: Floats) -> Floats:
        from truespring.kernels import metric
        from truespring.kernels.threads import writable

        found = np.empty(self.weights.shape)
        self._run(metric.products, writable(positions), *self._place, found)
        return found

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]."""
        return float(self._cell_energies(positions).sum())

    def _cell_energies(self, positions: Floats) -> Floats:
        return np.asarray((self.weights * (self._products(positions) - self._at_rest) ** 2).sum(axis=1))

    def stress(self, positions: Floats) -> Floats:
        """Return the derivatives p of the energy with respect to the products [N/m], shape (n_cells, n_products)."""
        return 2 * self.weights * (self._products(positions) - self._at_rest)

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return the stress extrapolated linearly along `step` [m], in N/m, shape (n_cells, n_products)."""
        from truespring.kernels import metric
        from truespring.kernels.threads import writable

        growth = np.empty(self.weights.shape)
        self._run(metric.growths, writable(positions), writable(step), *self._place, growth)
        return self.stress(positions) + 2 * self.weights * growth

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        from truespring.kernels import metric
        from truespring.kernels.threads import writable

        force = np.empty((len(self.weights), self.cells_by_corner.shape[1] * self._pattern.dim))
        self._run(metric.forces, writable(positions), *self._place, self.stress(positions), force)
        return self._pattern.vector(force)

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Return the tangent stiffness [N/m]; `stress` [N/m] gives the geometric part, by default the current one."""
        geometric = self.stress(positions) if stress is None else stress
        return self._pattern.summed(lambda first, last: self._matrices(positions, geometric, first, last))

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the sum of the Hessians of the cells, each with its negative eigenvalues set to zero [N/m]."""
        stress = self.stress(positions)

        def positive(first: int, last: int) -> Floats:
            return semidefinite(self._matrices(positions, stress, first, last), self._pattern.dim)

        return self._pattern.summed(positive)

    def _matrices(self, positions: Floats, stress: Floats, first: int, last: int) -> Floats:
        """Return the tangent stiffness of a slice of the cells [N/m], shape (n, n_dof, n_dof), corner by corner."""
        from truespring.kernels import metric
        from truespring.kernels.threads import run, writable

        cells, ends = self._place
        n_dof = cells.shape[1] * self._pattern.dim
        blocks, here = np.empty((last - first, n_dof, n_dof)), slice(first, last)
        known = (writable(positions), cells[here], ends, self.weights[here], writable(stress)[here])
        run(metric.stiffnesses, last - first, *known, blocks, self._pattern.zero, smallest=_SMALLEST_PIECE)
        return blocks

    @property
    def cells(self) -> dict[str, Ints]:
        """The elements by VTK name of their kind, shape (n_cells, corners)."""
        return self.problem.mesh.cells

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return the strain energy of each element [J], shape (n_cells,)."""
        return {"strain_energy": self._cell_energies(positions)}
