"""The potential of finite elements of one kind: the energy of a law, integrated over the undeformed body."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple, Protocol, runtime_checkable

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.assembly import Pattern
from truespring.errors import ModelError
from truespring.mesh import Mesh
from truespring.models.law import Constants, Law, Response
from truespring.models.laws import LAWS, law_constants
from truespring.models.reference_element import FEM_KINDS, Reference, reference_element
from truespring.models.strain import voigt_pairs
from truespring.models.symmetric import contracted, identity, voigt_places
from truespring.potential import Potential, SparseMatrix
from truespring.problem import Problem

# What laws answer is held for so many Gauss points at a time, which stays in the processor's cache.
_SLICE_POINTS = 8192
# Threads share the elements of a slice from so many on.
_SMALLEST_PIECE = 32


class Points(NamedTuple):
    """The Gauss points of a slice of the elements at a deformed state.

    Attributes:
        gradients: of the shape functions [1/m], axes (element, point, node of the element, direction).
        volumes: reference volume of each point [m^3], axes (element, point).
        F: deformation gradient, axes (i, j, element, point).
        frame: F, of a linear law the identity: a change dF strains by the symmetric part of frame^T dF.
        constants: of the law.
    """

    gradients: Floats
    volumes: Floats
    F: Floats
    frame: Floats
    constants: Constants


@runtime_checkable
class FiniteElements(Potential, Protocol):
    """A potential of finite elements, which has a law and an interpolation."""

    @property
    def law(self) -> Law:
        """The constitutive law."""
        ...

    @property
    def interpolation(self) -> str:
        """One of ELEMENTS."""
        ...


@dataclass(frozen=True, eq=False)
class FemPotential:
    """Elastic energy of a mesh of finite elements, integrated over the reference body.

    With W the law's energy density, S its stress and D its elasticity at the deformation gradient F:
    energy W, gradient F S : grad v, Hessian F^T grad u : D : F^T grad v + S : (grad u^T grad v).
    The linear law has F = I in the last two and no geometric part. Elements are taken a slice at a
    time, and nothing is kept of them but the pattern of their sum.
    """

    problem: Problem
    law: Law
    constants: Constants

    #: One of ELEMENTS.
    interpolation: ClassVar[str] = "linear"

    @property
    def mesh(self) -> Mesh:
        """The problem's mesh."""
        return self.problem.mesh

    @property
    def nodes(self) -> Floats:
        """Reference positions [m], shape (n_nodes, dim)."""
        return self.mesh.nodes

    @property
    def elements(self) -> Ints:
        """Node numbers of each element, its corners first, shape (n_elements, k)."""
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

    def _slices(self, first: int = 0, last: int | None = None) -> Iterator[tuple[int, int]]:
        """Cut a range of elements, by default all, into slices."""
        end = len(self.elements) if last is None else last
        step = max(1, _SLICE_POINTS // len(self._reference.weights))
        return ((begin, min(begin + step, end)) for begin in range(first, end, step))

    def quadrature(self, first: int = 0, last: int | None = None) -> tuple[Floats, Floats]:
        """Gradients of the shape functions [1/m] and volume [m^3] of the Gauss points of a slice of the elements.

        Axes (element, point, node of the element, direction) and (element, point).
        """
        from truespring.kernels import elements
        from truespring.kernels.threads import run

        section = self.problem.section
        assert section is not None  # fem_potential refuses bodies without one
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
        gradients, volumes = self.quadrature(first, last)
        F = self._gradient_of(positions, gradients, first, last)
        frame = F if self.law.finite else np.zeros_like(F)
        if not self.law.finite:
            frame[np.diag_indices(len(F))] = 1.0
        return Points(gradients, volumes, F, frame, self.constants.part(first, last))

    def _gradient_of(self, field: Floats, gradients: Floats, first: int, last: int) -> Floats:
        """Gradient of a vector field given at the nodes, axes (i, j, element, point)."""
        from truespring.kernels import elements
        from truespring.kernels.threads import run

        values = field[self.elements[first:last]]
        result = np.empty((self.mesh.dim,) * 2 + gradients.shape[:2])
        run(elements.gradients, len(values), values, gradients, result, self._zero, smallest=_SMALLEST_PIECE)
        return result

    def _strain(self, at: Points) -> Floats:
        """What the law asks for: C = F^T F, or the small strain, axes (component, element, point)."""
        pairs = voigt_pairs(len(at.F))
        if self.law.finite:
            return np.stack([sum(row[i] * row[j] for row in at.F) for i, j in pairs])
        small = np.stack([(at.F[i, j] + at.F[j, i]) / 2 for i, j in pairs])
        return small - identity(small)

    def _respond(self, at: Points) -> Response:
        return self.law.respond(self._strain(at), at.constants)

    def energy(self, positions: Floats) -> float:
        """Stored energy [J]; infinite where a law with a barrier meets an inverted element."""
        total = 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            for first, last in self._slices():
                at = self._points(positions, first, last)
                density = self._respond(at).energy
                if self._refused(at) or not np.isfinite(density).all():
                    return float("inf")
                total += float((density * at.volumes).sum())
        return total

    def _refused(self, at: Points) -> bool:
        """Whether an element is inverted under a law with a barrier."""
        return self.law.barrier and bool((determinant(at.F) <= 0).any())

    def stress(self, positions: Floats) -> Floats:
        """Second Piola-Kirchhoff stress at the Gauss points [Pa], axes (component, element, point)."""
        return self._everywhere(lambda first, last: self._respond(self._points(positions, first, last)).stress)

    def extrapolated_stress(self, positions: Floats, step: Floats) -> Floats:
        """The stress carried on linearly along `step` [m] by the law's elasticity [Pa], axes as of `stress`."""

        def carried_on(first: int, last: int) -> Floats:
            at = self._points(positions, first, last)
            response = self._respond(at)
            change = self._strain_change(at, self._gradient_of(step, at.gradients, first, last))
            return response.stress + self._stress_change(at, response, change)

        return self._everywhere(carried_on)

    def _stress_change(self, at: Points, response: Response, change: Floats) -> Floats:
        """The change of the stress that is linear in one of the strain [Pa], axes (component, element, point)."""
        return contracted(response.elasticity(), change)

    def _everywhere(self, stress: Callable[[int, int], Floats]) -> Floats:
        """What `stress` gives for slices of the elements, for all."""
        n_components, n_points = len(voigt_pairs(self.mesh.dim)), len(self._reference.weights)
        result = np.empty((n_components, len(self.elements), n_points))
        for first, last in self._slices():
            result[:, first:last] = stress(first, last)
        return result

    def _strain_change(self, at: Points, change: Floats) -> Floats:
        """The change of the strain that is linear in one of F, axes (component, element, point)."""
        pairs = voigt_pairs(len(change))
        both = zip(at.frame, change, strict=True)
        rows = [[one[i] * other[j] + one[j] * other[i] for i, j in pairs] for one, other in both]
        return np.asarray(np.array(rows).sum(axis=0) / 2)

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        forces = np.empty((len(self.elements), self.elements.shape[1] * self.mesh.dim))
        for first, last in self._slices():
            at = self._points(positions, first, last)
            forces[first:last] = self._forces(at, self._working_stress(at))
        return self._pattern.vector(forces)

    def _working_stress(self, at: Points) -> Floats:
        """The stress whose work on the strain is that of the nodal forces [Pa], axes (component, element, point)."""
        return self._respond(at).stress

    def _forces(self, at: Points, stress: Floats) -> Floats:
        """Nodal forces [N] of a stress on the strain, shape (n, k * dim)."""
        from truespring.kernels import elements
        from truespring.kernels.threads import run

        n, _, k, dim = at.gradients.shape
        forces = np.empty((n, k * dim))
        known = (at.frame, stress, self._voigt, at.gradients, at.volumes)
        run(elements.forces, n, *known, forces, self._zero, smallest=_SMALLEST_PIECE)
        return forces

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Tangent stiffness [N/m]; `stress` [Pa] makes the geometric part, by default that of the positions."""
        return self._pattern.summed(lambda first, last: self.element_hessians(positions, stress, first, last))

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Sum of the element Hessians, each with its negative eigenvalues cut off [N/m]."""

        def positive(first: int, last: int) -> Floats:
            values, vectors = np.linalg.eigh(self.element_hessians(positions, None, first, last))
            return np.asarray((vectors * np.maximum(values, 0.0)[:, None]) @ vectors.swapaxes(1, 2))

        return self._pattern.summed(positive)

    def element_hessians(
        self, positions: Floats, stress: Floats | None = None, first: int = 0, last: int | None = None
    ) -> Floats:
        """Tangent stiffness of each element, or of a slice [N/m], shape (n, n_dof, n_dof), dofs node by node."""
        parts = []
        for begin, end in self._slices(first, last):
            given = None if stress is None else stress[:, begin:end]
            parts.append(self._tangent(self._points(positions, begin, end), given))
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _tangent(self, at: Points, stress: Floats | None) -> Floats:
        """Element matrices [N/m], the geometric part of `stress` or the law's own."""
        response = self._respond(at)
        return self._matrices(at, response.stress if stress is None else stress, response.elasticity())

    def _matrices(self, at: Points, stress: Floats, elasticity: Floats) -> Floats:
        """Element matrices [N/m] of a stress and an elasticity, shape (n, k * dim, k * dim)."""
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
        """The elements, shape (n_elements, nodes)."""
        return self.mesh.cells

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """True stress [Pa], 3 by 3 flattened, and strain energy [J] of each element."""
        energy = np.empty(len(self.elements))
        for first, last in self._slices():
            at = self._points(positions, first, last)
            energy[first:last] = (self._respond(at).energy * at.volumes).sum(axis=1)
        return {"stress": self.cauchy_stress(positions).reshape(-1, 9), "strain_energy": energy}

    def cauchy_stress(self, positions: Floats) -> Floats:
        """True stress averaged over the points of each element [Pa], shape (n_elements, 3, 3).

        F S F^T over the volume ratio, the change of thickness included; of the linear law, its stress.
        """
        stress = np.empty((len(self.elements), 3, 3))
        for first, last in self._slices():
            at = self._points(positions, first, last)
            by_point = self._true_stress(self._law_gradient(at), self._respond(at))
            stress[first:last] = np.moveaxis(by_point.mean(axis=-1), -1, 0)
        return stress

    def _law_gradient(self, at: Points) -> Floats:
        """The deformation gradient that the law answers to."""
        return at.F

    def _true_stress(self, F: Floats, response: Response) -> Floats:
        """True stress [Pa] of a law's response at F, axes (i, j, element, point) in space."""
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
    """Return the determinant of tensors whose axes come first."""
    if len(F) == 2:
        return np.asarray(F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0])
    minors = [F[1, j] * F[2, k] - F[1, k] * F[2, j] for j, k in ((1, 2), (2, 0), (0, 1))]
    return np.asarray(F[0, 0] * minors[0] + F[0, 1] * minors[1] + F[0, 2] * minors[2])


def require_continuum(problem: Problem) -> None:
    """Raise ModelError for a problem without a material or a section, and for a mesh of lines."""
    if problem.material is None or problem.section is None or problem.mesh.element == "line":
        kinds = ", ".join(FEM_KINDS)
        raise ModelError(f"finite elements need a material, a section and elements of a kind among {kinds}")


def of_one_kind(problem: Problem, law: str, kind: type[FemPotential] = FemPotential) -> FemPotential:
    """Return the potential of a class on a mesh of one kind of elements, its constants by material."""
    return kind(problem, LAWS[law], law_constants(problem, law))


def element_matrices(problem: Problem) -> Floats:
    """Return each element's linear stiffness matrix [N/m], shape (n_elements, n_dof, n_dof), dofs node by node.

    Of elements of one kind.
    """
    return fem_of_one_kind(problem, "linear").element_hessians(problem.mesh.nodes)


def fem_of_one_kind(problem: Problem, law: str) -> FemPotential:
    """Return the finite elements of a mesh of one kind; raises MeshError for others."""
    require_continuum(problem)
    _ = problem.mesh.kind
    return of_one_kind(problem, law)
