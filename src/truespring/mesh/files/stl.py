"""Read and write STL files: triangles without connectivity and without a unit, ASCII or binary.

Source of the binary form: 80 bytes of header, the number of facets as uint32, then for each facet a normal, three
vertices as float32 and two bytes of attributes, all little-endian.
"""

import re

import numpy as np

from truespring.arrays import Floats
from truespring.errors import MeshError

_FACET = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84
_MARKS = {b"solid": "s", b"facet": "f", b"vertex": "v", b"endfacet": "F", b"endsolid": "S"}


def parse_stl(data: bytes) -> Floats:
    """Return the vertices of all facets in the file's order [the file's unit], shape (n_facets, 3, 3).

    Raises MeshError if it is no STL file, truncated or damaged; coordinates may be NaN or infinite.
    """
    return _binary(data) if _is_binary(data) else _text(data)


def stl_bytes(facets: Floats) -> bytes:
    """Return a binary STL file of facets, shape (n_facets, 3, 3), with unit normals (0 for facets without area)."""
    across = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    record = np.zeros(len(facets), _FACET)
    record["normal"] = across / np.where(length > 0, length, 1.0)
    record["vertices"] = facets
    return b"truespring".ljust(80) + len(facets).to_bytes(4, "little") + record.tobytes()


def _is_binary(data: bytes) -> bool:
    """Return whether the length is that of a binary file: a binary header may begin with "solid", too."""
    count = int.from_bytes(data[80:_HEADER], "little")
    expected = _HEADER + _FACET.itemsize * count
    if len(data) == expected:
        if not count:
            raise MeshError("the file has no facet")
        return True
    if b"\0" not in data:  # every binary file contains a zero byte, a text file none
        return False
    if len(data) < _HEADER:
        raise MeshError("this is no STL file, or it is truncated in its header")
    state = "truncated, or no STL file" if len(data) < expected else "damaged, or no STL file"
    raise MeshError(
        f"the file is {state}: a binary STL of the {count:,} facets in its header has {expected:,} bytes, "
        f"this file has {len(data):,}"
    )


def _binary(data: bytes) -> Floats:
    return np.frombuffer(data, _FACET, offset=_HEADER)["vertices"].astype(np.float64)


def _text(data: bytes) -> Floats:
    if not re.match(rb"\s*solid\b", data, re.IGNORECASE):
        raise MeshError("this is no STL file: it does not begin with 'solid'")
    # Names of solids may contain any word.
    data = re.sub(rb"^([ \t]*(?:end)?solid)\b[^\r\n]*", rb"\1", data, flags=re.IGNORECASE | re.MULTILINE)
    words = [word.lower() for word in re.findall(rb"^[ \t]*([a-z]+)\b", data, re.IGNORECASE | re.MULTILINE)]
    _refuse_torn([word for word in words if word in _MARKS])
    n_vertices = words.count(b"vertex")
    rows = re.findall(rb"^[ \t]*vertex((?:[ \t]+[^\s]+){3})[ \t\r]*$", data, re.IGNORECASE | re.MULTILINE)
    if len(rows) != n_vertices:
        raise MeshError(f"{n_vertices - len(rows)} of {n_vertices} vertices do not have three coordinates")
    try:
        return np.array([float(word) for row in rows for word in row.split()]).reshape(-1, 3, 3)
    except ValueError as error:
        raise MeshError(f"a vertex cannot be read ({error})") from None


def _refuse_torn(words: list[bytes]) -> None:
    """Raise MeshError if the keywords of a text file do not form complete solids of complete facets."""
    n_facets = words.count(b"facet")
    if not n_facets:
        raise MeshError("the file has no facet")
    expected = {b"vertex": 3 * n_facets, b"endfacet": n_facets, b"endsolid": words.count(b"solid")}
    lines = ", ".join(f"{words.count(word)} of {count} '{word.decode()}'" for word, count in expected.items())
    marks = "".join(_MARKS[word] for word in words)
    if any(words.count(word) != count for word, count in expected.items()):
        raise MeshError(f"the file is truncated or damaged: it has {lines} lines")
    if marks.replace("fvvvF", "").replace("sS", ""):
        raise MeshError(
            "the file is damaged: its facets, each of three vertices, and its solids do not follow in order"
        )
