"""Finite elements on the same mesh, the embedded reference: shape functions and quadrature by scikit-fem."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import skfem

from truespring.arrays import Floats, Ints
from truespring.errors import ModelError, nearest
from truespring.material import PlaneStress
from truespring.mesh import Mesh
from truespring.models.laws import LAWS, Constants, Law, Response
from truespring.models.strain import voigt_pairs
from truespring.potential import Pattern, SparseMatrix
from truespring.problem import Problem

#: Above this Poisson's ratio elements of first order lock; others are then the default.
LOCKING_POISSON = 0.4

#: Interpolations of `Fem.element`. Mean dilatation is for quadrilaterals and hexahedra, quadratic for
#: triangles and tetrahedra.
ELEMENTS = ("linear", "mean-dilatation", "quadratic")

# scikit-fem's mesh and element of each kind, and its quadrature: the order, or for the constant strain of a
# triangle its one point. 2 Gauss points a direction integrate polynomials of third order.
_SKFEM: dict[str, tuple[Any, Any, dict[str, Any]]] = {
    "triangle": (skfem.MeshTri, skfem.ElementTriP1, {"quadrature": (np.full((2, 1), 1 / 3), np.array([0.5]))}),
    "quadrilateral": (skfem.MeshQuad, skfem.ElementQuad1, {"intorder": 3}),
    "tetrahedron": (skfem.MeshTet, skfem.ElementTetP1, {"intorder": 1}),
    "hexahedron": (skfem.MeshHex, skfem.ElementHex1, {"intorder": 3}),
}

# scikit-fem counts the corners of a hexahedron in another order than VTK: its places of ours.
_ORDER = {"hexahedron": np.array([7, 4, 1, 5, 6, 2, 0, 3])}


@dataclass(frozen=True)
class Fem:
    """The finite element model.

    Attributes:
        law: linear, saint-venant-kirchhoff, neo-hookean or hencky.
        element: "linear", full integration, 2 Gauss points a direction; "mean-dilatation" (quadrilaterals
            and hexahedra), whose volume changes as a whole; "quadratic" (triangles and tetrahedra), with
            nodes in the middle of the edges. None takes linear ones in the plane; in 3D, where these
            would lock, at a Poisson's ratio above 0.4, the other that the mesh allows.
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
        return f"{LAWS[self.law].label}{asked}"

    def chosen_element(self, problem: Problem) -> str:
        """Return the interpolation on the problem's mesh; raise ModelError where the one asked for is not for it."""
        finer = _finer(problem)
        if self.element is None:
            return finer if problem.mesh.dim == 3 and locks(problem) else "linear"
        if self.element not in ("linear", finer):
            raise ModelError(
                f"element = '{self.element}' is not for a mesh of {problem.mesh.element} elements; "
                f"allowed here: linear, {finer}"
            )
        return self.element

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return what should be known before the model is solved: elements that lock."""
        if self.chosen_element(problem) != "linear" or not locks(problem):
            return ()
        largest = max(material.poisson for material in problem.materials)
        return (
            f"linear elements lock at a Poisson's ratio of {largest:g}: they are too stiff in bending; "
            f'element = "{_finer(problem)}" makes them of a kind that does not',
        )

    def potential(self, problem: Problem) -> "FemPotential":
        """Return the potential on the problem's mesh."""
        from truespring.models.mean_dilatation import MeanDilatationPotential
        from truespring.models.quadratic import QuadraticPotential

        kinds = {kind.interpolation: kind for kind in (FemPotential, MeanDilatationPotential, QuadraticPotential)}
        return fem_potential(problem, self.law, kinds[self.chosen_element(problem)])


def _finer(problem: Problem) -> str:
    """The interpolation beside the linear one that the mesh allows."""
    return "quadratic" if problem.mesh.element in ("triangle", "tetrahedron") else "mean-dilatation"


def locks(problem: Problem) -> bool:
    """Return whether linear elements are known to lock: nearly incompressible, and not free to change thickness."""
    incompressible = any(material.poisson > LOCKING_POISSON for material in problem.materials)
    return incompressible and not isinstance(problem.section, PlaneStress)


def fem_potential(problem: Problem, law: str, kind: "type[FemPotential] | None" = None) -> "FemPotential":
    """Set up quadrature and constants of `law` on the problem's mesh."""
    if problem.material is None or problem.section is None or problem.mesh.element not in _SKFEM:
        raise ModelError(f"finite elements need a material, a section and elements of a kind among {', '.join(_SKFEM)}")
    plane_stress = isinstance(problem.section, PlaneStress)
    if len(problem.materials) == 1:
        constants = Constants(*problem.materials[0].lame, plane_stress)
    else:
        lam, mu = (problem.of_elements(value)[:, None] for value in (lambda one: one.lame.lam, lambda one: one.lame.mu))
        constants = Constants(lam, mu, plane_stress)
    return (kind or FemPotential)(problem, LAWS[law], constants)


