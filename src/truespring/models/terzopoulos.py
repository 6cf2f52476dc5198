"""The metric-tensor model of Terzopoulos et al., by finite differences on a regular grid."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ModelError, nearest
from truespring.mesh.rows import distinct_rows
from truespring.mesh.selections import AXES
from truespring.models.metric import Component, MetricPotential, components
from truespring.models.model import Model
from truespring.models.rules import require_body
from truespring.models.strain import voigt_pairs
from truespring.problem import Problem

#: Weight of differences at the boundary of the body: that of inner ones, as in the paper, or by the trapezoidal rule.
BOUNDARIES = ("paper", "trapezoid")

# Largest distance of equal positions in a cell, relative to its size: well above rounding.
_SAME_PLACE = 1e-6
# Smallest Poisson's ratio for which a warning is issued.
_SAME_POISSON = 0.01


@dataclass(frozen=True)
class Terzopoulos(Model):
    """The metric-tensor model of Terzopoulos, Platt, Barr and Fleischer (SIGGRAPH 1987) on a regular grid.

    The energy is the integral of sum eta_ij (G_ij - G0_ij)^2, G_ij = dr/da_i . dr/da_j, by forward differences. The
    weights are eta_ii = E/8 and eta_ij = mu/4: Young's modulus along the axes and the shear modulus are then those of
    the material (in plane strain, the apparent ones). Poisson's ratio along the axes is 0 for any weights, since the
    energy has no product of two strains.

    Attributes:
        boundary: "paper" gives all differences the same weight, which makes a body n cells deep (n + 1) / n times as
            stiff; "trapezoid" halves the weight at the boundary, which is exact for a uniform strain.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> ts.solve(problem, ts.Terzopoulos())
        Solution(Terzopoulos (paper boundary), converged, 11 states up to load factor 1)
    """

    boundary: str = "paper"

    def __post_init__(self) -> None:
        if self.boundary not in BOUNDARIES:
            close = nearest(str(self.boundary), BOUNDARIES)
            raise ModelError(f"boundary = {self.boundary!r} is unknown{close}; allowed: {', '.join(BOUNDARIES)}")

    kind = "terzopoulos"

    @property
    def label(self) -> str:
        """Name in figures and tables."""
        return f"Terzopoulos ({self.boundary} boundary)"

    def potential(self, problem: Problem) -> MetricPotential:
        """Return the potential; raise ModelError if the mesh is not a regular grid along the axes."""
        cells, size = _grid(problem)
        return MetricPotential(problem, cells, np.concatenate(list(self._weights(problem, cells, size)), axis=1))

    def _weights(self, problem: Problem, cells: Ints, size: Floats) -> Iterator[Floats]:
        """Yield the weights of each component in each cell [J/m^4], shape (n_cells, corners)."""
        _, section = require_body(problem)
        volume = float(np.prod(size)) * section.thickness
        normal = problem.of_elements(lambda material: section.apparent_moduli(material)[0] / 8)
        shear = problem.of_elements(lambda material: section.lame_within(material).mu / 4)
        for one in components(problem.mesh.dim):
            eta = normal if one.i == one.j else 2 * shear  # G_ij and G_ji
            share = _shares(cells, one, problem.mesh.n_nodes) if self.boundary == "paper" else 1 / len(one.corners)
            here = eta * volume / (size[one.i] * size[one.j]) ** 2
            yield np.broadcast_to(here[:, None] * share, (len(cells), len(one.corners)))

    def elasticity(self, problem: Problem) -> Floats:
        """Return the elasticity matrix under a uniform strain [Pa], in Voigt's order, shape (3, 3) or (6, 6).

        It is diagonal, C_ii = 8 eta_ii and C_ij,ij = 4 eta_ij, times the factors of the boundary.
        """
        cells, size = _grid(problem)
        _, section = require_body(problem)
        found = {}
        weights = self._weights(problem, cells, size)
        for one, weight in zip(components(problem.mesh.dim), weights, strict=True):
            strained = 8 if one.i == one.j else 2  # of unit strain; of unit engineering shear
            found[one.i, one.j] = strained * float(weight.sum()) * (size[one.i] * size[one.j]) ** 2
        diagonal = np.array([found[min(pair), max(pair)] for pair in voigt_pairs(problem.mesh.dim)])
        return np.diag(diagonal / (len(cells) * float(np.prod(size)) * section.thickness))

    def warnings(self, problem: Problem) -> tuple[str, ...]:
        """Return warnings about effective moduli that differ from the material, and about the boundary."""
        return (*self._poisson_warnings(problem), *self._boundary_warnings(problem))

    def _poisson_warnings(self, problem: Problem) -> Iterator[str]:
        """Yield a warning for each material with another Poisson's ratio than zero."""
        _, section = require_body(problem)
        for material in problem.materials:
            young, poisson = section.apparent_moduli(material)
            if abs(poisson) <= _SAME_POISSON:
                continue
            double = 2 / young + 1 / section.lame_within(material).mu  # 4 / E at 45 degrees
            yield (
                f"along the axes of the grid Poisson's ratio is 0, that of the material is {poisson:.4g}"
                f"{section.within}: the energy has no product of two strains. Young's modulus along the axes "
                f"({young:.6g} Pa) and the shear modulus are those of the material; at 45 degrees Young's modulus is "
                f"{4 / double:.6g} Pa and Poisson's ratio {1 - 4 / young / double:.4g}"
            )

    def _boundary_warnings(self, problem: Problem) -> Iterator[str]:
        """Yield a warning about the stiffness that boundary = "paper" adds."""
        if self.boundary != "paper":
            return
        own, exact = (np.diag(one.elasticity(problem)) for one in (self, Terzopoulos("trapezoid")))
        factors = own / exact
        along = [f"{factors[axis]:.4g} along {AXES[axis]}" for axis in range(problem.mesh.dim)]
        yield (
            'boundary = "paper" gives differences at the boundary the weight of inner ones, which multiplies the '
            "stiffness by (n + 1) / n for each transverse direction of n cells; in stretch: "
            f'{", ".join(along)}; boundary = "trapezoid" has no such factor'
        )


