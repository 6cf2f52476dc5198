"""Read the undeformed and the deformed surface of a body from two STL files as a record."""

import re
from pathlib import Path

import numpy as np

from truespring.errors import ReferenceFileError
from truespring.reference.checks import checked, refuse_unreadable
from truespring.reference.placing import Placing
from truespring.reference.record import Level, Reading, Record
from truespring.reference.stl import distinct_vertices, read_facets

# Tolerance of common vertices in the deformed body as a fraction of its diameter.
_APART = 1e-5


def is_stl(head: bytes) -> bool:
    """Return whether the beginning of a file is that of an ASCII STL file; binary ones have no mark."""
    return bool(re.match(rb"\s*solid\b[^\n]*\n\s*facet\s+normal\b", head, re.IGNORECASE))


def read_stl_pair(file: Path, reading: Reading | None = None, undeformed: Path | None = None) -> Record:
    """Read the surface of a body from two STL files with the same triangles in the same order.

    Args:
        file: the deformed body.
        reading: called with the fraction that has been read.
        undeformed: the undeformed body.

    Returns a record of kind "stl" of triangles and one level of time 1. Raises ReferenceFileError if a file cannot be
    read, `undeformed` is missing, or the files do not match.
    """
    if undeformed is None:
        raise ReferenceFileError(
            f"{file}: a deformed STL file alone has no displacement: add the undeformed body (undeformed)"
        )
    for one in (file, undeformed):
        refuse_unreadable(one)
    deformed = read_facets(file, Placing())
    if reading:
        reading(0.5)
    rest = read_facets(undeformed, Placing())
    if len(rest) != len(deformed):
        raise ReferenceFileError(
            f"{file} has {len(deformed)} facets, {undeformed} has {len(rest)}: export both from one mesh"
        )
    before, after = rest.reshape(-1, 3), deformed.reshape(-1, 3)
    first, numbers = distinct_vertices(before)
    spread = np.linalg.norm(after - after[first][numbers], axis=1)
    worst = int(spread.argmax())
    if spread[worst] > _APART * np.linalg.norm(np.ptp(after, axis=0)):
        raise ReferenceFileError(
            f"the vertex of {undeformed} at {before[worst].tolist()} moves to two positions in {file}, "
            f"{after[worst].tolist()} and {after[first][numbers][worst].tolist()}: the files list their facets in "
            "different orders; export both in the same order"
        )
    triangles = numbers.reshape(-1, 3)
    a, b, c = triangles.T
    whole = triangles[(a != b) & (b != c) & (c != a)]  # without those that merging closed
    if reading:
        reading(1.0)
    level = Level(1.0, after[first] - before[first])
    return checked(Record(file, "stl", before[first], {"triangle": whole}, (level,)))
