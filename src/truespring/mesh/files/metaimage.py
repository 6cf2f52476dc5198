"""Read label images in the MetaImage format: .mha, and .mhd with the voxels in another file of the folder.

Source: https://itk.org/Wiki/ITK/MetaIO/Documentation; a row of TransformMatrix is an axis of the image.
"""

import difflib
import re
from pathlib import Path
from typing import Any

import numpy as np

from truespring.errors import MeshError
from truespring.mesh.files.labels import Labels
from truespring.mesh.files.raw_image import (
    SAVE_ANEW,
    Values,
    counts,
    data_beside,
    inflated_values,
    n_voxels,
    numbers,
    raw_values,
    refuse_large,
    text_values,
)
from truespring.opening import read_file

_TYPES = {
    **{"MET_CHAR": "i1", "MET_UCHAR": "u1", "MET_SHORT": "i2", "MET_USHORT": "u2", "MET_INT": "i4", "MET_UINT": "u4"},
    **{"MET_LONG": "i4", "MET_ULONG": "u4", "MET_LONG_LONG": "i8", "MET_ULONG_LONG": "u8"},
    **{"MET_FLOAT": "f4", "MET_DOUBLE": "f8"},
}
# Synonymous keys.
_MATRIX = ("TransformMatrix", "Rotation", "Orientation")
_ORIGIN = ("Offset", "Position", "Origin")
_SPACING = ("ElementSpacing", "ElementSize")
_ORDER = ("BinaryDataByteOrderMSB", "ElementByteOrderMSB")
# Keys that define the geometry: a key similar to one of these counts as damaged.
_READ = (
    *("ObjectType", "NDims", "DimSize", "ElementType", "ElementDataFile", "ElementNumberOfChannels", "HeaderSize"),
    *("BinaryData", "CompressedData", "CompressedDataSize", *_MATRIX, *_ORIGIN, *_SPACING, *_ORDER),
)
_OTHERS = (
    *("Comment", "ObjectSubType", "TransformType", "Name", "ID", "ParentID", "Color", "CenterOfRotation", "Modality"),
    *("DistanceUnits", "AnatomicalOrientation", "SequenceID", "ElementMin", "ElementMax", "ElementNBits"),
    *("AcquisitionDate", "AcquisitionTime", "CompressionLevel", "ElementToIntensityFunctionSlope"),
    "ElementToIntensityFunctionOffset",
)
_FREE = ("Comment", "Name", "ElementDataFile")  # of any text
# The longest header [bytes].
_LONGEST = 2**16


def read_metaimage(file: Path) -> Labels:
    """Read a .mha or .mhd file; raise MeshError if it is damaged or not supported."""
    data = read_file(file, MeshError)
    header, begin = _header(data)
    n_axes = counts(header.get("NDims", ""), 1, "NDims")[0]
    shape = counts(header.get("DimSize", ""), n_axes, "DimSize")
    code = header.get("ElementType", "").upper()
    if code not in _TYPES:
        raise MeshError(
            f"ElementType is '{code[:40]}', which is not supported; supported: {', '.join(_TYPES)}, one number per "
            "voxel"
        )
    if header.get("ElementNumberOfChannels", "1") != "1":
        raise MeshError(
            f"ElementNumberOfChannels is {header['ElementNumberOfChannels'][:20]}: expected one label per voxel"
        )
    dtype = np.dtype(_TYPES[code]).newbyteorder(">" if any(_is(header, key) for key in _ORDER) else "<")
    refuse_large(shape, dtype)
    if n_axes != 3:
        raise MeshError(f"the image has {n_axes} axes: expected three")
    values = _values(header, _stored(file.parent, header, data[begin:]), dtype, shape)
    matrix = numbers(_first(header, _MATRIX, "1 0 0 0 1 0 0 0 1"), 9, "TransformMatrix")
    return Labels(
        values,
        np.abs(numbers(_first(header, _SPACING, "1 1 1"), 3, "ElementSpacing")),
        np.array(numbers(_first(header, _ORIGIN, "0 0 0"), 3, "Offset")),
        np.array(matrix).reshape(3, 3).T,
    )


