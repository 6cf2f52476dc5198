"""Checks of result files and records of any format."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from truespring.arrays import Ints
from truespring.errors import ReferenceFileError
from truespring.mesh.files.contents import places
from truespring.opening import open_file
from truespring.reference.record import Level, Record

# Larger coordinates count as damaged; the square is still finite.
_FAR = 1e30


def refuse_unreadable(file: Path) -> None:
    """Raise ReferenceFileError if a file does not exist, is not a regular file, or is empty."""
    with open_file(file, ReferenceFileError) as stream:
        is_empty = not stream.read(1)
    if is_empty:
        raise ReferenceFileError(f"{file} is empty: did the other program stop with an error?")


def rows_of(numbers: Ints, nodes: Ints, what: str, file: Path) -> Ints:
    """Return the index in `numbers` of each of `nodes`, of their shape; raise ReferenceFileError if one is missing."""
    if nodes.shape == numbers.shape and np.array_equal(nodes, numbers):
        return np.arange(len(numbers))
    rows = places(numbers, nodes)
    lost = rows < 0
    if lost.any():
        raise ReferenceFileError(f"{file}: {what} refers to node {nodes[lost][0]}, which does not exist")
    return rows


def refuse_repeated(numbers: Ints, what: str, file: Path) -> None:
    """Raise ReferenceFileError if a node number is repeated."""
    distinct, counts = np.unique(numbers, return_counts=True)
    if (counts > 1).any():
        raise ReferenceFileError(f"{file}: {what}: node {distinct[counts > 1][0]} is repeated")


def checked(record: Record) -> Record:
    """Return the record, with a note on points without displacement; raise ReferenceFileError if a level has none."""
    if not record.levels:
        raise ReferenceFileError(f"{record.file} has no displacement: request it as output of the other program")
    lost = ~np.asarray((np.abs(record.points) < _FAR).all(axis=1))
    if lost.any():
        name = record.names[lost.argmax()] if record.names else int(lost.argmax())
        raise ReferenceFileError(f"{record.file}: {lost.sum()} points have no finite coordinates; the first is {name}")
    partial = []
    for number, level in enumerate(record.levels, 1):
        is_lost = np.asarray(~np.isfinite(level.displacement).all(axis=1))
        if is_lost.all():
            raise ReferenceFileError(
                f"{record.file}: level {number} of {len(record.levels)} (time {level.time:g}) has no finite "
                "displacement: did the other program converge?"
            )
        if is_lost.any():
            partial.append(f"{is_lost.sum()} of {len(is_lost)} points have no displacement at time {level.time:g}")
    if not partial:
        return record
    more = [f"... and at {len(partial) - 1} more levels"] if len(partial) > 1 else []
    return Record(
        record.file,
        record.kind,
        record.points,
        record.cells,
        record.levels,
        record.names,
        (*record.notes, partial[0], *more),
    )


def without_modes(levels: Sequence[Level], is_mode: Sequence[bool]) -> tuple[tuple[Level, ...], tuple[str, ...]]:
    """Return the levels that are not mode shapes, with notes; if all are mode shapes, return them."""
    modes = sum(is_mode)
    if not modes:
        return tuple(levels), ()
    if modes == len(levels):
        return tuple(levels), ("all levels are mode shapes, whose scale is arbitrary, not displacements",)
    kept = tuple(level for level, mode in zip(levels, is_mode, strict=True) if not mode)
    return kept, (f"{modes} mode shapes of a frequency or buckling step were left out",)
