"""Elements that know nothing but the squared lengths of their links: biquadratic springs and HEML are such."""

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

# Threads share the elements from so many on.
_SMALLEST_PIECE = 64


@dataclass(frozen=True, eq=False)
class LinkedElements(ABC):
    """Elements whose energy W(q) depends on q = l^2 - L^2 of the links between all their nodes.

    With p = dW/dq, 2M = d^2W/dq^2 and d the vector of a link from a to b: force 2 p d on b and -2 p d on a;
    Hessian J^T 2M J + sum 2 p [[I, -I], [-I, I]], J = dq/dx. What W is, the heirs say.
    """

    problem: Problem

    @property
    def nodes(self) -> Floats:
        """Reference positions [m], shape (n_nodes, dim)."""
        return self.problem.mesh.nodes

    @abstractmethod
    def energy(self, positions: Floats) -> float:
        """Stored energy [J]."""

    @abstractmethod
    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """A positive semidefinite neighbour of the Hessian [N/m]."""

    @abstractmethod
    def _pulls(self, change: Floats) -> Floats:
        """The derivative p of the energy by each squared length [N/m], shape (n_elements, links)."""

    @abstractmethod
    def _couplings(self, change: Floats, first: int, last: int) -> Floats:
        """Half the second derivative, M, of a slice of the elements [J/m^4], shape (n, links, links) or one of all."""

    @abstractmethod
    def _carried_on(self, change: Floats, growth: Floats) -> Floats:
        """p + 2M dq of a growth dq [m^2]: carried on linearly [N/m], shape (n_elements, links)."""

    @abstractmethod
    def _link_energies(self, change: Floats) -> Floats:
        """The share of each link in the energy [J], shape (n_elements, links)."""

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
        return np.empty((len(self._pattern.elements), len(self.problem.mesh.kind.links)))

    def _changes(self, positions: Floats) -> Floats:
        """The change q of squared lengths [m^2], shape (n_elements, links)."""
        from truespring.kernels import links
        from truespring.kernels.threads import writable

        change = self._by_link()
        known = (writable(positions), writable(self.nodes), *self._place)
        self._run(links.changes, *known, change, self._pattern.zero)
        return change

    def _growths(self, positions: Floats, step: Floats) -> Floats:
        """The change of squared lengths that is linear in a step [m], in m^2, shape (n_elements, links)."""
        from truespring.kernels import links
        from truespring.kernels.threads import writable

        growth = self._by_link()
        known = (writable(positions), writable(step), *self._place)
        self._run(links.growths, *known, growth, self._pattern.zero)
        return growth

    def _squared(self, positions: Floats) -> Floats:
        """Squared lengths [m^2], shape (n_elements, links)."""
        from truespring.kernels import links
        from truespring.kernels.threads import writable

        squared = self._by_link()
        self._run(links.squared_lengths, writable(positions), *self._place, squared, self._pattern.zero)
        return squared

    def stress(self, positions: Floats) -> Floats:
        """The derivative p of the energy by each squared length [N/m], shape (n_elements, links)."""
        return self._pulls(self._changes(positions))

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """p carried on by 2M dq with dq = 2 d . change of d along the step [N/m], shape (n_elements, links)."""
        return self._carried_on(self._changes(positions), self._growths(positions, step))

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
        return self._pattern.summed(self._matrices(positions, stress))

    def _matrices(self, positions: Floats, stress: Floats | None = None) -> Callable[[int, int], Floats]:
        """What gives the element matrices of a slice [N/m], shape (last - first, n_dof, n_dof)."""
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
    def cells(self) -> dict[str, Ints]:
        """The links as lines, shape (n_springs, 2)."""
        return {"line": self.springs}

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Tension [N], stretch [-], stiffness at rest [N/m] and strain energy [J] of each link.

        Sums over the elements that share it: tension 2 p l, stiffness 8 L^2 M_ss, and of the energy the links' parts.
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
