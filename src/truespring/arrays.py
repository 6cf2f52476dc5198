"""Array types, and read-only copies of arrays."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
#: Indices of large arrays, to save memory.
ShortInts = NDArray[np.int32]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def frozen_floats(values: object, shape: tuple[int | None, ...], name: str) -> Floats:
    """Return a read-only float64 copy of `values`, of their shape and unit; None in `shape` stands for any length.

    Raises ValueError, with `name`, for another shape or values that are not finite.
    """
    array = np.array(values, dtype=np.float64)
    _check_shape(array.shape, shape, name)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has values that are not finite")
    array.setflags(write=False)
    return array


def frozen_ints(values: object, shape: tuple[int | None, ...], name: str) -> Ints:
    """Return a read-only int64 copy of `values`; None in `shape` stands for any length.

    Raises ValueError, with `name`, for another shape or values that are not integers.
    """
    plain = np.asarray(values)
    if plain.size and not np.issubdtype(plain.dtype, np.integer):
        raise ValueError(f"{name} must be integers, not {plain.dtype}")
    array = np.array(plain, dtype=np.int64)
    _check_shape(array.shape, shape, name)
    array.setflags(write=False)
    return array


def along_axes(vectors: Floats, axes: Sequence[str]) -> Floats:
    """Return vectors, shape (n, 3), along other axes: component i is that along axes[i], such as "x" or "-z"."""
    return np.stack([(-1.0 if axis[0] == "-" else 1.0) * vectors[:, "xyz".index(axis[-1])] for axis in axes], axis=1)


def in_space(vectors: Floats) -> Floats:
    """Return vectors of 1 to 3 components with zeros for the missing ones, shape (n, 3), in the same unit."""
    padded = np.zeros((len(vectors), 3))
    padded[:, : vectors.shape[1]] = vectors
    return padded


def _check_shape(found: tuple[int, ...], allowed: tuple[int | None, ...], name: str) -> None:
    if len(found) != len(allowed) or any(a not in (None, f) for f, a in zip(found, allowed, strict=True)):
        shape = ", ".join("n" if a is None else str(a) for a in allowed)
        raise ValueError(f"{name} has shape {found}, expected ({shape})")