def element_matrices(problem: Problem) -> Floats:
    """Return each element's linear stiffness matrix [N/m], shape (n_elements, n_dof, n_dof), dofs node by node."""
    return fem_potential(problem, "linear").element_hessians(problem.mesh.nodes)


@dataclass(frozen=True, eq=False)
class FemPotential:
    """Elastic energy of a mesh of finite elements, integrated over the reference body.

    With W the law's energy density, S its stress and A its elasticity at the deformation gradient F:
    energy W, gradient F S : grad v, Hessian F^T grad u : A : F^T grad v + S : (grad u^T grad v).
    The linear law has F = I in the last two and no geometric part. Elements are summed into the
    same fixed pattern as springs are.
    """

    problem: Problem
    law: Law
    constants: Constants
    _last: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

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
        """Node numbers of each element, in the order of its shape functions, shape (n_elements, k)."""
        return self.mesh.elements

    @cached_property
    def _basis(self) -> Any:
        return skfem_basis(self.mesh)

    @cached_property
    def shape_gradients(self) -> Floats:
        """Gradients of the shape functions [1/m], axes (node of the element, direction, element, point)."""
        order = _ORDER.get(self.mesh.element, slice(None))
        return np.stack([function.grad for (function,) in self._basis.basis])[order]

    @cached_property
    def _gradients(self) -> Floats:
        """The same, axes (element, point, node of the element, direction)."""
        return np.ascontiguousarray(np.moveaxis(self.shape_gradients, (2, 3), (0, 1)))

    @cached_property
    def volumes(self) -> Floats:
        """Reference volume of each Gauss point [m^3], axes (element, point)."""
        section = self.problem.section
        assert section is not None  # fem_potential refuses bodies without one
        return np.asarray(section.thickness * self._basis.dx)

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.elements, *self.nodes.shape)

    def _deformation(self, positions: Floats) -> Floats:
        """Deformation gradient at the Gauss points, axes (i, j, element, point)."""
        at = positions[self.elements].swapaxes(1, 2)
        return np.ascontiguousarray(np.moveaxis(at[:, None] @ self._gradients, (2, 3), (0, 1)))

    def _respond(self, positions: Floats) -> tuple[Floats, Response]:
        """Deformation gradient and the law's response; the last ones are kept, for energy, gradient and Hessian."""
        key = positions.tobytes()
        if self._last.get("key") != key:
            F = self._deformation(positions)
            if self.law.finite:
                strain = np.einsum("ki...,kj...->ij...", F, F)
            else:
                strain = (F + F.swapaxes(0, 1)) / 2 - np.eye(len(F))[:, :, None, None]
            self._last.update(key=key, F=F, response=self.law.respond(strain, self.constants))
        return self._last["F"], self._last["response"]

    def energy(self, positions: Floats) -> float:
        """Stored energy [J]; infinite where a law with a barrier meets an inverted element."""
        with np.errstate(over="ignore", invalid="ignore"):
            F, response = self._respond(positions)
        density = response.energy
        if not np.isfinite(density).all() or (self.law.barrier and (determinant(F) <= 0).any()):
            return float("inf")
        return float((density * self.volumes).sum())

    def stress(self, positions: Floats) -> Floats:
        """Second Piola-Kirchhoff stress at the Gauss points [Pa], axes (i, j, element, point)."""
        return self._respond(positions)[1].stress

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        F, response = self._respond(positions)
        first = np.einsum("ik...,kj...->ij...", F, response.stress) if self.law.finite else response.stress
        return self._summed(first)

    def _summed(self, first: Floats) -> Floats:
        """Nodal forces [N] of a first Piola-Kirchhoff stress, axes (i, j, element, point)."""
        forces = self.nodal(first * self.volumes).sum(axis=1)
        return self._pattern.vector(forces).reshape(self.nodes.shape)

    def nodal(self, first: Floats) -> Floats:
        """Return the derivative by the nodes of a density from that by F, axes (i, j, element, point).

        Its own axes are (element, point, node of the element, direction).
        """
        return np.asarray(self._gradients @ np.moveaxis(first, (1, 0), (2, 3)))

    def hessian(self, positions: Floats, stress: Floats | None = None) -> SparseMatrix:
        """Tangent stiffness [N/m]; `stress` [Pa] makes the geometric part, by default that of the positions."""
        return self._pattern.matrix(self.element_hessians(positions, stress))

    def projected_hessian(self, positions: Floats) -> SparseMatrix:
        """Sum of the element Hessians, each with its negative eigenvalues cut off [N/m]."""
        blocks = self.element_hessians(positions)
        values, vectors = np.linalg.eigh((blocks + blocks.swapaxes(1, 2)) / 2)
        return self._pattern.matrix(np.einsum("eik,ek,ejk->eij", vectors, np.maximum(values, 0.0), vectors))

    def element_hessians(self, positions: Floats, stress: Floats | None = None) -> Floats:
        """Tangent stiffness of each element [N/m], shape (n_elements, n_dof, n_dof), dofs node by node."""
        F, response = self._respond(positions)
        if not self.law.finite:
            F = np.broadcast_to(np.eye(len(F))[:, :, None, None], F.shape)
        return self._tangent(F, response.stress if stress is None else stress, response.elasticity)

    def _tangent(self, F: Floats, S: Floats, elasticity: Floats) -> Floats:
        """Element matrices [N/m] of a stress and an elasticity by Green's strain, at the deformation gradient F.

        B^T D B with B the derivative of the strain by the nodes, in Voigt's order; F is I for a linear law.
        """
        dim, n_local = len(F), self._gradients.shape[2]
        pairs = voigt_pairs(dim)
        columns = np.moveaxis(F, (0, 1), (3, 2))[:, :, :, None]  # of F, beside the gradients, (e, q, j, 1, i)

        def strain(j: int, k: int) -> Floats:
            return np.asarray(columns[:, :, j] * self._gradients[..., [k]])

        rows = [strain(j, k) if j == k else strain(j, k) + strain(k, j) for j, k in pairs]
        n_elements, n_points = self.volumes.shape
        B = np.stack(rows, axis=2).reshape(n_elements, n_points, len(pairs), dim * n_local)  # by Green's strain
        D = np.stack([np.stack([elasticity[one + two] for two in pairs], axis=-1) for one in pairs], axis=-2)
        weighted = (self.volumes[:, :, None, None] * D) @ B
        flat = (n_elements, n_points * len(pairs), dim * n_local)
        blocks = B.reshape(flat).swapaxes(1, 2) @ weighted.reshape(flat)
        if self.law.finite:
            stress = np.moveaxis(S * self.volumes, (0, 1), (2, 3))
            spread = (self._gradients @ stress @ self._gradients.swapaxes(2, 3)).sum(axis=1)
            by_node = blocks.reshape(n_elements, n_local, dim, n_local, dim)
            for i in range(dim):
                by_node[:, :, i, :, i] += spread
        return np.asarray(blocks)

    @property
    def cells(self) -> tuple[str, Ints]:
        """The elements, shape (n_elements, nodes)."""
        return self.mesh.kind.vtk, self.mesh.elements

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """True stress [Pa], 3 by 3 flattened, and strain energy [J] of each element."""
        stress = self.cauchy_stress(positions)
        energy = (self._respond(positions)[1].energy * self.volumes).sum(axis=1)
        return {"stress": stress.reshape(-1, 9), "strain_energy": energy}

    def cauchy_stress(self, positions: Floats) -> Floats:
        """True stress averaged over the points of each element [Pa], shape (n_elements, 3, 3).

        F S F^T over the volume ratio, the change of thickness included; of the linear law, its stress.
        """
        F, response = self._respond(positions)
        return true_stress(F, response, self.law.finite)


