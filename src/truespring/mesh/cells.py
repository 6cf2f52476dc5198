"""Cells of first and second order in VTK's node order: reference coordinates, shape functions, quadrature."""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property
from types import MappingProxyType

import numpy as np

from truespring.arrays import Floats
from truespring.mesh.kinds import ELEMENT_KINDS

Groups = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, eq=False)
class CellShape:
    """A kind of cell in reference coordinates.

    Attributes:
        vtk_type: VTK's number of the cell type.
        base: name of the first-order cell with the same corners.
        corners: reference coordinates of the corners, shape (n_corners, dim).
        between: for each further node, the corners whose mean it is.
        powers: exponents of the basis functions that span the shape functions, shape (n_nodes, dim + 1): of the
            reference coordinates, and of 1 / (1 - z), nonzero for pyramids only.
        facets: corners of its faces, anticlockwise seen from outside; of a plane cell its edges.
    """

    vtk_type: int
    base: str
    corners: Floats
    between: Groups
    powers: Floats
    facets: Groups

    @property
    def dim(self) -> int:
        """Dimension of the cell."""
        return int(self.corners.shape[1])

    @cached_property
    def places(self) -> Floats:
        """Reference coordinates of the nodes [-], shape (n_nodes, dim)."""
        middles = [self.corners[list(few)].mean(axis=0) for few in self.between]
        return np.concatenate([self.corners, np.reshape(middles, (-1, self.dim))])

    @cached_property
    def _coefficients(self) -> Floats:
        """Coefficients of the shape functions in the basis: each is 1 at its node, 0 at all others."""
        return np.asarray(np.linalg.inv(_product(self.places, self.powers)))

    def shapes(self, at: Floats) -> Floats:
        """Return the shape functions, shape (n, n_nodes), at reference coordinates of shape (n, dim)."""
        return np.asarray(_product(at, self.powers) @ self._coefficients)

    def slopes(self, at: Floats) -> Floats:
        """Return the derivatives of the shape functions by the reference coordinates, shape (n, n_nodes, dim)."""
        found = np.empty((len(at), len(self.powers), self.dim))
        for axis in range(self.dim):
            lowered, raised = self.powers.copy(), self.powers.copy()
            lowered[:, axis] = np.maximum(lowered[:, axis] - 1, 0)
            slope = self.powers[:, axis] * _product(at, lowered)
            if axis == 2 and self.powers[:, -1].any():
                raised[:, -1] += 1
                slope += self.powers[:, -1] * _product(at, raised)
            found[:, :, axis] = slope @ self._coefficients
        return found

    def smallest_jacobian(self, places: Floats) -> Floats:
        """Return the smallest Jacobian determinant of each cell [m^dim], shape (n,).

        `places` has the positions of their nodes [m], shape (n, n_nodes, dim). The Jacobian is taken at the nodes and
        at Gauss points; a cell is folded where it is not positive.
        """
        smallest = np.full(len(places), np.inf)
        for slopes in self.slopes(np.concatenate([self.places, quadrature(self.base, 2)[0]])):
            smallest = np.minimum(smallest, np.linalg.det(np.einsum("nki,ka->nai", places, slopes)))
        return smallest

    def clipped(self, at: Floats) -> Floats:
        """Return reference coordinates, shape (n, dim), those outside the cell moved to its border."""
        inside = np.clip(at, -1.0 if self.base == "pyramid" else 0.0, 1.0)
        if self.base in ("triangle", "tetra", "wedge"):
            flat = inside[:, : 3 if self.base == "tetra" else 2]
            flat /= np.maximum(flat.sum(axis=1, keepdims=True), 1.0)
        elif self.base == "pyramid":
            inside[:, 2] = inside[:, 2].clip(0.0)
            inside[:, :2] = np.clip(inside[:, :2], inside[:, 2:] - 1, 1 - inside[:, 2:])
        return inside


def _product(at: Floats, powers: Floats) -> Floats:
    """Return the basis functions, products of powers of the reference coordinates, shape (n, n_powers)."""
    found = np.ones((len(at), len(powers)))
    for axis in range(at.shape[1]):
        exponents = powers[:, axis].astype(np.int64)
        table = np.vander(at[:, axis], exponents.max() + 1, increasing=True)  # faster than one power for each entry
        found *= table[:, exponents]
    if powers[:, -1].any():  # a pyramid: at its apex the other factors vanish faster
        found *= np.maximum(1.0 - at[:, 2, None], _TIP) ** -powers[:, -1]
    return found


_TIP = 1e-9


def _powers(exponents: Iterable[tuple[int, ...]]) -> Floats:
    """Return exponents of polynomials: without the factor 1 / (1 - z) of pyramids."""
    return np.array([(*few, 0) for few in exponents], dtype=float)


def _cubic(dim: int, most: int) -> list[tuple[int, ...]]:
    return list(itertools.product(range(most + 1), repeat=dim))


def _serendipity(dim: int) -> list[tuple[int, ...]]:
    """Return exponents of products with at most one square (Arnold and Awanou, 2011: superlinear degree two)."""
    return [few for few in _cubic(dim, 2) if few.count(2) <= 1]


def _simplex(dim: int, degree: int) -> list[tuple[int, ...]]:
    return [few for few in _cubic(dim, degree) if sum(few) <= degree]


def _prism(flat: int, whole: bool) -> list[tuple[int, ...]]:
    """Return exponents of a triangle times a line; without the products of two squares unless `whole`."""
    plane = _simplex(2, flat)
    return [(*few, z) for few in plane for z in range(flat + 1) if whole or flat == 1 or z < 2 or sum(few) < 2]


