"""Elements whose energy is a function of the squared lengths of their links: base of biquadratic springs and HEML."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from truespring.arrays import Floats, Ints, ShortInts
from truespring.assembly import Pattern
from truespring.potential import SparseMatrix
from truespring.problem import Problem

# Smallest number of elements for which threads share the work.
_SMALLEST_PIECE = 64


@dataclass(frozen=True, eq=False)
class LinkedElements(ABC):
    """Elements whose energy W(q) depends on q = l^2 - L^2 of the links between all their nodes.

    With p = dW/dq, 2M = d^2W/dq^2 and d the vector of a link from a to b: force 2 p d on b and -2 p d on a;
    Hessian J^T 2M J + sum 2 p [[I, -I], [-I, I]], J = dq/dx. Subclasses define W.
    """

    problem: Problem

    @property
    def nodes(self) -> Floats:
        """Undeformed positions [m], shape (n_nodes, dim)."""
        return self.problem.mesh.nodes

    @abstractmethod
    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]."""

    @abstractmethod
    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return a positive semidefinite approximation of the Hessian [N/m]."""

    @abstractmethod
    def _pulls(self, change: Floats) -> Floats:
        """Return the derivatives p of the energy with respect to squared lengths [N/m], shape (n_elements, links)."""

    @abstractmethod
    def _couplings(self, change: Floats, first: int, last: int) -> Floats:
        """Return half the second derivative, M, of a slice of the elements [J/m^4].

        Shape (n, links, links), or (1, links, links) if all are equal.
        """

    @abstractmethod
    def _extrapolated(self, change: Floats, growth: Floats) -> Floats:
        """Return p + 2M dq for a growth dq [m^2], in N/m, shape (n_elements, links)."""

    @abstractmethod
    def _link_energies(self, change: Floats) -> Floats:
        """Return the share of each link in the energy [J], shape (n_elements, links)."""

    @cached_property
    def _links(self) -> Ints:
        """Number of the link between each two nodes of an element, shape (k, k)."""
        kind = self.problem.mesh.kind
        number = np.full((kind.n_nodes, kind.n_nodes), -1)
        for link, (i, j) in enumerate(kind.links):
            number[i, j] = number[j, i] = link
        return number

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.problem.mesh.elements, *self.nodes.shape)

    def _run(self, kernel: Callable[..., Any], *arguments: Any) -> None:
        """Run a kernel on all elements in parallel."""
        from truespring.kernels.threads import run

        run(kernel, len(self._pattern.elements), *arguments, smallest=_SMALLEST_PIECE)

    @property
    def _place(self) -> tuple[ShortInts, Ints]:
        """Arguments of kernels: node numbers and links of the elements."""
        return self._pattern.elements, self._links

    def _by_link(self) -> Floats:
        """Return an empty array for values of links, shape (n_elements, links)."""
        return np.empty((len(self._pattern.elements), len(self.problem.mesh.kind.links)))

    def _changes(self, positions: Floats) -> Floats:
        """Return the change q of squared lengths [m^2], shape (n_elements, links)."""
        from truespring.kernels import links
        from truespring.kernels.threads import writable

        change = self._by_link()
        known = (writable(positions), writable(self.nodes), *self._place)
        self._run(links.changes, *known, change, self._pattern.zero)
        return change

    def _growths(self, positions: Floats, step: Floats) -> Floats:
        """Return the linear change of squared lengths for a step [m], in m^2, shape (n_elements, links)."""
        from truespring.kernels import links
        from truespring.kernels.threads import writable

        growth = self._by_link()
        known = (writable(positions), writable(step), *self._place)
        self._run(links.growths, *known, growth, self._pattern.zero)
        return growth

    def _squared(self, positions: Floats) -> Floats:
        """Return squared lengths [m^2], shape (n_elements, links)."""
        from truespring.kernels import links
        from truespring.kernels.threads import writable

        squared = self._by_link()
        self._run(links.squared_lengths, writable(positions), *self._place, squared, self._pattern.zero)
        return squared

    def stress(self, positions: Floats) -> Floats:
        """Return the derivatives p of the energy with respect to squared lengths [N/m], shape (n_elements, links)."""
        return self._pulls(self._changes(positions))

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return p + 2M dq, dq = 2 d . (change of d along `step`) [N/m], shape (n_elements, links)."""
        return self._extrapolated(self._changes(positions), self._growths(positions, step))

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        from truespring.kernels import links
        from truespring.kernels.threads import writable

        n_elements, k = self._pattern.elements.shape
        force = np.empty((n_elements, k * self._pattern.dim))
        self._run(links.forces, writable(positions), *self._place, self.stress(positions), force, self._pattern.zero)
        return self._pattern.vector(force)

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Return the tangent stiffness [N/m]; `stress` [N/m] gives the geometric part, by default the current one."""
        return self._pattern.summed(self._matrices(positions, stress))

    def _matrices(self, positions: Floats, stress: Floats | None = None) -> Callable[[int, int], Floats]:
        """Return a function that returns element matrices of a slice [N/m], shape (last - first, n_dof, n_dof)."""
        from truespring.kernels import links
        from truespring.kernels.threads import run, writable

        change = self._changes(positions)
        x, p = writable(positions), writable(self._pulls(change) if stress is None else stress)
        elements = self._pattern.elements
        n_dof = elements.shape[1] * self._pattern.dim

        def matrices(first: int, last: int) -> Floats:
            blocks = np.empty((last - first, n_dof, n_dof))
            known = (x, elements[first:last], self._links, self._couplings(change, first, last), p[first:last])
            run(links.stiffnesses, last - first, *known, blocks, self._pattern.zero, smallest=_SMALLEST_PIECE)
            return blocks

        return matrices

    def stretch(self, positions: Floats) -> Floats:
        """Return length over rest length of each element's links [-], shape (n_elements * links,)."""
        return np.asarray(np.sqrt(self._squared(positions) / self._squared(self.nodes)).ravel())

    @cached_property
    def _shared(self) -> tuple[Ints, Ints]:
        """Springs, each pair of nodes once, and the number of the spring of each link."""
        from truespring.kernels.sparsity import unique_pairs
        from truespring.kernels.threads import writable

        mesh = self.problem.mesh
        pairs = writable(mesh.elements[:, np.array(mesh.kind.links)].reshape(-1, 2))
        springs, place = unique_pairs(pairs, mesh.n_nodes)
        return springs, place

    @property
    def springs(self) -> Ints:
        """Node numbers of the springs, each pair once, shape (n_springs, 2)."""
        return self._shared[0]

    @property
    def cells(self) -> dict[str, Ints]:
        """Links as lines, shape (n_springs, 2)."""
        return {"line": self.springs}

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return tension [N], stretch [-], undeformed stiffness [N/m] and strain energy [J], shape (n_springs,).

        Sums over the elements that share a spring of the tension 2 p l, the stiffness 8 L^2 M_ss and the energy of the
        link.
        """
        change = self._changes(positions)
        at_rest = self._couplings(np.zeros_like(change), 0, len(change))
        alone = np.broadcast_to(np.einsum("ess->es", at_rest), change.shape)
        springs, place = self._shared

        def summed(values: Floats) -> Floats:
            return np.bincount(place, values.ravel(), len(springs)).astype(np.float64, copy=False)

        first = np.zeros(len(springs))
        first[place] = self.stretch(positions)
        return {
            "tension": summed(2 * self._pulls(change) * np.sqrt(self._squared(positions))),
            "stretch": first,
            "stiffness": summed(8 * self._squared(self.nodes) * alone),
            "strain_energy": summed(self._link_energies(change)),
        }