def true_stress(F: Floats, response: Response, finite: bool) -> Floats:
    """Return the true stress of a law's response at F, averaged over the points [Pa], shape (n_elements, 3, 3)."""
    dim = len(F)
    stress = np.zeros((3, 3, *F.shape[2:]))
    stress[2, 2] = response.across
    stress[:dim, :dim] = response.stress
    if finite:
        stress[:dim, :dim] = np.einsum("ik...,kl...,jl...->ij...", F, response.stress, F)
        volume = determinant(F) * response.thickness_stretch
        stress = np.divide(stress, volume, out=np.full_like(stress, np.nan), where=volume != 0)
    return np.moveaxis(stress.mean(axis=-1), -1, 0)


def skfem_basis(mesh: Mesh, element: Any = None, **quadrature: Any) -> Any:
    """Return scikit-fem's basis on a mesh: of its own kind of first order, or of the `element` given."""
    mesh_class, element_class, own_quadrature = _SKFEM[mesh.element]
    # scikit-fem's corner i is ours of number argsort(order)[i].
    order = np.argsort(_ORDER.get(mesh.element, np.arange(mesh.kind.n_nodes)))
    grid = mesh_class(
        np.ascontiguousarray(mesh.nodes.T),
        np.ascontiguousarray(mesh.elements[:, order].T),
        validate=False,
        sort_t=False,
    )
    return skfem.Basis(grid, element or element_class(), **(quadrature or own_quadrature))


def determinant(F: Floats) -> Floats:
    """Return the determinant of tensors whose axes come first."""
    return np.asarray(np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1))))