# First order: linear functions and xy / (1 - z); second order: quadratic ones, that, and that times x and times y.
# On the triangular faces all are polynomials.
_PYRAMID = [(0, 0, 0, 0), (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 1, 0, 1)]
_PYRAMID_13 = [*((*few, 0) for few in _simplex(3, 2)), (1, 1, 0, 1), (2, 1, 0, 1), (1, 2, 0, 1)]

_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))
_TRIANGLE = ((0, 0), (1, 0), (0, 1))
_CORNERS: dict[str, tuple[tuple[int, ...], ...]] = {
    "line": ((0,), (1,)),
    "triangle": _TRIANGLE,
    "quad": _SQUARE,
    "tetra": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "hexahedron": tuple((*corner, z) for z in (0, 1) for corner in _SQUARE),
    "wedge": tuple((*corner, z) for z in (0, 1) for corner in _TRIANGLE),
    "pyramid": ((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1)),
}
_EDGES: dict[str, Groups] = {kind.vtk: kind.edges for kind in ELEMENT_KINDS.values()}
_FACETS: dict[str, Groups] = {
    kind.vtk: tuple(tuple(dict.fromkeys(facet)) for facet in kind.facets) for kind in ELEMENT_KINDS.values()
}
_HEXAHEDRON_FACES = ((0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7))


def _shape(vtk_type: int, base: str, powers: Floats, between: Groups = ()) -> CellShape:
    return CellShape(vtk_type, base, np.array(_CORNERS[base], dtype=float), between, powers, _FACETS[base])


#: Kinds of cells by name, as meshio and scikit-fem spell it. A new kind of cell in results needs only an entry.
CELL_SHAPES: MappingProxyType[str, CellShape] = MappingProxyType(
    {
        "line": _shape(3, "line", _powers(_cubic(1, 1))),
        "line3": _shape(21, "line", _powers(_cubic(1, 2)), _EDGES["line"]),
        "triangle": _shape(5, "triangle", _powers(_simplex(2, 1))),
        "triangle6": _shape(22, "triangle", _powers(_simplex(2, 2)), _EDGES["triangle"]),
        "quad": _shape(9, "quad", _powers(_cubic(2, 1))),
        "quad8": _shape(23, "quad", _powers(_serendipity(2)), _EDGES["quad"]),
        "quad9": _shape(28, "quad", _powers(_cubic(2, 2)), (*_EDGES["quad"], (0, 1, 2, 3))),
        "tetra": _shape(10, "tetra", _powers(_simplex(3, 1))),
        "tetra10": _shape(24, "tetra", _powers(_simplex(3, 2)), _EDGES["tetra"]),
        "hexahedron": _shape(12, "hexahedron", _powers(_cubic(3, 1))),
        "hexahedron20": _shape(25, "hexahedron", _powers(_serendipity(3)), _EDGES["hexahedron"]),
        "hexahedron27": _shape(
            29,
            "hexahedron",
            _powers(_cubic(3, 2)),
            (*_EDGES["hexahedron"], *_HEXAHEDRON_FACES, tuple(range(8))),
        ),
        "wedge": _shape(13, "wedge", _powers(_prism(1, True))),
        "wedge15": _shape(26, "wedge", _powers(_prism(2, False)), _EDGES["wedge"]),
        "wedge18": _shape(32, "wedge", _powers(_prism(2, True)), (*_EDGES["wedge"], *_FACETS["wedge"][2:])),
        "pyramid": _shape(14, "pyramid", np.array(_PYRAMID, dtype=float)),
        "pyramid13": _shape(27, "pyramid", np.array(_PYRAMID_13, dtype=float), _EDGES["pyramid"]),
    }
)


@cache
def quadrature(base: str, n: int) -> tuple[Floats, Floats]:
    """Return Gauss points of a cell in reference coordinates, shape (n^dim, dim), and their weights, shape (n^dim,).

    `base` is that of a CellShape. Polynomials of order 2 n - 1 are integrated exactly, on quads, hexahedra and wedges
    along each axis. On simplices and pyramids the points are those of a collapsed cube, Gauss-Jacobi points along each
    axis that collapses (Karniadakis and Sherwin, Spectral/hp Element Methods for CFD, 1999).
    """
    from scipy.special import roots_jacobi

    if base == "wedge":
        (flat, shares), (high, heights) = quadrature("triangle", n), quadrature("line", n)
        at = np.column_stack([np.repeat(flat, len(high), axis=0), np.tile(high, (len(flat), 1))])
        return at, np.outer(shares, heights).ravel()
    if base == "pyramid":
        (flat, shares), (places, heights) = quadrature("quad", n), roots_jacobi(n, 2, 0)
        z, heights = (1 + places) / 2, heights / 2
        base_at = np.repeat(2 * flat - 1, len(z), axis=0) * (1 - np.tile(z, len(flat)))[:, None]
        return np.column_stack([base_at, np.tile(z, len(flat))]), np.outer(shares, heights).ravel()
    dim = {"line": 1, "quad": 2, "triangle": 2, "tetra": 3, "hexahedron": 3}[base]
    collapsed = base in ("triangle", "tetra")
    at, weights, left = np.zeros((1, 0)), np.ones(1), np.ones(1)  # left: remaining height of a simplex
    for axis in range(dim):
        power = dim - 1 - axis if collapsed else 0
        places, shares = roots_jacobi(n, power, 0)
        along, shares = (1 + places) / 2, shares / 2 ** (power + 1)
        at = np.column_stack([np.repeat(at, n, axis=0), np.outer(left, along).ravel()])
        weights = np.outer(weights, shares).ravel()
        left = np.outer(left, 1 - along).ravel() if collapsed else np.ones(len(weights))
    return at, weights
