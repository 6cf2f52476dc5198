"""A linear elastic block: boundary elements condensed to a stiffness matrix of the nodes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ModelError
from truespring.memory import available_memory
from truespring.mesh import Mesh
from truespring.models.boundary import Influence, Kelvin
from truespring.models.panels import Panels
from truespring.models.rules import require_body
from truespring.problem import Problem
from truespring.rigid_modes import rigid_body_modes


@dataclass(frozen=True, eq=False)
class Block:
    """A linear elastic block.

    The energy of displacements u_s of the surface nodes and u_i of the inner nodes is
    u_s . S u_s / 2 + kappa/2 |u_i - W u_s|^2: S is the stiffness of the surface; W gives the displacement of the inner
    nodes by Somigliana's identity. In equilibrium the inner nodes follow the surface exactly and carry no force.

    Attributes:
        surface, inside: node numbers of the mesh, shapes (n_surface,) and (n_inside,).
        nodes: undeformed positions, surface nodes first [m], shape (n_surface + n_inside, dim).
        stiffness: S [N/m], shape (n_surface * dim, n_surface * dim), symmetric; its null space is the rigid motions.
        following: W [-], shape (n_inside * dim, n_surface * dim), exact for rigid motions.
        kappa: mean of the diagonal of S [N/m].
    """

    surface: Ints
    inside: Ints
    nodes: Floats
    stiffness: Floats
    following: Floats
    kappa: float

    @property
    def numbers(self) -> Ints:
        """Node numbers of the mesh in the order of `nodes`, shape (n_surface + n_inside,)."""
        return np.concatenate([self.surface, self.inside])

    @cached_property
    def coupled(self) -> tuple[Floats, Floats]:
        """Blocks of the stiffness matrix [N/m]: between surface nodes, and from surface to inner nodes.

        Shapes (n_surface * dim, n_surface * dim) and (n_surface * dim, n_inside * dim).
        """
        W = self.following
        return self.stiffness + self.kappa * (W.T @ W), -self.kappa * W.T

    def forces(self, displacement: Floats) -> Floats:
        """Return the derivative of the energy with respect to a displacement [N], both of shape (n_nodes, dim, ...)."""
        n, dim = len(self.surface), self.nodes.shape[1]
        flat = displacement.reshape(len(displacement) * dim, -1)
        at_surface, at_inside = flat[: n * dim], flat[n * dim :]
        apart = self.kappa * (at_inside - self.following @ at_surface)
        force = np.concatenate([self.stiffness @ at_surface - self.following.T @ apart, apart])
        return np.asarray(force.reshape(displacement.shape))


def inner_nodes(mesh: Mesh, elements: Ints) -> Ints:
    """Return the nodes of elements that are not on their surface, ascending, shape (n,)."""
    facets, alone = mesh.facets_of(mesh.elements[elements])
    return np.setdiff1d(mesh.elements[elements], facets[alone])


def make_block(problem: Problem, elements: Ints) -> Block:
    """Return a block of elements of one material, by boundary elements on their surface.

    With G t = H u at the midpoints of the panels, and M the nodal forces of a traction t on the panels, the stiffness
    is K = thickness M G^-1 H. Since it is symmetric only up to the discretisation error, (K + K^T) / 2 is used,
    projected so that rigid motions cause no force. Raises ModelError if it is unstable or does not fit in memory.
    """
    mesh = problem.mesh
    _, section = require_body(problem)
    facets, alone = mesh.facets_of(mesh.elements[elements])
    facets = facets[alone]
    surface = np.unique(facets)
    inside = inner_nodes(mesh, elements)
    panels = Panels(mesh.nodes[surface], np.searchsorted(surface, facets))
    _check_memory(panels, len(inside))
    nodes = mesh.nodes[np.concatenate([surface, inside])]
    material = problem.materials[problem.material_numbers[elements[0]]]
    poisson = material.poisson / (1 + material.poisson) if section.free_thickness else material.poisson
    across = 2 * float(np.linalg.norm(nodes - nodes.mean(axis=0), axis=1).max())  # invariant under rotation
    influence = Influence(panels, Kelvin(material.lame.mu, poisson, across))
    G, H = influence.equations()
    traction = np.asarray(np.linalg.solve(G, H), dtype=np.float64)
    K = section.thickness * _at_nodes(influence, traction)
    rigid = rigid_body_modes(nodes)
    stiffness = _symmetric(K, rigid[: len(K)])
    following = np.zeros((len(inside) * mesh.dim, len(K)))
    if len(inside):
        U, T = influence.at(mesh.nodes[inside])
        following = U @ traction - T
        at_surface, at_inside = rigid[: len(K)], rigid[len(K) :]
        following -= (following @ at_surface - at_inside) @ np.linalg.pinv(at_surface)
    return Block(surface, inside, nodes, stiffness, following, float(np.diag(stiffness).mean()))


def _at_nodes(influence: Influence, traction: Floats) -> Floats:
    """Return the nodal forces of the tractions on the panels that each unit displacement causes [N/m per thickness]."""
    panels, dim = influence.surface, influence.surface.dim
    by_panel = traction.reshape(panels.n_panels, dim, -1)
    force = np.zeros((len(panels.nodes), *by_panel.shape[1:]))
    shares, corners = influence.shares(), panels.facets[panels.of]
    for place in range(corners.shape[1]):
        np.add.at(force, corners[:, place], shares[:, place, None, None] * by_panel)
    return force.reshape(-1, by_panel.shape[2])


def _symmetric(stiffness: Floats, rigid: Floats) -> Floats:
    """Return the symmetric part, projected so that rigid motions cause no force; raise ModelError if indefinite."""
    basis = np.linalg.qr(rigid)[0]
    projector = np.eye(len(basis)) - basis @ basis.T
    projected = projector @ stiffness @ projector
    projected = (projected + projected.T) / 2
    try:
        np.linalg.cholesky(projected + np.trace(projected) / len(projected) * (basis @ basis.T))
    except np.linalg.LinAlgError:
        raise ModelError(
            "the boundary elements of the block are unstable: its facets are too coarse or too unequal; use finer "
            "elements, or elements closer to squares, cubes or regular simplices"
        ) from None
    return np.asarray(projected)


def _check_memory(panels: Panels, n_inside: int) -> None:
    """Raise ModelError if the dense matrices do not fit in memory."""
    n, n_surface = panels.n_panels * panels.dim, panels.nodes.size
    needed = 8 * (2 * n * n + 4 * n * n_surface + 4 * n_surface**2 + n_inside * panels.dim * (n + 3 * n_surface))
    if needed > available_memory():
        raise ModelError(
            f"the boundary elements of the block, {len(panels.facets):,} facets, need about {needed / 2**30:,.0f} GiB, "
            f"but {available_memory() / 2**30:,.1f} GiB are available: use a smaller block or coarser elements"
        )
