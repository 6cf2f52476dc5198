"""What the formats of label images share: numbers behind a header, and the files that a header names."""

from pathlib import Path
from typing import Any

import numpy as np

from truespring.errors import MeshError
from truespring.mesh.files.inflate import inflated, refuse_too_large
from truespring.opening import file_beside, read_file

Values = np.ndarray[Any, Any]

#: The way out of a header that is damaged or of a kind that is not read.
SAVE_ANEW = "copy it again, or save it again from 3D Slicer or ITK-SNAP"


def n_voxels(shape: tuple[int, ...]) -> int:
    """Return how many voxels a shape has; raise MeshError where an axis is empty."""
    if not shape or min(shape) < 1:
        raise MeshError(f"the header gives the axes {list(shape)} voxels: each needs one at least")
    count = 1
    for one in shape:
        count *= one
    return count


def raw_values(data: bytes | memoryview, dtype: np.dtype[Any], shape: tuple[int, ...]) -> Values:
    """Return numbers whose first axis runs fastest; raise MeshError where there are more or fewer."""
    wanted = n_voxels(shape) * dtype.itemsize
    if len(data) != wanted:
        which = "it is cut off" if len(data) < wanted else "it is longer than it should be"
        told = " x ".join(map(str, shape))
        raise MeshError(
            f"{which}: {told} voxels of {dtype.itemsize} bytes are {wanted} bytes, {len(data)} are there; {SAVE_ANEW}"
        )
    return np.frombuffer(data, dtype).reshape(shape, order="F")


def inflated_values(
    data: bytes | memoryview, dtype: np.dtype[Any], shape: tuple[int, ...], method: str, skip: int = 0
) -> Values:
    """Return compressed numbers behind `skip` bytes of another kind; raise MeshError where they are damaged."""
    size = skip + n_voxels(shape) * dtype.itemsize
    try:
        return raw_values(memoryview(inflated(data, size, method))[skip:], dtype, shape)
    except ValueError as error:
        raise MeshError(f"its voxels are damaged ({error}); {SAVE_ANEW}") from None


def text_values(data: bytes, dtype: np.dtype[Any], shape: tuple[int, ...]) -> Values:
    """Return numbers that are written as text; raise MeshError where there are more or fewer."""
    if not data[-1:].isspace():
        raise MeshError(f"its last line has no line end: is it cut off? {SAVE_ANEW}")
    words = data.split()
    if len(words) != n_voxels(shape):
        raise MeshError(f"{n_voxels(shape)} voxels are announced, {len(words)} are there; {SAVE_ANEW}")
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        raise MeshError(f"its voxels are no numbers; {SAVE_ANEW}") from None
    if dtype.kind in "iu":
        limits = np.iinfo(dtype)
        if not ((values == np.rint(values)) & (values >= limits.min) & (values <= limits.max)).all():
            raise MeshError(f"a voxel is no number of the type that its header gives; {SAVE_ANEW}")
    return values.astype(dtype).reshape(shape, order="F")


def data_beside(folder: Path, name: str) -> bytes:
    """Return what stands in a file that a header names; raise MeshError where it lies elsewhere."""
    return read_file(file_beside(folder, name, MeshError), MeshError)


def refuse_large(shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Raise MeshError for an image that does not fit into the memory."""
    try:
        refuse_too_large(n_voxels(shape) * dtype.itemsize)
    except ValueError as error:
        raise MeshError(f"{error}: crop or resample the image") from None


def numbers(text: str, count: int | None, what: str) -> list[float]:
    """Return the finite numbers of a line of a header; raise MeshError where they are others or not `count`."""
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        found = []
    if not found or not np.isfinite(found).all() or (count is not None and len(found) != count):
        raise MeshError(f"'{what}' is '{text[:40]}': {count or 'some'} numbers are wanted; {SAVE_ANEW}")
    return found


def counts(text: str, count: int | None, what: str) -> tuple[int, ...]:
    """Return the whole numbers of a line of a header; raise MeshError where they are others or not `count`."""
    found = numbers(text, count, what)
    if any(value != int(value) or not 0 <= value < 2**40 for value in found):
        raise MeshError(f"'{what}' is '{text[:40]}': whole numbers from 0 are wanted; {SAVE_ANEW}")
    return tuple(map(int, found))
