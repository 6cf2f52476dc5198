"""Readers of mesh files: gmsh .msh, Abaqus and CalculiX .inp, VTK .vtu and .vtk.

The readers do not use meshio, gmsh's library or VTK. meshio is unmaintained and drops the surfaces, parts and
instances of .inp, and all but the last group of an element. VTK and gmsh are large binary packages; VTK logs damage
and returns what it has read so far. The readers here name the line or byte of an error, count what they leave out,
and are tested on files written by those programs.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
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
from truespring.plugins import Table
from truespring.units import unit_of

Reader = Callable[[bytes, Path], Contents]


def _alone(read: Callable[[bytes], Contents]) -> Reader:
    """Return a Reader that ignores the folder, for formats of a single file."""
    return lambda data, folder: read(data)


class Format(NamedTuple):
    """A format of mesh files.

    Attributes:
        recognises: returns whether the first bytes of a file belong to the format.
        read: returns the contents of a file, given its bytes and its folder.
        again: how to convert a file that cannot be read, in a sentence; empty if unknown.
        unnoticed: where a truncated file reads without an error, and why; empty if any truncation is an error.
    """

    recognises: Recognises
    read: Reader
    again: str = ""
    unnoticed: str = ""


_GMSH = "if gmsh reads it, save it again: gmsh FILE -0 -format msh41 -o NEW.msh"
_PARAVIEW = "if ParaView reads it, save it again there as an unstructured grid, .vtu"

#: The formats by suffix in lower case; if several recognise a file, the one with its suffix is used, else the first.
FORMATS: Table[Format] = Table(
    "truespring.meshes",
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
    },
    Format,
)


@renamed_argument("scale", "unit")
def read_mesh(file: str | Path, unit: str | float = "m", join: bool | None = None) -> Mesh:
    """Read a mesh file; the format is recognised by the content, else by the suffix.

    .msh: gmsh 1, 2 to 2.2, 4.0 and 4.1, text and binary. Physical groups become groups; one without a name is
    named by its number. .inp: Abaqus and CalculiX, with parts, instances and included files in the deck's
    folder or below. NSET, ELSET and SURFACE become groups, in their first spelling: those of the assembly by
    their name, those of an instance as INSTANCE.NAME, and also by NAME if no other scope uses it; if an NSET and
    an ELSET have the same name, the NSET gives the nodes of the group. Elements that do not form a body are left
    out. VTK (.vtk, .vtu, .vtp, .vts, .vtr, and .pvtu and the like with their pieces in the same folder):
    unstructured grids, surfaces and structured grids; pieces are joined where their points coincide. An integer
    cell array with at most 64 values becomes groups named ARRAY-VALUE, of the cells of the highest dimension that
    have the value; an integer point array of values 0 and 1 becomes the group ARRAY, of the points with 1. A cell
    array of three components becomes one of `Mesh.element_vectors`, for the directions of fibres.

    The elements of the highest dimension form the body, in the file's order; cells of a lower dimension only
    define groups: those of one dimension less define facets of the body. Each group of elements or facets
    also defines a group of their nodes; groups of the same name are united. Cells of second order are reduced
    to their corners, bricks with coincident corners become wedges, pyramids or simplices, inverted elements
    are mirrored, and nodes without an element are left out; each change adds a note to the mesh. The z of a
    plane body is dropped.

    Args:
        file: the mesh file.
        unit: the file's unit of length, such as "mm" or "0.2 mm"; a number is in metres.
        join: whether to merge coincident nodes; by default only if no two elements share a node.

    Returns the mesh, with its groups and notes; node positions in metres. Raises MeshError, with the file and the
    line of a text file, if the file cannot be read, is damaged or truncated, or contains no body.
    .inp and .vtk files have no end mark: one truncated between two lines may be read without an error; a .inp
    file then mostly has a note about unreferenced nodes.

    Example:
        >>> import truespring as ts
        >>> study = ts.new("mesh", "own.toml")  # writes own.msh, too
        >>> mesh = ts.read_mesh("own.msh", unit="mm")
        >>> mesh
        Mesh(325 nodes, 1141 elements: tetrahedron)
        >>> sorted(mesh.element_groups)
        ['tissue', 'tumour']
    """
    file = Path(file)
    scale = unit_of(unit, "length", f"{file}: unit", MeshError)
    data = _bytes(file)
    key = format_by_head(file.suffix, data, {suffix: form.recognises for suffix, form in FORMATS.items()})
    if key is None:
        raise MeshError(
            f"{file}: the suffix of a mesh file is {', '.join(FORMATS)}, not '{file.suffix}', and the content of this "
            f"one has none of these formats: {foreign(data) or 'convert it, for example: meshio convert FILE NEW.vtu'}"
        )
    form = FORMATS[key]
    try:
        contents = form.read(data, file.parent)
    except MeshError as error:
        other = "" if form.recognises(data) else foreign(data)
        if other:
            raise MeshError(f"{file}: this is no {key} file: {other}") from None
        others = "" if form.recognises(data) else f"its content does not match {listed_keys(FORMATS, key)} either"
        raise MeshError("; ".join(filter(None, [f"{file}: {error}", others, form.again]))) from None
    try:
        return replace(contents, notes=(*read_as(key, file.suffix), *contents.notes)).mesh(scale, join)
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from None


def _bytes(file: Path) -> bytes:
    data = read_file(file, MeshError).removeprefix(b"\xef\xbb\xbf")  # UTF-8 byte order mark, written by some editors
    if not data.strip():
        raise MeshError(f"{file} is empty")
    return data
