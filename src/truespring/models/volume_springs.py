"""Springs with an area or volume term, which gives an isotropic lattice any Poisson's ratio from 0 to 0.5."""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ModelError
from truespring.models.network import SpringNetwork
from truespring.models.spring_data import VOLUME_TERM, SpringData
from truespring.models.volume import VolumeTerm
from truespring.potential import SparseMatrix, VolumeStiffness


@dataclass(frozen=True, eq=False)
class VolumeSprings:
    """The potential of a spring network and an area or volume term on the same nodes."""

    network: SpringNetwork
    term: VolumeTerm

    @property
    def nodes(self) -> Floats:
        """Undeformed positions [m], shape (n_nodes, dim)."""
        return self.network.nodes

    @property
    def springs(self) -> Ints:
        """Node numbers of the springs, shape (n_springs, 2)."""
        return self.network.springs

    @property
    def semidefinite_at_rest(self) -> bool:
        """Whether the springs are, and no volume term is negative: at rest its Hessian is kappa / V0 s s^T."""
        return self.network.semidefinite_at_rest and bool((self.term.kappa >= 0).all())

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]."""
        return self.network.energy(positions) + float(self.term.element_energies(positions).sum())

    def stress(self, positions: Floats) -> Floats:
        """Return tensions of springs [N] and pressures of elements [Pa], shape (n_springs + n_elements,)."""
        return np.concatenate([self.network.stress(positions), self.term.pressure(positions)])

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return the stress extrapolated linearly along `step` [m], as `stress`, shape (n_springs + n_elements,)."""
        tension = self.network.extrapolated_stress(positions, step)
        return np.concatenate([tension, self.term.extrapolated_pressure(positions, step)])

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        return self.network.gradient(positions) + self.term.gradient(positions)

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Return the tangent stiffness [N/m]; `stress`, as from `stress()`, gives the geometric part."""
        stress = self.stress(positions) if stress is None else stress
        tension, pressure = np.split(stress, [len(self.springs)])
        matrix = self._checked(self.network.hessian(positions, tension))
        self.term.add_hessian(positions, pressure, matrix.data)
        return matrix

    def volume_stiffness(self, positions: Floats) -> tuple[VolumeStiffness, ...]:
        """Return the stiffness of the volume term; see Volumetric."""
        return self.term.volume_stiffness(positions)

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the projected Hessian of the springs plus the positive semidefinite part of the term [N/m]."""
        matrix = self._checked(self.network.projected_hessian(positions))
        self.term.add_projected_hessian(positions, matrix.data)
        return matrix

    def _checked(self, matrix: SparseMatrix) -> SparseMatrix:
        """Return the matrix of the network; raise ModelError unless its blocks are those of the volume term."""
        pattern = self.term.pattern
        if not (np.array_equal(matrix.indptr, pattern.starts) and np.array_equal(matrix.indices, pattern.columns)):
            raise ModelError("the springs must join all nodes that share an element of the volume term, and no others")
        return matrix

    def stretch(self, positions: Floats) -> Floats:
        """Return length over rest length of the springs [-], shape (n_springs,)."""
        return self.network.stretch(positions)

    def spring_data(self) -> SpringData:
        """Return springs and volume term as arrays: modulus and undeformed volume of elements, simplices of an element.

        See docs/export/arrays.md."""
        plain = self.network.spring_data()
        return SpringData(self.network, {**plain.arrays, **self.term.arrays}, VOLUME_TERM)

    @property
    def cells(self) -> dict[str, Ints]:
        """Springs as lines, shape (n_springs, 2)."""
        return self.network.cells

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return tension [N], stretch [-], stiffness [N/m] and strain energy [J] of springs, shape (n_springs,) each.

        The volume term is not included."""
        return self.network.cell_fields(positions)
