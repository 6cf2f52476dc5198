"""Deformed bodies as files: a VTU series for ParaView and an STL of the last state."""

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.comparison import Comparison
from truespring.equilibrium import Solution, State
from truespring.mesh import Mesh, Surface
from truespring.potential import Visible
from truespring.report.surfaces import facets_of, triangles_of

if TYPE_CHECKING:
    import meshio


def write_series(path: Solution, folder: Path, name: str) -> None:
    """Write NAME.pvd and, in the folder NAME beside it, one .vtu a state; SI units.

    Points stand where they were at rest, as is the custom: ParaView's "Warp By Vector" moves them.
    They carry displacement and reaction; cells what their potential tells: tension, stretch,
    stiffness and strain energy of springs, stress and strain energy of elements. Of a path that is
    no more than a surface, the surface. A state that is no equilibrium (Solution.best) is left out.
    """
    levels = folder / name
    levels.mkdir(parents=True, exist_ok=True)
    for old in levels.glob(f"{name}_*.vtu"):
        old.unlink()
    bodies = [(state.load_factor, _state_mesh(path, state)) for state in path.states]
    if not bodies and path.surface is not None:
        bodies = [(path.surface.load_factor, _surface_mesh(path.surface))]
    entries = []
    forwards = all(one[0] < other[0] for one, other in pairwise(bodies))
    for number, (load_factor, body) in enumerate(bodies):
        file = levels / f"{name}_{number:04d}.vtu"
        body.write(file, file_format="vtu")
        entries.append(
            f'<DataSet timestep="{load_factor if forwards else number!r}" file={quoteattr(f"{name}/{file.name}")}/>'
        )
    collection = "\n".join(['<VTKFile type="Collection" version="0.1">', "<Collection>", *entries])
    (folder / f"{name}.pvd").write_text(f"{collection}\n</Collection>\n</VTKFile>\n", encoding="utf-8")


def write_mesh(mesh: Mesh, file: Path, held: Bools | None = None) -> None:
    """Write the body at rest by its elements as VTU [m]; with the directions of nodes that supports hold as 1."""
    import meshio

    fields = {} if held is None else {"held": _in_space(held.astype(float))}
    meshio.Mesh(_in_space(mesh.nodes), list(mesh.cells.items()), point_data=fields).write(file, file_format="vtu")


def _state_mesh(path: Solution, state: State) -> "meshio.Mesh":
    import meshio

    mesh = path.problem.mesh
    visible = path.potential if isinstance(path.potential, Visible) else None
    cells = dict(visible.cells) if visible else mesh.cells
    ends = np.cumsum([len(nodes) for nodes in cells.values()])[:-1]
    fields = visible.cell_fields(state.all_positions) if visible else {}
    return meshio.Mesh(
        _in_space(mesh.nodes),
        list(cells.items()),
        point_data={"displacement": _in_space(state.displacement), "reaction": _in_space(state.reaction)},
        cell_data={field: np.split(values, ends) for field, values in fields.items()},
    )


def _surface_mesh(surface: Surface) -> "meshio.Mesh":
    return _triangle_mesh(surface.points, surface.triangles)


def _triangle_mesh(points: Floats, triangles: Ints) -> "meshio.Mesh":
    import meshio

    return meshio.Mesh(_in_space(points), [("triangle", triangles)])


def write_stl(path: Solution, file: Path) -> None:
    """Write the body of the last state as binary STL [m]; nothing where there is no body.

    Of a plane body its elements, in the plane z = 0, of one in 3D its surface, seen from outside
    anticlockwise; quadrilaterals as two triangles.
    """
    mesh = path.problem.mesh
    if path.surface is not None:
        drawn = _surface_mesh(path.surface)
    elif path.states and mesh.element != "line":
        facets = mesh.elements if mesh.dim == 2 else facets_of(mesh)
        drawn = _triangle_mesh(path.states[-1].positions, triangles_of(facets))
    else:
        return
    drawn.write(file, file_format="stl", binary=True)


def write_difference(comparison: Comparison, file: Path) -> None:
    """Write the nodes at which two paths are compared as VTU: both displacements, their distance, what lies outside.

    At the last level that both have; nothing where there is none.
    """
    import meshio

    level = float(comparison.load_factors[-1]) if comparison.load_factors.size else 0.0
    mine, theirs = comparison.model.at(level), comparison.reference.at(level)
    if mine is None or theirs is None or not level:
        return
    mesh = comparison.model.problem.mesh
    apart = mine.displacement - theirs.displacement
    fields = {
        "displacement": _in_space(mine.displacement),
        "reference_displacement": _in_space(theirs.displacement),
        "distance": np.linalg.norm(apart, axis=1),
        "outside": comparison.outside.astype(np.uint8),
    }
    written = meshio.Mesh(_in_space(mesh.nodes), list(mesh.cells.items()), point_data=fields)
    written.write(file, file_format="vtu")


def _in_space(vectors: Floats) -> Floats:
    """Pad plane vectors with zeros to three components, shape (n, 3)."""
    padded = np.zeros((len(vectors), 3))
    padded[:, : vectors.shape[1]] = vectors
    return padded
