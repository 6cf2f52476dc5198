"""Linear response of a body of simplices to uniform stress and pure bending, compared with the exact solution."""

import math
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ModelError
from truespring.mesh import Mesh
from truespring.models.by_rule import SpringsByRule
from truespring.models.fem_potential import fem_of_one_kind
from truespring.models.relaxation import pinned, relaxed
from truespring.models.rules import require_body
from truespring.problem import Problem
from truespring.remembering import remembered


class Response(NamedTuple):
    """Relative errors of the deformation of a body: negative if it is too stiff, positive if too soft.

    Attributes:
        stretch: error under a uniform stress along an axis, worst axis [-].
        bending: error in pure bending of the longest side, worst direction [-].
    """

    stretch: float
    bending: float

    @property
    def worst(self) -> float:
        """The larger error [-]."""
        return max(abs(self.stretch), abs(self.bending))


@remembered
def response(problem: Problem, springs: SpringsByRule) -> Response | None:
    """Return the response of a free body of triangles or tetrahedra; None if no equilibrium is found.

    The loads are the nodal forces of a stress field in equilibrium, the integral of stress : grad N, for a uniform
    stress along an axis and for the stress -y along x of pure bending. Their work on the displacement of the springs is
    compared with their work on the exact displacement, the integral of stress : stress / E. Elements that lock are too
    stiff in bending, not under uniform strain.
    """
    mesh = problem.mesh
    forces, works = _loads(problem)
    K = springs.potential(problem).hessian(mesh.nodes)
    moved = relaxed(K, forces, mesh.nodes, pinned(mesh.nodes), False)
    if moved is None:
        return None
    errors = (forces * moved).sum(axis=0) / works - 1
    worst = [float(part[np.abs(part).argmax()]) for part in (errors[: mesh.dim], errors[mesh.dim :])]
    return Response(*worst) if all(map(math.isfinite, worst)) else None


def _loads(problem: Problem) -> tuple[Floats, Floats]:
    """Return nodal forces [N], shape (n_dof, loads), and their work on the exact displacement [J], shape (loads,)."""
    mesh = problem.mesh
    if mesh.element not in ("triangle", "tetrahedron"):
        raise ModelError(f"the response is defined for triangles and tetrahedra, this mesh has {mesh.kinds} elements")
    material, section = require_body(problem)
    young, _ = section.apparent_moduli(material)
    gradients, volumes = (part[:, 0] for part in fem_of_one_kind(problem, "linear").quadrature())
    sides = np.argsort(mesh.lower - mesh.upper, kind="stable")
    middle = mesh.measures @ mesh.centres / mesh.measures.sum()
    forces, works = [], []
    for axis in range(mesh.dim):
        forces.append(_nodal(mesh, axis, gradients, volumes))
        works.append(float(volumes.sum()) / young)
    for up in sides[1:]:
        heights = (mesh.nodes - middle)[:, up][mesh.elements]
        forces.append(_nodal(mesh, int(sides[0]), gradients, -volumes * heights.mean(axis=1)))
        squares = ((heights**2).sum(axis=1) + heights.sum(axis=1) ** 2) @ volumes
        works.append(float(squares) / ((mesh.dim + 1) * (mesh.dim + 2)) / young)
    return np.stack(forces, axis=1), np.array(works)


def _nodal(mesh: Mesh, axis: int, gradients: Floats, weights: Floats) -> Floats:
    """Return nodal forces [N], shape (n_dof,), of a stress along an axis; `weights`: stress times volume [Pa m^3]."""
    force = np.zeros(mesh.nodes.shape)
    by_node = weights[:, None] * gradients[:, :, axis]
    force[:, axis] = np.bincount(mesh.elements.ravel(), by_node.ravel(), minlength=mesh.n_nodes)
    return force.ravel()
