"""Springs with an area or volume term, so that a lattice realises any Poisson's ratio."""

from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from math import factorial

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.mesh import ElementKind
from truespring.models.network import SpringNetwork
from truespring.potential import Pattern, SparseMatrix
from truespring.problem import Problem


@dataclass(frozen=True, eq=False)
class VolumeTerm:
    """Energy kappa/2 V0 (V / V0 - 1)^2 of each element, V its signed area times thickness, or volume.

    `kappa` [Pa], shape (n_elements,). Golec et al., The Visual Computer 36 (2020), for cubes.
    """

    problem: Problem
    kappa: Floats

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.problem.mesh.elements, *self.problem.mesh.nodes.shape)

    @cached_property
    def _form(self) -> Floats:
        section = self.problem.section
        assert section is not None  # the springs beside it need one
        return section.thickness * volume_form(self.problem.mesh.kind)

    @cached_property
    def _at_rest(self) -> Floats:
        return self._volumes(self.problem.mesh.nodes)

    def _places(self, positions: Floats) -> Floats:
        """Nodes of each element from their middle [m], shape (n_elements, n_dof): volumes are small differences."""
        at = positions[self.problem.mesh.elements]
        return np.asarray((at - at.mean(axis=1, keepdims=True)).reshape(len(at), -1))

    def _curvatures(self, places: Floats) -> Floats:
        """Second derivative of each element's volume by its nodes [m], shape (n_elements, n_dof, n_dof)."""
        n_dof = places.shape[1]
        if self._form.ndim == 2:
            return np.broadcast_to(self._form, (len(places), n_dof, n_dof))
        return np.asarray((places @ self._form.reshape(n_dof, -1)).reshape(-1, n_dof, n_dof))

    def _slopes(self, places: Floats) -> Floats:
        """The derivative of each element's volume by its nodes [m^2], shape (n_elements, n_dof)."""
        return np.asarray(np.einsum("eij,ej->ei", self._curvatures(places), places) / (self._form.ndim - 1))

    def _volumes(self, positions: Floats) -> Floats:
        """Signed volume of each element [m^3]; of a plane one area times thickness."""
        places = self._places(positions)
        return np.asarray((self._slopes(places) * places).sum(axis=1) / self._form.ndim)

    def element_energies(self, positions: Floats) -> Floats:
        """Stored energy of each element [J], shape (n_elements,)."""
        return np.asarray(self.kappa / 2 * self._at_rest * (self._volumes(positions) / self._at_rest - 1) ** 2)

    def pressure(self, positions: Floats) -> Floats:
        """kappa (V / V0 - 1), positive in tension [Pa], shape (n_elements,)."""
        return np.asarray(self.kappa * (self._volumes(positions) / self._at_rest - 1))

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        forces = self.pressure(positions)[:, None] * self._slopes(self._places(positions))
        return self._pattern.vector(forces).reshape(positions.shape)

    def hessian(self, positions: Floats, pressure: Floats) -> SparseMatrix:
        """Tangent stiffness [N/m], the curvature of the volumes weighted by `pressure` [Pa]."""
        bent = pressure[:, None, None] * self._curvatures(self._places(positions))
        return self._pattern.matrix(self.stiffening(positions) + bent)

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """What of the Hessian is positive semidefinite everywhere: the stiffness against a change of volume [N/m]."""
        positive = (self.kappa > 0)[:, None, None]
        return self._pattern.matrix(np.where(positive, self.stiffening(positions), 0.0))

    def stiffening(self, positions: Floats) -> Floats:
        """Stiffness of each element against a change of its volume [N/m], shape (n_elements, n_dof, n_dof)."""
        slopes = self._slopes(self._places(positions))
        return np.asarray((self.kappa / self._at_rest)[:, None, None] * slopes[:, :, None] * slopes[:, None, :])


def volume_form(kind: ElementKind) -> Floats:
    """Return the last derivative of an element's area or volume by its nodes: a constant, shape (n_dof,) * dim.

    The area is quadratic in the nodes, the volume cubic: sums of determinants over the simplices.
    """
    dim, n_dof = kind.dim, kind.n_nodes * kind.dim
    signs = np.linalg.det(np.eye(dim)[np.array(list(np.ndindex(*(dim,) * dim)))]).reshape((dim,) * dim)
    axes = "abc"[:dim], "ijk"[:dim]
    rule = (
        ",".join(f"{node}" for node in axes[0]) + f",{axes[1]}->" + "".join(a + i for a, i in zip(*axes, strict=True))
    )
    form = np.zeros((n_dof,) * dim)
    for simplex in kind.simplices:
        edges = np.zeros((dim, kind.n_nodes))  # each edge from the simplex' first node, as a sum of nodes
        edges[np.arange(dim), simplex[1:]], edges[:, simplex[0]] = 1, -1
        form += np.einsum(rule, *edges, signs).reshape(form.shape)
    symmetric = sum(np.transpose(form, order) for order in permutations(range(dim)))
    return np.asarray(symmetric * kind.simplex_weight / factorial(dim))


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
