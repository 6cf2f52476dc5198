"""Links, the pairs of nodes of an element that springs can join, and the strain as a function of their lengths."""

from collections.abc import Callable

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.memory import slices
from truespring.mesh import Mesh
from truespring.models.fem_potential import fem_of_one_kind
from truespring.models.law import Constants
from truespring.models.strain import voigt_pairs
from truespring.problem import Problem

#: Corners of a square (the first four) and of a cube, in the order of quadrilaterals and hexahedra.
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])

# Number of elements for which the coupling is computed at a time.
_SLICE = 1024


def n_links(mesh: Mesh) -> int:
    """Return the number of links of an element; for several kinds, the largest."""
    return max(len(part.kind.links) for _, part in mesh.blocks)


def in_a_row(mesh: Mesh, values: Floats) -> Floats:
    """Return values of links in the order of `shared_springs`, shape (n,), from `values` of shape (n_elements, links).

    If the mesh has several kinds of elements, the padding of rows is left out.
    """
    if len(mesh.blocks) == 1:
        return values.ravel()
    return np.concatenate([values[numbers, : len(part.kind.links)].ravel() for numbers, part in mesh.blocks])


def by_kind(problem: Problem, values: Callable[[Problem], Floats]) -> Floats:
    """Return the results of `values` for the links of each kind of elements, shape (n_elements, links).

    If the mesh has several kinds of elements, rows are padded with zeros.
    """
    if len(problem.blocks) == 1:
        return values(problem)
    found = np.zeros((len(problem.mesh.elements), n_links(problem.mesh)))
    for numbers, part in problem.blocks:
        found[numbers, : len(part.mesh.kind.links)] = values(part)
    return found


def link_vectors(mesh: Mesh, chosen: slice | Ints = slice(None)) -> Floats:
    """Return the vectors from the first to the second node of the links of elements [m], shape (n, links, dim)."""
    at = mesh.nodes[mesh.elements[chosen]]
    links = np.array(mesh.kind.links)
    return np.asarray(at[:, links[:, 1]] - at[:, links[:, 0]])


def all_alike(mesh: Mesh, share: float) -> bool:
    """Return whether the links of all elements are equal vectors, up to this share of the longest component."""
    own = link_vectors(mesh, slice(1))
    bound = share * np.abs(own).max()
    return all(np.abs(link_vectors(mesh, part) - own).max() <= bound for part in slices(len(mesh.elements), own.nbytes))


def link_coupling(problem: Problem) -> Floats:
    """Return M of W = q . M q, the energy of an element as a function of q = l^2 - L^2 of its links [J/m^4].

    Shape (n_elements, links, links), or (1, links, links) for a body of one material with equal elements. With the
    gradients g_a of the shape functions, C = F^T F = sum l^2 C_ab over the links, C_ab = -(g_a g_b^T + g_b g_a^T) / 2.
    The St. Venant-Kirchhoff energy is quadratic in C, so M = integral of lam/8 tr C_k tr C_l + mu/4 tr(C_k C_l). With
    the quadrature of the finite element, both energies are the same function. On triangles these are the biquadratic
    springs of Delingette (2008), on tetrahedra the links of Goulette and Chen (2015).
    """
    potential = fem_of_one_kind(problem, "saint-venant-kirchhoff")
    alike = len(problem.materials) == 1 and problem.mesh.forms.single
    n_links = len(problem.mesh.kind.links)
    coupling = np.empty((1 if alike else len(problem.mesh.elements), n_links, n_links))
    for first in range(0, len(coupling), _SLICE):
        last = min(first + _SLICE, len(coupling))
        constants = potential.constants.part(first, last)
        coupling[first:last] = _coupling(problem.mesh, *potential.quadrature(first, last), constants)
    return coupling


def link_strains(mesh: Mesh, gradients: Floats) -> Floats:
    """Return C_ab = -(g_a g_b^T + g_b g_a^T) / 2, the derivatives of C = F^T F with respect to squared link lengths.

    Axes (element, point, link, component in Voigt's order) [1/m^2]; `gradients` of the shape functions have axes
    (element, point, node, direction) [1/m].
    """
    links = np.array(mesh.kind.links)
    first, second = gradients[:, :, links[:, 0]], gradients[:, :, links[:, 1]]
    both = [first[..., i] * second[..., j] + first[..., j] * second[..., i] for i, j in voigt_pairs(mesh.dim)]
    return -np.stack(both, axis=-1) / 2


def _coupling(mesh: Mesh, gradients: Floats, volumes: Floats, constants: Constants) -> Floats:
    """Return M [J/m^4], shape (n, links, links); axes of `gradients` as in `link_strains`."""
    lam, mu = constants.lam_plane, constants.mu
    C = link_strains(mesh, gradients)
    trace = C[..., : mesh.dim].sum(axis=-1)
    twice = np.where(np.arange(C.shape[-1]) < mesh.dim, 1.0, 2.0)
    by_point = np.moveaxis(C, 2, 1).reshape(len(C), C.shape[2], -1)
    weighted = np.moveaxis((volumes * mu / 4)[:, :, None, None] * twice * C, 2, 1).reshape(by_point.shape)
    dilation = ((volumes * lam / 8)[:, :, None] * trace).swapaxes(1, 2) @ trace
    return np.asarray(dilation + weighted @ by_point.swapaxes(1, 2))
