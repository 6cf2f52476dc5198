"""Read label images in the NRRD format: .nrrd, .nhdr with the voxels in another file, .seg.nrrd of 3D Slicer.

Source: https://teem.sourceforge.net/nrrd/format.html; of segmentations
https://slicer.readthedocs.io/en/latest/developer_guide/modules/segmentations.html: overlapping segments are
layers along a first axis of kind "list".
"""

import binascii
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from truespring.arrays import Floats
from truespring.errors import MeshError
from truespring.mesh.files.labels import Labels, Segment
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

# NumPy codes, with the names of each type.
_NAMES = {
    "i1": "signed char, int8, int8_t",
    "u1": "uchar, unsigned char, uint8, uint8_t",
    "i2": "short, short int, signed short, signed short int, int16, int16_t",
    "u2": "ushort, unsigned short, unsigned short int, uint16, uint16_t",
    "i4": "int, signed int, int32, int32_t",
    "u4": "uint, unsigned int, uint32, uint32_t",
    "i8": "longlong, long long, long long int, signed long long, signed long long int, int64, int64_t",
    "u8": "ulonglong, unsigned long long, unsigned long long int, uint64, uint64_t",
    "f4": "float",
    "f8": "double",
}
_TYPES = {name: code for code, names in _NAMES.items() for name in names.split(", ")}
_METHODS = {"gzip": "gzip", "gz": "gzip", "bzip2": "bzip2", "bz2": "bzip2"}
_TEXTS = ("text", "txt", "ascii")
_ENCODINGS = ("raw", "hex", *_TEXTS, *_METHODS)
# Signs of the axes of each space, as in ITK: axes that point right or anterior are reversed.
_SPACES = {
    **{"right-anterior-superior": (-1.0, -1.0), "ras": (-1.0, -1.0), "scanner-xyz": (1.0, 1.0)},
    **{"left-anterior-superior": (1.0, -1.0), "las": (1.0, -1.0)},
    **{"left-posterior-superior": (1.0, 1.0), "lps": (1.0, 1.0)},
}
# All fields of the format: any other field is an error.
_FIELDS = {
    *("dimension", "type", "encoding", "endian", "content", "min", "max", "old min", "old max", "data file"),
    *("line skip", "byte skip", "number", "block size", "sample units", "sizes", "spacings", "thicknesses"),
    *("axis mins", "axis maxs", "centers", "labels", "units", "kinds", "space", "space dimension", "space units"),
    *("space origin", "space directions", "measurement frame"),
}
_SPELLINGS = {
    **{"centerings": "centers", "datafile": "data file", "lineskip": "line skip", "byteskip": "byte skip"},
    **{"blocksize": "block size", "axismins": "axis mins", "axismaxs": "axis maxs", "oldmin": "old min"},
    **{"oldmax": "old max", "sampleunits": "sample units"},
}
_VECTOR = r"\([^()]*\)"
_LONGEST = 2**22  # the longest header [bytes]: Slicer writes hundreds of segments into it


def read_nrrd(file: Path) -> Labels:
    """Read a .nrrd, .nhdr or .seg.nrrd file; raise MeshError if it is damaged or not supported."""
    data = read_file(file, MeshError)
    fields, keys, begin = _header(data)
    n_axes = counts(_required(fields, "dimension"), 1, "dimension")[0]
    sizes = counts(_required(fields, "sizes"), n_axes, "sizes")
    kind = _required(fields, "type").lower()
    if kind not in _TYPES:
        raise MeshError(f"voxels of type '{kind[:40]}' are no labels: save them as integers of 8 or 16 bits")
    dtype = np.dtype(_TYPES[kind])
    if dtype.itemsize > 1 and fields.get("encoding", "").lower() not in _TEXTS:
        dtype = dtype.newbyteorder(_endian(_required(fields, "endian")))
    refuse_large(sizes, dtype)
    values = _values(fields, _stored(file.parent, fields, data[begin:]), dtype, sizes)
    is_place = _axes_in_space(fields, sizes)
    spacing, origin, direction = _places(fields, is_place)
    # The axis of layers, if any, becomes the last one.
    values = np.moveaxis(values, np.flatnonzero(~is_place), range(int(is_place.sum()), n_axes))
    return Labels(values, spacing, origin, direction, segments=_segments(keys))


