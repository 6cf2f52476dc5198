"""Springs with an area or volume term, with which an isotropic lattice has any Poisson's ratio from 0 on."""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ModelError
from truespring.models.network import SpringNetwork
from truespring.models.spring_data import VOLUME_TERM, SpringData
from truespring.models.volume import VolumeTerm
from truespring.potential import SparseMatrix


@dataclass(frozen=True, eq=False)
class VolumeSprings:
    """A spring network and the area or volume term on the same nodes."""

    network: SpringNetwork
    term: VolumeTerm

    @property
    def nodes(self) -> Floats:
        """Reference positions [m], shape (n_nodes, dim)."""
        return self.network.nodes

    @property
    def springs(self) -> Ints:
        """Node numbers of the springs, shape (n_springs, 2)."""
        return self.network.springs

    def energy(self, positions: Floats) -> float:
        """Stored energy [J]."""
        return self.network.energy(positions) + float(self.term.element_energies(positions).sum())

    def stress(self, positions: Floats) -> Floats:
        """Tension of the springs [N], then pressure of the elements [Pa], shape (n_springs + n_elements,)."""
        return np.concatenate([self.network.stress(positions), self.term.pressure(positions)])

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Tensions [N] and pressures [Pa] carried on linearly along `step` [m], shape (n_springs + n_elements,)."""
        tension = self.network.extrapolated_stress(positions, step)
        return np.concatenate([tension, self.term.extrapolated_pressure(positions, step)])

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        return self.network.gradient(positions) + self.term.gradient(positions)

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Tangent stiffness [N/m]; `stress` as `stress()` gives it makes the geometric part."""
        given = self.stress(positions) if stress is None else stress
        tension, pressure = np.split(given, [len(self.springs)])
        matrix = self._checked(self.network.hessian(positions, tension))
        self.term.add_hessian(positions, pressure, matrix.data)
        return matrix

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """The projected springs, and of the term what is positive semidefinite [N/m]."""
        matrix = self._checked(self.network.projected_hessian(positions))
        self.term.add_projected_hessian(positions, matrix.data)
        return matrix

    def _checked(self, matrix: SparseMatrix) -> SparseMatrix:
        """Return the network's matrix, to whose values those of the term are then added: it has the same blocks."""
        pattern = self.term.pattern
        if not (np.array_equal(matrix.indptr, pattern.starts) and np.array_equal(matrix.indices, pattern.columns)):
            raise ModelError("the springs do not join the very nodes that share an element of the volume term")
        return matrix

    def stretch(self, positions: Floats) -> Floats:
        """Length over rest length of the springs, shape (n_springs,)."""
        return self.network.stretch(positions)

    def spring_data(self) -> SpringData:
        """Return the springs, and kappa of the area or volume term [Pa], shape (n_elements,)."""
        plain = self.network.spring_data()
        return SpringData(self.network, {**plain.arrays, "kappa": self.term.kappa}, VOLUME_TERM)

    @property
    def cells(self) -> dict[str, Ints]:
        """The springs as lines, shape (n_springs, 2)."""
        return self.network.cells

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Tension, stretch, stiffness and strain energy of each spring, without the volume term."""
        return self.network.cell_fields(positions)
