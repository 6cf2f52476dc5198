"""Links: the pairs of nodes of an element that may carry springs, and the strain that their lengths tell."""

import numpy as np

from truespring.arrays import Floats
from truespring.mesh import Mesh
from truespring.models.fem import fem_potential
from truespring.problem import Problem

#: Corners of a square (the first four) and of a cube, in the order of quadrilaterals and hexahedra.
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])


def link_vectors(mesh: Mesh) -> Floats:
    """From the first to the second node of each link [m], shape (n_elements, links, dim)."""
    links = np.array(mesh.kind.links)
    at = mesh.nodes[mesh.elements]
    return np.asarray(at[:, links[:, 1]] - at[:, links[:, 0]])


def link_coupling(problem: Problem) -> Floats:
    """Return M of W = q . M q, the energy of an element in the changes q = l^2 - L^2 of its squared link lengths.

    Shape (n_elements, links, links) [J/m^4]. With g_a the gradient of a node's shape function,
    C = F^T F = sum l^2 C_ab over the links, C_ab = -(g_a g_b^T + g_b g_a^T) / 2; St. Venant-Kirchhoff's
    energy is quadratic in C, so M = integral of lam/8 tr C_k tr C_l + mu/4 tr(C_k C_l), by the
    quadrature of the finite element: the two are one function. On triangles these are the
    biquadratic springs of Delingette (2008), on tetrahedra the links of Goulette and Chen (2015).
    """
    potential = fem_potential(problem, "saint-venant-kirchhoff")
    lam, mu = potential.constants.lam_plane, potential.constants.mu
    links = np.array(problem.mesh.kind.links)
    first, second = potential.shape_gradients[links[:, 0]], potential.shape_gradients[links[:, 1]]
    C = -(np.einsum("lieq,ljeq->lijeq", first, second) + np.einsum("lieq,ljeq->lijeq", second, first)) / 2
    trace = np.einsum("liieq->leq", C)
    w = potential.volumes
    M = np.einsum("eq,keq,leq->ekl", w * lam / 8, trace, trace)
    return np.asarray(M + np.einsum("eq,kijeq,lijeq->ekl", w * mu / 4, C, C, optimize=True))
