"""Gaussian springs between all nodes of triangles and tetrahedra of second order."""

from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.assembly import pairs_of_nodes
from truespring.models.cell_fields import CHANGE_OF_TENSION, beside, stretch
from truespring.models.fem_potential import FemPotential, of_one_kind
from truespring.models.fibres import stiff_fibres
from truespring.models.gaussian_weights import ROUNDING, integrated
from truespring.models.law import Constants, Law, Response
from truespring.models.laws import LAWS, law_constants
from truespring.models.quadratic import QuadraticPotential
from truespring.models.quadratic_mean import QuadraticMeanPotential
from truespring.models.spring_data import PRESSURE, SpringData
from truespring.models.symmetric import identity, trace
from truespring.problem import Problem


def _without_springs(law: Law) -> Law:
    """Return the neo-Hookean law without mu/2 tr C, the part of the springs."""

    def respond(C: Floats, constants: Constants) -> Response:
        return _less(law.respond(C, constants), trace(C), identity(C), constants.mu)

    def current(b: Floats, constants: Constants) -> Response:
        assert law.current is not None
        return _less(law.current(b, constants), trace(b), b, constants.mu)

    return replace(law, respond=respond, current=current)


def _less(whole: Response, trace_C: Floats, slope: Floats, mu: float | Floats) -> Response:
    """Return a response less that of mu/2 tr C, the derivative of tr C / 2 given by `slope`."""
    return replace(whole, energy=whole.energy - mu / 2 * trace_C, stress=whole.stress - mu * slope)


