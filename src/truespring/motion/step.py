"""A step in time as a potential: elastic energy, inertia, and damping since the begin of the step."""

from collections.abc import Sequence

import numpy as np

from truespring.arrays import Floats
from truespring.linear.gradients import norm
from truespring.potential import (
    Potential,
    Projectable,
    SparseMatrix,
    Stressed,
    VolumeStiffness,
    Volumetric,
    with_diagonal,
)


class Step:
    """The potential W(x) + c/2 |x - target|^2_M + dashpots(x), whose minimum is the state after a step.

    Attributes:
        nodes: undeformed positions [m], shape (n_nodes, dim).
        elastic: the potential of the body.
        target: positions without forces [m], shape (n_nodes, dim).
    """

    def __init__(
        self, elastic: Potential, inertia: Floats, target: Floats, momentum: float, dashpots: Sequence[Potential]
    ) -> None:
        """Store the parts.

        Args:
            elastic: the potential of the body.
            inertia: c times the mass of each node [N/m], shape (n_nodes,).
            target: positions without forces [m], shape (n_nodes, dim).
            momentum: size of the forces that would stop the body in the step [N].
            dashpots: dissipation of the step, as potentials.
        """
        self.nodes, self.elastic = elastic.nodes, elastic
        self.target = target
        self._inertia, self._momentum, self._dashpots = inertia, momentum, tuple(dashpots)
        self._elastic_size = 0.0

    def energy(self, positions: Floats) -> float:
        """Return the energy of all parts [J]."""
        away = positions - self.target
        kinetic = float((self._inertia[:, None] * away**2).sum()) / 2
        return self.elastic.energy(positions) + kinetic + sum(one.energy(positions) for one in self._dashpots)

    def gradient(self, positions: Floats) -> Floats:
        """Return internal force, inertia and damping [N], shape (n_nodes, dim)."""
        force = self.elastic.gradient(positions)
        self._elastic_size = norm(force)
        force = force + self._inertia[:, None] * (positions - self.target)
        for one in self._dashpots:
            force += one.gradient(positions)
        return force

    def hessian(self, positions: Floats, *stress: Floats) -> SparseMatrix:
        """Return the tangent with inertia and damping [N/m], shape (n_dof, n_dof)."""
        return self._whole(self.elastic.hessian(positions, *stress), positions)

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the tangent with the projected one of the body, if it has one [N/m], shape (n_dof, n_dof)."""
        if not isinstance(self.elastic, Projectable):
            return self.hessian(positions)
        return self._whole(self.elastic.projected_hessian(positions), positions)

    def volume_stiffness(self, positions: Floats) -> tuple[VolumeStiffness, ...]:
        """Return the stiffness of the body against changes of volume, see Volumetric."""
        return self.elastic.volume_stiffness(positions) if isinstance(self.elastic, Volumetric) else ()

    def force_scale(self) -> float:
        """Return the size of the parts of the last gradient, which cancel in balance [N]."""
        return max(self._elastic_size, self._momentum)

    def _whole(self, matrix: SparseMatrix, positions: Floats) -> SparseMatrix:
        dim = self.nodes.shape[1]
        for one in self._dashpots:
            matrix = _sum(matrix, one.hessian(positions), dim)
        return with_diagonal(matrix, self._inertia[:, None, None] * np.eye(dim))


class StressedStep(Step):
    """A step of a body whose geometric stiffness can be built from a given stress, see Stressed."""

    elastic: Stressed

    def stress(self, positions: Floats) -> Floats:
        """Return the stress of the body, see Stressed."""
        return self.elastic.stress(positions)

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return the stress of the body extrapolated along `step` [m], see Stressed."""
        return self.elastic.extrapolated_stress(positions, step)


def step_of(
    elastic: Potential, inertia: Floats, target: Floats, momentum: float, dashpots: Sequence[Potential]
) -> Step:
    """Return a step; arguments as Step."""
    kind = StressedStep if isinstance(elastic, Stressed) else Step
    return kind(elastic, inertia, target, momentum, dashpots)


def _sum(one: SparseMatrix, other: SparseMatrix, dim: int) -> SparseMatrix:
    """Return the sum of matrices in blocks of shape (dim, dim); of the same sparsity by their values."""
    if one.indices is other.indices or (
        len(one.indices) == len(other.indices) and np.array_equal(one.indices, other.indices)
    ):
        return type(one)((one.data + other.data, one.indices, one.indptr), shape=one.shape)
    total = type(one)(one + other, blocksize=(dim, dim))
    total.sort_indices()
    return total