def _header(data: bytes) -> tuple[dict[str, str], int]:
    """Return the values by key, and the length of the header, which ends with the line of ElementDataFile [bytes]."""
    header: dict[str, str] = {}
    begin = 0
    while "ElementDataFile" not in header:
        end = data.find(b"\n", begin, _LONGEST) + 1
        line = data[begin:end].decode("latin-1").strip()
        key, sign, value = (part.strip() for part in line.partition("="))
        if not end or (line and not (sign and key.isascii() and key.isprintable())):
            raise MeshError(f"this is no MetaImage: expected lines 'KEY = VALUE' up to ElementDataFile; {SAVE_ANEW}")
        begin = end
        if not line:
            continue
        if "=" in value and key in _READ + _OTHERS and key not in _FREE:
            raise MeshError(f"the header has two '=' in the line of {key}: is it damaged? {SAVE_ANEW}")
        if key in header:
            raise MeshError(f"the header has {key[:40]} twice; {SAVE_ANEW}")
        near = [] if key in _READ + _OTHERS else difflib.get_close_matches(key, _READ, 1, 0.85)
        if near:
            raise MeshError(f"the header has a key {key[:40]} (did you mean '{near[0]}'?): is it damaged? {SAVE_ANEW}")
        header[key] = value
    if header.get("ObjectType", "Image") != "Image":
        raise MeshError(f"ObjectType is {header['ObjectType'][:40]}: expected Image")
    return header, begin


def _stored(folder: Path, header: dict[str, str], local: bytes) -> list[bytes]:
    """Return the stored voxels: after the header, or in one or several other files of the folder."""
    name = header["ElementDataFile"]
    if name.upper() in ("LOCAL", "LOCAL_DATA"):
        return [local]
    if re.fullmatch(r"LIST(\s+\d+)?(\s*D)?", name, re.IGNORECASE):
        names = [line.strip() for line in local.decode("utf-8", errors="replace").splitlines() if line.strip()]
        return [data_beside(folder, one) for one in names]
    if "%" in name:
        raise MeshError(f"ElementDataFile is a pattern, '{name[:40]}': list the files (ElementDataFile = LIST)")
    return [data_beside(folder, name)]


def _values(header: dict[str, str], stored: list[bytes], dtype: np.dtype[Any], shape: tuple[int, ...]) -> Values:
    if _is(header, "CompressedData"):
        return _inflated(header, stored, dtype, shape)
    if "BinaryData" in header and not _is(header, "BinaryData"):
        return text_values(b"\n".join(stored), dtype, shape)
    skip = numbers(header.get("HeaderSize", "0"), 1, "HeaderSize")[0]
    if skip == -1:  # the voxels are at the end of the file
        size = n_voxels(shape) * dtype.itemsize // max(len(stored), 1)
        stored = [data[max(0, len(data) - size) :] for data in stored]
    elif skip >= 0:
        stored = [data[int(skip) :] for data in stored]
    else:
        raise MeshError(f"HeaderSize is {skip:g}: expected -1, or a number of bytes from 0; {SAVE_ANEW}")
    return raw_values(b"".join(stored), dtype, shape)


def _inflated(header: dict[str, str], stored: list[bytes], dtype: np.dtype[Any], shape: tuple[int, ...]) -> Values:
    if len(stored) != 1:
        raise MeshError("compressed voxels in several files are not supported: save them into one file, .mha")
    data = stored[0]
    size = counts(header.get("CompressedDataSize", str(len(data))), 1, "CompressedDataSize")[0]
    if size != len(data):
        raise MeshError(f"CompressedDataSize is {size}, {len(data)} bytes are there: is it truncated? {SAVE_ANEW}")
    return inflated_values(data, dtype, shape, "zlib")


def _first(header: dict[str, str], keys: tuple[str, ...], default: str) -> str:
    return next((header[key] for key in keys if key in header), default)


def _is(header: dict[str, str], key: str) -> bool:
    text = header.get(key, "False")
    if text.upper() not in ("TRUE", "FALSE", "1", "0"):
        raise MeshError(f"{key} is '{text[:40]}': expected True or False; {SAVE_ANEW}")
    return text.upper() in ("TRUE", "1")
