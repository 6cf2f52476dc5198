"""Read a body from a label image: a hexahedron for each voxel, or cubes of a given size."""

import math
from pathlib import Path

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.deprecation import renamed_argument
from truespring.errors import MeshError
from truespring.mesh.files.images import read_labels
from truespring.mesh.files.labels import Labels
from truespring.mesh.mesh import Mesh
from truespring.mesh.shapes import refuse_too_large
from truespring.units import unit_of

# Samples along each edge of a cube: the cube belongs to the body if more than half of its samples do.
_SAMPLES = 3
_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])


@renamed_argument("scale", "unit")
def read_voxels(file: str | Path, label: int | str, edge: float | None = None, unit: str | float = "mm") -> Mesh:
    """Read the body with a label from a label image as a mesh of hexahedra.

    Args:
        file: the image: .nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd, .vti or .npy.
        label: label of the body: a number, or the name of a segment of a .seg.nrrd file.
        edge: edge length of the cubes [m]; None makes a hexahedron of each voxel, with the spacing of the image.
        unit: the image's unit of length, such as "mm" or "0.2 mm"; a number is in metres.

    Of parts that share no face only the largest is read; a note counts the rest. Node positions follow the origin,
    spacing and direction of the image; in medical images x points to the patient's left, y to the back (LPS, as in
    DICOM and ITK). Raises MeshError, with the file, if the image cannot be read, has no such label, or fills no cube.

    Example:
        >>> import truespring as ts
        >>> study = ts.new("organ", "own.toml")  # writes own.nrrd, too
        >>> ts.read_voxels("own.nrrd", label=1)
        Mesh(1257 nodes, 857 elements: hexahedron)
    """
    scale = unit_of(unit, "length", f"{file}: unit", MeshError)
    if edge is not None and not (math.isfinite(edge) and edge > 0):
        raise MeshError(f"{file}: edge = {edge:g} m: the edge of the cubes must be positive")
    labels = read_labels(file)
    try:
        return _mesh(labels, label, edge, scale)
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from None


def _mesh(labels: Labels, label: int | str, edge: float | None, scale: float) -> Mesh:
    inside = labels.inside(label)
    from scipy import ndimage

    (box,) = ndimage.find_objects(inside.astype(np.uint8))
    low = np.array([part.start for part in box])
    inside, spacing = inside[box], scale * labels.spacing
    filled, sides = (inside, spacing) if edge is None else (_resampled(inside, spacing, edge), np.full(3, edge))
    if not filled.any():
        raise MeshError(
            f"cubes of {edge:g} m are too large: no cube is filled by more than half with label {label}, "
            f"which measures {' by '.join(f'{side:.3g}' for side in inside.shape * spacing)} m"
        )
    filled, notes = _largest_part(filled, label)
    refuse_too_large(int(filled.sum()), 3)
    nodes, elements = _cubes(filled)
    # Lower corner of the first voxel; the origin is its centre.
    corner = scale * labels.origin + labels.direction @ ((low - 0.5) * spacing)
    if np.linalg.det(labels.direction) < 0:  # left-handed axes: mirror the order of nodes
        elements = elements[:, [4, 5, 6, 7, 0, 1, 2, 3]]
    places = corner + (nodes * sides) @ labels.direction.T
    thin = [axis for axis, count in zip("xyz", np.ptp(nodes, axis=0), strict=True) if count == 1]
    if thin:
        notes.append(f"only one cube thick along its {' and '.join(thin)} axis: its bending stiffness is wrong")
    return Mesh(places, elements, "hexahedron", notes=(*labels.notes, *notes))


def _resampled(inside: Bools, spacing: Floats, edge: float) -> Bools:
    """Return which cubes of an edge [m] are filled by more than half, shape by the cubes along each axis."""
    counts = np.ceil(np.array(inside.shape) * spacing / edge - 1e-9).astype(int)
    refuse_too_large(int(counts.prod()) // 8, 3)  # a body is assumed to fill at least an eighth of its box
    at = [
        ((np.arange(count * _SAMPLES) + 0.5) / _SAMPLES * edge / side).astype(int)
        for count, side in zip(counts, spacing, strict=True)
    ]
    seen = inside[np.ix_(*(np.minimum(place, n - 1) for place, n in zip(at, inside.shape, strict=True)))]
    for axis, (place, n) in enumerate(zip(at, inside.shape, strict=True)):
        beyond: list[slice | Bools] = [slice(None)] * 3
        beyond[axis] = place >= n
        seen[tuple(beyond)] = False
    by_cube = seen.reshape(*(part for count in counts for part in (count, _SAMPLES)))
    return np.asarray(by_cube.sum(axis=(1, 3, 5)) > _SAMPLES**3 / 2)


def _largest_part(filled: Bools, label: int | str) -> tuple[Bools, list[str]]:
    """Return the largest part whose cubes share faces, and a note on the parts left out."""
    from scipy import ndimage

    parts, n_parts = ndimage.label(filled)
    if n_parts == 1:
        return filled, []
    sizes = np.bincount(parts.ravel())[1:]
    left = int(sizes.sum() - sizes.max())
    note = (
        f"label {label} has {n_parts} parts that share no face: the largest has {sizes.max()} cubes, "
        f"{left} of the others {'is' if left == 1 else 'are'} left out"
    )
    return parts == sizes.argmax() + 1, [note]


def _cubes(filled: Bools) -> tuple[Floats, Ints]:
    """Return the corners of cubes, in edges along each axis, shape (n, 3), and those of each cube, shape (m, 8)."""
    shape = np.array(filled.shape) + 1
    corners = np.argwhere(filled)[:, None] + _CORNERS
    numbers = np.ravel_multi_index(tuple(corners.reshape(-1, 3).T), tuple(shape))
    used, elements = np.unique(numbers, return_inverse=True)
    nodes = np.stack(np.unravel_index(used, tuple(shape)), axis=1).astype(np.float64)
    return nodes, elements.reshape(-1, 8)
