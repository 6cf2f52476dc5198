"""Read and write the stiffness of each spring of a mesh as CSV files."""

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.columns import Columns
from truespring.errors import MeshError
from truespring.models import PrescribedSprings, shared_springs
from truespring.models.pair_laws import STRAIGHT
from truespring.problem import Problem
from truespring.units import Dimension

_COLUMNS: dict[str, Dimension | None] = {"a": None, "b": None, "stiffness": "stiffness"}
_VOLUME_COLUMNS: dict[str, Dimension | None] = {"element": None, "kappa": "stress"}


def read_spring_files(
    problem: Problem,
    file: str | Path,
    volume: str | Path | None = None,
    allow_negative: bool = False,
    law: str = STRAIGHT,
) -> PrescribedSprings:
    """Read the stiffness of each spring of a mesh from CSV files with a header line.

    Args:
        problem: the problem; its springs are the edges and diagonals of the elements.
        file: columns a and b, the two nodes of each spring by number from 0, and stiffness [N/m].
        volume: columns element, the number of each element from 0, and kappa, the modulus of its volume term [Pa].
        allow_negative: whether springs of negative stiffness are accepted.
        law: force law of the springs, a key of PAIR_LAWS.

    Raises MeshError with file and line if a file is damaged, if a spring or element is missing, duplicate or not in the
    mesh, or if a stiffness is negative.
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
    return PrescribedSprings(np.asarray(springs, dtype=np.int64), stiffness, kappa, f"springs ({place.name})", law)


def _read_kappa(problem: Problem, file: Path) -> Floats:
    n_elements = len(problem.mesh.elements)
    data = Columns(file, _VOLUME_COLUMNS, ("element", "kappa"))
    numbers = _whole(data, file, "element", n_elements)
    return _by_number(file, data, numbers, data.numbers("kappa"), [str(n) for n in range(n_elements)], "element")


def _whole(data: Columns, file: Path, column: str, count: int) -> Ints:
    """Return a column of integers from 0 to count - 1, shape (n_rows,)."""
    values = data.numbers(column)
    wrong = np.flatnonzero((values != np.round(values)) | (values < 0) | (values >= count))
    if wrong.size:
        raise MeshError(
            f"{file}:{data.line(int(wrong[0]))}: {column} = {values[wrong[0]]:g}: must be an integer from 0 to "
            f"{count - 1}"
        )
    return values.astype(np.int64)


def _by_number(file: Path, data: Columns, numbers: Ints, values: Floats, names: list[str], what: str) -> Floats:
    """Return values in the order of the mesh, shape (len(names),); raise MeshError if one is duplicate or missing."""
    count = np.bincount(numbers, minlength=len(names))
    twice = np.flatnonzero(count[numbers] > 1)
    if twice.size:
        row = int(twice[-1])
        raise MeshError(f"{file}:{data.line(row)}: {what} {names[numbers[row]]} is listed twice")
    missing = np.flatnonzero(count == 0)
    if missing.size:
        raise MeshError(
            f"{file}: {missing.size} of {len(names)} {what}s of the mesh are missing, the first is {what} "
            f"{names[missing[0]]}"
        )
    ordered = np.empty(len(names))
    ordered[numbers] = values
    return ordered


def write_spring_files(springs: PrescribedSprings, file: Path, volume: Path) -> tuple[Path, ...]:
    """Write springs for `read_spring_files`, and the volume term, if any, to `volume`; return the files written."""
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
