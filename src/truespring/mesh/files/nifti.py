"""Read label images in the formats NIfTI-1 and NIfTI-2, single files, plain or compressed by gzip.

Source: nifti1.h and nifti2.h, https://nifti.nimh.nih.gov: the fields, and the matrices of quaternion and of sform.
"""

from pathlib import Path
from typing import Any, Literal

import numpy as np

from truespring.arrays import Floats
from truespring.errors import MeshError
from truespring.mesh.files.inflate import beginning
from truespring.mesh.files.labels import Labels
from truespring.mesh.files.raw_image import SAVE_ANEW, Values, inflated_values, n_voxels, raw_values, refuse_large
from truespring.opening import read_file

_Order = Literal["<", ">"]
_ORDERS: tuple[_Order, ...] = ("<", ">")

# By the size of the header [bytes]: the fields that are read, and their offsets.
_FIELDS: dict[int, dict[str, tuple[Any, int]]] = {
    348: {
        **{"dim": ("8i2", 40), "datatype": ("i2", 70), "bitpix": ("i2", 72), "pixdim": ("8f4", 76)},
        **{"offset": ("f4", 108), "slope": ("f4", 112), "inter": ("f4", 116), "units": ("u1", 123)},
        **{"qform": ("i2", 252), "sform": ("i2", 254), "quaternion": ("3f4", 256), "shift": ("3f4", 268)},
        **{"rows": ("(3,4)f4", 280), "magic": ("S4", 344)},
    },
    540: {
        **{"magic": ("S8", 4), "datatype": ("i2", 12), "bitpix": ("i2", 14), "dim": ("8i8", 16)},
        **{"pixdim": ("8f8", 104), "offset": ("i8", 168), "slope": ("f8", 176), "inter": ("f8", 184)},
        **{"qform": ("i4", 344), "sform": ("i4", 348), "quaternion": ("3f8", 352), "shift": ("3f8", 376)},
        **{"rows": ("(3,4)f8", 400), "units": ("i4", 500)},
    },
}
_MAGIC = {348: b"n+1", 540: b"n+2\0\r\n\x1a\n"}
_TYPES = {2: "u1", 4: "i2", 8: "i4", 16: "f4", 64: "f8", 256: "i1", 512: "u2", 768: "u4", 1024: "i8", 1280: "u8"}
# Units of length in millimetres, by code; code 0 is "unknown".
_MILLIMETRES = {0: 1.0, 1: 1e3, 2: 1.0, 3: 1e-3}

# The axes of NIfTI point right, anterior and superior (RAS), those of DICOM, ITK and here left and posterior (LPS).
_TO_LPS = np.diag([-1.0, -1.0, 1.0])
_LPS = (
    "coordinates of NIfTI are RAS (x to the right, y to the front), here they are LPS as in DICOM and ITK: x and y "
    "have the opposite sign of those in nibabel and FSL"
)
_NOWHERE = "its header has no position of the voxels (qform and sform are 0): the first voxel is at the origin"
# Positions and spacings that differ by more than this, relative to the voxel, are reported.
_SAME = 1e-2


def read_nifti(file: Path) -> Labels:
    """Read a .nii or .nii.gz file; lengths in mm, positions in LPS. Raises MeshError if it is damaged."""
    data = read_file(file, MeshError)
    is_gzip = data[:2] == b"\x1f\x8b"
    try:
        begin = beginning(data, 540, "gzip") if is_gzip else data[:540]
    except ValueError as error:
        raise MeshError(f"this is no NIfTI image, or a damaged one ({error}); {SAVE_ANEW}") from None
    header, order = _header(begin)
    shape, dtype = _shape(header["dim"]), _dtype(header).newbyteorder(order)
    refuse_large(shape, dtype)
    offset = _offset(header)
    if is_gzip:
        values = inflated_values(data, dtype, shape, "gzip", skip=offset)
    else:
        values = raw_values(memoryview(data)[offset:], dtype, shape)
    with np.errstate(all="ignore"):  # a damaged header may hold any number: _places checks the result
        matrix, spacing, notes = _places(header)
        values = _scaled(values, header)
    direction = matrix[:, :3] / np.linalg.norm(matrix[:, :3], axis=0)
    return Labels(values, spacing, matrix[:, 3], direction, notes=tuple(notes))


def _header(begin: bytes) -> tuple[Any, _Order]:
    """Return the fields of the header by name, and the byte order."""
    for size, fields in _FIELDS.items():
        for order in _ORDERS:
            if len(begin) < size or int(np.frombuffer(begin[:4], f"{order}i4")[0]) != size:
                continue
            names, formats, offsets = zip(*((name, *where) for name, where in fields.items()), strict=True)
            layout = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})
            header = np.frombuffer(begin[:size], layout.newbyteorder(order))[0]
            if header["magic"] == b"ni1" or header["magic"][:3] == b"ni2":
                raise MeshError(f"its voxels are in another file (.hdr and .img): {SAVE_ANEW}, as .nii or .nii.gz")
            if header["magic"] != _MAGIC[size]:
                raise MeshError(f"the magic string in its header is damaged; {SAVE_ANEW}")
            return header, order
    raise MeshError(f"this is no NIfTI image, or its header is truncated; {SAVE_ANEW}")


