"""The body of the table: a cantilever four times as long as deep, with a transverse dead load at its end."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from truespring.arrays import Floats
from truespring.conditions import Refined
from truespring.equilibrium import Solution, State, solve
from truespring.loading import Fixed, Force
from truespring.material import Material, PlaneStress
from truespring.mesh import Mesh, box, rectangle
from truespring.models import Fem
from truespring.problem import Problem
from truespring.solvers import Newton

LENGTH, DEPTH, YOUNG = 4.0, 1.0, 1.0

#: End loads over E A, A the area of the section: in the linear range, for a deflection of about half the length, and
#: the largest load.
SMALL, LARGE, LARGEST = 1e-4, 0.0107, 0.06

#: Poisson's ratio of an isotropic lattice of plain springs, by dimension.
POISSON = {2: 1 / 3, 3: 1 / 4}

# Load levels up to the largest load.
_LEVELS = 28


@dataclass(frozen=True)
class Size:
    """Mesh size: number of elements through the depth (and width); the length has four times as many."""

    dim: int
    depth: int

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of elements along each axis."""
        return (4 * self.depth, *[self.depth] * (self.dim - 1))

    @property
    def words(self) -> str:
        """Number of elements along each axis, as text."""
        return " x ".join(map(str, self.counts))


def grid(extents: tuple[float, ...], counts: tuple[int, ...], element: str) -> Mesh:
    """Return the mesh of a rectangle or box; triangles have alternating diagonals, to avoid a preferred direction."""
    if len(extents) == 3:
        return box(extents, counts, element)
    return rectangle(extents, counts, element, "alternating" if element == "triangle" else "right")


def cantilever(size: Size, element: str, load: float, poisson: float | None = None) -> Problem:
    """Return the body with an end load of `load` times E A, A the area of the section, on elements of a kind."""
    dim, extents = size.dim, (LENGTH, *[DEPTH] * (size.dim - 1))
    return Problem(
        grid(extents, size.counts, element),
        Material(YOUNG, POISSON[dim] if poisson is None else poisson),
        PlaneStress(1.0) if dim == 2 else None,
        [Fixed("left")],
        [Force("right", (0.0, load * YOUNG, 0.0)[:dim])],
    )


def end_displacement(path: Solution, state: State) -> Floats:
    """Return the mean displacement of the end, weighted as the load [m], shape (dim,)."""
    potential = path.potential
    refined = isinstance(potential, Refined)
    loading = potential.loading if isinstance(potential, Refined) else path.problem.loading
    rest = path.whole.points if refined else path.problem.mesh.nodes
    moved = (state.all_positions if refined else state.positions) - rest
    weights = np.abs(loading.external_force).sum(axis=1)
    return np.asarray(weights @ moved / weights.sum())


@cache
def reference(dim: int, large: bool) -> Solution:
    """Return the solution of the reference, finite elements of second order.

    The law is linear for the small load, neo-Hookean up to the largest load. The mesh has as many nodes as 256 x 64
    elements in 2D, 32 x 8 x 8 in 3D.
    """
    size = Size(dim, 32 if dim == 2 else 4)
    element = "triangle" if dim == 2 else "tetrahedron"
    law, load = ("neo-hookean", LARGEST) if large else ("linear", SMALL)
    levels = _LEVELS if large else 1
    return solve(cantilever(size, element, load), Fem(law, "quadratic"), Newton(load_steps=levels))


def followed() -> Newton:
    """Return the solver with the load levels of the reference."""
    return Newton(load_steps=_LEVELS, max_cutbacks=3)
