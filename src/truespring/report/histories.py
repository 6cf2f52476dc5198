"""motion.csv, energies.csv and tools.csv: what a motion has beyond the curves, and what tools do."""

import csv
from collections.abc import Iterable
from pathlib import Path

from truespring.arrays import Floats
from truespring.equilibrium import Solution, State
from truespring.mesh.selections import AXES
from truespring.report.curves import heads
from truespring.report.result import Result

_ENERGIES = ("kinetic", "elastic", "loads", "contact", "damped", "numerical", "total")


def write_histories(result: Result, folder: Path) -> None:
    """Write the tables that a problem has: motion.csv and energies.csv of a motion, tools.csv with tools or grasps.

    * motion.csv: model, time [s], ux, uy[, uz] [m], vx, vy[, vz] [m/s] at the probe, fx, fy[, fz], the total applied
      force [N].
    * energies.csv: model, time [s], and energies [J], see `Energies`.
    * tools.csv: model, tool, time [s] or at rest `share` of the way, x, y[, z] [m], fx, fy[, fz], the force of the body
      on the tool [N], depth [m].

    The header line states the units, such as "ux [m]".
    """
    problem = result.problem
    axes = AXES[: problem.mesh.dim]
    time = "share" if problem.dynamics is None else "time [s]"
    if problem.dynamics is not None:
        columns = ["model", time, *heads("u", axes, "m"), *heads("v", axes, "m/s"), *heads("f", axes, "N")]
        _write(folder / "motion.csv", columns, _motion(result))
        _write(folder / "energies.csv", ["model", time, *heads("", _ENERGIES, "J")], _energies(result))
    if problem.tools or problem.grasps:
        columns = ["model", "tool", time, *heads("", axes, "m"), *heads("f", axes, "N"), "depth [m]"]
        _write(folder / "tools.csv", columns, _tools(result))


def _write(file: Path, columns: list[str], rows: Iterable[list[object]]) -> None:
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(columns)
        table.writerows(rows)


def _states(result: Result) -> Iterable[tuple[str, Solution, State]]:
    return ((name, path, state) for name, path in result.solutions.items() for state in path.states)


def _motion(result: Result) -> Iterable[list[object]]:
    for name, path, state in _states(result):
        if state.moving is not None:
            values = (state.displacement, state.moving.velocity)
            at_probe = [value for one in values for value in _written(one[result.probe])]
            yield [name, repr(state.moving.time), *at_probe, *_written(path.applied_force(state))]


def _energies(result: Result) -> Iterable[list[object]]:
    for name, _, state in _states(result):
        if state.moving is not None:
            energies = state.moving.energies
            yield [name, repr(state.moving.time), *(repr(float(getattr(energies, one))) for one in _ENERGIES)]


def _tools(result: Result) -> Iterable[list[object]]:
    names = [one.name for one in result.problem.tools] + [one.name for one in result.problem.grasps]
    for name, _, state in _states(result):
        time = state.load_factor if state.moving is None else state.moving.time
        for tool, touch in zip(names, state.touches, strict=False):  # a state that was read has none
            yield [name, tool, repr(time), *_written(touch.place), *_written(touch.force), repr(float(touch.depth))]


def _written(values: Floats) -> list[str]:
    """Return numbers as text, a negative zero as zero."""
    return [repr(float(value) + 0.0) for value in values]
