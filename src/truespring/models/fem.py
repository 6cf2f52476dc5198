"""Finite elements on the same mesh, the embedded reference: shape functions and quadrature by scikit-fem."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol, runtime_checkable

import numpy as np
import skfem
from skfem.quadrature import get_quadrature

from truespring.arrays import Floats, Ints
from truespring.errors import ModelError, nearest
from truespring.mesh import CELL_SHAPES, ELEMENT_KINDS, MIXED, Mesh, counted
from truespring.models.law import Constants, Law, Response
from truespring.models.laws import LAWS, law_constants
from truespring.models.strain import voigt_pairs
from truespring.models.symmetric import contracted, identity, voigt_places
from truespring.potential import Pattern, Potential, SparseMatrix
from truespring.problem import Problem

if TYPE_CHECKING:
    from truespring.models.summed import SummedElements

#: Kinds whose strain is one, as long as they are of first order.
SIMPLICES = ("triangle", "tetrahedron")

#: Above this Poisson's ratio elements of first order lock; others are then the default.
LOCKING_POISSON = 0.4

#: Interpolations of `Fem.element`: those that are quadratic for meshes of triangles or of tetrahedra, mean dilatation
#: for others.
ELEMENTS = ("linear", "mean-dilatation", "quadratic", "quadratic-mean-dilatation")

# scikit-fem's element of each kind and its quadrature: the order, or for the constant strain of a triangle its one
# point and weight. 2 Gauss points a direction integrate polynomials of third order.
_SKFEM: dict[str, tuple[Any, Any]] = {
    "triangle": (skfem.ElementTriP1, (np.full((2, 1), 1 / 3), np.array([0.5]))),
    "quadrilateral": (skfem.ElementQuad1, 3),
    "tetrahedron": (skfem.ElementTetP1, 1),
    "hexahedron": (skfem.ElementHex1, 3),
}

# Points and weights of kinds that scikit-fem lacks, or lacks a quadrature of, in the coordinates of CELL_SHAPES.
# Wedges: three points of a triangle by two Gauss points along, as full as those of hexahedra. Pyramids: strain is the
# same all along a line to the tip, since shape functions and places shrink alike towards it. So one point along it,
# at the centre, with the integral of the shrinking (1 - z)^2, is exact, beside two Gauss points along x and y.
_GAUSS = 1 / np.sqrt(3)
_TRIANGLE = np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]])
_QUADRATURE: dict[str, tuple[Floats, Floats]] = {
    "wedge": (np.array([(*at, (1 + z) / 2) for at in _TRIANGLE for z in (-_GAUSS, _GAUSS)]), np.full(6, 1 / 12)),
    "pyramid": (
        np.array([(0.75 * x, 0.75 * y, 0.25) for x in (-_GAUSS, _GAUSS) for y in (-_GAUSS, _GAUSS)]),
        np.full(4, 1 / 3),
    ),
}

# scikit-fem counts the corners of a hexahedron in another order than VTK: its places of ours.
_ORDER = {"hexahedron": np.array([7, 4, 1, 5, 6, 2, 0, 3])}

# What laws answer is held for so many Gauss points at a time, which stays in the processor's cache.
_SLICE_POINTS = 8192
# Threads share the elements of a slice from so many on.
_SMALLEST_PIECE = 32


@dataclass(frozen=True)
class Fem:
    """The finite element model.

    Attributes:
        law: a key of LAWS.
        element: "linear", full integration, 2 Gauss points a direction; "mean-dilatation" (quadrilaterals, hexahedra,
            wedges and pyramids), whose volume changes as a whole; "quadratic" (triangles and tetrahedra), with nodes
            in the middle of the edges, and "quadratic-mean-dilatation", these with lambda's part of the law at the
            mean volume. None takes what does not lock: quadratic ones on triangles and tetrahedra, since linear ones
            are too stiff in bending at any Poisson's ratio, and mean dilatation on all of them above a Poisson's ratio
            of 0.4 in plane strain and in 3D; linear ones on others. On a mesh of several kinds triangles and
            tetrahedra are linear: quadratic ones do not meet the others.
    """

    law: str
    element: str | None = None

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise ModelError(f"law = '{self.law}' is unknown{nearest(self.law, LAWS)}; allowed: {', '.join(LAWS)}")
        if self.element is not None and self.element not in ELEMENTS:
            close = nearest(self.element, ELEMENTS)
            raise ModelError(f"element = '{self.element}' is unknown{close}; allowed: {', '.join(ELEMENTS)}")

    kind = "fem"

    @property
    def label(self) -> str:
        """How curves and tables call the model: the law is always named."""
        asked = "" if self.element is None else f" ({self.element.replace('-', ' ')})"
        return f"{LAWS[self.law].label} FEM{asked}"

    def chosen_element(self, problem: Problem) -> str:
        """Return the interpolation on the problem's mesh; raise ModelError where the one asked for is not for it."""
        if self.element is None:
            usual, incompressible = self._defaults(problem)
            return incompressible if locks(problem) else usual
        allowed = self._allowed(problem)
        if self.element not in allowed:
            within = f" in {problem.section.words}" if problem.section and _free_thickness(problem) else ""
            raise ModelError(
                f"element = '{self.element}' is not for a mesh of {problem.mesh.kinds} elements{within}; "
                f"allowed here: {', '.join(allowed)}"
            )
        return self.element

    def second_order(self, problem: Problem) -> "Fem | None":
        """Return the model of second order on triangles or tetrahedra; None where the own elements are as good."""
        return Fem(self.law) if self.chosen_element(problem) == "linear" else None

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return what should be known before the model is solved: elements that lock, or that are too stiff."""
        chosen, stiff = self.chosen_element(problem), _stiff_simplices(problem)
        if chosen != "linear" or not locks(problem):
            return stiff
        largest = max(material.poisson for material in problem.materials)
        return (
            f"linear elements lock at a Poisson's ratio of {largest:g}: they are too stiff; "
            f'element = "{self._defaults(problem)[-1]}", the default here, does not lock',
            *stiff,
        )

    def potential(self, problem: Problem) -> "FemPotential | SummedElements":
        """Return the potential on the problem's mesh."""
        from truespring.models.mean_dilatation import MeanDilatationPotential
        from truespring.models.quadratic import QuadraticPotential
        from truespring.models.quadratic_mean import QuadraticMeanPotential

        own = (FemPotential, MeanDilatationPotential, QuadraticPotential, QuadraticMeanPotential)
        kinds = {kind.interpolation: kind for kind in own}
        return fem_potential(problem, self.law, kinds[self.chosen_element(problem)])

    def _defaults(self, problem: Problem) -> tuple[str, str]:
        """Return the default interpolations on the mesh: usually, and where the usual one locks."""
        if problem.mesh.element not in SIMPLICES:
            return "linear", "mean-dilatation"
        return "quadratic", "quadratic" if LAWS[self.law].trace is None else "quadratic-mean-dilatation"

    def _allowed(self, problem: Problem) -> tuple[str, ...]:
        """Return the interpolations that the mesh and the law allow."""
        found = dict.fromkeys(("linear", *self._defaults(problem)))
        if _free_thickness(problem):  # the third direction is free to take lambda's part
            found.pop("quadratic-mean-dilatation", None)
        return tuple(found)


