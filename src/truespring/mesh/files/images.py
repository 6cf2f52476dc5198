"""Label images: segmented organs as .vti, .npy, and by SimpleITK .nii, .nii.gz, .nrrd, .mha, .mhd."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from truespring.arrays import Floats
from truespring.errors import MeshError
from truespring.mesh.files.vtu import open_vtk

#: What SimpleITK reads, directions included, which other readers drop.
_BY_SIMPLEITK = (".nii", ".nii.gz", ".nrrd", ".mha", ".mhd")


# Before the name of an image that comes with PyVista: "pyvista:frog_tissues".
_PYVISTA = "pyvista:"


class Labels(NamedTuple):
    """A label image: integers of shape (nx, ny, nz), each that of a cuboid about its place.

    Attributes:
        values: the labels.
        spacing: of the places along each axis, in the file's unit, shape (3,).
        origin: the place of the first one, shape (3,).
        direction: the axes of the image in space, as columns, shape (3, 3).
    """

    values: np.ndarray[Any, Any]
    spacing: Floats
    origin: Floats
    direction: Floats


def read_labels(file: str | Path) -> Labels:
    """Read a label image; raise MeshError, with the file, where it is damaged or holds no labels."""
    if str(file).startswith(_PYVISTA):
        return _checked(_of_pyvista(str(file).removeprefix(_PYVISTA)))
    file = Path(file)
    suffix = "".join(file.suffixes[-2:]).lower() if file.name.lower().endswith(".nii.gz") else file.suffix.lower()
    readers: dict[str, Callable[[Path], Labels]] = {".npy": _npy, ".vti": _vti}
    readers |= dict.fromkeys(_BY_SIMPLEITK, _by_simpleitk)
    if suffix not in readers:
        raise MeshError(f"{file}: a label image ends in {', '.join(readers)}, not in '{file.suffix}'")
    if not file.is_file():
        raise MeshError(f"{file} {'is a folder: give the image itself' if file.is_dir() else 'does not exist'}")
    try:
        found = readers[suffix](file)
        return _checked(found)
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from None


def _checked(labels: Labels) -> Labels:
    values = labels.values
    if values.ndim != 3 or not values.size:
        raise MeshError(f"the image has shape {values.shape}: three axes are wanted, none of them empty")
    if values.dtype.kind == "f":
        whole = np.isfinite(values).all() and (values == np.rint(values)).all()
        if not whole:
            raise MeshError("the image holds fractions, not labels: it was blurred or interpolated; segment it first")
        values = values.astype(np.int64)
    elif values.dtype.kind not in "iub":
        raise MeshError(f"the image holds {values.dtype}: integers are wanted, one label a voxel")
    if not (np.isfinite(labels.spacing).all() and (labels.spacing > 0).all()):
        raise MeshError(f"spacing = {labels.spacing.tolist()}: each must be positive")
    if not np.allclose(labels.direction.T @ labels.direction, np.eye(3), atol=1e-4):
        raise MeshError("the axes of the image do not stand upright on each other: a sheared image has no cubes")
    return labels._replace(values=values)


def _npy(file: Path) -> Labels:
    try:
        values = np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise MeshError(f"this is no .npy file, or not a whole one: {error}") from None
    return Labels(np.asarray(values), np.ones(3), np.zeros(3), np.eye(3))


def _vti(file: Path) -> Labels:
    """VTK's image: labels of the points, or of the cells between them."""
    root, reader = open_vtk(file.read_bytes(), "ImageData")
    image = root.find("ImageData")
    assert image is not None  # open_vtk has looked
    pieces = image.findall("Piece")
    if len(pieces) != 1:
        raise MeshError(f"there are {len(pieces)} pieces: one is wanted")
    extent = _numbers(image, "WholeExtent", 6)
    spacing, origin = _numbers(image, "Spacing", 3, "1 1 1"), _numbers(image, "Origin", 3, "0 0 0")
    direction = _numbers(image, "Direction", 9, "1 0 0 0 1 0 0 0 1").reshape(3, 3)
    low, n_points = extent[::2], (extent[1::2] - extent[::2] + 1).astype(int)
    for section, counts, shift in (("CellData", n_points - 1, 0.5), ("PointData", n_points, 0.0)):
        arrays = reader.arrays(pieces[0], section, int(counts.prod()))
        scalars = {name: values for name, values in arrays.items() if values.ndim == 1 and values.dtype.kind in "iu"}
        if scalars:
            if len(scalars) > 1:
                raise MeshError(f"there are several arrays of integers ({', '.join(scalars)}): leave the labels alone")
            values = next(iter(scalars.values())).reshape(counts, order="F")
            return Labels(values, spacing, origin + direction @ ((low + shift) * spacing), direction)
    raise MeshError("there is no array of integers among the points or cells")


def _of_pyvista(name: str) -> Labels:
    """An image that comes with PyVista's own package; others, which it would download, are not asked for."""
    try:
        from pyvista import examples
    except ImportError:
        raise MeshError(f"{_PYVISTA}{name} comes with PyVista: pip install 'truespring[3d]'") from None
    load = getattr(examples, f"load_{name}", None)
    image = load() if load else None
    if image is None or not hasattr(image, "spacing"):
        raise MeshError(f"{_PYVISTA}{name}: PyVista has no image of this name with its package, such as frog_tissues")
    values = np.asarray(image.active_scalars).reshape(image.dimensions, order="F")
    return Labels(values, np.array(image.spacing), np.array(image.origin), np.array(image.direction_matrix))


def _numbers(element: ElementTree.Element, name: str, count: int, default: str = "") -> Floats:
    text = element.get(name, default)
    try:
        found = np.array([float(word) for word in text.split()])
    except ValueError:
        found = np.zeros(0)
    if len(found) != count:
        raise MeshError(f'ImageData has {name}="{text[:40]}": {count} numbers are wanted')
    return found


def _by_simpleitk(file: Path) -> Labels:
    try:
        import SimpleITK
    except ImportError:
        raise MeshError("such images are read by SimpleITK: pip install 'truespring[images]'") from None
    itk: Any = SimpleITK  # typed in part only
    itk.ProcessObject.SetGlobalWarningDisplay(False)
    try:
        image = itk.ReadImage(str(file))
    except RuntimeError as error:
        told = [line.strip() for line in str(error).splitlines() if line.strip()]
        raise MeshError(f"this image cannot be read, it may be damaged: {told[-1] if told else error}") from None
    values = itk.GetArrayFromImage(image)
    if image.GetDimension() != 3 or image.GetNumberOfComponentsPerPixel() != 1:
        raise MeshError(
            f"the image has {image.GetDimension()} axes and {image.GetNumberOfComponentsPerPixel()} values a voxel: "
            "three axes and one label are wanted"
        )
    direction = np.array(image.GetDirection()).reshape(3, 3)
    return Labels(values.transpose(), np.array(image.GetSpacing()), np.array(image.GetOrigin()), direction)
