"""Deformed bodies as files: a VTU series for ParaView and an STL of the last state."""

from pathlib import Path as FilePath
from xml.sax.saxutils import quoteattr

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.equilibrium import Path, State
from truespring.potential import Visible


def write_series(path: Path, folder: FilePath, name: str) -> None:
    """Write NAME.pvd and, in the folder NAME beside it, one .vtu a state; SI units.

    Points carry displacement and reaction; cells what their potential tells: tension, stretch and
    strain energy of springs, stress and strain energy of elements. A state that is no equilibrium
    (Path.best) is left out.
    """
    levels = folder / name
    levels.mkdir(parents=True, exist_ok=True)
    for old in levels.glob(f"{name}_*.vtu"):
        old.unlink()
    entries = []
    for number, state in enumerate(path.states):
        file = levels / f"{name}_{number:04d}.vtu"
        _write_state(path, state, file)
        entries.append(f'<DataSet timestep="{state.load_factor!r}" file={quoteattr(f"{name}/{file.name}")}/>')
    collection = "\n".join(['<VTKFile type="Collection" version="0.1">', "<Collection>", *entries])
    (folder / f"{name}.pvd").write_text(f"{collection}\n</Collection>\n</VTKFile>\n", encoding="utf-8")


def _write_state(path: Path, state: State, file: FilePath) -> None:
    import meshio

    mesh = path.problem.mesh
    visible = path.potential if isinstance(path.potential, Visible) else None
    kind, cells = visible.cells if visible else (mesh.kind.vtk, mesh.elements)
    fields = visible.cell_fields(state.positions) if visible else {}
    meshio.Mesh(
        _in_space(mesh.nodes + state.displacement),
        [(kind, cells)],
        point_data={"displacement": _in_space(state.displacement), "reaction": _in_space(state.reaction)},
        cell_data={field: [values] for field, values in fields.items()},
    ).write(file, file_format="vtu")


def write_stl(path: Path, file: FilePath) -> None:
    """Write the body of the last state as binary STL [m], in the plane z = 0; nothing where there is no body."""
    import meshio

    if path.surface is not None:
        points, triangles = path.surface.points, path.surface.triangles
    elif path.states and path.problem.mesh.element != "line":
        points, triangles = path.states[-1].positions, _split(path.problem.mesh.elements)
    else:
        return
    meshio.Mesh(_in_space(points), [("triangle", triangles)]).write(file, file_format="stl", binary=True)


def _split(quadrilaterals: Ints) -> Ints:
    """Each quadrilateral as two triangles, shape (2 n, 3)."""
    return np.concatenate([quadrilaterals[:, [0, 1, 2]], quadrilaterals[:, [0, 2, 3]]])


def _in_space(vectors: Floats) -> Floats:
    """Pad plane vectors with zeros to three components, shape (n, 3)."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))
