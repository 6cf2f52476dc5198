"""The format of a file, by what it begins with and, where that does not tell, by its suffix."""

import re
from collections.abc import Callable, Iterable, Mapping

#: Tells whether a file that begins with some bytes has a format.
Recognises = Callable[[bytes], bool]

#: As many bytes tell every format but that of a deck behind a long comment.
HEAD = 1 << 16


def format_by_head(suffix: str, head: bytes, formats: Mapping[str, Recognises]) -> str | None:
    """Return the key of the format of a file that begins with `head`, None where neither content nor suffix tells.

    `formats` are by suffix in small letters. Of several that fit the one with the suffix counts, else the first.
    """
    head = head.removeprefix(b"\xef\xbb\xbf")  # some editors mark UTF-8 by that
    fitting = [key for key, recognises in formats.items() if recognises(head)]
    if suffix.lower() in fitting or (not fitting and suffix.lower() in formats):
        return suffix.lower()
    return fitting[0] if fitting else None


def read_as(key: str, suffix: str) -> tuple[str, ...]:
    """Say as what a file was read whose suffix tells something else."""
    ending = f"although its name ends in '{suffix}'" if suffix else "although its name has no ending"
    return (f"read as a {key} file by its content, {ending}",) if key != suffix.lower() else ()


def listed_keys(formats: Iterable[str], without: str) -> str:
    """List the files of other formats than one."""
    others = [key for key in formats if key != without]
    return f"{', '.join(others[:-1])} or {others[-1]} files"


def is_msh(head: bytes) -> bool:
    """Whether a file begins as gmsh's meshes do, behind comments."""
    return bool(re.match(rb"(?:\s*\$Comments.*?\$EndComments)?\s*\$(?:MeshFormat|NOD)\s", head, re.DOTALL))


def is_inp(head: bytes) -> bool:
    """Whether a file begins as decks of Abaqus and CalculiX do: with a keyword, behind comments."""
    return b"\0" not in head and bool(re.match(rb"(?:\s*\*\*[^\n]*\n)*\s*\*[ \t]*[A-Za-z]", head))


def is_vtk(head: bytes) -> bool:
    """Whether a file begins as legacy VTK files do."""
    return bool(re.match(rb"# vtk DataFile", head, re.IGNORECASE))


def is_vtk_xml(*kinds: str) -> Recognises:
    """Return what tells whether a file begins as VTK's XML files of some types do, as "UnstructuredGrid"."""
    before = rb"\s*(?:<\?xml[^>]*>\s*)?(?:<!--(?:(?!-->).)*-->\s*)*<VTKFile\b[^>]*?"
    names = "|".join(kinds).encode()
    form = re.compile(before + rb"\btype\s*=\s*[\"'](?:" + names + rb")[\"']", re.DOTALL)
    return lambda head: bool(form.match(head))


def foreign(data: bytes) -> str:
    """Say what a file of no known format is, and the way from there to a mesh, where what it holds tells; else ""."""
    if data.startswith((b"\x1f\x8b", b"PK\x03\x04")):
        return "it is packed: unpack it (gunzip, unzip), and name what comes out"
    is_stl = len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little")
    if is_stl or re.match(rb"\s*(?:solid\b.*?\bfacet\s|ply\s|OFF\s)", data[:HEAD], re.DOTALL):
        return (
            "it holds a surface (as .stl, .ply and .off do), not a body: let a mesher such as gmsh or fTetWild fill it "
            "with tetrahedra"
        )
    return ""
