"""Biquadratic springs: springs in squared lengths, coupled within an element, that are St. Venant-Kirchhoff FEM."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.models.links import link_coupling
from truespring.potential import Pattern, SparseMatrix
from truespring.problem import Problem


@dataclass(frozen=True, eq=False)
class BiquadraticSprings:
    """Energy W = q . M q of every element, q = l^2 - L^2 of its links, without a quadrature loop.

    With p = 2 M q and d the vector of a link from a to b: force 2 p d on b and -2 p d on a; Hessian
    J^T 2M J + sum 2 p [[I, -I], [-I, I]], J = dq/dx. Sources: see `link_coupling`.
    """

    problem: Problem

    @property
    def nodes(self) -> Floats:
        """Reference positions [m], shape (n_nodes, dim)."""
        return self.problem.mesh.nodes

    @cached_property
    def coupling(self) -> Floats:
        """M [J/m^4], shape (n_elements, links, links), or one for all elements."""
        return link_coupling(self.problem)

    @cached_property
    def _links(self) -> Ints:
        return np.array(self.problem.mesh.kind.links)

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.problem.mesh.elements, *self.nodes.shape)

    @cached_property
    def _at_rest(self) -> Floats:
        return _squared(self._vectors(self.nodes))

    def _vectors(self, positions: Floats) -> Floats:
        """Vector of each link [m], shape (n_elements, links, dim)."""
        first, second = self._ends
        return np.asarray(np.take(positions, second, axis=0) - np.take(positions, first, axis=0))

    @cached_property
    def _ends(self) -> tuple[Ints, Ints]:
        """The first and the second node of each link, shape (n_elements, links) each."""
        elements = self.problem.mesh.elements
        return elements[:, self._links[:, 0]], elements[:, self._links[:, 1]]

    def _change(self, vectors: Floats) -> Floats:
        """The change q of squared lengths [m^2], shape (n_elements, links)."""
        return _squared(vectors) - self._at_rest

    def energy(self, positions: Floats) -> float:
        """Stored energy [J]."""
        q = self._change(self._vectors(positions))
        return float((self._coupled(q) * q).sum())

    def _coupled(self, q: Floats) -> Floats:
        """M q of each element, shape (n_elements, links)."""
        if len(self.coupling) == 1:
            return np.asarray(q @ self.coupling[0])
        return np.asarray((self.coupling @ q[:, :, None])[:, :, 0])

    def stress(self, positions: Floats) -> Floats:
        """The derivative p = 2 M q of the energy by each squared length [N/m], shape (n_elements, links)."""
        q = self._change(self._vectors(positions))
        return 2 * self._coupled(q)

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        vectors = self._vectors(positions)
        pull = 4 * self._coupled(self._change(vectors))[:, :, None] * vectors
        return self._pattern.vector(self._incidence.T @ pull).reshape(positions.shape)

    @cached_property
    def _incidence(self) -> Floats:
        """1 at the second, -1 at the first node of each link, shape (links, nodes of the element)."""
        incidence = np.zeros((len(self._links), self.problem.mesh.kind.n_nodes))
        every = np.arange(len(self._links))
        incidence[every, self._links[:, 0]], incidence[every, self._links[:, 1]] = -1, 1
        return incidence

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Tangent stiffness [N/m]; `stress` [N/m] makes the geometric part, by default that of the positions."""
        p = self.stress(positions) if stress is None else stress
        d, s = self._vectors(positions), self._incidence
        n_elements, n_local, dim = len(d), s.shape[1], d.shape[2]
        J = 2 * np.einsum("la,eli->elai", s, d).reshape(n_elements, len(s), n_local * dim)
        blocks = J.swapaxes(1, 2) @ (2 * self.coupling) @ J
        spread = np.einsum("el,la,lb->eab", 2 * p, s, s, optimize=True)
        blocks = blocks.reshape(n_elements, n_local, dim, n_local, dim)
        for i in range(dim):
            blocks[:, :, i, :, i] += spread
        return self._pattern.matrix(blocks.reshape(n_elements, n_local * dim, n_local * dim))

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """The Hessian without what compressed links add to its geometric part, positive semidefinite [N/m]."""
        return self.hessian(positions, np.maximum(self.stress(positions), 0.0))

    def stretch(self, positions: Floats) -> Floats:
        """Length over rest length of each element's links, shape (n_elements * links,)."""
        return np.asarray(np.sqrt(_squared(self._vectors(positions)) / self._at_rest).ravel())

    @cached_property
    def _shared(self) -> tuple[Ints, Ints]:
        """Each pair of nodes that a link joins once, and the pair of each element's links."""
        pairs = np.sort(self.problem.mesh.elements[:, self._links].reshape(-1, 2), axis=1)
        springs, place = np.unique(pairs, axis=0, return_inverse=True)
        return springs, place.ravel()

    @property
    def springs(self) -> Ints:
        """Each pair of nodes that a link joins once, shape (n_springs, 2)."""
        return self._shared[0]

    @property
    def cells(self) -> tuple[str, Ints]:
        """The springs as lines, shape (n_springs, 2)."""
        return "line", self.springs

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Tension [N], stretch [-], stiffness [N/m] and strain energy [J] of each spring.

        Sums over the elements that share it: tension 2 p l, stiffness 8 L^2 M_ss, and of the energy q . M q
        the part q_s (M q)_s, which may be negative and adds up to the whole.
        """
        vectors = self._vectors(positions)
        q, length = self._change(vectors), np.sqrt(_squared(vectors))
        coupled = self._coupled(q)
        alone = np.broadcast_to(np.einsum("ess->es", self.coupling), q.shape)
        springs, place = self._shared

        def summed(values: Floats) -> Floats:
            return np.bincount(place, values.ravel(), len(springs)).astype(np.float64, copy=False)

        first = np.zeros(len(springs))
        first[place] = self.stretch(positions)
        return {
            "tension": summed(4 * coupled * length),
            "stretch": first,
            "stiffness": summed(8 * self._at_rest * alone),
            "strain_energy": summed(q * coupled),
        }


def _squared(vectors: Floats) -> Floats:
    """Squared lengths [m^2], shape (n_elements, links)."""
    return np.asarray(np.einsum("eli,eli->el", vectors, vectors))
