"""A reader of results: .npy files of six columns, positions and displacements of points [m]."""

from pathlib import Path

import numpy as np

from truespring.errors import ReferenceFileError
from truespring.reference.record import Level, Reading, Record
from truespring.reference.result import Format


def read_npy(file: Path, reading: Reading | None = None) -> Record:
    """Return the points of a file and their displacement, as markers."""
    try:
        table = np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise ReferenceFileError(f"{file}: this is no .npy file, or it is damaged: {error}") from None
    if table.ndim != 2 or table.shape[1] != 6:
        raise ReferenceFileError(f"{file}: a table of six columns is required: x, y, z, ux, uy, uz in metres")
    return Record(file, "npy", table[:, :3], {}, (Level(1.0, table[:, 3:]),))


NPY = Format(lambda head: head.startswith(b"\x93NUMPY"), read_npy)
