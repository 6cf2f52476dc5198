"""Biquadratic springs: springs in squared lengths, coupled within an element, equal to St. Venant-Kirchhoff FEM.

This is the potential of the rule `biquadratic` and of HEML with the St. Venant-Kirchhoff law. The potential of the
mass-tensor method on simplices is the same function, see `mass_tensor`.
"""

from functools import cached_property

import numpy as np

from truespring.arrays import Floats
from truespring.models.linked import LinkedElements
from truespring.models.links import link_coupling
from truespring.models.spring_data import COUPLING, SpringData
from truespring.potential import SparseMatrix


class BiquadraticSprings(LinkedElements):
    """The potential with energy W = q . M q of every element, q = l^2 - L^2 of its links; no quadrature loop.

    Sources: see `link_coupling`.
    """

    @cached_property
    def coupling(self) -> Floats:
        """M of each element [J/m^4], shape (n_elements, links, links), or (1, links, links) if all are equal."""
        return link_coupling(self.problem)

    def spring_data(self) -> SpringData:
        """Return the springs, the links of an element, and the coupling of each element [J/m^4]."""
        mesh = self.problem.mesh
        coupling = np.broadcast_to(self.coupling, (len(mesh.elements), *self.coupling.shape[1:]))
        links = list(mesh.kind.links)
        return SpringData(None, {"springs": self.springs, "links": links, "coupling": coupling}, COUPLING)

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]."""
        from truespring.kernels import vectors
        from truespring.kernels.threads import run

        change = self._changes(positions)
        pull = self._pulls(change)
        return float(sum(run(vectors.scalar_product, change.size, change.ravel(), pull.ravel()))) / 2

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the Hessian without the geometric part of compressed links, positive semidefinite [N/m]."""
        return self.hessian(positions, np.maximum(self.stress(positions), 0.0))

    def _pulls(self, change: Floats) -> Floats:
        """Return p = 2 M q [N/m], shape (n_elements, links)."""
        from truespring.kernels import links

        pull = self._by_link()
        self._run(links.couple, self.coupling, change, pull)
        return pull

    def _extrapolated(self, change: Floats, growth: Floats) -> Floats:
        return self._pulls(change + growth)

    def _couplings(self, change: Floats, first: int, last: int) -> Floats:
        return self.coupling[first:last] if len(self.coupling) > 1 else self.coupling

    def _link_energies(self, change: Floats) -> Floats:
        """Return q_s (M q)_s of each link [J], shape (n_elements, links): may be negative, the sum is the energy."""
        return change * self._pulls(change) / 2
