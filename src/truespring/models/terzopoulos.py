"""Terzopoulos' deformable body: the change of the metric tensor, by finite differences on a regular grid."""

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

#: How much a difference at the outside of the body counts: as any other, as in the paper, or by the trapezoidal rule.
BOUNDARIES = ("paper", "trapezoid")

# Places in a cell that differ by less than this share of its size are the same: well above rounding.
_SAME_PLACE = 1e-6
# A Poisson's ratio nearer to zero is worth no word.
_SAME_POISSON = 0.01


@dataclass(frozen=True)
class Terzopoulos(Model):
    """The metric-tensor model of Terzopoulos, Platt, Barr and Fleischer (SIGGRAPH 1987), of bodies on a regular grid.

    Its energy is the integral of sum eta_ij (G_ij - G0_ij)^2, G_ij = dr/da_i . dr/da_j, by forward differences. With
    one weight for each component of G the best for a material are eta_ii = E/8 and eta_ij = mu/4: Young's modulus
    along the axes and the shear modulus are then the material's (in plane strain those of a test in the plane).
    Poisson's ratio along the axes is 0 for any weights: the energy has no product of two strains.

    Attributes:
        boundary: "paper" gives every difference that exists the same weight, which makes a body n cells deep
            (n + 1) / n times as stiff; "trapezoid" halves it at the outside, which is exact for a uniform strain.
    """

    boundary: str = "paper"

    def __post_init__(self) -> None:
        if self.boundary not in BOUNDARIES:
            close = nearest(str(self.boundary), BOUNDARIES)
            raise ModelError(f"boundary = {self.boundary!r} is unknown{close}; allowed: {', '.join(BOUNDARIES)}")

    kind = "terzopoulos"

    @property
    def label(self) -> str:
        """How curves and tables call the model."""
        return f"Terzopoulos ({self.boundary} boundary)"

    def potential(self, problem: Problem) -> MetricPotential:
        """Return the potential on the problem's mesh; raise ModelError where that is no regular grid along the axes."""
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
        """Return what the body has under a uniform strain [Pa], in Voigt's order, shape (3, 3) or (6, 6).

        C_ii = 8 eta_ii and C_ij,ij = 4 eta_ij on its diagonal, times what the boundary makes of them.
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
        """Return what should be known before the model is solved: what its weights and its boundary do not realise."""
        return (*self._poisson_warnings(problem), *self._boundary_warnings(problem))

    def _poisson_warnings(self, problem: Problem) -> Iterator[str]:
        _, section = require_body(problem)
        for material in problem.materials:
            young, poisson = section.apparent_moduli(material)
            if abs(poisson) <= _SAME_POISSON:
                continue
            double = 2 / young + 1 / section.lame_within(material).mu  # 4 / E at 45 degrees
            yield (
                f"along the grid's axes Poisson's ratio is 0 where the material has {poisson:.4g}{section.within}, for "
                "any weights of the metric tensor: its energy has no product of two strains. Young's modulus along the "
                f"axes ({young:.6g} Pa) and the shear modulus are the material's; at 45 degrees these weights give "
                f"{4 / double:.6g} Pa and {1 - 4 / young / double:.4g}"
            )

    def _boundary_warnings(self, problem: Problem) -> Iterator[str]:
        if self.boundary != "paper":
            return
        own, exact = (np.diag(one.elasticity(problem)) for one in (self, Terzopoulos("trapezoid")))
        factors = own / exact
        along = [f"{factors[axis]:.4g} along {AXES[axis]}" for axis in range(problem.mesh.dim)]
        yield (
            'boundary = "paper" counts a difference at the outside of the body as one inside, which multiplies the '
            "stiffness by (n + 1) / n for each direction across, n cells deep; against stretching: "
            f'{", ".join(along)}; boundary = "trapezoid" has no such factor'
        )


def _grid(problem: Problem) -> tuple[Ints, Floats]:
    """Return the nodes of each cell by corner and the size of a cell [m], shapes (n_cells, 2^dim) and (dim,).

    Corners count x first, then y, then z. Raises ModelError where the mesh is no regular grid along the axes.
    """
    require_body(problem)
    mesh = problem.mesh
    wants = 'kind = "terzopoulos" takes differences along the axes of a regular grid'
    other = "a model for any mesh, such as springs or fem"
    if mesh.element not in ("quadrilateral", "hexahedron"):
        raise ModelError(
            f"{wants}; {mesh.element} elements have none: take rectangles or bricks of one size, or {other}"
        )
    at = mesh.nodes[mesh.elements]
    order = np.argsort((at > at.mean(axis=1, keepdims=True)) @ 2 ** np.arange(mesh.dim), axis=1)
    ordered = np.take_along_axis(at, order[:, :, None], axis=1)
    size = np.median(at.max(axis=1) - at.min(axis=1), axis=0)
    wanted = np.array([corner[::-1] for corner in product((0.0, 1.0), repeat=mesh.dim)]) * size
    off = np.abs(ordered - ordered[:, :1] - wanted).max(axis=(1, 2)) > _SAME_PLACE * size.min()
    if off.any():
        first = int(off.argmax())
        place = ", ".join(f"{coordinate:.6g}" for coordinate in mesh.centres[first])
        cell = " x ".join(f"{length:.6g}" for length in size)
        raise ModelError(
            f"{wants}: {int(off.sum())} of {len(off)} elements are no {'rectangle' if mesh.dim == 2 else 'brick'} "
            f"along the axes, of the size {cell} m; the first is element {first} at ({place}) m; "
            f"take a rectangle or a box, or {other}"
        )
    return np.take_along_axis(mesh.elements, order, axis=1), size


def _shares(cells: Ints, one: Component, n_nodes: int) -> Floats:
    """One over the number of cells that have each product of differences in common, shape (n_cells, corners).

    An edge is known by its two nodes, a face by the two at the far ends of its differences.
    """
    start = one.corners if one.i == one.j else one.corners + 2**one.i
    keys = cells[:, start] * n_nodes + cells[:, one.corners + 2**one.j]
    found = distinct_rows([keys.ravel()])
    return np.asarray(1 / found.count[found.of].reshape(keys.shape))
