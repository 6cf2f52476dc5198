"""Shapes of modes as VTU files for ParaView."""

from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

from truespring.arrays import in_space
from truespring.mesh.files.vtu_writing import write_vtu
from truespring.potential import Visible
from truespring.vibration.result import Modes


def write_shapes(modes: Modes, chosen: Sequence[int], folder: Path, name: str) -> None:
    """Write NAME.pvd, whose times are the numbers of modes, and one .vtu for each of the `chosen` into the folder NAME.

    Points are undeformed; `shape` is the displacement, largest component 1 [-], for ParaView's "Warp By Vector".
    """
    mesh = modes.problem.mesh
    cells = modes.potential.cells if isinstance(modes.potential, Visible) else mesh.cells
    (folder / name).mkdir(parents=True, exist_ok=True)
    entries = []
    for mode in chosen:
        file = folder / name / f"{name}_{mode + 1:04d}.vtu"
        write_vtu(file, mesh.nodes, cells.items(), {"shape": in_space(modes.shapes[mode])})
        entries.append(f'<DataSet timestep="{mode + 1}" file={quoteattr(f"{name}/{file.name}")}/>')
    lines = ['<VTKFile type="Collection" version="0.1">', "<Collection>", *entries, "</Collection>", "</VTKFile>", ""]
    (folder / f"{name}.pvd").write_text("\n".join(lines), encoding="utf-8")
