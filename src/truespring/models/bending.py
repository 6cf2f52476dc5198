"""Bending factors: EI of strips of springs and of finite elements over EI of the material."""

import math
from types import MappingProxyType

import numpy as np

from truespring.arrays import Floats
from truespring.mesh import Mesh
from truespring.models.by_rule import SpringsByRule
from truespring.models.fem_potential import FemPotential, element_matrices
from truespring.models.finite_elements import fem_potential
from truespring.models.interpolation import chosen_interpolation
from truespring.models.links import CORNERS, all_alike, link_vectors
from truespring.models.rules import require_body
from truespring.models.volume import VolumeTerm
from truespring.problem import Problem, sample
from truespring.remembering import remembered


def cell_counts(mesh: Mesh) -> tuple[int, ...] | None:
    """Return the number of cells along each axis; None unless all elements are equal rectangles or bricks on a grid."""
    if mesh.element not in ("quadrilateral", "hexahedron"):
        return None
    if not mesh.forms.single and not all_alike(mesh, 1e-6):
        return None
    at = mesh.nodes[mesh.elements[0]] - mesh.nodes[mesh.elements[0, 0]]
    sides = at[-2 if mesh.dim == 3 else 2]
    if (sides <= 0).any() or np.abs(at - CORNERS[: len(at), : mesh.dim] * sides).max() > 1e-6 * sides.max():
        return None
    counts = tuple(round(float(count)) for count in (mesh.upper - mesh.lower) / sides)
    return counts if math.prod(counts) == len(mesh.elements) else None


def bending_factors(
    problem: Problem, springs: SpringsByRule | None, sizes: dict[int, tuple[int, ...]]
) -> MappingProxyType[int, float]:
    """Return bending factors by depth [-], for sections with the given numbers of elements through depth (and width).

    Without springs, return those of finite elements.
    """
    if not sizes:
        return MappingProxyType({})
    one = sample(problem, np.zeros(1, dtype=np.int64))
    matrix = _element_matrix(one, springs)
    return MappingProxyType({depth: _bending_factor(one, springs, matrix, sizes[depth]) for depth in sorted(sizes)})


@remembered
def fem_bending_factors(
    problem: Problem, sizes: tuple[tuple[int, tuple[int, ...]], ...]
) -> MappingProxyType[int, float]:
    """Return the bending factors of the default finite elements by depth [-]."""
    return bending_factors(problem, None, dict(sizes))


@remembered
def bending_excess(problem: Problem) -> float:
    """Return the relative excess stiffness of linear simplices in pure bending of the longest side of the body [-].

    This is the energy of the nodal displacements of pure bending with unit curvature about the centre of the body,
    u = (-x y, (x^2 + nu (y^2 - z^2)) / 2, nu y z), divided by the exact one, E / 2 times the integral of y^2, minus 1;
    in 3D the larger of both directions. Springs on the edges of simplices have the same strains.
    """
    material, section = require_body(problem)
    mesh = problem.mesh
    young, poisson = section.apparent_moduli(material)
    sides = np.argsort(mesh.lower - mesh.upper, kind="stable")
    at = (mesh.nodes - mesh.measures @ mesh.centres / mesh.measures.sum())[:, sides]
    matrices, found = element_matrices(problem), []
    for up, aside in ((1, 2), (2, 1))[: mesh.dim - 1]:
        bent = np.zeros_like(at)
        bent[:, 0], bent[:, up] = -at[:, 0] * at[:, up], (at[:, 0] ** 2 + poisson * at[:, up] ** 2) / 2
        if mesh.dim == 3:
            bent[:, up] -= poisson * at[:, aside] ** 2 / 2
            bent[:, aside] = poisson * at[:, up] * at[:, aside]
        moved = np.empty_like(bent)
        moved[:, sides] = bent
        by_element = moved[mesh.elements].reshape(len(mesh.elements), -1)
        energy = np.einsum("ei,eij,ej->", by_element, matrices, by_element) / 2
        heights = at[:, up][mesh.elements]
        squares = ((heights**2).sum(axis=1) + heights.sum(axis=1) ** 2) @ mesh.measures
        exact = young / 2 * section.thickness * squares / ((mesh.dim + 1) * (mesh.dim + 2))
        found.append(float(energy / exact) - 1)
    return max(found)