def _grid(problem: Problem) -> tuple[Ints, Floats]:
    """Return the nodes of each cell by corner and the size of a cell [m], shapes (n_cells, 2^dim) and (dim,).

    Corners are numbered along x first, then y, then z. Raises ModelError if the mesh is not a regular grid.
    """
    require_body(problem)
    mesh = problem.mesh
    required = 'kind = "terzopoulos" requires a regular grid along the axes'
    other = "a model for any mesh, such as springs or fem"
    if mesh.element not in ("quadrilateral", "hexahedron"):
        raise ModelError(
            f"{required}, the mesh has {mesh.element} elements: use rectangles or bricks of one size, or {other}"
        )
    at = mesh.nodes[mesh.elements]
    order = np.argsort((at > at.mean(axis=1, keepdims=True)) @ 2 ** np.arange(mesh.dim), axis=1)
    ordered = np.take_along_axis(at, order[:, :, None], axis=1)
    size = np.median(at.max(axis=1) - at.min(axis=1), axis=0)
    corners = np.array([corner[::-1] for corner in product((0.0, 1.0), repeat=mesh.dim)]) * size
    off = np.abs(ordered - ordered[:, :1] - corners).max(axis=(1, 2)) > _SAME_PLACE * size.min()
    if off.any():
        first = int(off.argmax())
        place = ", ".join(f"{coordinate:.6g}" for coordinate in mesh.centres[first])
        cell = " x ".join(f"{length:.6g}" for length in size)
        raise ModelError(
            f"{required}: {int(off.sum())} of {len(off)} elements are not a "
            f"{'rectangle' if mesh.dim == 2 else 'brick'} of {cell} m along the axes, the first is element {first} at "
            f"({place}) m; use a rectangle or a box, or {other}"
        )
    return np.take_along_axis(mesh.elements, order, axis=1), size


def _shares(cells: Ints, one: Component, n_nodes: int) -> Floats:
    """Return 1 over the number of cells that share each product of differences [-], shape (n_cells, corners).

    Edges are identified by their two nodes, faces by the two nodes at the ends of the differences.
    """
    start = one.corners if one.i == one.j else one.corners + 2**one.i
    keys = cells[:, start] * n_nodes + cells[:, one.corners + 2**one.j]
    found = distinct_rows([keys.ravel()])
    return np.asarray(1 / found.count[found.of].reshape(keys.shape))
