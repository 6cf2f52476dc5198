"""Convert fields of text files to numbers; errors name the line."""

from collections.abc import Callable, Sequence

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError

Rows = Sequence[Sequence[bytes]]


def integers(rows: Rows, lines: Sequence[int], what: str) -> Ints:
    """Return all fields of all rows as integers, shape (n,); raise MeshError with the line of one that is not."""
    try:
        return np.array(_numbers(rows, lines, what, int, "an integer"), dtype=np.int64)
    except OverflowError:
        raise MeshError(f"line {lines[0]} or later: {what}: a number has too many digits for a mesh") from None


def reals(rows: Rows, lines: Sequence[int], what: str) -> Floats:
    """Return all fields of all rows as numbers, shape (n,); raise MeshError with the line of one that is not."""
    return np.array(_numbers(rows, lines, what, _real, "a number"), dtype=np.float64)


def refuse_ragged(rows: Rows, lines: Sequence[int], columns: int, what: str) -> None:
    """Raise MeshError, with the line, if a row does not have `columns` fields."""
    for row, line in zip(rows, lines, strict=True):
        if len(row) != columns:
            raise MeshError(f"line {line}: {what} needs {columns} numbers, found {len(row)}")


def word(field: bytes) -> str:
    """Return a field as text for a message, shortened."""
    text = field.decode("utf-8", errors="replace").strip()
    return text if len(text) <= 40 else f"{text[:40]}..."


def _real(field: bytes) -> float:
    try:
        return float(field)
    except ValueError:
        return float(field.upper().replace(b"D", b"E"))  # Fortran writes 1.0D-3


def _numbers(
    rows: Rows, lines: Sequence[int], what: str, convert: Callable[[bytes], float], expected: str
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
        raise MeshError(f"line {line}: {what}: '{word(field)}' is not {expected}") from None


def _converts(field: bytes, convert: Callable[[bytes], float]) -> bool:
    try:
        convert(field)
    except ValueError:
        return False
    return True
