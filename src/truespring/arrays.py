"""The array types that the whole package shares."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
#: Of places in memory, where half the size counts.
ShortInts = NDArray[np.int32]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def frozen_floats(values: object, shape: tuple[int | None, ...], name: str) -> Floats:
    """Return a read-only float64 copy of `values`; None in `shape` stands for any length.

    Raises ValueError with `name`, the shape found and the shape wanted.
    """
    array = np.array(values, dtype=np.float64)
    _check_shape(array.shape, shape, name)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} holds values that are not finite")
    array.setflags(write=False)
    return array


def frozen_ints(values: object, shape: tuple[int | None, ...], name: str) -> Ints:
    """Return a read-only int64 copy of `values`; None in `shape` stands for any length."""
    given = np.asarray(values)
    if given.size and not np.issubdtype(given.dtype, np.integer):
        raise ValueError(f"{name} must hold integers, not {given.dtype}")
    array = np.array(given, dtype=np.int64)
    _check_shape(array.shape, shape, name)
    array.setflags(write=False)
    return array


def in_space(vectors: Floats) -> Floats:
    """Return vectors of 1 to 3 components with zeros for the missing ones, shape (n, 3)."""
    padded = np.zeros((len(vectors), 3))
    padded[:, : vectors.shape[1]] = vectors
    return padded


def _check_shape(found: tuple[int, ...], wanted: tuple[int | None, ...], name: str) -> None:
    if len(found) != len(wanted) or any(w not in (None, f) for f, w in zip(found, wanted, strict=True)):
        shape = ", ".join("n" if w is None else str(w) for w in wanted)
        raise ValueError(f"{name} has shape {found}, wanted ({shape})")
