"""Finite elements on the same mesh, the embedded reference: shape functions and quadrature by scikit-fem."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from skfem import Basis, ElementQuad1, MeshQuad

from truespring.arrays import Floats, Ints
from truespring.errors import ModelError, nearest
from truespring.material import PlaneStress
from truespring.mesh import Mesh
from truespring.models.laws import LAWS, Constants, Law, Response
from truespring.potential import Pattern, SparseMatrix
from truespring.problem import Problem

# scikit-fem's mesh and element of each kind, and the order of its quadrature: 2 x 2 Gauss points
# integrate polynomials of third order in each direction.
_SKFEM = {"quadrilateral": (MeshQuad, ElementQuad1, 3)}


@dataclass(frozen=True)
class Fem:
    """The finite element model with the constitutive `law`: linear, saint-venant-kirchhoff, neo-hookean or hencky."""

    law: str

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise ModelError(f"law = '{self.law}' is unknown{nearest(self.law, LAWS)}; allowed: {', '.join(LAWS)}")

    kind = "fem"

    @property
    def label(self) -> str:
        """How curves and tables call the model: the law is always named."""
        return LAWS[self.law].label

    def potential(self, problem: Problem) -> "FemPotential":
        """Return the potential of four-node quadrilaterals with 2 x 2 Gauss points."""
        return fem_potential(problem, self.law)


def fem_potential(problem: Problem, law: str) -> "FemPotential":
    """Set up quadrature and constants of `law` on the problem's mesh."""
    if problem.material is None or problem.section is None or problem.mesh.element not in _SKFEM:
        raise ModelError(f"finite elements need a material, a section and elements of a kind among {', '.join(_SKFEM)}")
    constants = Constants.of(problem.material.lame, isinstance(problem.section, PlaneStress))
    return FemPotential(problem.mesh, LAWS[law], constants, problem.section.thickness)


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

    mesh: Mesh
    law: Law
    constants: Constants
    thickness: float
    _last: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def nodes(self) -> Floats:
        """Reference positions [m], shape (n_nodes, dim)."""
        return self.mesh.nodes

    @cached_property
    def _basis(self) -> Any:
        mesh_class, element_class, order = _SKFEM[self.mesh.element]
        grid = mesh_class(
            np.ascontiguousarray(self.mesh.nodes.T), np.ascontiguousarray(self.mesh.elements.T), validate=False
        )
        return Basis(grid, element_class(), intorder=order)

    @cached_property
    def _shape_gradients(self) -> Floats:
        """Gradients of the shape functions [1/m], axes (node of the element, direction, element, point)."""
        return np.stack([function.grad for (function,) in self._basis.basis])

    @cached_property
    def _volumes(self) -> Floats:
        """Reference volume of each Gauss point [m^3], axes (element, point)."""
        return np.asarray(self.thickness * self._basis.dx)

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern(self.mesh.elements, *self.nodes.shape)

    def _deformation(self, positions: Floats) -> Floats:
        """Deformation gradient at the Gauss points, axes (i, j, element, point)."""
        return np.asarray(np.einsum("eai,ajeq->ijeq", positions[self.mesh.elements], self._shape_gradients))

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
        if not np.isfinite(density).all() or (self.law.barrier and (_determinant(F) <= 0).any()):
            return float("inf")
        return float((density * self._volumes).sum())

    def stress(self, positions: Floats) -> Floats:
        """Second Piola-Kirchhoff stress at the Gauss points [Pa], axes (i, j, element, point)."""
        return self._respond(positions)[1].stress

    def gradient(self, positions: Floats) -> Floats:
        """Internal force [N], shape (n_nodes, dim)."""
        F, response = self._respond(positions)
        first = np.einsum("ik...,kj...->ij...", F, response.stress) if self.law.finite else response.stress
        forces = np.einsum("ijeq,ajeq->eai", first * self._volumes, self._shape_gradients)
        return self._pattern.vector(forces).reshape(positions.shape)

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
        if self.law.finite:
            S = response.stress if stress is None else stress
            tangent = np.einsum("ai...,ijkl...,bk...->ajbl...", F, response.elasticity, F, optimize=True)
            tangent += np.einsum("ab,jl...->ajbl...", np.eye(len(F)), S)
        else:
            tangent = response.elasticity
        half = np.einsum("ijkleq,bleq->ijkbeq", tangent * self._volumes, self._shape_gradients)
        blocks = np.einsum("ajeq,ijkbeq->eaibk", self._shape_gradients, half)
        size = self._pattern.dofs.shape[1]
        return np.asarray(blocks.reshape(-1, size, size))

    @property
    def cells(self) -> tuple[str, Ints]:
        """The elements, shape (n_elements, nodes)."""
        return self.mesh.kind.vtk, self.mesh.elements

    def cell_fields(self, positions: Floats) -> dict[str, Floats]:
        """True stress [Pa], 3 by 3 flattened, and strain energy [J] of each element."""
        stress = self.cauchy_stress(positions)
        energy = (self._respond(positions)[1].energy * self._volumes).sum(axis=1)
        return {"stress": stress.reshape(-1, 9), "strain_energy": energy}

    def cauchy_stress(self, positions: Floats) -> Floats:
        """True stress averaged over the points of each element [Pa], shape (n_elements, 3, 3).

        F S F^T over the volume ratio, the change of thickness included; of the linear law, its stress.
        """
        F, response = self._respond(positions)
        dim = self.mesh.dim
        stress = np.zeros((3, 3, *F.shape[2:]))
        stress[2, 2] = response.across
        stress[:dim, :dim] = response.stress
        if self.law.finite:
            stress[:dim, :dim] = np.einsum("ik...,kl...,jl...->ij...", F, response.stress, F)
            volume = _determinant(F) * response.thickness_stretch
            stress = np.divide(stress, volume, out=np.full_like(stress, np.nan), where=volume != 0)
        return np.moveaxis(stress.mean(axis=-1), -1, 0)


def _determinant(F: Floats) -> Floats:
    return np.asarray(np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1))))
