"""Boundary elements of linear elasticity, by collocation with Kelvin's solution.

The displacement is linear between the nodes of a facet (bilinear on quadrilaterals). Each facet is divided into panels
by halving its edges; the traction is constant on each panel, and the integral equation is collocated at the midpoint of
each panel. With panels as large as the facets, a sawtooth displacement would vanish at all midpoints and the stiffness
would be indefinite. Kernels: Brebbia and Dominguez, Boundary Elements: An Introductory Course.
"""

import math
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.models.panels import Panels, Patch

# By dimension: Gauss points per direction on panels that are closer to a point than the given multiple of their radius;
# the error is about 1e-14 in 2D and 1e-8 in 3D.
_LEVELS = {
    2: ((2.0, 24), (6.0, 12), (np.inf, 8)),
    3: ((1.3, 20), (2.2, 12), (4.0, 6), (10.0, 4), (np.inf, 3)),
}
# If the midpoint of a panel is closer to a point than this multiple of its radius, the point is the midpoint.
_ITSELF = 1e-6


class Kelvin(NamedTuple):
    """Displacement and traction of a point force in an infinite body, in 2D of unit thickness.

    Attributes:
        mu: shear modulus [Pa].
        poisson: Poisson's ratio of plane strain or 3D; for plane stress use nu / (1 + nu).
        length: unit of distances in the logarithm of 2D [m], about the size of the body: for some sizes near the unit
            the integral equation is singular for uniform displacements.
    """

    mu: float
    poisson: float
    length: float


class Influence:
    """Integrals of Kelvin's solution over the panels of a surface."""

    def __init__(self, surface: Panels, kelvin: Kelvin) -> None:
        self.surface, self.kelvin = surface, kelvin
        self._levels = [(reach, surface.gauss(n)) for reach, n in _LEVELS[surface.dim]]

    def at(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the integrals of U over the panels and of T times the nodal functions at `points` [m], shape (n, dim).

        Shapes (n * dim, n_panels * dim) and (n * dim, n_nodes * dim). The integrals of a panel at its midpoint are not
        included.
        """
        surface, dim, n = self.surface, self.surface.dim, len(points)
        U, T = np.zeros((n, dim, surface.n_panels, dim)), np.zeros((n, dim, len(surface.nodes), dim))
        nearest = _ITSELF
        for furthest, patch in self._levels:
            self._integrate(points, patch, patch.shape, (nearest, furthest), U, T)
            nearest = furthest
        return U.reshape(n * dim, -1), T.reshape(n * dim, -1)

    def _integrate(
        self, points: Floats, patch: Patch, shape: Floats, reach: tuple[float, float], U: Floats, T: Floats
    ) -> None:
        from truespring.kernels import kelvin
        from truespring.kernels.threads import run, writable

        surface = self.surface
        known = (writable(points), tuple(self.kelvin), surface.middles.places[:, 0].copy(), surface.radii, *reach)
        values = (patch.places, patch.normals, np.ascontiguousarray(shape), patch.measures)
        corners = np.ascontiguousarray(surface.facets[surface.of])
        run(kelvin.integrate, len(points), *known, *map(writable, values), corners, U, T, smallest=1)

    def equations(self) -> tuple[Floats, Floats]:
        """Return G [m/Pa] and H [-] of the integral equation H u = G t at the midpoints of the panels.

        Shapes (n_panels * dim, n_panels * dim) and (n_panels * dim, n_nodes * dim). The singular part of H follows from
        the condition that a uniform displacement causes no traction.
        """
        surface, dim, n = self.surface, self.surface.dim, self.surface.n_panels
        G, H = (one.reshape(n, dim, -1, dim) for one in self.at(surface.middles.places[:, 0]))
        free = -H.sum(axis=2)
        self._add_own(G, H)
        panels = np.arange(n)
        for corner in range(surface.facets.shape[1]):
            at_middle = surface.middles.shape[:, 0, corner, None, None]
            H[panels, :, surface.facets[surface.of, corner]] += at_middle * free
        return G.reshape(n * dim, -1), H.reshape(n * dim, -1)

    def _add_own(self, G: Floats, H: Floats) -> None:
        """Add the integrals of each panel at its midpoint: U, and T times the nodal functions minus their values there.

        Closed form in 2D.
        """
        surface, middles = self.surface, self.surface.middles
        if surface.dim == 3:
            patch = surface.around_middles()
            own = middles.places[:, 0], patch, patch.shape - middles.shape
            self._integrate(*own, (0.0, _ITSELF), G, H)
            return
        mu, poisson, unit = self.kelvin
        ends = surface.nodes[surface.facets[surface.of]]
        along = ends[:, 1] - ends[:, 0]
        whole = np.linalg.norm(along, axis=1)
        e, length = along / whole[:, None], whole / 2
        size = (3 - 4 * poisson) * (1 - np.log(length / 2 / unit))
        both = size[:, None, None] * np.eye(2) + e[:, :, None] * e[:, None]
        panels = np.arange(surface.n_panels)
        G[panels, :, panels] += both * (length / (8 * math.pi * mu * (1 - poisson)))[:, None, None]
        turned = e[:, :, None] * middles.normals[:, 0][:, None]
        linear = (1 - 2 * poisson) / (8 * math.pi * (1 - poisson)) * (turned - turned.swapaxes(1, 2))
        for corner, sign in enumerate((-1, 1)):  # the functions change by half along a panel
            H[panels, :, surface.facets[surface.of, corner]] += sign * linear

    def shares(self) -> Floats:
        """Return the nodal forces of a unit traction on each panel [m] or [m^2], shape (n_panels, corners)."""
        patch = self._levels[0][1]
        return np.asarray((patch.shape * patch.measures[..., None]).sum(axis=1))
