"""Numbers out of the lines of text files, with the line where they are wrong."""

from collections.abc import Callable, Sequence

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError

Rows = Sequence[Sequence[bytes]]


def integers(rows: Rows, lines: Sequence[int], what: str) -> Ints:
    """Return all fields of all rows, shape (n,); raise MeshError with the line of one that is no whole number."""
    try:
        return np.array(_numbers(rows, lines, what, int, "a whole number"), dtype=np.int64)
    except OverflowError:
        raise MeshError(f"line {lines[0]} or later: {what}: a number has more digits than any mesh needs") from None


def reals(rows: Rows, lines: Sequence[int], what: str) -> Floats:
    """Return all fields of all rows, shape (n,); raise MeshError with the line of one that is no number."""
    return np.array(_numbers(rows, lines, what, _real, "a number"), dtype=np.float64)


def refuse_ragged(rows: Rows, lines: Sequence[int], columns: int, what: str) -> None:
    """Raise MeshError with the first line that has another number of fields."""
    for row, line in zip(rows, lines, strict=True):
        if len(row) != columns:
            raise MeshError(f"line {line}: {what} takes {columns} numbers, found {len(row)}")


def word(field: bytes) -> str:
    """Return a field as text that fits into a message."""
    text = field.decode("utf-8", errors="replace").strip()
    return text if len(text) <= 40 else f"{text[:40]}..."


def _real(field: bytes) -> float:
    try:
        return float(field)
    except ValueError:
        return float(field.upper().replace(b"D", b"E"))  # as Fortran writes 1.0D-3


def _numbers(
    rows: Rows, lines: Sequence[int], what: str, convert: Callable[[bytes], float], wanted: str
) -> list[float]:
    try:
        return [convert(field) for row in rows for field in row]
    except ValueError:
        line, field = next(
            (line, field)
            for row, line in zip(rows, lines, strict=True)
            for field in row
            if not _converts(field, convert)
        )
        raise MeshError(f"line {line}: {what}: '{word(field)}' is not {wanted}") from None


def _converts(field: bytes, convert: Callable[[bytes], float]) -> bool:
    try:
        convert(field)
    except ValueError:
        return False
    return True
