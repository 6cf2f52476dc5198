"""Write a solution to a file, by suffix."""

from collections.abc import Callable
from pathlib import Path

from truespring.errors import OutputError, nearest
from truespring.report.series import snapshot_of, write_series, write_stl
from truespring.showing.levels import state_of
from truespring.showing.tables import columns_of
from truespring.solution import Solution


def write_solution(solution: Solution, file: Path, level: int) -> Path:
    """Write a solution, see `Solution.write`."""
    suffix = file.suffix.lower()
    if suffix not in _WRITERS:
        raise OutputError(f"{file}: the suffix is {', '.join(_WRITERS)}, not '{suffix}'{nearest(suffix, _WRITERS)}")
    file.parent.mkdir(parents=True, exist_ok=True)
    _WRITERS[suffix](solution, file, level)
    return file


def _series(solution: Solution, file: Path, level: int) -> None:
    write_series(solution, file.parent, file.stem)


def _state(solution: Solution, file: Path, level: int) -> None:
    snapshot_of(solution, state_of(solution, level) if solution.states else None).write(file)


def _stl(solution: Solution, file: Path, level: int) -> None:
    write_stl(solution, file)


def _csv(solution: Solution, file: Path, level: int) -> None:
    import csv

    columns = columns_of(solution, None)
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow([f"{name} [{unit}]" if unit else name for name, (unit, _) in columns.items()])
        table.writerows(zip(*(values for _, values in columns.values()), strict=True))


_WRITERS: dict[str, Callable[[Solution, Path, int], None]] = {
    ".pvd": _series,
    ".vtu": _state,
    ".stl": _stl,
    ".csv": _csv,
}
