"""Springs with an area or volume term, so that a lattice realises any Poisson's ratio."""

from dataclasses import dataclass
from functools import cached_property
from math import factorial

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.models.network import SpringNetwork
from truespring.potential import Pattern, SparseMatrix
from truespring.problem import Problem


@dataclass(frozen=True, eq=False)
class VolumeTerm:
    """Energy kappa/2 V0 (V / V0 - 1)^2 of each element, V its signed area times thickness, or volume.

    `kappa` [Pa], shape (n_elements,). Golec et al., The Visual Computer 36 (2020), for cubes. The
    volume of a hexahedron is the mean of its two divisions into five tetrahedra, which is exact.
    """

    problem: Problem
    kappa: Floats

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.problem.mesh.elements, *self.problem.mesh.nodes.shape)

    @cached_property
    def _simplices(self) -> Ints:
        return np.array(self.problem.mesh.kind.simplices)

    @property
    def _thickness(self) -> float:
        section = self.problem.section
        assert section is not None  # the springs beside it need one
        return section.thickness

    @cached_property
    def _at_rest(self) -> Floats:
        return self._volumes(self.problem.mesh.nodes)

    def _volumes(self, positions: Floats) -> Floats:
        """Signed volume of each element [m^3]; of a plane one area times thickness."""
        return self._thickness * self.problem.mesh.measures_at(positions)

    @property
    def _share(self) -> float:
        """The volume of an element over the sum of the determinants of its simplices."""
        kind = self.problem.mesh.kind
        return self._thickness * kind.simplex_weight / factorial(kind.dim)

    def element_energies(self, positions: Floats) -> Floats:
        """Stored energy of each element [J], shape (n_elements,)."""
        return np.asarray(self.kappa / 2 * self._at_rest * (self._volumes(positions) / self._at_rest - 1) ** 2)

    def pressure(self, positions: Floats) -> Floats:
        """kappa (V / V0 - 1), positive in tension [Pa], shape (n_elements,)."""
        return np.asarray(self.kappa * (self._volumes(positions) / self._at_rest - 1))

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        forces = self.pressure(positions)[:, None, None] * self._slopes(positions)
        return self._pattern.vector(forces).reshape(positions.shape)

    def _slopes(self, positions: Floats) -> Floats:
        """The derivative of each element's volume by its nodes [m^2], shape (n_elements, nodes, dim)."""
        mesh = self.problem.mesh
        at = positions[mesh.elements]
        slopes = np.zeros_like(at)
        for simplex in self._simplices:
            spans = at[:, simplex[1:]] - at[:, simplex[:1]]
            cofactors = _cofactors(spans)
            slopes[:, simplex[1:]] += cofactors
            slopes[:, simplex[0]] -= cofactors.sum(axis=1)
        return np.asarray(slopes * self._share)

    def hessian(self, positions: Floats, pressure: Floats) -> SparseMatrix:
        """Tangent stiffness [N/m], the curvature of the volumes weighted by `pressure` [Pa]."""
        blocks = self.stiffening(positions)
        return self._pattern.matrix(blocks + pressure[:, None, None] * self._curvatures(positions))

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """What of the Hessian is positive semidefinite everywhere: the stiffness against a change of volume [N/m]."""
        positive = (self.kappa > 0)[:, None, None]
        return self._pattern.matrix(np.where(positive, self.stiffening(positions), 0.0))

    def stiffening(self, positions: Floats) -> Floats:
        """Stiffness of each element against a change of its volume [N/m], shape (n_elements, n_dof, n_dof)."""
        slopes = self._slopes(positions).reshape(len(self.kappa), -1)
        return np.asarray((self.kappa / self._at_rest)[:, None, None] * slopes[:, :, None] * slopes[:, None, :])

    def _curvatures(self, positions: Floats) -> Floats:
        """Second derivative of each element's volume by its nodes, shape (n_elements, n_dof, n_dof)."""
        mesh = self.problem.mesh
        at = positions[mesh.elements]
        n_elements, n_local, dim = at.shape
        curvature = np.zeros((n_elements, n_local, dim, n_local, dim))
        for simplex in self._simplices:
            spans = at[:, simplex[1:]] - at[:, simplex[:1]]
            first, others = simplex[0], simplex[1:]
            for i in range(dim):
                for j in range(dim):
                    if i == j:
                        continue
                    block = _mixed_derivative(spans, i, j)
                    a, b = others[i], others[j]
                    for node, other, sign in ((a, b, 1), (a, first, -1), (first, b, -1), (first, first, 1)):
                        curvature[:, node, :, other, :] += sign * block
        return np.asarray(curvature.reshape(n_elements, n_local * dim, -1) * self._share)


def _cofactors(spans: Floats) -> Floats:
    """Derivative of the determinant by its rows, shape (n, dim, dim)."""
    if spans.shape[1] == 2:
        a, b = spans[:, 0], spans[:, 1]
        return np.stack([np.stack([b[:, 1], -b[:, 0]], axis=1), np.stack([-a[:, 1], a[:, 0]], axis=1)], axis=1)
    return np.stack([np.cross(spans[:, (i + 1) % 3], spans[:, (i + 2) % 3]) for i in range(3)], axis=1)


def _mixed_derivative(spans: Floats, i: int, j: int) -> Floats:
    """Second derivative of the determinant by rows i and j, shape (n, dim, dim)."""
    n, dim = spans.shape[:2]
    if dim == 2:
        turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
        return np.broadcast_to(turn if i < j else -turn, (n, 2, 2))
    c = spans[:, 3 - i - j] * (1.0 if (i + 1) % 3 == j else -1.0)
    zero = np.zeros(n)
    # det = r_i . (r_j x r_k) for (i, j, k) in order: the derivative by r_i and r_j is -[r_k]x transposed.
    return np.stack(
        [
            np.stack([zero, c[:, 2], -c[:, 1]], axis=1),
            np.stack([-c[:, 2], zero, c[:, 0]], axis=1),
            np.stack([c[:, 1], -c[:, 0], zero], axis=1),
        ],
        axis=1,
    )


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

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        return self.network.gradient(positions) + self.term.gradient(positions)

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Tangent stiffness [N/m]; `stress` as `stress()` gives it makes the geometric part."""
        given = self.stress(positions) if stress is None else stress
        tension, pressure = np.split(given, [len(self.springs)])
        return self.network.hessian(positions, tension) + self.term.hessian(positions, pressure)

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """The projected springs, and of the term what is positive semidefinite [N/m]."""
        return self.network.projected_hessian(positions) + self.term.projected_hessian(positions)

    def stretch(self, positions: Floats) -> Floats:
        """Length over rest length of the springs, shape (n_springs,)."""
        return self.network.stretch(positions)

    @property
    def cells(self) -> tuple[str, Ints]:
        """The springs as lines, shape (n_springs, 2)."""
        return self.network.cells

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Tension, stretch, stiffness and strain energy of each spring, without the volume term."""
        return self.network.cell_fields(positions)
