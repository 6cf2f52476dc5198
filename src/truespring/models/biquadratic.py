"""Biquadratic springs: springs in squared lengths, coupled within an element, that are St. Venant-Kirchhoff FEM."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from truespring.arrays import Floats, Ints, ShortInts
from truespring.models.links import link_coupling
from truespring.potential import Pattern, SparseMatrix
from truespring.problem import Problem

# Threads share the elements from so many on.
_SMALLEST_PIECE = 64


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
        """The link of each pair of an element's nodes, shape (k, k)."""
        kind = self.problem.mesh.kind
        number = np.full((kind.n_nodes, kind.n_nodes), -1)
        for link, (i, j) in enumerate(kind.links):
            number[i, j] = number[j, i] = link
        return number

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.problem.mesh.elements, *self.nodes.shape)

    def _run(self, kernel: Callable[..., Any], *arguments: Any) -> None:
        """Run a kernel over all elements."""
        from truespring.kernels.threads import run

        run(kernel, len(self._pattern.elements), *arguments, smallest=_SMALLEST_PIECE)

    @property
    def _place(self) -> tuple[ShortInts, Ints]:
        """What kernels ask of the elements: their nodes and links."""
        return self._pattern.elements, self._links

    def _by_link(self) -> Floats:
        """Room for a value of each link, shape (n_elements, links)."""
        return np.empty((len(self._pattern.elements), self.coupling.shape[1]))

    def _changes(self, positions: Floats, step: Floats | None = None) -> Floats:
        """The change q of squared lengths [m^2], carried on linearly along a step [m], shape (n_elements, links)."""
        from truespring.kernels import links
        from truespring.kernels.threads import writable

        x, change = writable(positions), self._by_link()
        self._run(links.changes, x, writable(self.nodes), *self._place, change, self._pattern.zero)
        if step is not None:
            self._run(links.carry_on, x, writable(step), *self._place, change, self._pattern.zero)
        return change

    def _coupled(self, change: Floats) -> Floats:
        """2 M q of each element [N/m], shape (n_elements, links)."""
        from truespring.kernels import links

        pull = self._by_link()
        self._run(links.couple, self.coupling, change, pull)
        return pull

    def _squared(self, positions: Floats) -> Floats:
        """Squared lengths [m^2], shape (n_elements, links)."""
        from truespring.kernels import links
        from truespring.kernels.threads import writable

        squared = self._by_link()
        self._run(links.squared_lengths, writable(positions), *self._place, squared, self._pattern.zero)
        return squared

    def energy(self, positions: Floats) -> float:
        """Stored energy [J]."""
        change = self._changes(positions)
        return float(np.vdot(change, self._coupled(change))) / 2

    def stress(self, positions: Floats) -> Floats:
        """The derivative p = 2 M q of the energy by each squared length [N/m], shape (n_elements, links)."""
        return self._coupled(self._changes(positions))

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """2 M (q + 2 d . change of d along the step) [N/m], shape (n_elements, links)."""
        return self._coupled(self._changes(positions, step))

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        from truespring.kernels import links
        from truespring.kernels.threads import writable

        n_elements, k = self._pattern.elements.shape
        force = np.empty((n_elements, k * self._pattern.dim))
        self._run(links.forces, writable(positions), *self._place, self.stress(positions), force, self._pattern.zero)
        return self._pattern.vector(force)

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Tangent stiffness [N/m]; `stress` [N/m] makes the geometric part, by default that of the positions."""
        from truespring.kernels import links
        from truespring.kernels.threads import run, writable

        x, p = writable(positions), writable(self.stress(positions) if stress is None else stress)
        elements, own = self._pattern.elements, len(self.coupling) > 1
        n_dof = elements.shape[1] * self._pattern.dim

        def matrices(first: int, last: int) -> Floats:
            blocks = np.empty((last - first, n_dof, n_dof))
            coupling = self.coupling[first:last] if own else self.coupling
            known = (x, elements[first:last], self._links, coupling, p[first:last])
            run(links.stiffnesses, last - first, *known, blocks, self._pattern.zero, smallest=_SMALLEST_PIECE)
            return blocks

        return self._pattern.summed(matrices)

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """The Hessian without what compressed links add to its geometric part, positive semidefinite [N/m]."""
        return self.hessian(positions, np.maximum(self.stress(positions), 0.0))

    def stretch(self, positions: Floats) -> Floats:
        """Length over rest length of each element's links, shape (n_elements * links,)."""
        return np.asarray(np.sqrt(self._squared(positions) / self._squared(self.nodes)).ravel())

    @cached_property
    def _shared(self) -> tuple[Ints, Ints]:
        """Each pair of nodes that a link joins once, and the pair of each element's links."""
        from truespring.kernels.sparsity import unique_pairs
        from truespring.kernels.threads import writable

        mesh = self.problem.mesh
        pairs = writable(mesh.elements[:, np.array(mesh.kind.links)].reshape(-1, 2))
        springs, place = unique_pairs(pairs, mesh.n_nodes)
        return springs, place

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
        change = self._changes(positions)
        pull = self._coupled(change)
        alone = np.broadcast_to(np.einsum("ess->es", self.coupling), change.shape)
        springs, place = self._shared

        def summed(values: Floats) -> Floats:
            return np.bincount(place, values.ravel(), len(springs)).astype(np.float64, copy=False)

        first = np.zeros(len(springs))
        first[place] = self.stretch(positions)
        return {
            "tension": summed(2 * pull * np.sqrt(self._squared(positions))),
            "stretch": first,
            "stiffness": summed(8 * self._squared(self.nodes) * alone),
            "strain_energy": summed(change * pull / 2),
        }