def _header(data: bytes) -> tuple[dict[str, str], dict[str, str], int]:
    """Return the fields, the key-value pairs, and the length of the header, which ends with a blank line [bytes]."""
    if not re.match(rb"NRRD000[1-9]\r?\n", data):
        raise MeshError(f"this is no NRRD image: it must begin with NRRD and the version of the format; {SAVE_ANEW}")
    fields: dict[str, str] = {}
    keys: dict[str, str] = {}
    begin = data.index(b"\n") + 1
    while begin < len(data):
        end = data.find(b"\n", begin, _LONGEST) + 1
        if not end:
            raise MeshError(f"its header is truncated; {SAVE_ANEW}")
        line = data[begin:end].decode("utf-8", errors="replace").rstrip("\r\n")
        begin = end
        if not line:
            return fields, keys, begin
        if line.startswith("#"):
            continue
        field, sign, value = line.partition(": ")
        name = _SPELLINGS.get(field.strip().lower(), field.strip().lower())
        if sign and name in _FIELDS:
            if name in fields:
                raise MeshError(f"the header has '{name}' twice; {SAVE_ANEW}")
            fields[name] = value.strip()
            if name == "data file" and value.split()[:1] == ["LIST"]:
                return fields, keys, begin
            continue
        key, sign, value = line.partition(":=")
        if not sign:
            raise MeshError(f"the header has a line '{line[:40]}', which is no field of NRRD; {SAVE_ANEW}")
        keys[key.strip()] = value.strip()
    if "data file" not in fields:
        raise MeshError(f"its header is truncated: a blank line must end it, before the voxels; {SAVE_ANEW}")
    return fields, keys, len(data)


def _required(fields: Mapping[str, str], name: str) -> str:
    if name not in fields:
        raise MeshError(f"its header has no field '{name}'; {SAVE_ANEW}")
    return fields[name]


def _endian(text: str) -> Literal["<", ">"]:
    if text.lower() not in ("little", "big"):
        raise MeshError(f"endian is '{text[:40]}': expected little or big; {SAVE_ANEW}")
    return "<" if text.lower() == "little" else ">"


def _stored(folder: Path, fields: Mapping[str, str], behind: bytes) -> bytes:
    """Return the stored voxels, without the lines to skip."""
    name = fields.get("data file")
    if name is None:
        data = behind
    elif name.split()[:1] == ["LIST"]:
        names = [line.strip() for line in behind.decode("utf-8", errors="replace").splitlines() if line.strip()]
        return b"".join(_skipped(fields, data_beside(folder, one)) for one in names)
    elif "%" in name:
        raise MeshError(f"'data file' is a pattern, '{name[:40]}': list the files (data file: LIST)")
    else:
        data = data_beside(folder, name)
    return _skipped(fields, data)


def _skipped(fields: Mapping[str, str], data: bytes) -> bytes:
    begin, n_lines = 0, counts(fields.get("line skip", "0"), 1, "line skip")[0]
    for number in range(n_lines):
        end = data.find(b"\n", begin)
        if end < 0:
            raise MeshError(f"'line skip' is {n_lines}, there are {number} lines; {SAVE_ANEW}")
        begin = end + 1
    return data[begin:]


def _values(fields: Mapping[str, str], data: bytes, dtype: np.dtype[Any], sizes: tuple[int, ...]) -> Values:
    encoding = _required(fields, "encoding").lower()
    if encoding not in _ENCODINGS:
        raise MeshError(f"the encoding '{encoding[:40]}' is not supported; supported: {', '.join(_ENCODINGS)}")
    skip = int(numbers(fields.get("byte skip", "0"), 1, "byte skip")[0])
    if encoding in _METHODS:
        if skip < 0:
            raise MeshError("'byte skip' below 0 is allowed for the encoding raw only")
        return inflated_values(data, dtype, sizes, _METHODS[encoding], skip)
    if skip == -1:
        skip = max(0, len(data) - n_voxels(sizes) * dtype.itemsize)
    data = data[skip:] if skip >= 0 else b""
    if encoding in _TEXTS:
        return text_values(data, dtype, sizes)
    if encoding == "hex":
        try:
            data = binascii.unhexlify(b"".join(data.split()))
        except ValueError as error:
            raise MeshError(f"its voxels are damaged ({error}); {SAVE_ANEW}") from None
    return raw_values(data, dtype, sizes)


