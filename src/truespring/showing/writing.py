"""Write a solution to a file, by suffix."""

import csv
from collections.abc import Callable
from pathlib import Path

from truespring.errors import OutputError, nearest
from truespring.mesh.selections import AXES
from truespring.outputs import writing_file
from truespring.report.series import snapshot_of, write_series, write_stl, write_vtkhdf_series
from truespring.showing.levels import state_of
from truespring.solution import Solution, State


def write_solution(solution: Solution, file: Path, level: int) -> Path:
    """Write a solution, see `Solution.write`."""
    suffix = file.suffix.lower()
    if suffix not in _WRITERS:
        raise OutputError(f"{file}: the suffix is {', '.join(_WRITERS)}, not '{suffix}'{nearest(suffix, _WRITERS)}")
    state = state_of(solution, level) if solution.states else None
    with writing_file(file):
        file.parent.mkdir(parents=True, exist_ok=True)
        _WRITERS[suffix](solution, file, state)
    return file


def _write_pvd(solution: Solution, file: Path, state: State | None) -> None:
    write_series(solution, file.parent, file.stem)


def _write_vtkhdf(solution: Solution, file: Path, state: State | None) -> None:
    write_vtkhdf_series(solution, file)


def _write_vtu(solution: Solution, file: Path, state: State | None) -> None:
    snapshot_of(solution, state).write(file)


def _write_stl(solution: Solution, file: Path, state: State | None) -> None:
    if solution.problem.mesh.element == "line" and state is not None:
        raise OutputError(f"{file}: {solution.label} has lines only, STL has triangles: write .vtu or .csv")
    write_stl(solution, file, state)


def _write_csv(solution: Solution, file: Path, state: State | None) -> None:
    """Write a row for each state and node: load factor, number of the node, undeformed position and displacement."""
    if state is None:
        raise OutputError(f"{file}: {solution.label} is a surface without displacements: write .stl or .vtu")
    mesh = solution.problem.mesh
    axes = AXES[: mesh.dim]
    heads = [*(f"{axis} [m]" for axis in axes), *(f"u{axis} [m]" for axis in axes)]
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(["load_factor", "marker", *heads])
        for one in solution.states:
            places, moved = mesh.nodes.tolist(), (one.displacement + 0.0).tolist()
            table.writerows(
                [one.load_factor, node, *place, *move]
                for node, (place, move) in enumerate(zip(places, moved, strict=True))
            )


_WRITERS: dict[str, Callable[[Solution, Path, State | None], None]] = {
    ".pvd": _write_pvd,
    ".vtkhdf": _write_vtkhdf,
    ".vtu": _write_vtu,
    ".stl": _write_stl,
    ".csv": _write_csv,
}
