"""Linear equilibrium of springs near rest, for what is told of them before a solve."""

import numpy as np
from scipy import linalg, sparse

from truespring.arrays import Bools, Floats
from truespring.linear.choice import choose
from truespring.linear.direct import SingularMatrixError
from truespring.linear.gradients import IndefiniteError
from truespring.mesh import MIXED, Mesh
from truespring.models.by_rule import SpringsByRule
from truespring.models.links import link_vectors
from truespring.models.rules import require_body
from truespring.models.strain import uniform_strain, voigt_pairs
from truespring.modes import rigid_body_modes
from truespring.potential import SparseMatrix
from truespring.problem import Problem

# Unbalanced forces below this share of E h^(d-1) are rounding: a uniform strain is an equilibrium.
_BALANCED = 1e-8

# To this relative residual displacements are found; their energies are exact to its square.
_ACCURACY = 1e-6


def relaxed_elasticity(
    problem: Problem, springs: SpringsByRule, stiffness: Floats, negative: bool
) -> tuple[Floats | None, float]:
    """Return the elasticity of a body whose boundary is strained uniformly [Pa], and its patch score (see `Moduli`).

    None where nothing relaxes, whose score is 0, or where the body is not stable. `stiffness` is the part of each
    element in its springs [N/m], shape (n_elements, links), `negative` whether there are negative springs.
    """
    mesh = problem.mesh
    material, section = require_body(problem)
    inner = np.ones(mesh.n_nodes, dtype=bool)
    inner[mesh.boundary] = False
    if not inner.any():
        return None, 0.0
    K = None
    if mesh.element != MIXED and mesh.forms.few and (springs.sharing == "summed" or mesh.kind.sharing):
        force = _forces_by_form(mesh, stiffness)
    else:
        K = _at_rest(problem, springs)
        force = K @ _unit_strains(mesh)
    size = (mesh.measures.sum() / len(mesh.elements)) ** ((mesh.dim - 1) / mesh.dim)
    squares = (force.reshape(*mesh.nodes.shape, -1)[inner] ** 2).sum(axis=(0, 1)) / inner.sum()
    score = float(np.sqrt(squares.max())) / (material.young * section.thickness * size)
    if score <= _BALANCED:
        return None, 0.0
    K = _at_rest(problem, springs) if K is None else K
    strains, held = _unit_strains(mesh), np.repeat(~inner[:, None], mesh.dim, axis=1)
    definite = not negative and bool((springs.kappa(problem) > -1e-9 * material.young).all())
    relaxing = relaxed(K, -(K @ strains), mesh.nodes, held, definite)
    if relaxing is None:
        return None, score
    moved = strains + relaxing
    energy = moved.T @ (K @ moved)  # the least there is: errors of the displacement count by their square
    return np.asarray((energy + energy.T) / 2 / (section.thickness * mesh.measures.sum())), score


def _unit_strains(mesh: Mesh) -> Floats:
    """Displacements of unit uniform strains [m], a column each in Voigt's order, shape (n_dof, 3 or 6)."""
    return np.stack([uniform_strain(mesh.nodes, i, j).ravel() for i, j in voigt_pairs(mesh.dim)], axis=1)


def _at_rest(problem: Problem, springs: SpringsByRule) -> SparseMatrix:
    """The stiffness of the body at rest [N/m]."""
    return springs.allowing_negative().potential(problem).hessian(problem.mesh.nodes)


def _forces_by_form(mesh: Mesh, stiffness: Floats) -> Floats:
    """Nodal forces of springs under unit uniform strains [N/m], shape (n_nodes, dim * strains), right at inner nodes.

    What a form's first element does holds for all of its elements. A volume term of one modulus, which these
    meshes have, does nothing at inner nodes: the volume of a body does not depend on them.
    """
    forms, links = mesh.forms, np.array(mesh.kind.links)
    across = link_vectors(mesh, forms.first)
    pairs = voigt_pairs(mesh.dim)
    strain = np.stack([across[:, :, i] * across[:, :, j] for i, j in pairs], axis=2)
    tension = (stiffness[forms.first] / (across**2).sum(axis=2))[:, :, None] * strain
    pull = across[:, :, :, None] * tension[:, :, None, :]
    incidence = np.zeros((mesh.kind.n_nodes, len(links)))
    every = np.arange(len(links))
    incidence[links[:, 0], every], incidence[links[:, 1], every] = -1, 1
    forces = np.einsum("al,flis->fais", incidence, pull).reshape(-1, mesh.dim * len(pairs))
    places = forms.of[:, None] * mesh.kind.n_nodes + np.arange(mesh.kind.n_nodes)
    ones = np.ones(mesh.elements.size)
    at_nodes = sparse.coo_array((ones, (mesh.elements.ravel(), places.ravel())), shape=(mesh.n_nodes, len(forces)))
    return np.asarray(at_nodes.tocsr() @ forces)


def relaxed(matrix: SparseMatrix, right: Floats, nodes: Floats, held: Bools, definite: bool) -> Floats | None:
    """Solve matrix x = right on the directions that are not held, columns of shape (n_dof, k); zero elsewhere.

    None where the matrix is not seen to be positive definite; one that is known to be `definite` need not be looked
    at. `nodes` [m] and `held` have shape (n_nodes, dim).
    """
    try:
        tangent = choose("auto", nodes, held).ready(matrix, nodes)
        if not definite and tangent.negative_eigenvalues != 0:
            return None
        free = np.where(held.ravel(), 0.0, right.T).reshape(-1, *nodes.shape)
        return np.stack([tangent.solve(column, _ACCURACY).ravel() for column in free], axis=1)
    except (SingularMatrixError, IndefiniteError):
        return None


def pinned(nodes: Floats) -> Bools:
    """Return directions that hold a body against rigid motion and no more, shape (n_nodes, dim).

    Without them no strain is hindered.
    """
    upper, order = linalg.qr(rigid_body_modes(nodes).T, mode="r", pivoting=True)
    sizes = np.abs(np.diag(upper))
    held = np.zeros(nodes.size, dtype=bool)
    held[order[: int((sizes > 1e-9 * sizes[0]).sum())]] = True
    return held.reshape(nodes.shape)
