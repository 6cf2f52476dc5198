"""HEML, hyper-elastic mass links: the energy of a finite element told by the squared lengths of its links."""

from dataclasses import dataclass
from functools import cached_property
from math import factorial
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ModelError, nearest
from truespring.models.biquadratic import BiquadraticSprings
from truespring.models.fem import Fem, FemPotential, fem_of_one_kind, fem_potential, locking_warnings
from truespring.models.law import Response
from truespring.models.laws import LAWS
from truespring.models.linked import LinkedElements
from truespring.models.links import link_strains
from truespring.models.summed import SummedLinks, summed_links
from truespring.models.symmetric import identity
from truespring.potential import SparseMatrix
from truespring.problem import Problem

#: Laws that links can tell: those of finite strain.
HEML_LAWS = tuple(name for name, law in LAWS.items() if law.finite)
# Threads share the elements of a slice from so many on.
_SMALLEST_PIECE = 256
_SIMPLICES = ("triangle", "tetrahedron")


@dataclass(frozen=True)
class Heml:
    """Hyper-elastic mass links (Goulette and Chen 2015), by the law of the material.

    Attributes:
        law: saint-venant-kirchhoff on any element; neo-hookean or hencky on triangles and tetrahedra.
    """

    law: str

    kind = "heml"

    def __post_init__(self) -> None:
        if self.law == "linear":
            raise ModelError(
                "law = 'linear': links know lengths, whose change is no linear strain; "
                f"allowed: {', '.join(HEML_LAWS)}; the linear law is that of fem and mass-tensor"
            )
        if self.law not in HEML_LAWS:
            close = nearest(self.law, HEML_LAWS)
            raise ModelError(f"law = '{self.law}' is unknown{close}; allowed: {', '.join(HEML_LAWS)}")

    @property
    def label(self) -> str:
        """How curves and tables call the model."""
        return f"HEML ({LAWS[self.law].label})"

    def second_order(self, problem: Problem) -> Fem:
        """Return the finite elements of second order of the same law: where finer meshes of this model lead."""
        return Fem(self.law)

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return what should be known before the model is solved: elements that lock."""
        return locking_warnings(problem)

    def potential(self, problem: Problem) -> LinkedElements | SummedLinks:
        """Return the potential on the problem's mesh; raise ModelError for a law that does not fit its elements."""
        element = problem.mesh.element
        fem_potential(problem, self.law)  # refuses what is no continuum, such as a plain network
        if self.law == "saint-venant-kirchhoff":
            return summed_links(problem, BiquadraticSprings)
        if element not in _SIMPLICES:
            raise ModelError(
                f"law = '{self.law}' is for {' and '.join(_SIMPLICES)} elements, whose strain is one and told by the "
                f"lengths of their links; the mesh has {problem.mesh.kinds} elements: take law = "
                "'saint-venant-kirchhoff', which goes with any, kind = 'fem' with this law, or a mesh of "
                f"{_SIMPLICES[problem.mesh.dim - 2]} elements"
            )
        return HyperelasticLinks(problem, self.law)


class _Work(NamedTuple):
    """What links are to the law, in an element or in a slice of them.

    Attributes:
        strain: how each component of C changes with each squared length [1/m^2], shape (n, links, components).
        work: by what a stress is multiplied to be p [m], shape (n, links, components): the reference volume by half the
            strain, shear twice.
    """

    strain: Floats
    work: Floats


