"""Meshes that other programs wrote: gmsh .msh, Abaqus and CalculiX .inp, VTK .vtu and .vtk.

These formats are read by code of this package, without meshio, gmsh's own library or VTK. meshio is unmaintained
and drops what problems are stated with: the surfaces, parts and instances of .inp, and all but the last group of an
element. VTK and gmsh are large binary packages, which a plain installation does without; VTK logs damage and returns
what it has read so far. The readers here name the line or byte of a fault, count what they leave out, and are tested
on files that those programs wrote.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from truespring.deprecation import renamed_argument
from truespring.errors import MeshError
from truespring.mesh.files.contents import Contents
from truespring.mesh.files.gmsh import read_msh
from truespring.mesh.files.heads import Recognises, foreign, format_by_head, is_inp, is_msh, listed_keys, read_as
from truespring.mesh.files.inp import read_inp
from truespring.mesh.files.vtk_file import VTK_FORMATS, read_vtk
from truespring.mesh.mesh import Mesh
from truespring.opening import read_file
from truespring.units import unit_of

Reader = Callable[[bytes, Path], Contents]


def _alone(read: Callable[[bytes], Contents]) -> Reader:
    """Return a reader of files that name no others."""
    return lambda data, folder: read(data)


class Format(NamedTuple):
    """A format of mesh files.

    Attributes:
        recognises: whether a file begins as those of the format do.
        read: returns the contents of a file from its bytes and the folder that it lies in.
        again: how a file that cannot be read may be mended, in a sentence; empty where nothing is known.
        unnoticed: why a truncated file may pass for a whole one, and where; empty where any truncation is an error.
    """

    recognises: Recognises
    read: Reader
    again: str = ""
    unnoticed: str = ""


_GMSH = "if gmsh reads it, save it again: gmsh FILE -0 -format msh41 -o NEW.msh"
_PARAVIEW = "if ParaView reads it, save it again there as an unstructured grid, .vtu"

#: By suffix in small letters; of a file that several recognise the one with its suffix counts, else the first.
FORMATS: MappingProxyType[str, Format] = MappingProxyType(
    {
        ".msh": Format(is_msh, _alone(read_msh), _GMSH),
        ".inp": Format(is_inp, read_inp, unnoticed="a deck has no end mark: truncated between two lines it is shorter"),
        **{suffix: Format(recognises, read_vtk, _PARAVIEW) for suffix, recognises in VTK_FORMATS.items()},
        ".vtk": Format(
            VTK_FORMATS[".vtk"],
            read_vtk,
            _PARAVIEW,
            unnoticed="a legacy file has no end mark: truncated between two arrays it has fewer groups",
        ),
    }
)


@renamed_argument("scale", "unit")
def read_mesh(file: str | Path, unit: str | float = "m", join: bool | None = None) -> Mesh:
    """Read a mesh file; its content tells the format, else its suffix.

    .msh: gmsh 1, 2 to 2.2, 4.0 and 4.1, text and binary. Physical groups become groups; one without a name is
    called by its number. .inp: Abaqus and CalculiX, with parts, instances and included files in the deck's
    folder or below. NSET, ELSET and SURFACE become groups, in their first spelling: those of the assembly by
    their name, those of an instance as INSTANCE.NAME, and by their name where no other scope has it; an NSET
    stands before an ELSET of one name where nodes are asked for. Elements that no body is made of are left
    out. VTK (.vtk, .vtu, .vtp, .vts, .vtr, and .pvtu and the like with their pieces beside them):
    grids, faces and lattices; pieces are joined where their points coincide. An integer array of the cells with at most
    64 values becomes groups named ARRAY-VALUE, of the cells of the highest dimension that have the value;
    an integer array of the points that holds 0 and 1 becomes the group ARRAY, of the points with 1.

    The elements of the highest dimension are the body, in the file's order; cells of a lower one only
    carry groups: those of one dimension less are facets of the elements that they bound. A group of
    elements or facets is one of their nodes, too; where several have one name, the nodes are united.
    Cells of second order become their corners, bricks with corners that are one node wedges, pyramids or
    simplices, inverted elements are mirrored, nodes without an element are left out: the mesh's notes say
    so. A plane body loses its z.

    Args:
        file: the mesh file.
        unit: the file's unit of length, such as "mm", or "0.2 mm" where one of its is so long; a number is in metres.
        join: whether nodes that stand at one place become one; by default where no two elements share a node.

    Returns the mesh, with its groups and notes. Raises MeshError, with the file and, of a text, the line,
    where the file cannot be read, is damaged or cut off, or holds no body.
    A .inp or .vtk file has no end mark: one that was cut off between two lines may pass, the former
    mostly with a note on nodes that no element has.
    """
    file = Path(file)
    scale = unit_of(unit, "length", f"{file}: unit", MeshError)
    data = _bytes(file)
    key = format_by_head(file.suffix, data, {suffix: form.recognises for suffix, form in FORMATS.items()})
    if key is None:
        raise MeshError(
            f"{file}: a mesh file ends in {', '.join(FORMATS)}, not in '{file.suffix}', and what this one begins with "
            f"is none of these formats: {foreign(data) or 'convert it, for example: meshio convert FILE NEW.vtu'}"
        )
    form = FORMATS[key]
    try:
        contents = form.read(data, file.parent)
    except MeshError as error:
        other = "" if form.recognises(data) else foreign(data)
        if other:
            raise MeshError(f"{file}: this is no {key} file: {other}") from None
        others = "" if form.recognises(data) else f"it does not begin like {listed_keys(FORMATS, key)} either"
        raise MeshError("; ".join(filter(None, [f"{file}: {error}", others, form.again]))) from None
    try:
        return replace(contents, notes=(*read_as(key, file.suffix), *contents.notes)).mesh(scale, join)
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from None


def _bytes(file: Path) -> bytes:
    data = read_file(file, MeshError).removeprefix(b"\xef\xbb\xbf")  # some editors mark UTF-8 by that
    if not data.strip():
        raise MeshError(f"{file} is empty")
    return data