def _axes_in_space(fields: Mapping[str, str], sizes: tuple[int, ...]) -> Any:
    """Return which axes are spatial, shape (n_axes,): the others have no direction, or are of kind list."""
    is_place = np.ones(len(sizes), dtype=bool)
    if "space directions" in fields:
        words = re.findall(rf"none|{_VECTOR}", fields["space directions"])
        if len(words) != len(sizes) or "".join("".join(words).split()) != "".join(fields["space directions"].split()):
            raise MeshError(f"'space directions' has {len(words)} axes, there are {len(sizes)}; {SAVE_ANEW}")
        is_place = np.array([word != "none" for word in words])
    elif len(sizes) > 3 and "kinds" in fields:
        words = fields["kinds"].lower().split()
        is_place = np.array([word in ("domain", "space", "none", "???") for word in words])
    if is_place.shape != (len(sizes),) or is_place.sum() != min(3, len(sizes)) or len(sizes) > 4:
        raise MeshError(f"the image has {len(sizes)} axes, {int(is_place.sum())} in space: expected three")
    return is_place


def _places(fields: Mapping[str, str], is_place: Any) -> tuple[Floats, Floats, Floats]:
    """Return spacing, origin and direction in LPS, shapes (3,), (3,) and (3, 3)."""
    dim = int(is_place.sum())
    signs = np.ones(dim)
    space = fields.get("space", "").lower()
    if space in _SPACES:
        signs[: min(dim, 2)] = _SPACES[space][:dim]
    elif space:
        raise MeshError(
            f"the space '{space[:40]}' is not supported; supported: "
            f"{', '.join(name for name in _SPACES if '-' in name)}"
        )
    if "space directions" in fields:
        axes = np.array([_vector(text, dim) for text in re.findall(_VECTOR, fields["space directions"])]).T
        spacing = np.linalg.norm(axes, axis=0)
        direction = signs[:, None] * axes / np.where(spacing > 0, spacing, 1.0)
    else:
        given = fields.get("spacings", " ".join(["1"] * len(is_place))).split()
        if len(given) != len(is_place):
            raise MeshError(f"'spacings' has {len(given)} numbers, there are {len(is_place)} axes; {SAVE_ANEW}")
        own = [text for text, is_one in zip(given, is_place, strict=True) if is_one]
        spacing = np.array(numbers(" ".join("1" if text.lower() == "nan" else text for text in own), dim, "spacings"))
        direction = np.diag(signs)
    if "space origin" in fields:
        origin = signs * _vector(fields["space origin"], dim)
    elif "axis mins" in fields and "nan" not in fields["axis mins"].lower():
        # Without "centers: node", an axis begins at the border of its first voxel.
        centers = fields.get("centers", "").lower().split() or ["cell"] * len(is_place)
        half = np.array([0.0 if center == "node" else 0.5 for center in centers])
        if len(half) != len(is_place):
            raise MeshError(f"'centers' has {len(half)} words, there are {len(is_place)} axes; {SAVE_ANEW}")
        origin = np.array(numbers(fields["axis mins"], len(is_place), "axis mins"))[is_place]
        origin = origin + half[is_place] * spacing
    else:
        origin = np.zeros(dim)
    return spacing, origin, direction


def _vector(text: str, dim: int) -> Floats:
    if not re.fullmatch(rf"{_VECTOR}", text):
        raise MeshError(f"'{text[:40]}' is no vector, such as (1,0,0); {SAVE_ANEW}")
    return np.array(numbers(text[1:-1].replace(",", " "), dim, text))


def _segments(keys: Mapping[str, str]) -> tuple[Segment, ...]:
    """Return the segments of 3D Slicer: Segment0_Name, Segment0_LabelValue, Segment0_Layer."""
    found = []
    numbered = sorted({int(read[1]) for key in keys if (read := re.match(r"Segment(\d{1,6})_", key))})
    for number in numbered:
        given = {part: keys.get(f"Segment{number}_{part}", "") for part in ("Name", "ID", "LabelValue", "Layer")}
        value, layer = given["LabelValue"] or str(number + 1), given["Layer"] or "0"
        if not (re.fullmatch(r"-?\d{1,9}", value) and re.fullmatch(r"\d{1,4}", layer)):
            raise MeshError(
                f"Segment{number} has LabelValue '{value[:20]}' and Layer '{layer[:20]}': expected integers"
            )
        found.append(Segment(given["Name"] or given["ID"] or f"Segment{number}", int(layer), int(value)))
    return tuple(found)
