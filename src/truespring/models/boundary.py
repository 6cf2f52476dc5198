"""Boundary elements of linear elasticity: what Kelvin's solution makes of the surface of a body.

The displacement is linear between the nodes of a facet (bilinear on four-sided ones), the traction constant on each of
the panels into which a facet is halved along its edges, and the integral equation holds at the middle of every panel.
On panels as large as the facets a sawtooth of the displacement would be unseen at their middles, and the stiffness
indefinite. Source of the kernels: any text on boundary elements, such as Brebbia and Dominguez, chapters 3 and 4.
"""

import math
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.memory import slices
from truespring.models.panels import Panels, Patch

# Gauss points a direction on panels that are nearer to a point than so many times their radius, in the plane and in
# space: their error is some 1e-14 and 1e-8.
_LEVELS = {
    2: ((2.0, 24), (6.0, 12), (np.inf, 8)),
    3: ((1.3, 20), (2.2, 12), (4.0, 6), (10.0, 4), (np.inf, 3)),
}


@dataclass(frozen=True)
class Kelvin:
    """Displacement and traction of a point force in an unbounded body, in the plane of a unit thickness.

    Attributes:
        mu: shear modulus [Pa].
        poisson: of plane strain or of the solid; plane stress is plane strain with nu / (1 + nu).
        length: what distances are measured in under the logarithm of the plane [m]; a rigid motion depends on it.
    """

    mu: float
    poisson: float
    length: float

    def displacement(self, across: Floats) -> Floats:
        """Return U_ij, the displacement along j at `across` [m] from a unit force along i [1/N or 1/(N/m)]."""
        dim = across.shape[-1]
        r = np.sqrt((across**2).sum(axis=-1))[..., None]
        e = across / r
        found = e[..., :, None] * e[..., None, :]
        found[..., range(dim), range(dim)] += (3 - 4 * self.poisson) * (-np.log(r / self.length) if dim == 2 else 1.0)
        scale = 8 * math.pi * self.mu * (1 - self.poisson) * (1.0 if dim == 2 else 2 * r[..., None])
        return np.asarray(found / scale)

    def traction(self, across: Floats, normal: Floats) -> Floats:
        """Return T_ij, the traction along j there on a surface with this unit normal [1/m or 1/m^2]."""
        dim = across.shape[-1]
        r = np.sqrt((across**2).sum(axis=-1))
        e = across / r[..., None]
        slope = (e * normal).sum(axis=-1)[..., None]
        rest = 1 - 2 * self.poisson
        turned = e[..., :, None] * normal[..., None, :]
        found = rest * (turned - turned.swapaxes(-1, -2)) - dim * slope[..., None] * e[..., :, None] * e[..., None, :]
        found[..., range(dim), range(dim)] -= rest * slope
        return np.asarray(found / (4 * (dim - 1) * math.pi * (1 - self.poisson) * r ** (dim - 1))[..., None, None])