def _free_thickness(problem: Problem) -> bool:
    """Whether the body changes its thickness freely: plane stress."""
    return problem.section is not None and problem.section.free_thickness


def _stiff_simplices(problem: Problem) -> tuple[str, ...]:
    """What should be known of simplices beside elements of other kinds."""
    blocks = problem.mesh.blocks
    simplices = [counted(len(numbers), part.element) for numbers, part in blocks if part.element in SIMPLICES]
    if not simplices or len(blocks) == 1:
        return ()
    return (
        f"the {simplices[0]} beside other kinds of elements are linear, too stiff in bending and where the material is "
        "nearly incompressible: keep them few and away from where it matters, or mesh the body with them alone: "
        "they are quadratic then",
    )


def locks(problem: Problem) -> bool:
    """Return whether linear elements are known to lock: nearly incompressible, and not free to change thickness."""
    incompressible = any(material.poisson > LOCKING_POISSON for material in problem.materials)
    return incompressible and not _free_thickness(problem)


def locking_warnings(problem: Problem) -> tuple[str, ...]:
    """Return what should be known of a model that is linear elements in another form: that these lock."""
    if not locks(problem):
        return ()
    largest = max(material.poisson for material in problem.materials)
    return (
        f"at a Poisson's ratio of {largest:g} these elements lock, as linear ones of FEM do: they are too stiff; "
        'kind = "fem" has elements that do not',
    )


