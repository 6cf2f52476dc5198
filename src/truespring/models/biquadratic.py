"""Biquadratic springs: springs in squared lengths, coupled within an element, that are St. Venant-Kirchhoff FEM.

Of the rule `biquadratic` and of HEML's St. Venant-Kirchhoff law this is the potential, on any element; on simplices
the mass-tensor method's is the same function, see `mass_tensor`.
"""

from functools import cached_property

import numpy as np

from truespring.arrays import Floats
from truespring.models.linked import LinkedElements
from truespring.models.links import link_coupling
from truespring.models.spring_data import COUPLING, SpringData
from truespring.potential import SparseMatrix


class BiquadraticSprings(LinkedElements):
    """Energy W = q . M q of every element, q = l^2 - L^2 of its links, without a quadrature loop.

    Sources: see `link_coupling`.
    """

    @cached_property
    def coupling(self) -> Floats:
        """M [J/m^4], shape (n_elements, links, links), or one for all elements."""
        return link_coupling(self.problem)

    def spring_data(self) -> SpringData:
        """Return the pairs of nodes, the links of an element, and their coupling [J/m^4] in each element."""
        mesh = self.problem.mesh
        coupling = np.broadcast_to(self.coupling, (len(mesh.elements), *self.coupling.shape[1:]))
        links = list(mesh.kind.links)
        return SpringData(None, {"springs": self.springs, "links": links, "coupling": coupling}, COUPLING)

    def energy(self, positions: Floats) -> float:
        """Stored energy [J]."""
        from truespring.kernels import vectors
        from truespring.kernels.threads import run

        change = self._changes(positions)
        pull = self._pulls(change)
        return float(sum(run(vectors.scalar_product, change.size, change.ravel(), pull.ravel()))) / 2

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """The Hessian without what compressed links add to its geometric part, positive semidefinite [N/m]."""
        return self.hessian(positions, np.maximum(self.stress(positions), 0.0))

    def _pulls(self, change: Floats) -> Floats:
        """2 M q."""
        from truespring.kernels import links

        pull = self._by_link()
        self._run(links.couple, self.coupling, change, pull)
        return pull

    def _carried_on(self, change: Floats, growth: Floats) -> Floats:
        return self._pulls(change + growth)

    def _couplings(self, change: Floats, first: int, last: int) -> Floats:
        return self.coupling[first:last] if len(self.coupling) > 1 else self.coupling

    def _link_energies(self, change: Floats) -> Floats:
        """The part q_s (M q)_s, which may be negative and adds up to the whole."""
        return change * self._pulls(change) / 2
