"""The measures of an entry: speed, material properties, accuracy, large deflection."""

import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from truespring.arrays import Floats
from truespring.comparison import compare
from truespring.equilibrium import Status, solve
from truespring.errors import ModelError
from truespring.material import Material, PlaneStress
from truespring.problem import Problem
from truespring.solvers import Newton
from truespring.table1.bodies import (
    LARGE,
    LARGEST,
    LENGTH,
    POISSON,
    SMALL,
    Size,
    cantilever,
    end_displacement,
    followed,
    grid,
    reference,
)
from truespring.table1.entries import Entry

#: Poisson's ratios at which effective moduli are measured.
RATIOS = (0.0, 0.1, 0.2, 0.25, 0.3, 1 / 3, 0.4, 0.45)

#: Numbers of elements through the depth in the search for an error of 1 %.
DEPTHS = (2, 3, 4, 6, 8, 12, 16, 24, 32)

_ONE_PERCENT, _FIVE_PERCENT = 0.01, 0.05

_LOAD_STEPS = (1, 4, 16)

# Number of timed solves; shortest time for which force evaluations are repeated [s].
_TIMES, _AT_LEAST = 3, 0.2


def speed(entry: Entry, size: Size) -> dict[str, float | int | None]:
    """Return the times of a solve at a deflection of about half the length, and of a force evaluation there [ms].

    `solve_ms` is the best of three, from the mesh to the equilibrium, in the fewest load steps (1, 4 or 16) that give
    a stable equilibrium; `setup_ms` is the part of it that builds the potential. None if no steps do.
    """
    problem = cantilever(size, entry.element(size.dim), LARGE)
    model = entry.model(size.dim, POISSON[size.dim])
    setup = min(_timed(lambda: model.potential(problem)) for _ in range(_TIMES))
    for load_steps in _LOAD_STEPS:
        path = solve(problem, model, Newton(load_steps=load_steps))
        if path.status is Status.CONVERGED and path.potential is not None:
            again = [solve(problem, model, Newton(load_steps=load_steps)) for _ in range(_TIMES - 1)]
            force = partial(path.potential.gradient, path.states[-1].all_positions)
            return {
                "solve_ms": 1e3 * min(one.seconds for one in (path, *again)),
                "load_steps": load_steps,
                "newton_iterations": path.newton_iterations,
                "setup_ms": 1e3 * setup,
                "force_ms": 1e3 * _repeated(force),
            }
    return {"solve_ms": None, "load_steps": None, "newton_iterations": None, "setup_ms": 1e3 * setup, "force_ms": None}


def _timed(work: Callable[[], object]) -> float:
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def _repeated(work: Callable[[], object]) -> float:
    """Return the shortest time of repeated runs [s]."""
    times: list[float] = []
    ends = time.perf_counter() + _AT_LEAST
    while time.perf_counter() < ends or len(times) < _TIMES:
        times.append(_timed(work))
    return min(times)


def material(entry: Entry, dim: int) -> dict[str, object]:
    """Return the error of the effective moduli of a block of eight (in 3D four) elements along each axis [-].

    This is the relative Frobenius norm of the difference of the elasticity matrices, in Mandel's notation, at each
    Poisson's ratio; the matrix is computed from the energy of uniform strains. None if the model is not available.
    """
    errors: dict[float, float | None] = {}
    for ratio in RATIOS:
        try:
            errors[ratio] = _moduli_error(entry, dim, ratio)
        except ModelError:  # such as a ratio that a volume term does not support
            errors[ratio] = None
    return {"moduli_errors": [{"poisson": ratio, "error": error} for ratio, error in errors.items()]}


def _moduli_error(entry: Entry, dim: int, ratio: float) -> float:
    problem = _block(entry, dim, ratio)
    potential = entry.model(dim, ratio).potential(problem)
    nodes = potential.nodes
    fields = np.stack([(nodes @ strain).ravel() for strain in _strains(dim)], axis=1)
    found = fields.T @ (potential.hessian(nodes.copy()) @ fields) / problem.mesh.measures.sum()
    lame = Material(1.0, ratio)
    section = PlaneStress(1.0) if dim == 2 else problem.section
    assert section is not None
    lam, mu = section.lame_within(lame)
    n_normal = dim
    exact = 2 * mu * np.eye(len(found))
    exact[:n_normal, :n_normal] += lam
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


