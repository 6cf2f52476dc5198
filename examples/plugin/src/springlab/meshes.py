"""A format of mesh files: .off, points and polygons, of which triangles and quadrilaterals form a body."""

from pathlib import Path

import numpy as np

from truespring.errors import MeshError
from truespring.mesh.files import Format
from truespring.mesh.files.contents import Cells, Contents

_KINDS = {3: "triangle", 4: "quadrilateral"}


def read_off(data: bytes, folder: Path) -> Contents:
    """Return the contents of an OFF file: its name, counts, points, and for each face the number of its corners."""
    words = iter(b" ".join(line.partition(b"#")[0] for line in data.splitlines()).split())
    try:
        if next(words) != b"OFF":
            raise MeshError("an OFF file begins with OFF")
        n_points, n_faces, _ = (int(next(words)) for _ in range(3))
        points = np.array([float(next(words)) for _ in range(3 * n_points)]).reshape(-1, 3)
        faces: dict[int, list[list[int]]] = {}
        for _ in range(n_faces):
            corners = int(next(words))
            faces.setdefault(corners, []).append([int(next(words)) for _ in range(corners)])
    except (StopIteration, ValueError) as error:
        raise MeshError(f"the file is truncated or damaged: {error or 'it ends too early'}") from None
    cells, number = [], 0
    for corners, several in faces.items():
        if corners not in _KINDS:
            raise MeshError(f"a face has {corners} corners: allowed are 3 and 4")
        cells.append(Cells(_KINDS[corners], np.array(several), number + np.arange(len(several))))
        number += len(several)
    return Contents(np.arange(n_points), points, cells)


OFF = Format(lambda head: head.lstrip().startswith(b"OFF"), read_off)
