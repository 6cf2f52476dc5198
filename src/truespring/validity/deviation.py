"""Errors of springs against the reference at every size of the load, interpolated between levels."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from truespring.arrays import Floats
from truespring.comparison import compare
from truespring.support_errors import Decisive, SupportError, largest
from truespring.validity.reference import Reference
from truespring.validity.solving import Solved, conjugate_force

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

# Levels closer than this share of the largest are equal.
_SAME = 1e-9


@dataclass(frozen=True, eq=False, slots=True)
class Deviation:
    """Relative errors of one springs model on one mesh under one load type.

    Attributes:
        sizes: sizes of the load at the solved levels, the small one first, shape (n,).
        rms_errors, probe_errors: as in a Comparison, shape (n,).
        stiffness: stiffness of the springs over that of the reference, minus 1, by the displacement along the same load
            or the force of the same motion, shape (n,).
        force_errors: largest error of forces and torques of moved supports, as in a Comparison, shape (n,); zero
            without moved supports.
        grid: sizes from 0, shape (m,).
        errors: decisive error at the grid, see `comparison.decisive`; NaN if springs or reference do not reach a size.
        stiffness_on_grid: `stiffness` at the grid.
        reached: the largest size with an error.
        end: why the springs end there; empty if they do not.
        interpolation: estimated error of the interpolation between levels.
        n_nodes: number of nodes of the springs.
        seconds: time of their solution.
    """

    sizes: Floats
    rms_errors: Floats
    probe_errors: Floats
    force_errors: Floats
    stiffness: Floats
    grid: Floats
    errors: Floats
    stiffness_on_grid: Floats
    reached: float
    end: str
    interpolation: float
    n_nodes: int
    seconds: float


def deviation_of(springs: Solved, reference: Reference, grid: Floats, probe: int | None) -> Deviation:
    """Compare springs with the reference, interpolated to their nodes, at each level and between levels.

    Between levels the relative difference of the displacements is interpolated by a cubic spline over the size of the
    load, not the error: where springs cross the reference the error has a minimum that an interpolation of errors
    would miss.
    """
    theirs = reference.solved
    small = compare(springs.small, theirs.small, probe)
    full = compare(springs.path, theirs.path, probe)
    n = min(len(springs.states), len(theirs.states))
    size = reference.sizes[:n]
    rising = np.flatnonzero(np.diff(size) <= _SAME * size[-1]) if n else np.zeros(0, dtype=int)
    n = int(rising[0]) + 1 if rising.size else n
    compared = full.compared
    mine = np.array([state.displacement for state in springs.states[:n]])
    theirs_loaded = [state for state in full.reference.states if state.loaded]
    other = np.array([state.displacement for state in (small.reference.states[-1], *theirs_loaded)[:n]])
    norms = np.sqrt((other[:, compared] ** 2).sum(axis=(1, 2)))
    apart = (mine - other)[:, compared].reshape(n, -1) / norms[:, None]
    moved = np.linalg.norm(other[:, full.probe], axis=1)
    has_probe = bool((moved > 0).all())  # a held probe has no relative error
    at_probe = (mine - other)[:, full.probe] / np.where(moved > 0, moved, 1.0)[:, None]
    forces = _apart((small.support_errors[-1], *full.support_errors)[:n])
    loading = springs.path.problem.loading
    if loading.driven_by_motion:
        levels = springs.levels[:n]
        both = [conjugate_force(one.path, one.states[:n], levels) for one in (springs, theirs)]
        stiffness = both[0] / both[1] - 1
    else:
        load = loading.force(springs.path.problem.mesh.nodes)
        stiffness = (load * other).sum(axis=(1, 2)) / (load * mine).sum(axis=(1, 2)) - 1
    columns = [apart, at_probe, *forces, stiffness[:, None]]
    ends = np.cumsum([one.shape[1] for one in columns])

    def split(rows: Floats) -> tuple[Floats, Floats, list[Floats], Floats]:
        fields, probed, *forced, stiff = np.split(rows, ends[:-1], axis=1)
        unknown = np.full(len(rows), np.nan)
        return (
            np.linalg.norm(fields, axis=1) if compared.any() else unknown,
            np.linalg.norm(probed, axis=1) if has_probe else unknown,
            [np.linalg.norm(one, axis=1) for one in forced],
            stiff[:, 0],
        )

    size = size[:n]
    together = np.hstack(columns)
    between = _spline(size, together)
    reached = float(size[-1])
    there = grid <= reached * (1 + 1e-3)  # loads are scaled to their last size with this accuracy
    rms, _, forced, stiff = split(between(np.minimum(grid[there], reached)))
    on_grid = np.full((2, len(grid)), np.nan)
    on_grid[:, there] = _deciding(rms, forced), stiff
    rms, probed, forced, stiff = split(together)
    return Deviation(
        sizes=size,
        rms_errors=rms,
        probe_errors=probed,
        force_errors=np.max([np.zeros(n), *forced], axis=0),
        stiffness=stiff,
        grid=grid,
        errors=on_grid[0],
        stiffness_on_grid=on_grid[1],
        reached=reached,
        end=springs.end if n == len(springs.states) and n < len(theirs.states) else "",
        interpolation=_left_out(size, apart),
        n_nodes=springs.path.problem.mesh.n_nodes,
        seconds=springs.seconds,
    )


def _deciding(rms: Floats, forced: Sequence[Floats]) -> Floats:
    """Return the decisive error at each size, shape (m,), as `comparison.decisive` at a level."""
    rows = zip(rms, *forced, strict=True)
    return np.array([largest([Decisive(float(error), "") for error in row]).error for row in rows])


def _apart(levels: Sequence[tuple[SupportError, ...]]) -> list[Floats]:
    """Return relative differences of forces and torques of moved supports, (n, dim) each; zero where they vanish."""
    found = []
    for several in zip(*levels, strict=True):
        for parts in ([one.force_difference for one in several], [one.torque_difference for one in several]):
            known = next((part for part in parts if part is not None), None)
            if known is not None:
                found.append(np.array([np.zeros_like(known) if part is None else part for part in parts]))
    return found


def _spline(size: Floats, rows: Floats) -> "CubicSpline":
    from scipy.interpolate import CubicSpline

    if len(size) == 1:
        size, rows = np.array([0.0, size[0]]), np.vstack([rows, rows])
    return CubicSpline(size, rows, axis=0)


def _left_out(size: Floats, fields: Floats) -> float:
    """Return the interpolation error: of every second level from the others, rms, over 8.

    Halving the steps of a cubic spline divides its error by 16, near its ends by less.
    """
    if len(size) < 5:
        return 0.0
    kept = np.unique([*range(0, len(size), 2), len(size) - 1])
    left = np.setdiff1d(np.arange(len(size)), kept)
    return float(np.linalg.norm(_spline(size[kept], fields[kept])(size[left]) - fields[left], axis=1).max()) / 8
