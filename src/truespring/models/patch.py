"""The patch test of springs: the deviation from uniform strain of a free body under uniform stress."""

import math
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Bools
from truespring.mesh import Mesh
from truespring.models.by_rule import SpringsByRule
from truespring.models.elasticity import hooke
from truespring.models.finite_elements import fem_potential
from truespring.models.moduli import moduli
from truespring.models.relaxation import pinned, relaxed
from truespring.models.rules import require_body
from truespring.models.strain import uniform_strain, voigt_pairs
from truespring.problem import Problem
from truespring.remembering import remembered
from truespring.rigid_modes import rigid_body_modes


@dataclass(frozen=True)
class Patch:
    """The result of a patch test.

    Attributes:
        error: root-mean-square deviation from the displacement of a uniform strain, over that displacement [-].
        outside: whether the body is a lattice and forces are unbalanced only at its outer elements.
    """

    error: float
    outside: bool


@remembered
def patch_test(problem: Problem, springs: SpringsByRule) -> Patch:
    """Return the result of the patch test for the worst uniform stress.

    The displacement is compared with that by the effective moduli of the springs, without rigid motion. The undeformed
    springs must be stable; the error is infinite if no equilibrium is found.
    """
    mesh, effective = problem.mesh, moduli(problem, springs)
    material, section = require_body(problem)
    K = springs.potential(problem).hessian(mesh.nodes)
    exact = fem_potential(problem, "linear").hessian(mesh.nodes)  # exact nodal forces of a uniform strain
    elasticity = hooke(*section.lame_within(material), mesh.dim)
    centred = mesh.nodes - mesh.nodes.mean(axis=0)
    strains = np.stack([uniform_strain(centred, i, j).ravel() for i, j in voigt_pairs(mesh.dim)], axis=1)
    expected = strains @ np.linalg.solve(effective.elasticity, elasticity)
    definite = not effective.n_negative and not bool((springs.kappa(problem) < -1e-9 * material.young).any())
    moved = relaxed(K, exact @ strains, mesh.nodes, pinned(mesh.nodes), definite)
    if moved is None:
        return Patch(math.inf, False)
    rigid, _ = np.linalg.qr(rigid_body_modes(mesh.nodes))
    apart = moved - expected
    apart -= rigid @ (rigid.T @ apart)
    worst = float((np.linalg.norm(apart, axis=0) / np.linalg.norm(expected, axis=0)).max())
    unbalanced = np.abs(K @ strains)
    balanced = unbalanced[np.repeat(_far_inside(mesh), mesh.dim)].max(initial=0.0) <= 1e-6 * unbalanced.max()
    return Patch(worst, bool(effective.lattice and balanced))


def _far_inside(mesh: Mesh) -> Bools:
    """Return whether each node belongs only to elements without boundary nodes, shape (n_nodes,)."""
    outside, inside = np.zeros(mesh.n_nodes, dtype=bool), np.ones(mesh.n_nodes, dtype=bool)
    outside[mesh.boundary] = True
    inside[mesh.elements[outside[mesh.elements].any(axis=1)]] = False
    return inside
