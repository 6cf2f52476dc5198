"""Convert VTK's structured data sets and PolyData to unstructured grids."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.files.inflate import refuse_too_large
from truespring.mesh.files.vtk_grid import Arrays, Grid

#: The cell lists of PolyData, in the order of its cell numbers.
FACES = ("verts", "lines", "polys", "strips")

# VTK's cell type by number of points; of a structured grid by its number of axes with cells.
_POLYGONS = {3: 5, 4: 9}
_LATTICE = {0: 1, 1: 3, 2: 9, 3: 12}
_CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]


class Lists(NamedTuple):
    """Cells of any number of points: `offsets` are the start of each in `connectivity`, and the end of the last."""

    offsets: Ints
    connectivity: Ints


def lattice(dims: Sequence[int], points: Floats, point_arrays: Arrays, cell_arrays: Arrays) -> Grid:
    """Return a structured grid as hexahedra, or as quadrilaterals if one axis has a single point; x runs fastest."""
    if len(dims) != 3 or min(dims) < 1 or math.prod(dims) != len(points):
        raise MeshError(f"a lattice of {' x '.join(map(str, dims))} points does not have {len(points)} of them")
    numbers = np.arange(len(points)).reshape(tuple(dims), order="F").squeeze()
    dim = numbers.ndim
    corners = [
        numbers[tuple(slice(at, at - 1 or None) for at in corner[:dim])].ravel(order="F")
        for corner in _CORNERS[: 2**dim]
    ]
    cells = np.stack(corners, axis=1)
    return Grid(
        points,
        np.arange(len(cells) + 1) * cells.shape[1],
        cells.ravel(),
        np.full(len(cells), _LATTICE[dim]),
        point_arrays,
        cell_arrays,
    )


def lattice_points(coordinates: Sequence[Floats]) -> Floats:
    """Return the points of a rectilinear grid [the file's unit], shape (n_points, 3).

    Raise MeshError if there are too many.
    """
    try:
        refuse_too_large(24 * math.prod(map(len, coordinates)))
    except ValueError as error:
        raise MeshError(str(error)) from None
    x, y, z = np.meshgrid(*coordinates, indexing="ij")
    return np.stack([x.ravel(order="F"), y.ravel(order="F"), z.ravel(order="F")], axis=1).astype(np.float64)


def faces(points: Floats, lists: Mapping[str, Lists], point_arrays: Arrays, cell_arrays: Arrays) -> Grid:
    """Return PolyData as a grid; lines become segments, strips become triangles, with the values of their cell."""
    first, sizes, cells, types, rows = 0, [], [], [], []
    for name in FACES:
        if name not in lists:
            continue
        offsets, connectivity = lists[name]
        refuse_torn(offsets, connectivity)
        count = np.diff(offsets)
        owner = np.repeat(np.arange(len(count)), count)
        if name in ("lines", "strips"):
            size = 2 if name == "lines" else 3
            place = np.arange(len(connectivity))
            begin = np.flatnonzero(place + size <= offsets[1:][owner])
            pieces = connectivity[begin[:, None] + np.arange(size)]
            if size == 3:  # every other triangle of a strip is reversed
                odd = (begin - offsets[:-1][owner[begin]]) % 2 == 1
                pieces[odd] = pieces[odd][:, [1, 0, 2]]
            owner, connectivity, count = owner[begin], pieces.ravel(), np.full(len(begin), size)
            types.append(np.full(len(begin), 3 if size == 2 else 5))
        else:
            owner = np.arange(len(count))
            by_size = {1: 1} if name == "verts" else _POLYGONS
            types.append(
                np.array([by_size.get(n, 2 if name == "verts" else 7) for n in count.tolist()], dtype=np.int64)
            )
        cells.append(connectivity)
        sizes.append(count)
        rows.append(first + owner)
        first += len(offsets) - 1
    if not sizes:
        raise MeshError("there are no polygons, lines or points: is the file truncated?")
    order = np.concatenate(rows)
    for name, values in cell_arrays.items():
        if len(values) != first:
            raise MeshError(f"array '{name}' of the cells has {len(values)} rows, expected {first}")
    return Grid(
        points,
        np.concatenate([[0], np.cumsum(np.concatenate(sizes))]).astype(np.int64),
        np.concatenate(cells),
        np.concatenate(types),
        point_arrays,
        {name: values[order] for name, values in cell_arrays.items()},
    )


def refuse_torn(offsets: Ints, connectivity: Ints) -> None:
    """Raise MeshError if offsets do not ascend from 0 to the length of `connectivity`."""
    if not len(offsets) or offsets[0] != 0 or (np.diff(offsets) < 0).any() or offsets[-1] != len(connectivity):
        raise MeshError(f"offsets do not ascend from 0 to {len(connectivity)}, the number of points that cells list")
