"""Read VTK files of any kind: legacy or XML, and parallel XML files with pieces in files of the same folder."""

from collections.abc import Mapping
from pathlib import Path

from truespring.errors import MeshError
from truespring.mesh.files.contents import Contents
from truespring.mesh.files.heads import Recognises, is_vtk, is_vtk_xml
from truespring.mesh.files.vtk import read_legacy_grid
from truespring.mesh.files.vtk_grid import Grid, contents
from truespring.mesh.files.vtk_pieces import one_grid
from truespring.mesh.files.vtu import GRIDS, read_grids, root_of
from truespring.opening import file_beside, read_file

_TYPES = {".vtu": "UnstructuredGrid", ".vtp": "PolyData", ".vts": "StructuredGrid", ".vtr": "RectilinearGrid"}

#: Functions that recognise a file, by suffix: of files that contain a grid, and of parallel files that name its pieces.
VTK_FORMATS: Mapping[str, Recognises] = {
    ".vtu": is_vtk_xml(_TYPES[".vtu"]),
    ".vtk": is_vtk,
    **{suffix: is_vtk_xml(kind) for suffix, kind in _TYPES.items()},
    **{f".p{suffix[1:]}": is_vtk_xml(f"P{kind}") for suffix, kind in _TYPES.items()},
}

# The most pieces of a parallel file.
_MOST_PIECES = 100_000


def read_vtk(data: bytes, folder: Path) -> Contents:
    """Read the contents of a VTK file; its pieces lie in `folder`. Raises MeshError as read_vtk_grid."""
    return contents(read_vtk_grid(data, folder))


def read_vtk_grid(data: bytes, folder: Path) -> Grid:
    """Read the grid of a VTK file with its arrays; raise MeshError if it is damaged or contains no grid."""
    data = data.removeprefix(b"\xef\xbb\xbf")
    if data[:1000].lstrip()[:1] != b"<":
        return read_legacy_grid(data)
    root = root_of(data)
    kind = root.get("type", "")
    if kind in GRIDS:
        return one_grid(read_grids(data))
    if kind[:1] != "P" or kind[1:] not in GRIDS:
        known = ", ".join((*GRIDS, *(f"P{name}" for name in GRIDS)))
        raise MeshError(
            f"a VTKFile of type {kind[:40] or 'none'} is not supported; supported: {known}; in ParaView, Append "
            "Datasets and save it as .vtu"
        )
    names = [piece.get("Source", "") for piece in root.iterfind(f"{kind}/Piece")]
    if not names or len(names) > _MOST_PIECES or len(set(names)) < len(names):
        raise MeshError(f"it names {len(names)} pieces, only {len(set(names))} of them different: name each once")
    return one_grid([grid for name in names for grid in _piece(file_beside(folder, name, MeshError), kind[1:])])


def _piece(file: Path, kind: str) -> list[Grid]:
    try:
        return read_grids(read_file(file, MeshError), kind)
    except MeshError as error:
        message = str(error)
        raise MeshError(message if message.startswith(str(file)) else f"{file.name}: {message}") from None