def _shape(dim: Any) -> tuple[int, ...]:
    sizes = [int(size) for size in dim]
    if not 1 <= sizes[0] <= 7:
        raise MeshError(f"the header gives {sizes[0]} axes, 1 to 7 are allowed; {SAVE_ANEW}")
    shape = sizes[1 : 1 + sizes[0]]
    n_voxels(tuple(shape))
    while len(shape) > 3 and shape[-1] == 1:
        shape.pop()
    return tuple(shape)


def _dtype(header: Any) -> np.dtype[Any]:
    code = int(header["datatype"])
    if code not in _TYPES:
        raise MeshError(f"voxels of NIfTI's type {code} are no labels: save them as integers of 8 or 16 bits")
    dtype = np.dtype(_TYPES[code])
    if int(header["bitpix"]) != 8 * dtype.itemsize:
        raise MeshError(
            f"the header is damaged: voxels of type {code} have {8 * dtype.itemsize} bits, it gives "
            f"{int(header['bitpix'])}; {SAVE_ANEW}"
        )
    return dtype


def _offset(header: Any) -> int:
    offset, size = float(header["offset"]), header.dtype.itemsize
    if not size <= offset < 2**30 or offset != int(offset):
        raise MeshError(f"the header is damaged: its voxels begin at byte {offset:g}; {SAVE_ANEW}")
    return int(offset)


def _scaled(values: Values, header: Any) -> Values:
    slope, inter = float(header["slope"]), float(header["inter"])
    if slope == 0 or not np.isfinite([slope, inter]).all() or (slope, inter) == (1.0, 0.0):
        return values
    return values * slope + inter


def _places(header: Any) -> tuple[Floats, Floats, list[str]]:
    """Return the matrix from voxel indices to LPS positions and the spacing, shapes (3, 4) and (3,) [mm], and notes.

    The matrix is sform if the header has one, else qform. The spacing is pixdim, which is more precise than a
    rounded matrix, unless the two differ.
    """
    sides = np.abs(header["pixdim"][1:4].astype(np.float64))
    rows = header["rows"].astype(np.float64)
    unit = _MILLIMETRES.get(int(header["units"]) & 7)
    if unit is None:
        raise MeshError(f"the header gives an unknown unit of length, {int(header['units']) & 7}; {SAVE_ANEW}")
    by_q = _by_quaternion(header, sides) if int(header["qform"]) > 0 else None
    if int(header["sform"]) > 0:
        matrix, field = rows, "sform"
    elif by_q is not None:
        matrix, field = by_q, "qform"
    else:
        matrix, field = _TO_LPS @ np.hstack([np.diag(sides), np.zeros((3, 1))]), "pixdim"
    if not np.isfinite(matrix).all() or not (np.abs(matrix) < 1e12).all() or not abs(np.linalg.det(matrix[:, :3])) > 0:
        raise MeshError(f"the header's {field} is not finite or is singular; {SAVE_ANEW}")
    notes = [_NOWHERE if field == "pixdim" else _LPS]
    if field == "sform" and by_q is not None and not _same(rows, by_q):
        notes.append("its header has two transforms, qform and sform, that differ: sform is used, as in nibabel")
    norms = np.linalg.norm(matrix[:, :3], axis=0)
    if (np.abs(norms - sides) <= _SAME * norms).all():
        norms = sides
    else:
        notes.append(
            f"its header has two spacings, {_listed(sides)} (pixdim) and {_listed(norms)} ({field}): the latter is used"
        )
    return _TO_LPS @ (unit * matrix), unit * norms, notes


def _listed(values: Floats) -> str:
    return " x ".join(f"{value:.4g}" for value in values)


def _by_quaternion(header: Any, sides: Floats) -> Floats:
    b, c, d = (float(part) for part in header["quaternion"])
    a = np.sqrt(max(0.0, 1.0 - (b * b + c * c + d * d)))
    turn = np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - c * c - b * b],
        ]
    )
    handed = np.array([1.0, 1.0, -1.0 if float(header["pixdim"][0]) < 0 else 1.0])
    shift = np.asarray(header["shift"], dtype=np.float64)
    return np.hstack([turn * (sides * handed), shift[:, None]])


def _same(one: Floats, other: Floats) -> bool:
    edge = np.linalg.norm(one[:, :3], axis=0).min()
    return bool(np.abs(one - other).max() <= _SAME * edge) if np.isfinite(other).all() else False