def _block(entry: Entry, dim: int, ratio: float) -> Problem:
    """Return a block of the same length as the body, so that the same part can be boundary elements."""
    whole = cantilever(Size(dim, 4 if dim == 2 else 2), entry.element(dim), SMALL, ratio)
    counts = (8, 8) if dim == 2 else (4, 4, 4)
    extents = (4.0, 4.0, 4.0)[:dim]
    return Problem(
        grid(extents, counts, entry.element(dim)), whole.material, whole.section, whole.supports, whole.loads
    )


def _strains(dim: int) -> Iterator[Floats]:
    """Yield displacement gradients of unit strains in Mandel's order, normal, then shear, shape (dim, dim)."""
    for axis in range(dim):
        strain = np.zeros((dim, dim))
        strain[axis, axis] = 1.0
        yield strain
    for one in range(dim):
        for other in range(one + 1, dim):
            strain = np.zeros((dim, dim))
            strain[one, other] = strain[other, one] = np.sqrt(0.5)
            yield strain


def accuracy(entry: Entry, coarse: Size, fine: Size) -> dict[str, float | None]:
    """Return the relative root-mean-square nodal error at a small load, on a coarse and on a fine mesh [-]."""
    return {"small_error": _small(entry, coarse)[0], "small_limit": _small(entry, fine)[0]}


def _small(entry: Entry, size: Size) -> tuple[float | None, float, float]:
    """Return the root-mean-square error at the small load [-], that of the end [-], and the time of the solve [ms]."""
    problem = cantilever(size, entry.element(size.dim), SMALL)
    path = solve(problem, entry.model(size.dim, POISSON[size.dim]), Newton(load_steps=1))
    known = reference(size.dim, large=False)
    if path.status is not Status.CONVERGED:
        return None, np.inf, np.inf
    found, given = (end_displacement(one, one.states[-1]) for one in (path, known))
    error = float(np.linalg.norm(found - given) / np.linalg.norm(given))
    return compare(path, known).rms_error, error, 1e3 * path.seconds


def to_one_percent(entry: Entry, dim: int = 2) -> dict[str, float | int | None]:
    """Return the coarsest mesh from which on the error of the end is below 1 % at a small load, and its time [ms]."""
    tried = [(depth, *_small(entry, Size(dim, depth))[1:]) for depth in DEPTHS]
    enough = None
    for depth, error, milliseconds in reversed(tried):
        if error >= _ONE_PERCENT:
            break
        enough = depth, milliseconds
    return {
        "depth_to_1_percent": None if enough is None else enough[0],
        "ms_to_1_percent": None if enough is None else enough[1],
    }


def reach(entry: Entry, size: Size) -> dict[str, float | str]:
    """Return the largest deflection over length up to which the end is within 5 % of converged neo-Hookean FEM.

    All states from a small load on are stable; the deflection is interpolated where the error reaches 5 %. `ended_by`
    states the reason why it ends there.
    """
    small = solve(
        cantilever(size, entry.element(size.dim), SMALL), entry.model(size.dim, POISSON[size.dim]), followed()
    )
    path = solve(
        cantilever(size, entry.element(size.dim), LARGEST), entry.model(size.dim, POISSON[size.dim]), followed()
    )
    at_small, at_large = reference(size.dim, large=False), reference(size.dim, large=True)
    pairs = [(small.at(1.0), at_small, at_small.states[-1], small)]
    pairs += [(path.at(state.load_factor), at_large, state, path) for state in at_large.states[1:]]
    last, error = 0.0, 0.0
    for count, (mine, exact, state, found) in enumerate(pairs):
        if mine is None or mine.negative_eigenvalues or mine.area_ratio <= 0:
            ended = "no stable state" if mine is None or mine.negative_eigenvalues else "an inverted element"
            break
        end = end_displacement(exact, state)
        before, error = error, float(np.linalg.norm(end_displacement(found, mine) - end) / np.linalg.norm(end))
        here = float(end[1]) / LENGTH
        if error >= _FIVE_PERCENT:
            if count:
                last += (here - last) * (_FIVE_PERCENT - before) / (error - before)
            ended = "the error"
            break
        last = here
    else:
        ended = "the largest load"
    return {"deflection_within_5_percent": last, "ended_by": ended}
