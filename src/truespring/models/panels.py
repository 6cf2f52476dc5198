"""The panels of a surface, and quadrature points on them."""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from truespring.arrays import Floats, Ints

# Quadrature points in the triangles between the midpoint and the edges of a panel: in the outward direction, where the
# integrand is a polynomial on flat panels, and along the edge.
_OUTWARD, _AROUND = 4, 28


@dataclass(frozen=True, eq=False)
class Patch:
    """Quadrature points on panels.

    Attributes:
        places: positions [m], shape (n_panels, points, dim).
        normals: outward unit normals [-], shape (n_panels, points, dim).
        shape: shape functions of the corners of the facet [-], shape (n_panels, points, corners).
        measures: weights, the length [m] or area [m^2] of each point, shape (n_panels, points).
    """

    places: Floats
    normals: Floats
    shape: Floats
    measures: Floats


@dataclass(frozen=True, eq=False)
class Panels:
    """A closed surface, with two panels per line and four per triangle or quadrilateral.

    Attributes:
        nodes: positions [m], shape (n_nodes, dim).
        facets: node numbers, counterclockwise seen from outside, shape (n_facets, 2 to 4).
    """

    nodes: Floats
    facets: Ints

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return int(self.nodes.shape[1])

    @cached_property
    def _pieces(self) -> Floats:
        """Corners of the panels in the reference facet, shape (panels, corners, dim - 1)."""
        corners = self.facets.shape[1]
        if self.dim == 2:
            return np.array([[[0.0], [0.5]], [[0.5], [1.0]]])
        if corners == 4:
            square = np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])
            return np.array([square + start for start in product((0.0, 0.5), repeat=2)])
        one, two, three = np.array([0.0, 0.0]), np.array([1.0, 0.0]), np.array([0.0, 1.0])
        a, b, c = (one + two) / 2, (two + three) / 2, (three + one) / 2
        return np.array([[one, a, c], [a, two, b], [c, b, three], [a, b, c]])

    @cached_property
    def of(self) -> Ints:
        """Facet number of each panel, shape (n_panels,)."""
        return np.repeat(np.arange(len(self.facets)), len(self._pieces))

    @property
    def n_panels(self) -> int:
        """The number of panels."""
        return len(self.of)

    def _functions(self, at: Floats) -> tuple[Floats, Floats]:
        """Return shape functions in the reference facet, axes (..., corner), and derivatives, (..., corner, axis)."""
        x, y = at[..., 0], at[..., -1]
        one, zero = np.ones_like(x), np.zeros_like(x)
        if self.dim == 2:
            return np.stack([1 - x, x], axis=-1), np.stack([-one, one], axis=-1)[..., None]
        if self.facets.shape[1] == 3:
            values = [1 - x - y, x, y]
            slopes = [(-one, -one), (one, zero), (zero, one)]
        else:
            values = [(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y]
            slopes = [(y - 1, x - 1), (1 - y, -x), (y, x), (-y, 1 - x)]
        return np.stack(values, axis=-1), np.stack([np.stack(pair, axis=-1) for pair in slopes], axis=-2)

    def _patch(self, at: Floats, weights: Floats) -> Patch:
        """Return points of every panel, from points and weights in the reference facet, axes (piece, point, ...)."""
        values, slopes = self._functions(at)
        corners = self.nodes[self.facets]
        places = np.einsum("pqa,fad->fpqd", values, corners)
        tangents = np.einsum("pqas,fad->fpqsd", slopes, corners)
        if self.dim == 2:
            along = tangents[..., 0, :]
            normals = np.stack([along[..., 1], -along[..., 0]], axis=-1)
        else:
            normals = np.cross(tangents[..., 0, :], tangents[..., 1, :])
        sizes = np.linalg.norm(normals, axis=-1)
        n, points = self.n_panels, at.shape[1]
        return Patch(
            places.reshape(n, points, -1),
            (normals / sizes[..., None]).reshape(n, points, -1),
            np.broadcast_to(values, (len(self.facets), *values.shape)).reshape(n, points, -1),
            (sizes * weights).reshape(n, points),
        )

    def gauss(self, n: int) -> Patch:
        """Return Gauss points of the panels, n per direction."""
        pieces = self._pieces
        x, w = _unit_gauss(n)
        if self.dim == 2:
            start, end = pieces[:, 0, None], pieces[:, 1, None]
            return self._patch(start + x[:, None] * (end - start), w * (end - start)[..., 0])
        s, t = (one.ravel() for one in np.meshgrid(x, x, indexing="ij"))
        both = np.outer(w, w).ravel()
        first, second, last = pieces[:, 0, None], pieces[:, 1, None], pieces[:, -1, None]
        if pieces.shape[1] == 4:
            return self._patch(
                first + s[:, None] * (second - first) + t[:, None] * (last - first),
                both * _determinant(second - first, last - first),
            )
        return self._patch(*_collapsed(first, second, last, s, t, both))

    def around_middles(self) -> Patch:
        """Return points in the triangles from the midpoint of each panel to its edges, denser near the midpoint."""
        (x, w), (y, v) = _unit_gauss(_OUTWARD), _unit_gauss(_AROUND)
        s, t = (one.ravel() for one in np.meshgrid(x, y, indexing="ij"))
        both, pieces = np.outer(w, v).ravel(), self._pieces
        middle, following = pieces.mean(axis=1)[:, None], np.roll(pieces, -1, axis=1)
        parts = [
            _collapsed(middle, pieces[:, k, None], following[:, k, None], s, t, both) for k in range(pieces.shape[1])
        ]
        return self._patch(*(np.concatenate(part, axis=1) for part in zip(*parts, strict=True)))

    @cached_property
    def middles(self) -> Patch:
        """The midpoint of each panel, as one point."""
        middle = self._pieces.mean(axis=1)[:, None]
        return self._patch(middle, np.ones(middle.shape[:2]))

    @cached_property
    def radii(self) -> Floats:
        """Distance from the midpoint of each panel to its furthest corner [m], shape (n_panels,)."""
        corners = self._patch(self._pieces, np.ones(self._pieces.shape[:2])).places
        return np.asarray(np.linalg.norm(corners - self.middles.places, axis=2).max(axis=1))


def _unit_gauss(n: int) -> tuple[Floats, Floats]:
    x, w = np.polynomial.legendre.leggauss(n)
    return (x + 1) / 2, w / 2


def _determinant(first: Floats, second: Floats) -> Floats:
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])


def _collapsed(tip: Floats, one: Floats, other: Floats, s: Floats, t: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Return points and weights of a square collapsed to a triangle, with s = 0 at the tip (Duffy 1982)."""
    at = tip + s[:, None] * (one - tip + t[:, None] * (other - one))
    return at, weights * s * _determinant(one - tip, other - tip)
