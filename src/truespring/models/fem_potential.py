"""The potential of finite elements of one kind: the energy density of a law, integrated over the undeformed body."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple, Protocol, runtime_checkable

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.assembly import Pattern
from truespring.errors import ModelError
from truespring.fibres import Families
from truespring.mesh import Mesh
from truespring.models.carried import advanced, pressure_of
from truespring.models.fibres import stiff_fibres, with_fibres
from truespring.models.law import Constants, Law, Response
from truespring.models.laws import LAWS, law_constants
from truespring.models.reference_element import FEM_KINDS, Reference, reference_element
from truespring.models.semidefinite import semidefinite
from truespring.models.strain import voigt_pairs
from truespring.models.symmetric import contracted, identity, inverted, swapped, voigt_places
from truespring.potential import Potential, SparseMatrix
from truespring.problem import Problem

# Number of Gauss points that are evaluated at a time, so that the response of the law fits in the processor's cache.
_SLICE_POINTS = 8192
# Smallest number of elements for which threads share a slice.
_SMALLEST_PIECE = 32


class Points(NamedTuple):
    """The Gauss points of a slice of the elements in a deformed state.

    Attributes:
        gradients: gradients of the shape functions [1/m], axes (element, point, node of the element, direction).
        volumes: undeformed volume of each point [m^3], axes (element, point).
        F: deformation gradient [-], axes (i, j, element, point).
        frame: F, or the identity for a linear law: the change of strain is the symmetric part of frame^T dF.
        constants: constants of the law.
        fibres: fibres of the elements; None without.
    """

    gradients: Floats
    volumes: Floats
    F: Floats
    frame: Floats
    constants: Constants
    fibres: Families | None


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

    With energy density W, stress S and elasticity D of the law at the deformation gradient F, the integrands are:
    energy W, gradient F S : grad v, Hessian F^T grad u : D : F^T grad v + S : (grad u^T grad v) (Bonet and Wood,
    Nonlinear Continuum Mechanics). The linear law has F = I in the last two and no geometric part. Elements are
    evaluated slice by slice; only the sparsity pattern is stored.

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

    @cached_property
    def _voigt(self) -> Ints:
        return voigt_places(self.mesh.dim)

    def slices(self, first: int = 0, last: int | None = None) -> Iterator[tuple[int, int]]:
        """Divide a range of elements, by default all, into slices; return the first and last element of each."""
        end = len(self.elements) if last is None else last
        step = max(1, _SLICE_POINTS // len(self._reference.weights))
        return ((begin, min(begin + step, end)) for begin in range(first, end, step))

    def quadrature(self, first: int = 0, last: int | None = None) -> tuple[Floats, Floats]:
        """Return gradients of the shape functions [1/m] and undeformed volumes [m^3] of the Gauss points of a slice.

        Axes (element, point, node of the element, direction) and (element, point).
        """
        from truespring.kernels import elements
        from truespring.kernels.threads import run

        section = self.problem.section
        assert section is not None  # see require_continuum
        corner_slopes, slopes, weights = self._reference
        places = self.nodes[self.elements[first:last, : corner_slopes.shape[1]]]
        gradients = np.empty((len(places), *slopes.shape))
        volumes = np.empty((len(places), len(weights)))
        known = (places, corner_slopes, slopes, section.thickness * weights)
        run(elements.quadrature, len(places), *known, gradients, volumes, self._zero, smallest=_SMALLEST_PIECE)
        return gradients, volumes

    @property
    def _zero(self) -> tuple[float, ...]:
        return (0.0,) * self.mesh.dim

    def _points(self, positions: Floats, first: int, last: int) -> Points:
        """Return the Gauss points of a slice of the elements."""
        gradients, volumes = self.quadrature(first, last)
        F = self._gradient_of(positions, gradients, first, last)
        frame = F if self.law.finite else np.zeros_like(F)
        if not self.law.finite:
            frame[np.diag_indices(len(F))] = 1.0
        fibres = None if self.fibres is None else self.fibres.part(first, last)
        return Points(gradients, volumes, F, frame, self.constants.part(first, last), fibres)

    def _gradient_of(self, field: Floats, gradients: Floats, first: int, last: int) -> Floats:
        """Return the gradient of a vector field with the given nodal values, axes (i, j, element, point)."""
        from truespring.kernels import elements
        from truespring.kernels.threads import run

        values = field[self.elements[first:last]]
        result = np.empty((self.mesh.dim,) * 2 + gradients.shape[:2])
        run(elements.gradients, len(values), values, gradients, result, self._zero, smallest=_SMALLEST_PIECE)
        return result

    def _strain(self, at: Points) -> Floats:
        """Return C = F^T F, or the small strain for the linear law, axes (component, element, point)."""
        pairs = voigt_pairs(len(at.F))
        if self.law.finite:
            return np.stack([sum(row[i] * row[j] for row in at.F) for i, j in pairs])
        small = np.stack([(at.F[i, j] + at.F[j, i]) / 2 for i, j in pairs])
        return small - identity(small)

    def _respond(self, at: Points) -> Response:
        """Return the response of the law and of the fibres."""
        response = self._law_response(at)
        return response if at.fibres is None else with_fibres(response, self._strain(at), at.fibres)

    def _law_response(self, at: Points) -> Response:
        return self.law.respond(self._strain(at), at.constants)

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]; infinite if an element is inverted and the law has a barrier."""
        total = 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            for first, last in self.slices():
                at = self._points(positions, first, last)
                density = self._respond(at).energy
                if self._inverted(at) or not np.isfinite(density).all():
                    return float("inf")
                total += float((density * at.volumes).sum())
        return total

    def _inverted(self, at: Points) -> bool:
        """Return whether an element is inverted and the law has a barrier."""
        return self.law.barrier and bool((determinant(at.F) <= 0).any())

    def stress(self, positions: Floats) -> Floats:
        """Return the second Piola-Kirchhoff stress at the Gauss points [Pa], axes (component, element, point)."""
        return self._everywhere(lambda first, last: self._respond(self._points(positions, first, last)).stress)

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """Return the stress [Pa], shape as `stress`, extrapolated along `step` [m] by the elasticity of the law.

        If the pressure is carried apart, see `carried`, the result is not linear in the step.
        """

        def extrapolated(first: int, last: int) -> Floats:
            at = self._points(positions, first, last)
            response = self._respond(at)
            growth = self._strain_change(at, self._gradient_of(step, at.gradients, first, last))
            change = self._stress_change(at, response, growth)
            if not self._carries_pressure:
                return response.stress + change
            reached = self._strain(self._points(positions + step, first, last))
            return advanced(response.stress, change, self._strain(at), growth, reached)

        return self._everywhere(extrapolated)

    @property
    def _carries_pressure(self) -> bool:
        """Whether the pressure is carried along a step apart from the rest of the stress: if it depends on ln J."""
        return self.law.finite and self.law.trace == "logarithmic"

    def _excess(self, at: Points, response: Response, stress: Floats | None) -> Floats | None:
        """Return the pressure of the law over that of a given stress [Pa], axes (element, point); None without."""
        if stress is None or not self._carries_pressure:
            return None
        C = self._strain(at)
        return pressure_of(response.stress, C) - pressure_of(stress, C)

    def _elasticity(self, at: Points, response: Response, stress: Floats | None) -> Floats:
        """Return the elasticity [Pa] with the pressure of a given stress, two axes of components, (element, point)."""
        elasticity, excess = response.elasticity(), self._excess(at, response, stress)
        return elasticity if excess is None else elasticity + excess * swapped(inverted(self._strain(at)))

    def _stress_change(self, at: Points, response: Response, change: Floats) -> Floats:
        """Return the linear change of the stress for a change of strain [Pa], axes (component, element, point)."""
        return contracted(response.elasticity(), change)

    def _everywhere(self, stress: Callable[[int, int], Floats]) -> Floats:
        """Return the results of `stress` for all slices [Pa], axes (component, element, point)."""
        n_components, n_points = len(voigt_pairs(self.mesh.dim)), len(self._reference.weights)
        result = np.empty((n_components, len(self.elements), n_points))
        for first, last in self.slices():
            result[:, first:last] = stress(first, last)
        return result

    def _strain_change(self, at: Points, change: Floats) -> Floats:
        """Return the linear change of the strain for a change of F, axes (component, element, point)."""
        pairs = voigt_pairs(len(change))
        both = zip(at.frame, change, strict=True)
        rows = [[one[i] * other[j] + one[j] * other[i] for i, j in pairs] for one, other in both]
        return np.asarray(np.array(rows).sum(axis=0) / 2)

    def gradient(self, positions: Floats) -> Floats:
        """Return the internal force [N], shape (n_nodes, dim)."""
        forces = np.empty((len(self.elements), self.elements.shape[1] * self.mesh.dim))
        for first, last in self.slices():
            at = self._points(positions, first, last)
            forces[first:last] = self._forces(at, self._working_stress(at))
        return self._pattern.vector(forces)

    def _working_stress(self, at: Points) -> Floats:
        """Return the stress that is work-conjugate to the strain [Pa], axes (component, element, point)."""
        return self._respond(at).stress

    def _forces(self, at: Points, stress: Floats) -> Floats:
        """Return the nodal forces of a stress [N], shape (n, k * dim)."""
        from truespring.kernels import elements
        from truespring.kernels.threads import run

        n, _, k, dim = at.gradients.shape
        forces = np.empty((n, k * dim))
        known = (at.frame, stress, self._voigt, at.gradients, at.volumes)
        run(elements.forces, n, *known, forces, self._zero, smallest=_SMALLEST_PIECE)
        return forces

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Return the tangent stiffness [N/m]; `stress` [Pa] gives the geometric part, by default the current one."""
        return self._pattern.summed(lambda first, last: self.element_hessians(positions, stress, first, last))

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Return the sum of the element Hessians, each with its negative eigenvalues set to zero [N/m]."""

        def positive(first: int, last: int) -> Floats:
            return semidefinite(self.element_hessians(positions, None, first, last), self.mesh.dim)

        return self._pattern.summed(positive)

    def element_hessians(
        self, positions: Floats, stress: Floats | None = None, first: int = 0, last: int | None = None
    ) -> Floats:
        """Return the tangent stiffness of elements, by default all [N/m], shape (n, n_dof, n_dof), node by node."""
        parts = []
        for begin, end in self.slices(first, last):
            geometric = None if stress is None else stress[:, begin:end]
            parts.append(self._tangent(self._points(positions, begin, end), geometric))
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _tangent(self, at: Points, stress: Floats | None) -> Floats:
        """Return element matrices [N/m]; `stress` [Pa] gives the geometric part, by default that of the law."""
        response = self._respond(at)
        elasticity = self._elasticity(at, response, stress)
        return self._matrices(at, response.stress if stress is None else stress, elasticity)

    def _matrices(self, at: Points, stress: Floats, elasticity: Floats) -> Floats:
        """Return the element matrices of a stress and an elasticity [N/m], shape (n, k * dim, k * dim)."""
        from truespring.kernels import elements
        from truespring.kernels.threads import run, writable

        n, _, k, dim = at.gradients.shape
        blocks = np.empty((n, k * dim, k * dim))
        geometric = writable(stress) if self.law.finite else np.zeros(stress.shape)
        known = (at.frame, geometric, elasticity, self._voigt, at.gradients, at.volumes)
        zeros = self._zero, self._zero * dim
        run(elements.stiffnesses, n, *known, blocks, *zeros, smallest=_SMALLEST_PIECE)
        return blocks

    @property
    def cells(self) -> dict[str, Ints]:
        """The elements by VTK name of their kind, shape (n_elements, nodes)."""
        return self.mesh.cells

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """Return the true stress [Pa], shape (n_elements, 9), and strain energy [J], shape (n_elements,)."""
        energy = np.empty(len(self.elements))
        for first, last in self.slices():
            at = self._points(positions, first, last)
            energy[first:last] = (self._respond(at).energy * at.volumes).sum(axis=1)
        return {"stress": self.cauchy_stress(positions).reshape(-1, 9), "strain_energy": energy}

    def cauchy_stress(self, positions: Floats) -> Floats:
        """Return the true stress, averaged over the Gauss points of each element [Pa], shape (n_elements, 3, 3).

        F S F^T over the volume ratio, which includes the change of thickness; for the linear law, its stress.
        """
        stress = np.empty((len(self.elements), 3, 3))
        for first, last in self.slices():
            at = self._points(positions, first, last)
            by_point = self._true_stress(self._law_gradient(at), self._respond(at))
            stress[first:last] = np.moveaxis(by_point.mean(axis=-1), -1, 0)
        return stress

    def _law_gradient(self, at: Points) -> Floats:
        """Return the deformation gradient at which the law is evaluated, axes (i, j, element, point)."""
        return at.F

    def _true_stress(self, F: Floats, response: Response) -> Floats:
        """Return the true stress of a response of the law at F [Pa], axes (i, j, element, point), in 3D."""
        dim = len(F)
        stress = np.zeros((3, 3, *F.shape[2:]))
        stress[2, 2] = response.across
        stress[:dim, :dim] = response.stress[self._voigt]
        if self.law.finite:
            stress[:dim, :dim] = np.einsum("ik...,kl...,jl...->ij...", F, stress[:dim, :dim], F)
            volume = determinant(F) * response.thickness_stretch
            stress = np.divide(stress, volume, out=np.full_like(stress, np.nan), where=volume != 0)
        return stress


def determinant(F: Floats) -> Floats:
    """Return the determinant of tensors of axes (i, j, ...), axes (...), in their unit to the power of dim."""
    if len(F) == 2:
        return np.asarray(F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0])
    minors = [F[1, j] * F[2, k] - F[1, k] * F[2, j] for j, k in ((1, 2), (2, 0), (0, 1))]
    return np.asarray(F[0, 0] * minors[0] + F[0, 1] * minors[1] + F[0, 2] * minors[2])


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
