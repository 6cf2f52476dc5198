"""Links: the pairs of nodes of an element that may carry springs, and the strain that their lengths tell."""

import numpy as np

from truespring.arrays import Floats
from truespring.mesh import Mesh
from truespring.models.fem import fem_potential
from truespring.problem import Problem

#: Corners of a square (the first four) and of a cube, in the order of quadrilaterals and hexahedra.
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])

# Elements whose links differ by less than this share have one coupling: their own would differ by rounding.
_ALIKE = 1e-13


def link_vectors(mesh: Mesh) -> Floats:
    """From the first to the second node of each link [m], shape (n_elements, links, dim)."""
    links = np.array(mesh.kind.links)
    at = mesh.nodes[mesh.elements]
    return np.asarray(at[:, links[:, 1]] - at[:, links[:, 0]])


def link_coupling(problem: Problem) -> Floats:
    """Return M of W = q . M q, the energy of an element in the changes q = l^2 - L^2 of its squared link lengths.

    Shape (n_elements, links, links) [J/m^4]; on a body of one material whose elements are all alike one M
    for all, shape (1, links, links). With g_a the gradient of a node's shape function,
    C = F^T F = sum l^2 C_ab over the links, C_ab = -(g_a g_b^T + g_b g_a^T) / 2; St. Venant-Kirchhoff's
    energy is quadratic in C, so M = integral of lam/8 tr C_k tr C_l + mu/4 tr(C_k C_l), by the
    quadrature of the finite element: the two are one function. On triangles these are the
    biquadratic springs of Delingette (2008), on tetrahedra the links of Goulette and Chen (2015).
    """
    potential = fem_potential(problem, "saint-venant-kirchhoff")
    lam, mu = potential.constants.lam_plane, potential.constants.mu
    across = link_vectors(problem.mesh)
    alike = len(problem.materials) == 1 and np.abs(across - across[:1]).max() <= _ALIKE * np.abs(across).max()
    wanted = slice(1 if alike else None)
    links = np.array(problem.mesh.kind.links)
    gradients = np.moveaxis(
        potential.shape_gradients[:, :, wanted], (2, 3), (0, 1)
    )  # (element, point, node, direction)
    first, second = gradients[:, :, links[:, 0]], gradients[:, :, links[:, 1]]
    outer = first[..., :, None] * second[..., None, :]
    C = -(outer + outer.swapaxes(-1, -2)) / 2
    w = potential.volumes[wanted]
    trace = np.einsum("eqlii->eql", C)
    by_point = np.moveaxis(C.reshape(*C.shape[:3], -1), 2, 1).reshape(len(C), len(links), -1)
    weighted = np.moveaxis((w * mu / 4)[:, :, None, None, None] * C, 2, 1).reshape(by_point.shape)
    dilation = ((w * lam / 8)[:, :, None] * trace).swapaxes(1, 2) @ trace
    return np.asarray(dilation + weighted @ by_point.swapaxes(1, 2))
