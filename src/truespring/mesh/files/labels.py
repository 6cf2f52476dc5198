"""Label images, independent of their format: labels of voxels, voxel positions and names of segments."""

from typing import Any, NamedTuple

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.errors import MeshError, nearest

# Maximum number of labels listed in a message.
_MANY = 30

# The cosine between axes: above the first, e.g. by rounded headers, they are made perpendicular, with a note; above
# the second the image is sheared, which is an error.
_UPRIGHT, _SHEARED = 1e-5, 1e-2


class Segment(NamedTuple):
    """A named segment: its label in one layer of the image."""

    name: str
    layer: int
    value: int


class Labels(NamedTuple):
    """A label image: an integer label per voxel; the voxel is centred at its position.

    Attributes:
        values: the labels, shape (nx, ny, nz), or (nx, ny, nz, n_layers) for several layers.
        spacing: the distance of voxels along each axis [the file's unit], shape (3,).
        origin: the centre of the first voxel [the file's unit], shape (3,).
        direction: the unit vectors of the image axes, as columns, shape (3, 3).
        segments: the named segments.
        notes: remarks about the image for the user.
    """

    values: np.ndarray[Any, Any]
    spacing: Floats
    origin: Floats
    direction: Floats
    segments: tuple[Segment, ...] = ()
    notes: tuple[str, ...] = ()

    def inside(self, label: int | str) -> Bools:
        """Return which voxels have a label or belong to a segment, shape (nx, ny, nz).

        Raises MeshError, with the labels of the image, if there are none or the label is in several layers.
        """
        layer, value = self._named(label) if isinstance(label, str) else self._numbered(label)
        found = np.asarray((self.values if self.values.ndim == 3 else self.values[..., layer]) == value)
        if not found.any():
            raise MeshError(f"no voxel has the label {label!r}; there are {self._listed()}")
        return found

    def _named(self, name: str) -> tuple[int, int]:
        exact = [one for one in self.segments if one.name == name]
        same = exact or [one for one in self.segments if one.name.casefold() == name.casefold()]
        if len({(one.layer, one.value) for one in same}) > 1:
            raise MeshError(f"{len(same)} segments have the name '{name}': use a label; there are {self._listed()}")
        if not same:
            known = [one.name for one in self.segments]
            why = nearest(name, known) if known else ", the image has no names"
            raise MeshError(f"there is no segment '{name}'{why}; there are {self._listed()}")
        return same[0].layer, same[0].value

    def _numbered(self, value: int) -> tuple[int, int]:
        if self.values.ndim == 3 or self.values.shape[3] == 1:
            return 0, value
        layers = [layer for layer in range(self.values.shape[3]) if (self.values[..., layer] == value).any()]
        if len(layers) > 1:
            raise MeshError(
                f"the label {value} is in {len(layers)} of {self.values.shape[3]} layers: name the segment, as "
                f'label = "{self.segments[0].name if self.segments else "liver"}"; there are {self._listed()}'
            )
        return (layers or [0])[0], value

    def _listed(self) -> str:
        if self.segments:
            found = [f"{one.value} ('{one.name[:40]}')" for one in self.segments]
        else:
            found = [str(value) for value in np.unique(self.values).tolist()]
        return ", ".join(found[:_MANY]) + (", ..." if len(found) > _MANY else "")


def checked(labels: Labels) -> Labels:
    """Return the labels as integers, on perpendicular axes; raise MeshError if this is not possible."""
    values = labels.values
    if values.ndim == 4 and labels.segments and max(one.layer for one in labels.segments) >= values.shape[3]:
        raise MeshError(f"a segment is in a layer that does not exist: there are {values.shape[3]}")
    if values.ndim not in (3, 4) or not values.size:
        raise MeshError(f"the image has shape {values.shape}: expected three axes, none of them empty")
    if values.dtype.kind == "f":
        whole = np.isfinite(values).all() and (values == np.rint(values)).all()
        whole = whole and float(np.abs(values).max()) < 2**53
        if not whole:
            raise MeshError(
                "the image has fractional values, not labels: it was blurred or interpolated; segment it first"
            )
        values = values.astype(np.int64)
    elif values.dtype.kind not in "iub":
        raise MeshError(f"the image has type {values.dtype}: must be integers, one label per voxel")
    if not (np.isfinite(labels.spacing).all() and (labels.spacing > 0).all()):
        raise MeshError(f"spacing = {labels.spacing.tolist()}: each must be positive")
    if not np.isfinite(labels.origin).all():
        raise MeshError(f"origin = {labels.origin.tolist()}: expected finite numbers")
    return _upright(labels._replace(values=values))


def _upright(labels: Labels) -> Labels:
    """Return the labels with the nearest orthonormal axes: the orthogonal polar factor of `direction`."""
    cosines = labels.direction.T @ labels.direction - np.eye(3)
    off = float(np.abs(cosines).max()) if np.isfinite(cosines).all() else np.inf
    if off > _SHEARED:
        raise MeshError(
            f"the axes of the image are not perpendicular: the cosine between two is {off:.2g}, at most {_SHEARED:g} "
            "is allowed: resample the image onto perpendicular axes (3D Slicer: Resample Scalar/Vector/DWI Volume, "
            "by nearest neighbour)"
        )
    left, _, right = np.linalg.svd(labels.direction)
    note = (
        f"the axes of the image are not quite perpendicular, the cosine between two is {off:.2g}: the nearest "
        "perpendicular axes were used"
    )
    return labels._replace(direction=left @ right, notes=(*labels.notes, *([note] if off > _UPRIGHT else [])))
