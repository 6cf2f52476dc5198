"""Read label images (segmentations) by their suffix: .nii, .nii.gz, .nrrd, .mha, .mhd, .vti and .npy."""

import io
import math
import tokenize
from collections.abc import Callable
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from truespring.arrays import Floats
from truespring.errors import MeshError
from truespring.mesh.files.labels import Labels, checked
from truespring.mesh.files.metaimage import read_metaimage
from truespring.mesh.files.nifti import read_nifti
from truespring.mesh.files.nrrd import read_nrrd
from truespring.mesh.files.raw_image import SAVE_ANEW, n_voxels
from truespring.mesh.files.vtu import dims_of, open_vtk
from truespring.opening import read_file

# Prefix of the name of an image of the PyVista package: "pyvista:frog_tissues".
_PYVISTA = "pyvista:"


class ImageFormat(NamedTuple):
    """A format of label images.

    Attributes:
        read: returns the labels of a file.
        unnoticed: where a truncated file reads without an error, and why; empty if any truncation is an error.
    """

    read: Callable[[Path], Labels]
    unnoticed: str = ""


def read_labels(file: str | Path) -> Labels:
    """Read a label image; raise MeshError, with the file, if it is damaged or contains no labels."""
    if str(file).startswith(_PYVISTA):
        return checked(_of_pyvista(str(file).removeprefix(_PYVISTA)))
    file = Path(file)
    form = next((one for suffix, one in IMAGES.items() if file.name.lower().endswith(suffix)), None)
    if form is None:
        raise MeshError(f"{file}: the suffix of a label image is {', '.join(IMAGES)}, not '{file.suffix}'")
    try:
        return checked(form.read(file))
    except MeshError as error:
        message = str(error)
        raise MeshError(message if message.startswith(str(file)) else f"{file}: {message}") from None


def _npy(file: Path) -> Labels:
    data = read_file(file, MeshError)
    stream = io.BytesIO(data)
    wrong = f"this is no .npy file, or its header is damaged; {SAVE_ANEW} or numpy.save"
    try:
        version = np.lib.format.read_magic(stream)
        if version not in ((1, 0), (2, 0)):
            raise MeshError(f".npy of version {version[0]}.{version[1]} contains no labels: save an array of integers")
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, is_fortran, dtype = read(stream)
    except (ValueError, TypeError, SyntaxError, tokenize.TokenError, EOFError, OverflowError, RecursionError) as error:
        raise MeshError(f"{wrong} ({str(error).splitlines()[0][:80] if str(error) else 'no header'})") from None
    if dtype.hasobject or dtype.kind not in "iubf":
        raise MeshError(f"the array has type {dtype}: must be integers, one label per voxel")
    expected, there = n_voxels(shape) * dtype.itemsize, len(data) - stream.tell()
    if expected != there:
        raise MeshError(f"its header states {expected} bytes of voxels, found {there}: is it truncated? {SAVE_ANEW}")
    values = np.frombuffer(data, dtype, offset=stream.tell()).reshape(shape, order="F" if is_fortran else "C")
    return Labels(values, np.ones(3), np.zeros(3), np.eye(3))


def _vti(file: Path) -> Labels:
    """Read a VTK image: labels of the points, or of the cells."""
    root, reader = open_vtk(read_file(file, MeshError), "ImageData")
    image = root.find("ImageData")
    assert image is not None  # checked by open_vtk
    pieces = image.findall("Piece")
    if len(pieces) != 1:
        raise MeshError(f"expected one piece, found {len(pieces)}")
    n_points = np.array(dims_of(image, "WholeExtent"))
    if dims_of(pieces[0]) != n_points.tolist():
        raise MeshError("its piece is not the whole image: save it in one piece")
    low = _numbers(image, "WholeExtent", 6)[::2]
    spacing, origin = _numbers(image, "Spacing", 3, "1 1 1"), _numbers(image, "Origin", 3, "0 0 0")
    direction = _numbers(image, "Direction", 9, "1 0 0 0 1 0 0 0 1").reshape(3, 3)
    for section, counts, shift in (("CellData", np.maximum(n_points - 1, 1), 0.5), ("PointData", n_points, 0.0)):
        arrays = reader.arrays(pieces[0], section, math.prod(counts.tolist()))
        one = {name: values for name, values in arrays.items() if values.ndim == 1}
        scalars = {name: values for name, values in one.items() if values.dtype.kind in "iu"} or one
        if scalars:
            if len(scalars) > 1:
                raise MeshError(f"there are several arrays ({', '.join(scalars)}): keep only that of the labels")
            values = next(iter(scalars.values())).reshape(counts, order="F")
            return Labels(values, spacing, origin + direction @ ((low + shift) * spacing), direction)
    raise MeshError("there is no array of labels among the points or cells")


def _of_pyvista(name: str) -> Labels:
    """Read an example image of the PyVista package; those that PyVista would download raise MeshError."""
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
        raise MeshError(f'ImageData has {name}="{text[:40]}": expected {count} numbers')
    return found


#: The formats by the end of the file name, in lower case.
IMAGES: MappingProxyType[str, ImageFormat] = MappingProxyType(
    {
        **dict.fromkeys((".nii", ".nii.gz"), ImageFormat(read_nifti)),
        **dict.fromkeys((".nrrd", ".nhdr"), ImageFormat(read_nrrd)),
        **dict.fromkeys((".mha", ".mhd"), ImageFormat(read_metaimage)),
        ".vti": ImageFormat(_vti),
        ".npy": ImageFormat(_npy),
    }
)