def _bending_factor(problem: Problem, springs: SpringsByRule | None, matrix: Floats, counts: tuple[int, ...]) -> float:
    """Return EI of a strip of elements like the first in pure bending along x, over EI of the material [-].

    `matrix` is the stiffness of an element whose links are not shared [N/m].

    A column of elements is bent to unit curvature, u = (-x y, x^2 / 2), plus the periodic displacement that minimises
    the energy; EI is twice this energy per length. For springs on squares with summed sharing the factor is
    e0 (1 - 1/n^2) + 6 a / n^2, n elements deep: e0 is Young's modulus along x over E, a the stiffness of edges in t E.
    """
    from truespring.kernels.threads import one_blas_thread

    material, section = require_body(problem)
    mesh = problem.mesh
    dim, corners = mesh.dim, CORNERS[: mesh.kind.n_nodes, : mesh.dim]
    sides = mesh.nodes[mesh.elements[0, -2 if dim == 3 else 2]] - mesh.nodes[mesh.elements[0, 0]]
    grid = np.array([count + 1 for count in counts])
    # The displacement is periodic: both ends of a cell along x have the same degrees of freedom.
    section_corners, place = np.unique(corners[:, 1:], axis=0, return_inverse=True)
    gather = np.kron(np.eye(len(section_corners))[place.ravel()], np.eye(dim))
    n_free = dim * int(np.prod(grid))
    stiffness, force, energy = np.zeros((n_free, n_free)), np.zeros(n_free), 0.0
    single = springs is not None and springs.sharing == "single"
    for cell in np.ndindex(*counts):
        if single:
            matrix = _element_matrix(problem, springs, _shares_of_links(problem, cell, counts))
        numbers = np.ravel_multi_index(tuple((section_corners + np.array(cell)).T), tuple(grid))
        dofs = (dim * numbers[:, None] + np.arange(dim)).ravel()
        bent = np.zeros((len(corners), dim))
        bent[:, 0] = -corners[:, 0] * sides[0] * (corners[:, 1] + cell[0] - counts[0] / 2) * sides[1]
        bent[:, 1] = corners[:, 0] * sides[0] ** 2 / 2
        stiffness[np.ix_(dofs, dofs)] += gather.T @ matrix @ gather
        force[dofs] += gather.T @ matrix @ bent.ravel()
        energy += float(bent.ravel() @ matrix @ bent.ravel())
    with one_blas_thread():
        values, vectors = np.linalg.eigh(stiffness)
    firm = np.abs(values) > 1e-10 * np.abs(values).max()
    energy -= float(((force @ vectors[:, firm]) ** 2 / values[firm]).sum())
    young, _ = section.apparent_moduli(material)
    width = section.thickness if dim == 2 else counts[1] * sides[2]
    return float(energy / sides[0] / (young * width * (counts[0] * sides[1]) ** 3 / 12))


def _element_matrix(problem: Problem, springs: SpringsByRule | None, share: Floats | None = None) -> Floats:
    """Return the linear stiffness matrix of the only element [N/m], shape (n_dof, n_dof).

    `share` is a factor for the stiffness of each spring.
    """
    if springs is None:
        elements = fem_potential(problem, "linear", chosen_interpolation(problem, "linear"))
        assert isinstance(elements, FemPotential)  # `cell_counts` is None for several kinds
        return np.asarray(elements.element_hessians(problem.mesh.nodes)[0])
    if springs.coupled:
        return np.asarray(springs.potential(problem).hessian(problem.mesh.nodes).toarray())
    mesh = problem.mesh
    links, across = np.array(mesh.kind.links), link_vectors(mesh)[0]
    direction = across / np.linalg.norm(across, axis=1)[:, None]
    stencils = np.zeros((len(links), mesh.kind.n_nodes, mesh.dim))
    every = np.arange(len(links))
    stencils[every, links[:, 0]], stencils[every, links[:, 1]] = -direction, direction
    stiffness = springs.element_stiffness(problem)[0] * (1.0 if share is None else share)
    matrix = np.einsum("l,lai,lbj->aibj", stiffness, stencils, stencils).reshape((mesh.kind.n_nodes * mesh.dim,) * 2)
    if springs.volume:
        matrix += VolumeTerm(problem, springs.kappa(problem)).stiffening(mesh.nodes)[0]
    return np.asarray(matrix)


def _shares_of_links(problem: Problem, cell: tuple[int, ...], counts: tuple[int, ...]) -> Floats:
    """Return the share of a cell of a strip in each link [-], for sharing "single".

    Cells share the links in the plane between them: always along x, inside the section across it.
    """
    dim = problem.mesh.dim
    links = np.array(problem.mesh.kind.links)
    ends = CORNERS[links][:, :, :dim]
    within = ends[:, 0] == ends[:, 1]
    places = ends[:, 0] + np.array([0, *cell])
    inside = np.ones_like(within)
    inside[:, 1:] = (places[:, 1:] > 0) & (places[:, 1:] < np.array(counts))
    return np.asarray(0.5 ** (within & inside).sum(axis=1))
