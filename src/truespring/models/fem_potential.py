"""The potential of finite elements of one kind: the energy density of a law, integrated over the undeformed body."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import ClassVar, Protocol, TypeVar, runtime_checkable

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.assembly import Pattern, dense
from truespring.errors import ModelError
from truespring.fibres import Families
from truespring.mesh import Mesh
from truespring.models.carried import Deformed, advanced
from truespring.models.elasticity_parts import Elasticity
from truespring.models.fibres import stiff_fibres, with_fibres
from truespring.models.gauss_points import Points, determinant
from truespring.models.law import FRAMES, Constants, Law, Response
from truespring.models.laws import LAWS, law_constants
from truespring.models.reference_element import FEM_KINDS, Reference, reference_element
from truespring.models.semidefinite import semidefinite
from truespring.models.strain import voigt_pairs
from truespring.models.symmetric import voigt_places
from truespring.potential import Potential, SparseMatrix
from truespring.problem import Problem

# Number of Gauss points that are evaluated at a time, so that the response of the law fits in the processor's cache.
_SLICE_POINTS = 4096
# Smallest number of blocks of elements for which threads share a slice.
_SMALLEST_PIECE = 4

_Result = TypeVar("_Result")


@runtime_checkable
class FiniteElements(Potential, Protocol):
    """A potential of finite elements, with a law and an interpolation."""

    @property
    def law(self) -> Law:
        """The constitutive law."""
        ...

    @property
    def interpolation(self) -> str:
        """The interpolation, one of ELEMENTS."""
        ...


@dataclass(frozen=True, eq=False)
class FemPotential:
    """Elastic energy of a mesh of finite elements, integrated over the undeformed body.

    The integrands are those of `Points`. Elements are evaluated slice by slice; only the sparsity pattern is stored.

    Attributes:
        problem: mesh, material and section.
        law: the constitutive law.
        constants: its constants.
        fibres: fibres whose energy is added to that of a law of finite strain; None without.
    """

    problem: Problem
    law: Law
    constants: Constants
    fibres: Families | None = None

    #: The interpolation, one of ELEMENTS.
    interpolation: ClassVar[str] = "linear"

    @property
    def mesh(self) -> Mesh:
        """The problem's mesh."""
        return self.problem.mesh

    @property
    def nodes(self) -> Floats:
        """Undeformed positions [m], shape (n_nodes, dim)."""
        return self.mesh.nodes

    @property
    def elements(self) -> Ints:
        """Node numbers of each element, corners first, shape (n_elements, k)."""
        return self.mesh.elements

    @cached_property
    def _reference(self) -> Reference:
        return reference_element(self.mesh.element)

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.elements, *self.nodes.shape)

    def slices(self, first: int = 0, last: int | None = None) -> Iterator[tuple[int, int]]:
        """Divide a range of elements, by default all, into slices; return the first and last element of each."""
        from truespring.kernels.lanes import LANES

        end = len(self.elements) if last is None else last
        # An odd number of blocks: rows whose length is a power of two compete for the same lines of the cache.
        blocks = max(1, _SLICE_POINTS // len(self._reference.weights) // LANES) - 1 | 1
        step = blocks * LANES
        return ((begin, min(begin + step, end)) for begin in range(first, end, step))

    def quadrature(self, first: int = 0, last: int | None = None) -> tuple[Floats, Floats]:
        """Return gradients of the shape functions [1/m] and undeformed volumes [m^3] of the Gauss points of a slice.

        Axes (element, point, node of the element, direction) and (element, point).
        """
        end = len(self.elements) if last is None else last
        at = self._points(self.nodes, first, end)
        rows = np.moveaxis(at.gradients, -1, 1).reshape(-1, self.elements.shape[1], at.dim, len(at.volumes))
        gradients = np.moveaxis(rows[: at.count], -1, 1)
        return np.ascontiguousarray(gradients), np.ascontiguousarray(at.own(at.volumes).T)

    @property
    def _zero(self) -> tuple[float, ...]:
        return (0.0,) * self.mesh.dim

    def _points(self, positions: Floats, first: int, last: int) -> Points:
        """Return the Gauss points of a slice of the elements."""
        from truespring.kernels import elements
        from truespring.kernels.lanes import LANES
        from truespring.kernels.threads import run, writable

        section = self.problem.section
        assert section is not None  # see require_continuum
        corner_slopes, slopes, weights = self._reference
        chosen = filled_up(first, last)
        nodes, dim, n_points = writable(self.elements[chosen]), self.mesh.dim, len(weights)
        n = len(nodes)
        gradients = np.empty((n // LANES, slopes.shape[1] * dim * n_points, LANES))
        F = np.empty((dim, dim, n_points, n))
        volumes, J = np.empty((n_points, n)), np.empty((n_points, n))
        strain, frame = np.empty((len(voigt_pairs(dim)), n_points, n)), self.law.frame
        found = (gradients, volumes, F.reshape(-1, n), J, strain.reshape(-1, n))
        places = (writable(self.nodes), writable(positions), nodes)
        parent = (corner_slopes, slopes, section.thickness * weights, FRAMES.index(frame), voigt_places(dim))
        run(elements.deformations, n // LANES, *places, *parent, *found, self._zero, smallest=_SMALLEST_PIECE)
        fibres = None if self.fibres is None else self.fibres.of(chosen)
        constants = self.constants.of(chosen)
        return Points(frame, last - first, nodes, gradients, volumes, F, J, strain, constants, fibres)

    def _strain(self, at: Points) -> Floats:
        """Return the strain at which the law is evaluated, axes (component, point, element)."""
        return at.strain

    def _respond(self, at: Points) -> Response:
        """Return the response of the law and of the fibres, in the frame of the points."""
        response = self._law_response(at)
        return response if at.fibres is None else with_fibres(response, self._law_gradient(at), at)

    def _law_response(self, at: Points) -> Response:
        return self.law.in_frame(self._strain(at), at.constants)

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]; infinite if an element is inverted and the law has a barrier."""

        def stored(first: int, last: int) -> float:
            at = self._points(positions, first, last)
            if self._inverted(at):
                return float("inf")
            density = self._respond(at).energy
            return float(at.own(density * at.volumes).sum()) if np.isfinite(density).all() else float("inf")

        with np.errstate(all="ignore"):
            return sum(self._by_slice(stored), 0.0)

    def _inverted(self, at: Points) -> bool:
        """Return whether an element is inverted and the law has a barrier."""
        return self.law.barrier and bool((at.J <= 0).any())

    def stress(self, positions: Floats) -> Floats:
        """Return the second Piola-Kirchhoff stress at the Gauss points [Pa], axes (component, point, element)."""

        return self._everywhere(positions, lambda at, _: self._deformed(at).reference(self._respond(at).stress))

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return the stress [Pa], shape as `stress`, extrapolated along `step` [m] by the elasticity of the law.

        If the pressure is carried apart, see `carried`, the result is not linear in the step.
        """

        def extrapolated(at: Points, ends: tuple[int, int]) -> Floats:
            response, growth = self._respond(at), self._strain_change(at, step)
            change = self._stress_change(at, response, growth)
            before = self._deformed(at)
            if not self._carries_pressure:
                return before.reference(response.stress + change)
            after = self._deformed(self._points(positions + step, *ends))
            return advanced(before, after, response.stress, change, growth)

        return self._everywhere(positions, extrapolated)

    @property
    def _carries_pressure(self) -> bool:
        """Whether the pressure is carried along a step apart from the rest of the stress: if it depends on ln J."""
        return self.law.finite and self.law.trace == "logarithmic"

    def _deformed(self, at: Points) -> Deformed:
        """Return points with the deformation of the law."""
        return Deformed(at, self._law_gradient(at), self._strain(at))

    def _excess(self, at: Points, response: Response, stress: Floats | None) -> Floats | None:
        """Return the pressure of the law over that of a given stress [Pa], axes (point, element); None without."""
        if stress is None or not self._carries_pressure:
            return None
        return at.pressure_of(response.stress - stress, self._strain(at))

    def _elasticity(self, at: Points, response: Response, excess: Floats | None) -> Elasticity:
        """Return the elasticity [Pa] with the pressure of the law less `excess`, see `_excess`."""
        elasticity = response.elasticity()
        return elasticity if excess is None else elasticity.plus(at.of_metric(0.0, excess, self._strain(at)))

    def _stress_change(self, at: Points, response: Response, change: Floats) -> Floats:
        """Return the linear change of the stress for a change of strain [Pa], axes (component, point, element)."""
        return response.elasticity().times(change)

    def _everywhere(self, positions: Floats, stress: Callable[[Points, tuple[int, int]], Floats]) -> Floats:
        """Return the results of `stress` for all slices [Pa], axes (component, point, element)."""
        n_components, n_points = len(voigt_pairs(self.mesh.dim)), len(self._reference.weights)
        result = np.empty((n_components, n_points, len(self.elements)))

        def write(first: int, last: int) -> None:
            at = self._points(positions, first, last)
            result[..., first:last] = at.own(stress(at, (first, last)))

        self._by_slice(write)
        return result

    def _by_slice(self, function: Callable[[int, int], _Result]) -> list[_Result]:
        """Return function(first, last) of all slices in order; several threads share the slices."""
        from truespring.kernels.threads import run

        slices = list(self.slices())

        def some(begin: int, end: int) -> list[_Result]:
            return [function(*ends) for ends in slices[begin:end]]

        return list(chain.from_iterable(run(some, len(slices), smallest=1)))

    def _strain_change(self, at: Points, step: Floats) -> Floats:
        """Return the linear change of the strain of the law for a step, axes (component, point, element)."""
        return at.strain_change(step)

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        forces = np.empty((len(self.elements), self.elements.shape[1] * self.mesh.dim))

        def write(first: int, last: int) -> None:
            at = self._points(positions, first, last)
            forces[first:last] = at.own(at.forces(self._working_stress(at))).T

        self._by_slice(write)
        return self._pattern.vector(forces)

    def _working_stress(self, at: Points) -> Floats:
        """Return the stress that is work-conjugate to the strain [Pa], axes (component, point, element)."""
        return self._respond(at).stress

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Return the tangent stiffness [N/m]; `stress` [Pa] gives the geometric part, by default the current one."""
        return self._pattern.summed_pairs(self.slices(), lambda *ends: self._pairs_of(positions, stress, *ends))

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the sum of the element Hessians, each with its negative eigenvalues set to zero [N/m]."""

        def positive(first: int, last: int) -> Floats:
            return semidefinite(self.element_hessians(positions, None, first, last), self.mesh.dim)

        return self._pattern.summed(positive)

    def element_hessians(
        self, positions: Floats, stress: Floats | None = None, first: int = 0, last: int | None = None
    ) -> Floats:
        """Return the tangent stiffness of elements, by default all [N/m], shape (n, n_dof, n_dof), node by node."""
        k, dim = self.elements.shape[1], self.mesh.dim
        parts = [
            dense(self._pairs_of(positions, stress, begin, end), k, dim)[: end - begin]
            for begin, end in self.slices(first, last)
        ]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _pairs_of(self, positions: Floats, stress: Floats | None, first: int, last: int) -> Floats:
        """Return the tangent stiffness of a slice of the elements [N/m], as `Points.matrices` does."""
        at = self._points(positions, first, last)
        if stress is None:
            return self._tangent(at, None)
        given = np.ascontiguousarray(stress[..., filled_up(first, last)])
        return self._tangent(at, at.from_reference(given, self._law_gradient(at)))

    def _tangent(self, at: Points, stress: Floats | None) -> Floats:
        """Return element matrices [N/m]; `stress` [Pa] gives the geometric part, by default that of the law."""
        response = self._respond(at)
        elasticity = self._elasticity(at, response, self._excess(at, response, stress))
        return at.matrices(response.stress if stress is None else stress, elasticity)

    @property
    def cells(self) -> dict[str, Ints]:
        """The elements by VTK name of their kind, shape (n_elements, nodes)."""
        return self.mesh.cells

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return the true stress [Pa], shape (n_elements, 9), and strain energy [J], shape (n_elements,)."""
        energy = np.empty(len(self.elements))
        for first, last in self.slices():
            at = self._points(positions, first, last)
            energy[first:last] = at.own((self._respond(at).energy * at.volumes).sum(axis=0))
        return {"stress": self.cauchy_stress(positions).reshape(-1, 9), "strain_energy": energy}

    def cauchy_stress(self, positions: Floats) -> Floats:
        """Return the true stress, averaged over the Gauss points of each element [Pa], shape (n_elements, 3, 3).

        The Kirchhoff stress over the volume ratio, which includes the change of thickness; for the linear law, its
        stress.
        """
        stress = np.empty((len(self.elements), 3, 3))
        for first, last in self.slices():
            at = self._points(positions, first, last)
            by_point = self._true_stress(at, self._respond(at))
            stress[first:last] = np.moveaxis(at.own(by_point.mean(axis=-2)), -1, 0)
        return stress

    def _law_gradient(self, at: Points) -> Floats:
        """Return the deformation gradient at which the law is evaluated, axes (i, j, point, element)."""
        return at.F

    def _true_stress(self, at: Points, response: Response) -> Floats:
        """Return the true stress of a response of the law [Pa], axes (i, j, point, element), in 3D."""
        dim, F = at.dim, self._law_gradient(at)
        stress = np.zeros((3, 3, *F.shape[2:]))
        stress[2, 2] = response.across
        stress[:dim, :dim] = response.stress[voigt_places(dim)]
        if at.frame == "reference":
            stress[:dim, :dim] = np.einsum("ik...,kl...,jl...->ij...", F, stress[:dim, :dim], F)
        if at.frame != "small":
            volume = determinant(F) * response.thickness_stretch
            stress = np.divide(stress, volume, out=np.full_like(stress, np.nan), where=volume != 0)
        return stress


def filled_up(first: int, last: int) -> Ints | slice:
    """Return the indices of a slice of the elements, filled up with its last one to a multiple of LANES."""
    from truespring.kernels.lanes import LANES

    missing = (first - last) % LANES
    return np.minimum(np.arange(first, last + missing), last - 1) if missing else slice(first, last)


def require_continuum(problem: Problem) -> None:
    """Raise ModelError if a problem has no material or section, or a mesh of lines."""
    if problem.material is None or problem.section is None or problem.mesh.element == "line":
        kinds = ", ".join(FEM_KINDS)
        raise ModelError(f"finite elements require a material, a section and elements of one of the kinds {kinds}")


def of_one_kind(problem: Problem, law: str, kind: type[FemPotential] = FemPotential) -> FemPotential:
    """Return a potential of the class `kind` on a mesh of one kind of elements, with the fibres of the material."""
    return kind(problem, LAWS[law], law_constants(problem, law), stiff_fibres(problem))


def element_matrices(problem: Problem) -> Floats:
    """Return the linear stiffness matrices of elements of one kind [N/m], shape (n_elements, n_dof, n_dof)."""
    return fem_of_one_kind(problem, "linear").element_hessians(problem.mesh.nodes)


def fem_of_one_kind(problem: Problem, law: str) -> FemPotential:
    """Return the finite elements of a mesh of one kind of elements, without fibres.

    Raises MeshError if the mesh has several kinds.
    """
    require_continuum(problem)
    _ = problem.mesh.kind
    return FemPotential(problem, LAWS[law], law_constants(problem, law))
