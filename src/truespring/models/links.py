"""Links: the pairs of nodes of an element that may carry springs, and the strain that their lengths tell."""

from collections.abc import Callable

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.memory import slices
from truespring.mesh import Mesh
from truespring.models.fem import fem_of_one_kind
from truespring.models.law import Constants
from truespring.models.strain import voigt_pairs
from truespring.problem import Problem

#: Corners of a square (the first four) and of a cube, in the order of quadrilaterals and hexahedra.
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])

# Elements whose coupling is found at a time.
_SLICE = 1024


def n_links(mesh: Mesh) -> int:
    """Return the number of links of an element; of several kinds that of the kind with most."""
    return max(len(part.kind.links) for _, part in mesh.blocks)


def in_a_row(mesh: Mesh, values: Floats) -> Floats:
    """Return a value of each element's each link, shape (n_elements, links), in the order of `shared_springs`.

    Of several kinds rows are as long as that of the kind with most links; what is beyond an element's own is no link's.
    """
    if len(mesh.blocks) == 1:
        return values.ravel()
    return np.concatenate([values[numbers, : len(part.kind.links)].ravel() for numbers, part in mesh.blocks])


def by_kind(problem: Problem, values: Callable[[Problem], Floats]) -> Floats:
    """Return what `values` makes of the elements of each kind for their links, shape (n_elements, links).

    Of several kinds zero beyond an element's own links.
    """
    if len(problem.blocks) == 1:
        return values(problem)
    found = np.zeros((len(problem.mesh.elements), n_links(problem.mesh)))
    for numbers, part in problem.blocks:
        found[numbers, : len(part.mesh.kind.links)] = values(part)
    return found


def link_vectors(mesh: Mesh, chosen: slice | Ints = slice(None)) -> Floats:
    """From the first to the second node of each link of the elements chosen [m], shape (n, links, dim)."""
    at = mesh.nodes[mesh.elements[chosen]]
    links = np.array(mesh.kind.links)
    return np.asarray(at[:, links[:, 1]] - at[:, links[:, 0]])


def all_alike(mesh: Mesh, share: float) -> bool:
    """Return whether the links of all elements are the same vectors, but for this share of the longest component."""
    own = link_vectors(mesh, slice(1))
    bound = share * np.abs(own).max()
    return all(np.abs(link_vectors(mesh, part) - own).max() <= bound for part in slices(len(mesh.elements), own.nbytes))


def link_coupling(problem: Problem) -> Floats:
    """Return M of W = q . M q, the energy of an element in the changes q = l^2 - L^2 of its squared link lengths.

    Shape (n_elements, links, links) [J/m^4]; on a body of one material whose elements are all alike one M
    for all, shape (1, links, links). With g_a the gradient of a node's shape function,
    C = F^T F = sum l^2 C_ab over the links, C_ab = -(g_a g_b^T + g_b g_a^T) / 2; St. Venant-Kirchhoff's
    energy is quadratic in C, so M = integral of lam/8 tr C_k tr C_l + mu/4 tr(C_k C_l), by the
    quadrature of the finite element: the two are one function. On triangles these are the
    biquadratic springs of Delingette (2008), on tetrahedra the links of Goulette and Chen (2015).
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
    """Return C_ab = -(g_a g_b^T + g_b g_a^T) / 2 of each link, by which C = F^T F changes with its squared length.

    `gradients` of the shape functions have axes (element, point, node, direction); the result (element, point, link,
    component in Voigt's order) [1/m^2].
    """
    links = np.array(mesh.kind.links)
    first, second = gradients[:, :, links[:, 0]], gradients[:, :, links[:, 1]]
    both = [first[..., i] * second[..., j] + first[..., j] * second[..., i] for i, j in voigt_pairs(mesh.dim)]
    return -np.stack(both, axis=-1) / 2


def _coupling(mesh: Mesh, gradients: Floats, volumes: Floats, constants: Constants) -> Floats:
    """M of elements by the gradients of their shape functions, axes (element, point, node, direction)."""
    lam, mu = constants.lam_plane, constants.mu
    C = link_strains(mesh, gradients)
    trace = C[..., : mesh.dim].sum(axis=-1)
    twice = np.where(np.arange(C.shape[-1]) < mesh.dim, 1.0, 2.0)
    by_point = np.moveaxis(C, 2, 1).reshape(len(C), C.shape[2], -1)
    weighted = np.moveaxis((volumes * mu / 4)[:, :, None, None] * twice * C, 2, 1).reshape(by_point.shape)
    dilation = ((volumes * lam / 8)[:, :, None] * trace).swapaxes(1, 2) @ trace
    return np.asarray(dilation + weighted @ by_point.swapaxes(1, 2))
