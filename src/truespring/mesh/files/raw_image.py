"""Helpers of all readers of label images: voxel data, header values and the files that a header names."""

from pathlib import Path
from typing import Any

import numpy as np

from truespring.errors import MeshError
from truespring.mesh.files.inflate import inflated, refuse_too_large
from truespring.opening import file_beside, read_file

Values = np.ndarray[Any, Any]

#: The advice for a damaged or unsupported file.
SAVE_ANEW = "copy it again, or save it again from 3D Slicer or ITK-SNAP"


def n_voxels(shape: tuple[int, ...]) -> int:
    """Return the number of voxels of a shape; raise MeshError if an axis is empty."""
    if not shape or min(shape) < 1:
        raise MeshError(f"the header gives axes of {list(shape)} voxels: each needs at least one")
    count = 1
    for one in shape:
        count *= one
    return count


def raw_values(data: bytes | memoryview, dtype: np.dtype[Any], shape: tuple[int, ...]) -> Values:
    """Return an array of `shape` from data whose first axis runs fastest; raise MeshError if the size is wrong."""
    expected = n_voxels(shape) * dtype.itemsize
    if len(data) != expected:
        which = "it is truncated" if len(data) < expected else "it is too long"
        size = " x ".join(map(str, shape))
        raise MeshError(
            f"{which}: {size} voxels of {dtype.itemsize} bytes are {expected} bytes, found {len(data)}; {SAVE_ANEW}"
        )
    return np.frombuffer(data, dtype).reshape(shape, order="F")


def inflated_values(
    data: bytes | memoryview, dtype: np.dtype[Any], shape: tuple[int, ...], method: str, skip: int = 0
) -> Values:
    """Return an array of `shape` from compressed data, after `skip` bytes; raise MeshError if they are damaged."""
    size = skip + n_voxels(shape) * dtype.itemsize
    try:
        return raw_values(memoryview(inflated(data, size, method))[skip:], dtype, shape)
    except ValueError as error:
        raise MeshError(f"its voxels are damaged ({error}); {SAVE_ANEW}") from None


def text_values(data: bytes, dtype: np.dtype[Any], shape: tuple[int, ...]) -> Values:
    """Return an array of `shape` from numbers written as text; raise MeshError if their number is wrong."""
    if not data[-1:].isspace():
        raise MeshError(f"its last line has no line end: is it truncated? {SAVE_ANEW}")
    words = data.split()
    if len(words) != n_voxels(shape):
        raise MeshError(f"{n_voxels(shape)} voxels are stated in the header, found {len(words)}; {SAVE_ANEW}")
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        raise MeshError(f"its voxels are not numbers; {SAVE_ANEW}") from None
    if dtype.kind in "iu":
        limits = np.iinfo(dtype)
        if not ((values == np.rint(values)) & (values >= limits.min) & (values <= limits.max)).all():
            raise MeshError(f"a voxel does not fit the type in the header; {SAVE_ANEW}")
    return values.astype(dtype).reshape(shape, order="F")


def data_beside(folder: Path, name: str) -> bytes:
    """Return the bytes of a file that a header names; raise MeshError if it lies outside of the folder."""
    return read_file(file_beside(folder, name, MeshError), MeshError)


def refuse_large(shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Raise MeshError if an image does not fit into the memory."""
    try:
        refuse_too_large(n_voxels(shape) * dtype.itemsize)
    except ValueError as error:
        raise MeshError(f"{error}: crop or resample the image") from None


def numbers(text: str, count: int | None, what: str) -> list[float]:
    """Return the numbers of a header line; raise MeshError if one is not finite or there are not `count`."""
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        found = []
    if not found or not np.isfinite(found).all() or (count is not None and len(found) != count):
        raise MeshError(f"'{what}' is '{text[:40]}': expected {count or 'some'} numbers; {SAVE_ANEW}")
    return found


def counts(text: str, count: int | None, what: str) -> tuple[int, ...]:
    """Return the integers of a header line; raise MeshError if one is negative or there are not `count`."""
    found = numbers(text, count, what)
    if any(value != int(value) or not 0 <= value < 2**40 for value in found):
        raise MeshError(f"'{what}' is '{text[:40]}': expected integers from 0; {SAVE_ANEW}")
    return tuple(map(int, found))
