"""Linear equilibrium of springs, for effective moduli and findings."""

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats
from truespring.linear.choice import choose
from truespring.linear.direct import SingularMatrixError
from truespring.linear.gradients import IndefiniteError
from truespring.mesh import MIXED, Mesh
from truespring.models.by_rule import SpringsByRule
from truespring.models.links import link_vectors
from truespring.models.rules import require_body
from truespring.models.strain import uniform_strain, voigt_pairs
from truespring.potential import SparseMatrix
from truespring.problem import Problem
from truespring.rigid_modes import rigid_body_modes

# Unbalanced force below which a uniform strain is an equilibrium, relative to E h^(d-1): rounding.
_BALANCED = 1e-8

# Relative residual of displacements; the relative error of energies is its square.
_ACCURACY = 1e-6


def relaxed_elasticity(
    problem: Problem, springs: SpringsByRule, stiffness: Floats, negative: bool
) -> tuple[Floats | None, float]:
    """Return the elasticity matrix under a uniform strain of the boundary [Pa], and the patch score (see `Moduli`).

    The matrix is None if the score is 0, so that no node relaxes, or if the body is unstable. `stiffness` is the share
    of each element in its springs [N/m], shape (n_elements, links); `negative` states whether springs are negative.
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
    energy = moved.T @ (K @ moved)  # at its minimum: of second order in errors of the displacement
    return np.asarray((energy + energy.T) / 2 / (section.thickness * mesh.measures.sum())), score


def _unit_strains(mesh: Mesh) -> Floats:
    """Return the displacements of unit uniform strains [m], columns in Voigt's order, shape (n_dof, 3 or 6)."""
    return np.stack([uniform_strain(mesh.nodes, i, j).ravel() for i, j in voigt_pairs(mesh.dim)], axis=1)


def _at_rest(problem: Problem, springs: SpringsByRule) -> SparseMatrix:
    """Return the stiffness of the undeformed body [N/m]."""
    return springs.allowing_negative().potential(problem).hessian(problem.mesh.nodes)


def _forces_by_form(mesh: Mesh, stiffness: Floats) -> Floats:
    """Return nodal forces of springs under unit uniform strains [N], shape (n_nodes, dim * strains).

    They are valid at inner nodes. Forces are computed for one element of each form. A volume term of one modulus
    causes no forces at inner nodes, since the volume of the body does not depend on them.
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
    """Solve matrix x = right for the free degrees of freedom and return x [m], shape (n_dof, k), zero elsewhere.

    Returns None if the matrix is not positive definite, which is not tested if `definite`. `nodes` [m] and `held` have
    shape (n_nodes, dim).
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
    """Return whether each degree of freedom is fixed to prevent rigid motion, shape (n_nodes, dim).

    The constraints are statically determinate: they do not restrain strain.
    """
    from scipy import linalg

    upper, order = linalg.qr(rigid_body_modes(nodes).T, mode="r", pivoting=True)
    sizes = np.abs(np.diag(upper))
    held = np.zeros(nodes.size, dtype=bool)
    held[order[: int((sizes > 1e-9 * sizes[0]).sum())]] = True
    return held.reshape(nodes.shape)
