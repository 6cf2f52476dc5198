"""Springs of a stiffness that stands in CSV files, spring by spring: read, and written."""

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.columns import Columns
from truespring.errors import MeshError
from truespring.models import PrescribedSprings, shared_springs
from truespring.problem import Problem
from truespring.units import Dimension

_COLUMNS: dict[str, Dimension | None] = {"a": None, "b": None, "stiffness": "stiffness"}
_VOLUME_COLUMNS: dict[str, Dimension | None] = {"element": None, "kappa": "stress"}


def read_given(
    problem: Problem, file: str | Path, volume: str | Path | None = None, allow_negative: bool = False
) -> PrescribedSprings:
    """Read the stiffness of each spring of a problem's mesh from a CSV file with a line of column names.

    Args:
        problem: whose mesh tells the springs: the edges and diagonals of its elements.
        file: columns a and b, the numbers of the nodes that a spring joins, from 0, and stiffness [N/m].
        volume: columns element, its number from 0, and kappa, the modulus of its volume term [Pa].
        allow_negative: accept springs of negative stiffness.

    Raises MeshError, with file and line, where a file is damaged, names a spring or an element that the mesh does not
    have or names one twice, leaves one out, or a stiffness is negative.
    """
    place = Path(file)
    springs, _ = shared_springs(problem.mesh)
    n_nodes = problem.mesh.n_nodes
    data = Columns(place, _COLUMNS, ("a", "b", "stiffness"))
    ends = np.sort(np.stack([_whole(data, place, "a", n_nodes), _whole(data, place, "b", n_nodes)], axis=1), axis=1)
    keys, known = ends[:, 0] * n_nodes + ends[:, 1], springs[:, 0].astype(np.int64) * n_nodes + springs[:, 1]
    order = np.argsort(known)
    found = order[np.minimum(np.searchsorted(known, keys, sorter=order), len(known) - 1)]
    other = np.flatnonzero(known[found] != keys)
    if other.size:
        a, b = ends[other[0]]
        raise MeshError(
            f"{place}:{data.line(int(other[0]))}: no element of the mesh joins nodes {a} and {b} by an edge or a "
            "diagonal: the file belongs to another mesh"
        )
    values = data.numbers("stiffness")
    negative = np.flatnonzero(values < 0)
    if negative.size and not allow_negative:
        raise MeshError(
            f"{place}:{data.line(int(negative[0]))}: stiffness = {values[negative[0]]:g} N/m is negative: "
            "allow_negative = true accepts that"
        )
    stiffness = _by_number(place, data, found, values, [f"{a}-{b}" for a, b in springs.tolist()], "spring")
    kappa = np.zeros(0) if volume is None else _read_kappa(problem, Path(volume))
    return PrescribedSprings(np.asarray(springs, dtype=np.int64), stiffness, kappa, f"springs ({place.name})")


def _read_kappa(problem: Problem, file: Path) -> Floats:
    n_elements = len(problem.mesh.elements)
    data = Columns(file, _VOLUME_COLUMNS, ("element", "kappa"))
    numbers = _whole(data, file, "element", n_elements)
    return _by_number(file, data, numbers, data.numbers("kappa"), [str(n) for n in range(n_elements)], "element")


def _whole(data: Columns, file: Path, column: str, count: int) -> Ints:
    """A column of numbers 0 ... count - 1."""
    values = data.numbers(column)
    wrong = np.flatnonzero((values != np.round(values)) | (values < 0) | (values >= count))
    if wrong.size:
        raise MeshError(
            f"{file}:{data.line(int(wrong[0]))}: {column} = {values[wrong[0]]:g}: the mesh has the numbers 0 to "
            f"{count - 1}"
        )
    return values.astype(np.int64)


def _by_number(file: Path, data: Columns, numbers: Ints, values: Floats, names: list[str], what: str) -> Floats:
    """Values in the mesh's order; raise MeshError where one is there twice or left out."""
    count = np.bincount(numbers, minlength=len(names))
    twice = np.flatnonzero(count[numbers] > 1)
    if twice.size:
        row = int(twice[-1])
        raise MeshError(f"{file}:{data.line(row)}: {what} {names[numbers[row]]} is there twice")
    missing = np.flatnonzero(count == 0)
    if missing.size:
        raise MeshError(
            f"{file}: {missing.size} of {len(names)} {what}s of the mesh are missing, the first is {what} "
            f"{names[missing[0]]}"
        )
    ordered = np.empty(len(names))
    ordered[numbers] = values
    return ordered


def write_given(springs: PrescribedSprings, file: Path, volume: Path) -> tuple[Path, ...]:
    """Write springs as `read_given` reads them; the second file only where there is a volume term."""
    rows = [(a, b, repr(k)) for (a, b), k in zip(springs.springs.tolist(), springs.stiffness.tolist(), strict=True)]
    _write(file, ("a", "b", "stiffness [N/m]"), rows)
    if not springs.kappa.size:
        volume.unlink(missing_ok=True)
        return (file,)
    _write(volume, ("element", "kappa [Pa]"), [(n, repr(kappa)) for n, kappa in enumerate(springs.kappa.tolist())])
    return file, volume


def _write(file: Path, names: tuple[str, ...], rows: Iterable[tuple[object, ...]]) -> None:
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(rows)
