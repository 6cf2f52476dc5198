"""Recognise the format of a file by its first bytes, else by its suffix."""

import re
from collections.abc import Callable, Iterable, Mapping

#: Returns whether a file that begins with the given bytes has a certain format.
Recognises = Callable[[bytes], bool]

#: The number of bytes to look at: enough for every format, except a deck that begins with a long comment.
HEAD = 1 << 16


def format_by_head(suffix: str, head: bytes, formats: Mapping[str, Recognises]) -> str | None:
    """Return the key of the format of a file that begins with `head`, None if neither content nor suffix is known.

    `formats` are by suffix in lower case. If several fit, the one with the file's suffix is used, else the first.
    """
    head = head.removeprefix(b"\xef\xbb\xbf")  # UTF-8 byte order mark, written by some editors
    fitting = [key for key, recognises in formats.items() if recognises(head)]
    if suffix.lower() in fitting or (not fitting and suffix.lower() in formats):
        return suffix.lower()
    return fitting[0] if fitting else None


def read_as(key: str, suffix: str) -> tuple[str, ...]:
    """Return a note if the format `key` of a file differs from its suffix, else nothing."""
    ending = f"although its name ends in '{suffix}'" if suffix else "although its name has no suffix"
    return (f"read as a {key} file by its content, {ending}",) if key != suffix.lower() else ()


def listed_keys(formats: Iterable[str], without: str) -> str:
    """Return a text that lists the formats except `without`."""
    others = [key for key in formats if key != without]
    return f"{', '.join(others[:-1])} or {others[-1]} files"


def is_msh(head: bytes) -> bool:
    """Return whether a file begins as a gmsh mesh, after comments."""
    return bool(re.match(rb"(?:\s*\$Comments.*?\$EndComments)?\s*\$(?:MeshFormat|NOD)\s", head, re.DOTALL))


def is_inp(head: bytes) -> bool:
    """Return whether a file begins as a deck of Abaqus or CalculiX: with a keyword, after comments."""
    return b"\0" not in head and bool(re.match(rb"(?:\s*\*\*[^\n]*\n)*\s*\*[ \t]*[A-Za-z]", head))


def is_vtk(head: bytes) -> bool:
    """Return whether a file begins as a legacy VTK file."""
    return bool(re.match(rb"# vtk DataFile", head, re.IGNORECASE))


def is_vtk_xml(*kinds: str) -> Recognises:
    """Return a function that recognises VTK XML files of the given types, such as "UnstructuredGrid"."""
    before = rb"\s*(?:<\?xml[^>]*>\s*)?(?:<!--(?:(?!-->).)*-->\s*)*<VTKFile\b[^>]*?"
    names = "|".join(kinds).encode()
    form = re.compile(before + rb"\btype\s*=\s*[\"'](?:" + names + rb")[\"']", re.DOTALL)
    return lambda head: bool(form.match(head))


def foreign(data: bytes) -> str:
    """Return what a file of an unsupported format is and how to convert it to a mesh; empty if unknown."""
    if data.startswith((b"\x1f\x8b", b"PK\x03\x04")):
        return "it is compressed: decompress it (gunzip, unzip) and use the result"
    is_stl = len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little")
    if is_stl or re.match(rb"\s*(?:solid\b.*?\bfacet\s|ply\s|OFF\s)", data[:HEAD], re.DOTALL):
        return (
            "it contains a surface (as .stl, .ply and .off do), not a body: fill it by a mesher such as gmsh or "
            "fTetWild with tetrahedra"
        )
    return ""
