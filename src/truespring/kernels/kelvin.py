"""Integrals of Kelvin's solution (displacement and traction of a point force) over the panels of a surface."""

import math
from typing import Any

import numpy as np

from truespring.kernels.threads import kernel


@kernel
def integrate(
    first: int,
    last: int,
    points: Any,
    law: Any,
    middles: Any,
    radii: Any,
    nearest: float,
    furthest: float,
    places: Any,
    normals: Any,
    shape: Any,
    measures: Any,
    corners: Any,
    U: Any,
    T: Any,
) -> None:
    """Add the integrals of U, and of T times the shape functions of the corners, over panels, for points first to last.

    Only panels count whose centre is at least `nearest` and less than `furthest` times their radius away. With e the
    direction from the point to an integration point at distance r, and n the normal there, the displacement U_ij and
    traction T_ij along j of a unit force along i are, up to constant factors, (3 - 4 nu) s delta_ij + e_i e_j, with
    s = -ln(r / length) in the plane and 1 in space, and (1 - 2 nu) (e_i n_j - e_j n_i - e . n delta_ij)
    - dim (e . n) e_i e_j.

    Shapes, with c corners and q integration points per panel: points (n_points, dim), law (mu, nu, length), middles
    (n_panels, dim), radii (n_panels,), places, normals (n_panels, q, dim), shape (n_panels, q, c), measures
    (n_panels, q), corners (n_panels, c); U (n_points, dim, n_panels, dim), T (n_points, dim, n_corners, dim).
    """
    dim, n_points = points.shape[1], places.shape[1]
    mu, nu, length = law
    plain, rest = 3.0 - 4.0 * nu, 1.0 - 2.0 * nu
    scale_u = 1.0 / (8.0 * math.pi * mu * (1.0 - nu) * (1.0 if dim == 2 else 2.0))
    scale_t = 1.0 / (4.0 * math.pi * (1.0 - nu) * (dim - 1.0))
    n_corners = corners.shape[1]
    e, u, t = np.empty(dim), np.empty((dim, dim)), np.empty((n_corners, dim, dim))
    for c in range(first, last):
        for p in range(len(radii)):
            apart = 0.0
            for i in range(dim):
                apart += (middles[p, i] - points[c, i]) ** 2
            apart = math.sqrt(apart) / radii[p]
            if apart < nearest or apart >= furthest:
                continue
            u[:] = 0.0
            t[:] = 0.0
            for q in range(n_points):
                squared = 0.0
                for i in range(dim):
                    e[i] = places[p, q, i] - points[c, i]
                    squared += e[i] * e[i]
                r = math.sqrt(squared)
                slope = 0.0
                for i in range(dim):
                    e[i] /= r
                    slope += e[i] * normals[p, q, i]
                size = plain * (-math.log(r / length) if dim == 2 else 1.0)
                weight_u = measures[p, q] * scale_u / (1.0 if dim == 2 else r)
                weight_t = measures[p, q] * scale_t / (r if dim == 2 else squared)
                for i in range(dim):
                    for j in range(dim):
                        same = 1.0 if i == j else 0.0
                        both = e[i] * e[j]
                        u[i, j] += weight_u * (both + size * same)
                        turned = e[i] * normals[p, q, j] - e[j] * normals[p, q, i]
                        pull = weight_t * (rest * (turned - slope * same) - dim * slope * both)
                        for a in range(n_corners):
                            t[a, i, j] += shape[p, q, a] * pull
            for i in range(dim):
                for j in range(dim):
                    U[c, i, p, j] += u[i, j]
                    for a in range(n_corners):
                        T[c, i, corners[p, a], j] += t[a, i, j]
