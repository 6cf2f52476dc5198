"""A file of every format that is read: written by its program where that is here, else by us or shipped in tests/data.

A new format needs nothing here where a file `sample` with its suffix lies in tests/data.
"""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.ccx_decks import element_deck, run
from tests.test_images import ball
from tests.test_vtk_files import bar, moved, rectilinear, structured
from truespring.mesh.files.stl import stl_bytes

DATA = Path(__file__).parent / "data"
Sample = Callable[[Path, str], Path]


def _shipped(folder: Path, suffix: str, name: str = "sample") -> Path:
    return Path(shutil.copyfile(DATA / f"{name}{suffix}", folder / f"sample{suffix}"))


def _vtk(folder: Path, suffix: str) -> Path:
    """Written by VTK, with a displacement that is linear in the places."""
    import pyvista as pv

    plane = pv.Plane(i_size=4, j_size=2, i_resolution=4, j_resolution=2)
    plane.point_data.clear()
    plane.points = plane.points.astype(float)
    plane.point_data["displacement"] = moved(np.asarray(plane.points))
    own = {".vtp": lambda: plane, ".vts": structured, ".vtr": rectilinear}.get(suffix, bar)()
    own.save(folder / f"sample{suffix}", binary=suffix != ".vtk")
    return folder / f"sample{suffix}"


def _pieces(folder: Path, suffix: str) -> Path:
    """A file that names one of VTK's."""
    piece = _vtk(folder, f".{suffix[2:]}")
    kind = {".pvtu": "UnstructuredGrid", ".pvtp": "PolyData", ".pvts": "StructuredGrid", ".pvtr": "RectilinearGrid"}
    name = f"P{kind[suffix]}"
    text = f'<VTKFile type="{name}"><{name}><Piece Source="{piece.name}"/></{name}></VTKFile>\n'
    (folder / f"sample{suffix}").write_text(text)
    return folder / f"sample{suffix}"


def _series(folder: Path, suffix: str) -> Path:
    piece = _vtk(folder, ".vtu")
    text = f'<VTKFile type="Collection"><Collection><DataSet timestep="1" file="{piece.name}"/></Collection></VTKFile>'
    (folder / "sample.pvd").write_text(text)
    return folder / "sample.pvd"


def _vtkhdf(folder: Path, suffix: str) -> Path:
    bar().save(folder / "sample.vtkhdf")
    return folder / "sample.vtkhdf"


def _calculix(folder: Path, suffix: str) -> Path:
    """Run by CalculiX, or skipped without it."""
    if shutil.which("ccx") is None:
        pytest.skip("CalculiX (ccx) is not installed")
    return run(element_deck("C3D8"), folder, "sample").with_suffix(suffix)


def _ansys(folder: Path, suffix: str) -> Path:
    pytest.importorskip("ansys.mapdl.reader")
    from ansys.mapdl.reader import examples

    return Path(shutil.copyfile(examples.rstfile, folder / "sample.rst"))


def _markers(folder: Path, suffix: str) -> Path:
    rows = ["marker,x [mm],y [mm],ux [mm],uy [mm]", *(f"m{n},{n},{2 * n},{0.125 * n},-0.25" for n in range(9)), ""]
    (folder / "sample.csv").write_text("\n".join(rows))
    return folder / "sample.csv"


def _surface(folder: Path, suffix: str) -> Path:
    """Deformed, beside `rest.stl`."""
    from truespring.mesh import box

    points = box((2.0, 1.0, 1.0), (1, 1, 1))
    facets = points.nodes[points.boundary][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    (folder / "rest.stl").write_bytes(stl_bytes(facets))
    (folder / "sample.stl").write_bytes(stl_bytes(facets + moved(facets.reshape(-1, 3)).reshape(-1, 3, 3)))
    return folder / "sample.stl"


_VTK: dict[str, Sample] = {
    **dict.fromkeys((".vtu", ".vtk", ".vtp", ".vts", ".vtr"), _vtk),
    **dict.fromkeys((".pvtu", ".pvtp", ".pvts", ".pvtr"), _pieces),
}
_MESHES: dict[str, Sample] = {
    **_VTK,
    ".msh": lambda folder, suffix: _shipped(folder, suffix, "block_41"),
    ".inp": lambda folder, suffix: _shipped(folder, suffix, "block"),
}
_RESULTS: dict[str, Sample] = {
    **_VTK,
    ".pvd": _series,
    ".vtkhdf": _vtkhdf,
    ".frd": _calculix,
    ".dat": _calculix,
    ".rst": _ansys,
    ".csv": _markers,
    ".stl": _surface,
}


def mesh_sample(folder: Path, suffix: str) -> Path:
    """Write a mesh file with a suffix into a folder."""
    return _MESHES.get(suffix, _shipped)(folder, suffix)


def result_sample(folder: Path, suffix: str) -> Path:
    """Write a result file with a suffix into a folder; STL has its body at rest beside it."""
    return _RESULTS.get(suffix, _shipped)(folder, suffix)


def image_sample(folder: Path, suffix: str) -> Path:
    """Write a label image with a suffix into a folder."""
    if (DATA / f"sample{suffix}").exists():
        return _shipped(folder, suffix)
    return ball(folder, suffix, compressed=suffix == ".nii.gz")