def fem_potential(
    problem: Problem, law: str, kind: "type[FemPotential] | None" = None
) -> "FemPotential | SummedElements":
    """Set up quadrature and constants of `law` on the problem's mesh, of several kinds of elements on each of them."""
    _require_continuum(problem)
    if problem.mesh.element == MIXED:
        from truespring.models.summed import SummedElements

        return SummedElements(tuple(_of_one_kind(part, law, kind) for _, part in problem.blocks), problem)
    return _of_one_kind(problem, law, kind)


def _require_continuum(problem: Problem) -> None:
    if problem.material is None or problem.section is None or problem.mesh.element == "line":
        kinds = ", ".join((*_SKFEM, *_QUADRATURE))
        raise ModelError(f"finite elements need a material, a section and elements of a kind among {kinds}")


def _of_one_kind(problem: Problem, law: str, kind: "type[FemPotential] | None") -> "FemPotential":
    return (kind or FemPotential)(problem, LAWS[law], law_constants(problem, law))


def element_matrices(problem: Problem) -> Floats:
    """Return each element's linear stiffness matrix [N/m], shape (n_elements, n_dof, n_dof), dofs node by node.

    Of elements of one kind.
    """
    return fem_of_one_kind(problem, "linear").element_hessians(problem.mesh.nodes)


def fem_of_one_kind(problem: Problem, law: str) -> "FemPotential":
    """Return the finite elements of a mesh of one kind; raises MeshError for others."""
    _require_continuum(problem)
    _ = problem.mesh.kind
    return _of_one_kind(problem, law, None)


class Reference(NamedTuple):
    """What is known of every element of a kind, axes (point, node of the element, direction) and (point,).

    Attributes:
        corner_slopes: derivatives of the functions that place the reference element in space.
        slopes: derivatives of its shape functions.
        weights: of the Gauss points.
    """

    corner_slopes: Floats
    slopes: Floats
    weights: Floats


def reference_element(kind: str, element: Any = None, order: int | None = None) -> Reference:
    """Return scikit-fem's reference element of a kind: of first order, or `element` with the quadrature of `order`.

    Of pyramids it is the element of Bedrosian (IEEE Transactions on Magnetics 28, 1992), whose shape functions are
    rational: a hexahedron with four corners made one.
    """
    if kind in _QUADRATURE:
        at, of_points = _QUADRATURE[kind]
        by_point = np.ascontiguousarray(CELL_SHAPES[ELEMENT_KINDS[kind].vtk].slopes(at))
        return Reference(by_point, by_point, of_points)
    corners, own = _SKFEM[kind]
    rule = own if order is None else order
    points, weights = rule if isinstance(rule, tuple) else get_quadrature(corners.refdom, rule)

    def slopes(functions: Any) -> Floats:
        by_node = [functions.lbasis(points, node)[1] for node in range(len(functions.doflocs))]
        return np.ascontiguousarray(np.stack(by_node)[_ORDER.get(kind, slice(None))].transpose(2, 0, 1))

    return Reference(slopes(corners()), slopes(corners() if element is None else element), weights)


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