class _BetweenAllNodes(QuadraticPotential):
    """Springs of zero rest length between all nodes of an element, and a function of the volume.

    The springs have the weights mu w, w_ab = - integral of grad N_a . grad N_b, a constant; `law` is the rest of the
    neo-Hookean law at the Gauss points: - mu ln J, and the part of lam, which a subclass may take at the mean volume.
    """

    cell_note = CHANGE_OF_TENSION
    #: The finite elements that the springs equal.
    of_whole_law: ClassVar[type[FemPotential]] = QuadraticPotential

    @cached_property
    def _twin(self) -> FemPotential:
        """Finite elements of the whole law, the same function of the positions."""
        return of_one_kind(self.problem, "neo-hookean", self.of_whole_law)

    @cached_property
    def _laplacians(self) -> Floats:
        """The quadratic form of each element, times mu [N/m], shape (n_elements, nodes, nodes)."""
        mu = self.problem.of_elements(lambda material: material.lame.mu)
        return np.asarray(mu[:, None, None] * integrated(self, lambda gradients: gradients))

    @cached_property
    def _weights(self) -> Floats:
        """The stiffness between each node and its neighbours [N/m], shape (n_blocks,)."""
        found = np.bincount(self._pattern.slots.ravel(), -self._laplacians.ravel(), len(self._pattern.columns))
        return found.astype(np.float64, copy=False)

    def _pulls(self, positions: Floats) -> Floats:
        """Return the forces of the springs [N], shape (n_nodes, dim)."""
        from truespring.kernels import gaussian
        from truespring.kernels.threads import run, writable

        pattern, force = self._pattern, np.empty(positions.shape)
        known = (writable(positions), pattern.starts, pattern.columns, self._weights)
        run(gaussian.pulls, len(force), *known, force, pattern.zero)
        return force

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]; infinite if an element is inverted."""
        return super().energy(positions) + float((self._pulls(positions) * positions).sum()) / 2

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        return super().gradient(positions) + self._pulls(positions)

    def _pairs_of(self, positions: Floats, stress: Floats | None, first: int, last: int) -> Floats:
        """Return the tangent stiffness of a slice of the elements [N/m], as `Points.matrices` does."""
        pairs, dim = super()._pairs_of(positions, stress, first, last), self.mesh.dim
        a, b = pairs_of_nodes(self.elements.shape[1])
        springs = np.zeros((pairs.shape[0] * pairs.shape[2], len(a)))
        springs[: last - first] = self._laplacians[first:last, a, b]
        for axis in range(dim):
            pairs[:, axis * (dim + 1) :: dim * dim] += springs.reshape(len(pairs), -1, len(a)).swapaxes(1, 2)
        return pairs

    @cached_property
    def _pairs(self) -> tuple[Ints, Floats]:
        """Pairs of nodes joined by springs, shape (n, 2), and their stiffness [N/m], shape (n,)."""
        rows = np.repeat(np.arange(len(self.nodes)), np.diff(self._pattern.starts))
        columns = self._pattern.columns
        chosen = (rows < columns) & (np.abs(self._weights) > ROUNDING * np.abs(self._weights).max())
        return np.stack([rows, columns], axis=1)[chosen], self._weights[chosen]

    @property
    def springs(self) -> Ints:
        """Node numbers of the springs, each pair once, shape (n_springs, 2); midpoints follow the mesh's nodes."""
        return self._pairs[0]

    @property
    def stiffness(self) -> Floats:
        """Stiffness of each spring [N/m], shape (n_springs,)."""
        return self._pairs[1]

    def stretch(self, positions: Floats) -> Floats:
        """Return length over undeformed length of each spring [-], shape (n_springs,)."""
        return stretch(self.springs, self.nodes, positions)

    def spring_data(self) -> SpringData:
        """Return springs between all nodes, and points of integration of the elements; see docs/export/arrays.md."""
        springs, stiffness = self._pairs
        gradients, volumes = self.quadrature()
        arrays: dict[str, Any] = {
            "springs": springs,
            "stiffness": stiffness,
            "rest_length": np.zeros(len(springs)),
            "law": "neo-hookean",
            "lam": self.problem.of_elements(lambda material: material.lame.lam),
            "mu": self.problem.of_elements(lambda material: material.lame.mu),
            "all_elements": self.elements,
            "gradients": gradients,
            "point_volume": volumes,
        }
        if self.fibres is not None:
            arrays |= {"fibre_directions": self.fibres.directions, "k1": self.fibres.k1, "k2": self.fibres.k2}
        return SpringData(None, arrays, PRESSURE)

    @property
    def cells(self) -> dict[str, Ints]:
        """Edges of the mesh as lines, shape (n_edges, 2), and the elements, shape (n_elements, corners)."""
        return {"line": self.mesh.edges, **self.mesh.cells}

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return fields of edges, then of elements, NaN where a field is not defined, shape (n_cells, ...).

        Edges: stretch [-], the distance of their ends over that of the undeformed body. Elements: true stress [Pa],
        shape (n_cells, 9), and strain energy [J].
        """
        edges = self.mesh.edges
        return beside({"stretch": stretch(edges, self.nodes, positions)}, self._twin.cell_fields(positions))

    def cauchy_stress(self, positions: Floats) -> Floats:
        """Return the true stress of each element [Pa], shape (n_elements, 3, 3)."""
        return self._twin.cauchy_stress(positions)


class _AtPoints(_BetweenAllNodes):
    """The whole volume function at the Gauss points: plane stress, where nothing locks."""


class _AtMean(_BetweenAllNodes, QuadraticMeanPotential):
    """The part of lam at the mean volume of an element, so that it does not lock."""

    of_whole_law = QuadraticMeanPotential


#: Potentials of Gaussian springs of second order.
GaussianQuadratic = _AtPoints | _AtMean


def gaussian_quadratic(problem: Problem) -> GaussianQuadratic:
    """Return neo-Hookean Gaussian springs between all nodes of second-order triangles or tetrahedra."""
    section = problem.section
    kind = _AtPoints if section is not None and section.free_thickness else _AtMean
    return kind(
        problem, _without_springs(LAWS["neo-hookean"]), law_constants(problem, "neo-hookean"), stiff_fibres(problem)
    )
