"""Meshes that other programs wrote: gmsh .msh, Abaqus and CalculiX .inp, VTK .vtu and .vtk."""

import math
from collections.abc import Callable
from pathlib import Path

from truespring.errors import MeshError
from truespring.mesh.files.contents import Contents
from truespring.mesh.files.gmsh import read_msh
from truespring.mesh.files.inp import is_inp, read_inp
from truespring.mesh.files.vtk import read_vtk
from truespring.mesh.files.vtu import read_vtu
from truespring.mesh.mesh import Mesh
from truespring.opening import read_file

Reader = Callable[[bytes, Path], Contents]


def _alone(read: Callable[[bytes], Contents]) -> Reader:
    """Return a reader of files that name no others."""
    return lambda data, file: read(data)


# By suffix: from what a file holds, and where it lies.
_READERS: dict[str, Reader] = {
    ".msh": _alone(read_msh),
    ".inp": read_inp,
    ".vtu": _alone(read_vtu),
    ".vtk": _alone(read_vtk),
}


def read_mesh(file: str | Path, scale: float = 1.0) -> Mesh:
    """Read a mesh file; its suffix tells the format, but a deck of Abaqus or CalculiX is known by what it holds.

    .msh: gmsh 2 to 2.2 and 4.1, text and binary. Physical groups become groups; one without a name is
    called by its number. .inp: Abaqus and CalculiX, with parts, instances and included files in the deck's
    folder or below. NSET, ELSET and SURFACE become groups, in their first spelling: those of the assembly by
    their name, those of an instance as INSTANCE.NAME, and by their name where no other scope has it; an NSET
    stands before an ELSET of one name where nodes are asked for. Elements that no body is made of are left
    out. .vtu and .vtk (DATASET UNSTRUCTURED_GRID): an integer array of the cells with at most
    64 values becomes groups named ARRAY-VALUE, of the cells of the highest dimension that have the value;
    an integer array of the points that holds 0 and 1 becomes the group ARRAY, of the points with 1.

    The elements of the highest dimension are the body, in the file's order; cells of a lower one only
    carry groups. A group of elements is one of their nodes, too; where several have one name, the nodes
    are united. Cells of second order become their corners, elements that all are inverted are mirrored,
    nodes without an element are left out: the mesh's notes say so. A plane body loses its z.

    Args:
        file: the mesh file.
        scale: the file's unit of length [m].

    Returns the mesh, with its groups and notes. Raises MeshError, with the file and, of a text, the line,
    where the file cannot be read, is damaged or cut off, or holds no body of one kind of element.
    A .inp or .vtk file has no end mark: one that was cut off between two lines may pass, the former
    mostly with a note on nodes that no element has.
    """
    file = Path(file)
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise MeshError(f"{file}: a mesh file ends in {', '.join(_READERS)}, not in '{file.suffix}'")
    if not (math.isfinite(scale) and scale > 0):
        raise MeshError(f"{file}: scale = {scale:g} is no length of the file's unit in metres: it must be above 0")
    data = _bytes(file)
    try:
        return (read_inp if is_inp(data) else reader)(data, file).mesh(scale)
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from None


def _bytes(file: Path) -> bytes:
    data = read_file(file, MeshError).removeprefix(b"\xef\xbb\xbf")  # some editors mark UTF-8 by that
    if not data.strip():
        raise MeshError(f"{file} is empty")
    return data
