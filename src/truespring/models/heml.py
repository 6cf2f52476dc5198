"""HEML, hyper-elastic mass links: the energy of a finite element as a function of the squared lengths of its links."""

from dataclasses import dataclass, field
from functools import cached_property
from math import factorial
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ModelError, nearest
from truespring.models.biquadratic import BiquadraticSprings
from truespring.models.fem import Fem
from truespring.models.fem_potential import FemPotential, fem_of_one_kind
from truespring.models.finite_elements import fem_potential
from truespring.models.interpolation import locking_warnings
from truespring.models.law import Response
from truespring.models.laws import LAWS
from truespring.models.linked import LinkedElements
from truespring.models.links import link_strains
from truespring.models.model import Model
from truespring.models.semidefinite import semidefinite
from truespring.models.summed import SummedLinks, summed_links
from truespring.models.symmetric import identity
from truespring.plugins import Names
from truespring.potential import SparseMatrix
from truespring.problem import Problem

#: Laws allowed for links: those of finite strain.
HEML_LAWS = Names(LAWS, lambda law: law.finite)
# Smallest number of elements for which threads share a slice.
_SMALLEST_PIECE = 256
_SIMPLICES = ("triangle", "tetrahedron")


@dataclass(frozen=True)
class Heml(Model):
    """Hyper-elastic mass links (Goulette and Chen 2015).

    Attributes:
        law: saint-venant-kirchhoff on any element; other laws of finite strain on triangles and tetrahedra.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> ts.solve(problem, ts.Heml("saint-venant-kirchhoff"))
        Solution(HEML (St. Venant-Kirchhoff), converged, 11 states up to load factor 1)
    """

    law: str = field()

    kind = "heml"

    def __post_init__(self) -> None:
        if self.law == "linear":
            raise ModelError(
                "law = 'linear': small strain is not a function of the lengths of links; "
                f"allowed: {', '.join(HEML_LAWS)}; use the linear law with fem or mass-tensor"
            )
        if self.law not in HEML_LAWS:
            close = nearest(self.law, HEML_LAWS)
            raise ModelError(f"law = '{self.law}' is unknown{close}; allowed: {', '.join(HEML_LAWS)}")

    @property
    def lines(self) -> str:
        """Name of the lines of the potential in figures."""
        return "links"

    @property
    def label(self) -> str:
        """Name in figures and tables."""
        return f"HEML ({LAWS[self.law].label})"

    def on_pieces(self, problem: Problem) -> "Heml":
        """Return the model itself: its energy is a sum over elements."""
        return self

    def second_order(self, problem: Problem) -> Fem:
        """Return finite elements of second order with the same law, the limit of this model on fine meshes."""
        return Fem(self.law)

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return warnings about elements that lock."""
        return locking_warnings(problem)

    def potential(self, problem: Problem) -> LinkedElements | SummedLinks:
        """Return the potential; raise ModelError if the law does not support the elements of the mesh."""
        element = problem.mesh.element
        fem_potential(problem, self.law)  # raises for problems without a continuum, such as a plain network
        if self.law == "saint-venant-kirchhoff":
            return summed_links(problem, BiquadraticSprings)
        if element not in _SIMPLICES:
            raise ModelError(
                f"law = '{self.law}' requires {' or '.join(_SIMPLICES)} elements, whose uniform strain follows from "
                f"the lengths of their links; the mesh has {problem.mesh.kinds} elements: use law = "
                "'saint-venant-kirchhoff', which supports any element, kind = 'fem' with this law, or a mesh of "
                f"{_SIMPLICES[problem.mesh.dim - 2]} elements"
            )
        return HyperelasticLinks(problem, self.law)


class _Work(NamedTuple):
    """Derivatives that relate squared lengths to the strain of the law, for a slice of elements.

    Attributes:
        strain: derivative of C with respect to each squared length [1/m^2], shape (n, links, components).
        work: factor from stress to p [m], shape (n, links, components): undeformed volume times half of `strain`, shear
            components doubled.
    """

    strain: Floats
    work: Floats


@dataclass(frozen=True, eq=False)
class HyperelasticLinks(LinkedElements):
    """Triangles or tetrahedra of any law: they have as many links as strain components, so lengths determine W(C).

    With C = I + sum q_l C_l (see `link_strains`), stress S and elasticity D of the law, and undeformed volume V:
    W = V W(C), p_l = V/2 S : C_l and 2M_kl = V/4 C_k : D : C_l. For the neo-Hookean law this is the energy of Goulette
    and Chen (2015), V (mu/2 (sum tr C_l l^2 - 3) - mu ln J + lam/2 (ln J)^2), J from the same lengths. Lengths do not
    determine the orientation, which is computed from the positions: an inverted element has infinite energy.
    """

    law: str

    @cached_property
    def _fem(self) -> FemPotential:
        """Finite elements of the same law, the same function of the positions."""
        return fem_of_one_kind(self.problem, self.law)

    @cached_property
    def _work(self) -> _Work:
        gradients, volumes = self._fem.quadrature()
        strain = link_strains(self.problem.mesh, gradients)[:, 0]
        twice = np.where(np.arange(strain.shape[2]) < self.problem.mesh.dim, 1.0, 2.0)
        return _Work(strain, volumes[:, :, None] / 2 * twice * strain)

    def _response(self, change: Floats, first: int = 0, last: int | None = None) -> Response:
        """Return the response of the law in a slice of the elements, axes (component, element, 1)."""
        from truespring.kernels import links
        from truespring.kernels.threads import run, writable

        end = len(change) if last is None else last
        strains = self._work.strain[first:end]
        grown = np.empty((strains.shape[2], len(strains), 1))
        run(links.strain, len(strains), writable(change[first:end]), strains, grown, smallest=_SMALLEST_PIECE)
        return LAWS[self.law].respond(identity(grown) + grown, self._fem.constants.part(first, end))

    def _energies(self, change: Floats) -> Floats:
        """Return the energy of each element [J], regardless of its orientation, shape (n_elements,)."""
        return np.asarray(self._response(change).energy[:, 0] * self._volumes)

    @cached_property
    def _volumes(self) -> Floats:
        """Undeformed volume of each element [m^3], shape (n_elements,)."""
        return self._fem.quadrature()[1][:, 0]

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]; infinite if an element is inverted."""
        if LAWS[self.law].barrier and not (self._signed(positions) > 0).all():
            return float("inf")
        with np.errstate(over="ignore", invalid="ignore"):
            total = float(self._energies(self._changes(positions)).sum())
        return total if np.isfinite(total) else float("inf")

    def _signed(self, positions: Floats) -> Floats:
        """Return the signed area [m^2] or volume [m^3] of each element, shape (n_elements,)."""
        from truespring.kernels import volumes
        from truespring.kernels.threads import writable

        kind, signed = self.problem.mesh.kind, np.empty(len(self._pattern.elements))
        known = (writable(positions), self._pattern.elements, np.array(kind.simplices), 1 / factorial(kind.dim))
        self._run(volumes.volumes, *known, signed, self._pattern.zero)
        return signed

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the sum of the element Hessians, each with its negative eigenvalues set to zero [N/m]."""
        matrices = self._matrices(positions)
        return self._pattern.summed(lambda first, last: semidefinite(matrices(first, last), self._pattern.dim))

    def _pulls(self, change: Floats) -> Floats:
        from truespring.kernels import links

        pull = self._by_link()
        self._run(links.work, self._response(change).stress, self._work.work, pull)
        return pull

    def _extrapolated(self, change: Floats, growth: Floats) -> Floats:
        coupled = np.matmul(self._couplings(change, 0, len(change)), growth[..., None])[..., 0]
        return np.asarray(self._pulls(change) + 2 * coupled)

    def _couplings(self, change: Floats, first: int, last: int) -> Floats:
        """Return M = V/8 C_k : D : C_l of a slice of the elements [J/m^4], shape (n, links, links)."""
        from truespring.kernels import links
        from truespring.kernels.threads import run

        works, share = self._work.work[first:last], 1 / (2 * self._volumes[first:last])
        coupling = np.empty((len(works), works.shape[1], works.shape[1]))
        response = self._response(change, first, last)
        known = (response.elasticity().dense(response.stress), works, share)
        run(links.couplings, len(works), *known, coupling, smallest=_SMALLEST_PIECE)
        return coupling

    def _link_energies(self, change: Floats) -> Floats:
        """Return equal shares of each element's energy [J], shape (n_elements, links); links have no own energy."""
        n_links = change.shape[1]
        return np.repeat(self._energies(change)[:, None] / n_links, n_links, axis=1)
