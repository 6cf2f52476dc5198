"""What is asked of every result, whatever its format."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from truespring.arrays import Ints
from truespring.errors import ReferenceFileError
from truespring.mesh.files.contents import places
from truespring.opening import open_file
from truespring.reference.record import Level, Record


def refuse_unreadable(file: Path) -> None:
    """Raise ReferenceFileError for what is not there, is no regular file or is empty."""
    with open_file(file, ReferenceFileError) as stream:
        is_empty = not stream.read(1)
    if is_empty:
        raise ReferenceFileError(f"{file} is empty: did the other program stop with an error?")


def rows_of(numbers: Ints, wanted: Ints, what: str, file: Path) -> Ints:
    """Return where `wanted` nodes stand among `numbers`; raise ReferenceFileError where one does not."""
    if wanted.shape == numbers.shape and np.array_equal(wanted, numbers):
        return np.arange(len(numbers))
    rows = places(numbers, wanted)
    lost = rows < 0
    if lost.any():
        raise ReferenceFileError(f"{file}: {what} names node {wanted[lost][0]}, which is not among the nodes")
    return rows


def refuse_repeated(numbers: Ints, what: str, file: Path) -> None:
    """Raise ReferenceFileError where a node is there twice."""
    distinct, counts = np.unique(numbers, return_counts=True)
    if (counts > 1).any():
        raise ReferenceFileError(f"{file}: {what}: node {distinct[counts > 1][0]} is there twice")


def checked(record: Record) -> Record:
    """Return the record, with a note on levels where some points did not move; raise where one has no displacement."""
    if not record.levels:
        raise ReferenceFileError(f"{record.file} holds no displacement: ask the other program to write it")
    lost = ~np.isfinite(record.points).all(axis=1)
    if lost.any():
        name = record.names[lost.argmax()] if record.names else int(lost.argmax())
        raise ReferenceFileError(f"{record.file}: {lost.sum()} points have no finite coordinates, the first is {name}")
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
    """Return the levels that are no mode shapes, and what to say of it; the modes where there is nothing else."""
    modes = sum(is_mode)
    if not modes:
        return tuple(levels), ()
    if modes == len(levels):
        return tuple(levels), ("all levels are mode shapes, whose size is arbitrary: they are no displacement",)
    kept = tuple(level for level, mode in zip(levels, is_mode, strict=True) if not mode)
    return kept, (f"{modes} mode shapes of a frequency or buckling step were left out",)
