"""The one body of the table: a cantilever four times as long as deep, under a dead load across its end."""

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

#: End loads over E times the area of the section: in the linear range, at a deflection of about half the length, and
#: the largest that paths are followed to.
SMALL, LARGE, LARGEST = 1e-4, 0.0107, 0.06

#: The Poisson's ratio that springs have by themselves, by dimension.
POISSON = {2: 1 / 3, 3: 1 / 4}

# Levels of the path to the largest load.
_LEVELS = 28


@dataclass(frozen=True)
class Size:
    """How finely the body is divided: so many elements deep (and wide), four times as many long."""

    dim: int
    depth: int

    @property
    def counts(self) -> tuple[int, ...]:
        """Elements along the axes."""
        return (4 * self.depth, *[self.depth] * (self.dim - 1))

    @property
    def words(self) -> str:
        """The elements along the axes as they are written."""
        return " x ".join(map(str, self.counts))


def grid(extents: tuple[float, ...], counts: tuple[int, ...], element: str) -> Mesh:
    """Return a rectangle or a box; triangles with alternating diagonals, which favour no direction."""
    if len(extents) == 3:
        return box(extents, counts, element)
    return rectangle(extents, counts, element, "alternating" if element == "triangle" else "right")


def cantilever(size: Size, element: str, load: float, poisson: float | None = None) -> Problem:
    """Return the body under an end load of `load` E A across its end, by elements of a kind."""
    dim, extents = size.dim, (LENGTH, *[DEPTH] * (size.dim - 1))
    return Problem(
        grid(extents, size.counts, element),
        Material(YOUNG, POISSON[dim] if poisson is None else poisson),
        PlaneStress(1.0) if dim == 2 else None,
        [Fixed("left")],
        [Force("right", (0.0, load * YOUNG, 0.0)[:dim])],
    )


def end_displacement(path: Solution, state: State) -> Floats:
    """Return the displacement of the end that does work with the load [m], shape (dim,): a mean with its weights."""
    potential = path.potential
    refined = isinstance(potential, Refined)
    loading = potential.loading if isinstance(potential, Refined) else path.problem.loading
    rest = path.whole.points if refined else path.problem.mesh.nodes
    moved = (state.all_positions if refined else state.positions) - rest
    weights = np.abs(loading.external_force).sum(axis=1)
    return np.asarray(weights @ moved / weights.sum())


@cache
def reference(dim: int, large: bool) -> Solution:
    """Return the path of finite elements of second order that all are measured against.

    Linear at the small load; neo-Hookean up to the largest load. Of as many nodes as 256 x 64 elements in the plane,
    32 x 8 x 8 in space.
    """
    size = Size(dim, 32 if dim == 2 else 4)
    element = "triangle" if dim == 2 else "tetrahedron"
    law, load = ("neo-hookean", LARGEST) if large else ("linear", SMALL)
    levels = _LEVELS if large else 1
    return solve(cantilever(size, element, load), Fem(law, "quadratic"), Newton(load_steps=levels))


def followed() -> Newton:
    """Return the solver that follows a path through the levels of the reference."""
    return Newton(load_steps=_LEVELS, max_cutbacks=3)