class Influence:
    """The integrals of Kelvin's solution over a surface: what each panel and each node does at some points."""

    def __init__(self, surface: Panels, kelvin: Kelvin) -> None:
        self.surface, self.kelvin = surface, kelvin
        self._levels = [(reach, surface.gauss(n)) for reach, n in _LEVELS[surface.dim]]

    def at(self, points: Floats, own: bool = False) -> tuple[Floats, Floats]:
        """Return the integrals of U over the panels and of T times the nodes' functions at points [m], shape (n, dim).

        Shapes (n * dim, n_panels * dim) and (n * dim, n_nodes * dim). With `own` the points are the middles of the
        panels, and what each does to itself is left out.
        """
        surface, dim, n = self.surface, self.surface.dim, len(points)
        middles = surface.middles.places[:, 0]
        U = np.empty((n, dim, surface.n_panels, dim))
        T = np.zeros((n, dim, len(surface.nodes), dim))
        at_nodes = surface.facets[surface.of]
        for part in slices(n, 8 * surface.n_panels * (at_nodes.shape[1] + 1) * 3 * dim**2):
            here = points[part]
            apart = np.linalg.norm(middles - here[:, None], axis=2)
            left = np.ones(apart.shape, dtype=bool)
            if own:
                left[np.arange(len(here)), np.arange(part.start, part.start + len(here))] = False
            u = np.zeros((*apart.shape, dim, dim))
            h = np.zeros((*apart.shape, at_nodes.shape[1], dim, dim))
            for reach, patch in self._levels:
                chosen = left & (apart < reach * surface.radii)
                self._integrate(patch, here, chosen, u, h)
                left &= ~chosen
            U[part] = u.swapaxes(1, 2)
            for corner in range(at_nodes.shape[1]):
                spread = h[:, :, corner].transpose(1, 0, 2, 3)
                moved = np.zeros((len(surface.nodes), *spread.shape[1:]))
                np.add.at(moved, at_nodes[:, corner], spread)
                T[part] += moved.transpose(1, 2, 0, 3)
        return U.reshape(n * dim, -1), T.reshape(n * dim, -1)

    def _integrate(self, patch: Patch, points: Floats, chosen: Bools, u: Floats, h: Floats) -> None:
        """Integrate over the panels `chosen` for each point, into u and h."""
        pairs = np.argwhere(chosen)
        for part in slices(len(pairs), 8 * patch.measures.shape[1] * 8 * self.surface.dim**2):
            point, panel = pairs[part].T
            across = patch.places[panel] - points[point][:, None]
            measures = patch.measures[panel]
            u[point, panel] = np.einsum("nq,nqij->nij", measures, self.kelvin.displacement(across))
            weighted = patch.shape[panel] * measures[..., None]
            h[point, panel] = np.einsum("nqa,nqij->naij", weighted, self.kelvin.traction(across, patch.normals[panel]))

    def equations(self) -> tuple[Floats, Floats]:
        """Return G, H of the integral equation H u = G t at the middles of the panels.

        Shapes (n_panels * dim, n_panels * dim) and (n_panels * dim, n_nodes * dim). What a uniform displacement does,
        which is nothing, tells the singular part of H.
        """
        surface, dim, n = self.surface, self.surface.dim, self.surface.n_panels
        G, H = self.at(surface.middles.places[:, 0], own=True)
        G, H = G.reshape(n, dim, n, dim), H.reshape(n, dim, -1, dim)
        free = -H.sum(axis=2)
        panels = np.arange(n)
        u, h = self._own_action()
        G[panels, :, panels] = u
        h = h + surface.middles.shape[:, 0, :, None, None] * free[:, None]
        for corner in range(surface.facets.shape[1]):
            H[panels, :, surface.facets[surface.of, corner]] += h[:, corner]
        return G.reshape(n * dim, -1), H.reshape(n * dim, -1)

    def _own_action(self) -> tuple[Floats, Floats]:
        """The integrals of each panel at its own middle: of U, and of T times the functions less their values there."""
        surface, kelvin, dim = self.surface, self.kelvin, self.surface.dim
        middles = surface.middles
        if dim == 2:
            ends = surface.nodes[surface.facets[surface.of]]
            along = ends[:, 1] - ends[:, 0]
            whole = np.linalg.norm(along, axis=1)
            e, length = along / whole[:, None], whole / 2
            scale = 8 * math.pi * kelvin.mu * (1 - kelvin.poisson)
            size = (3 - 4 * kelvin.poisson) * (1 - np.log(length / 2 / kelvin.length))
            u = (size[:, None, None] * np.eye(2) + e[:, :, None] * e[:, None]) * (length / scale)[:, None, None]
            turned = e[:, :, None] * middles.normals[:, 0][:, None]
            linear = (1 - 2 * kelvin.poisson) / (4 * math.pi * (1 - kelvin.poisson)) * (turned - turned.swapaxes(1, 2))
            slope = np.stack([-length / whole, length / whole], axis=1)
            return u, slope[:, :, None, None] * linear[:, None]
        patch = surface.around_middles()
        across = patch.places - middles.places
        u = np.einsum("nq,nqij->nij", patch.measures, kelvin.displacement(across))
        weighted = (patch.shape - middles.shape) * patch.measures[..., None]
        return u, np.einsum("nqa,nqij->naij", weighted, kelvin.traction(across, patch.normals))

    def shares(self) -> Floats:
        """Return what a unit traction on a panel gives to its facet's corners [m, m^2], shape (n_panels, corners)."""
        patch = self._levels[0][1]
        return np.asarray((patch.shape * patch.measures[..., None]).sum(axis=1))