@dataclass(frozen=True, eq=False)
class HyperelasticLinks(LinkedElements):
    """Triangles or tetrahedra of any law: as many links as a strain has components, so W(C) is a function of lengths.

    With C = I + sum q_l C_l (see `link_strains`), S and D the law's stress and elasticity there and V the rest volume:
    W = V W(C), p_l = V/2 S : C_l and 2M_kl = V/4 C_k : D : C_l. For the neo-Hookean law this is Goulette and
    Chen's, V (mu/2 (sum tr C_l l^2 - 3) - mu ln J + lam/2 (ln J)^2), J from the same lengths; its sign, which no
    length tells, is taken from the nodes: an element that is turned inside out has infinite energy.
    """

    law: str

    @cached_property
    def _fem(self) -> FemPotential:
        """The finite elements of the same law, which are the same function."""
        return fem_of_one_kind(self.problem, self.law)

    @cached_property
    def _work(self) -> _Work:
        gradients, volumes = self._fem.quadrature()
        strain = link_strains(self.problem.mesh, gradients)[:, 0]
        twice = np.where(np.arange(strain.shape[2]) < self.problem.mesh.dim, 1.0, 2.0)
        return _Work(strain, volumes[:, :, None] / 2 * twice * strain)

    def _response(self, change: Floats, first: int = 0, last: int | None = None) -> Response:
        """What the law answers in a slice of the elements, axes (component, element, 1)."""
        from truespring.kernels import links
        from truespring.kernels.threads import run, writable

        end = len(change) if last is None else last
        strains = self._work.strain[first:end]
        grown = np.empty((strains.shape[2], len(strains), 1))
        run(links.strain, len(strains), writable(change[first:end]), strains, grown, smallest=_SMALLEST_PIECE)
        return LAWS[self.law].respond(identity(grown) + grown, self._fem.constants.part(first, end))

    def _energies(self, change: Floats) -> Floats:
        """Stored energy of each element [J], were it not turned inside out, shape (n_elements,)."""
        return np.asarray(self._response(change).energy[:, 0] * self._volumes)

    @cached_property
    def _volumes(self) -> Floats:
        """Reference volume of each element [m^3], shape (n_elements,)."""
        return self._fem.quadrature()[1][:, 0]

    def energy(self, positions: Floats) -> float:
        """Stored energy [J]; infinite where an element is turned inside out."""
        if LAWS[self.law].barrier and not (self._signed(positions) > 0).all():
            return float("inf")
        with np.errstate(over="ignore", invalid="ignore"):
            total = float(self._energies(self._changes(positions)).sum())
        return total if np.isfinite(total) else float("inf")

    def _signed(self, positions: Floats) -> Floats:
        """Signed area or volume of each element, without thickness, shape (n_elements,)."""
        from truespring.kernels import volumes
        from truespring.kernels.threads import writable

        kind, signed = self.problem.mesh.kind, np.empty(len(self._pattern.elements))
        known = (writable(positions), self._pattern.elements, np.array(kind.simplices), 1 / factorial(kind.dim))
        self._run(volumes.volumes, *known, signed, self._pattern.zero)
        return signed

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Sum of the element Hessians, each with its negative eigenvalues cut off [N/m]."""
        matrices = self._matrices(positions)

        def positive(first: int, last: int) -> Floats:
            values, vectors = np.linalg.eigh(matrices(first, last))
            return np.asarray((vectors * np.maximum(values, 0.0)[:, None]) @ vectors.swapaxes(1, 2))

        return self._pattern.summed(positive)

    def _pulls(self, change: Floats) -> Floats:
        from truespring.kernels import links

        pull = self._by_link()
        self._run(links.work, self._response(change).stress, self._work.work, pull)
        return pull

    def _carried_on(self, change: Floats, growth: Floats) -> Floats:
        coupled = np.matmul(self._couplings(change, 0, len(change)), growth[..., None])[..., 0]
        return np.asarray(self._pulls(change) + 2 * coupled)

    def _couplings(self, change: Floats, first: int, last: int) -> Floats:
        """M = V/8 C_k : D : C_l."""
        from truespring.kernels import links
        from truespring.kernels.threads import run

        works, share = self._work.work[first:last], 1 / (2 * self._volumes[first:last])
        coupling = np.empty((len(works), works.shape[1], works.shape[1]))
        known = (self._response(change, first, last).elasticity(), works, share)
        run(links.couplings, len(works), *known, coupling, smallest=_SMALLEST_PIECE)
        return coupling

    def _link_energies(self, change: Floats) -> Floats:
        """No law but the quadratic ones tells whose the energy is: its element's links have equal shares."""
        n_links = change.shape[1]
        return np.repeat(self._energies(change)[:, None] / n_links, n_links, axis=1)
