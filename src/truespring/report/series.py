"""Deformed bodies as files: a VTU series for ParaView and an STL of the last state."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Bools, Floats, Ints, in_space
from truespring.comparison import Comparison
from truespring.equilibrium import Solution, State
from truespring.mesh import Mesh
from truespring.mesh.facets import triangles_of
from truespring.mesh.files.stl import stl_bytes
from truespring.mesh.files.vtkhdf_writing import Step, write_vtkhdf
from truespring.mesh.files.vtu_writing import write_vtu
from truespring.potential import Visible
from truespring.report.surfaces import facets_of

#: Name of a form of the files of all levels.
Form = Literal["vtu", "vtkhdf"]


@dataclass(frozen=True, eq=False)
class Snapshot:
    """An undeformed body with the fields of one state, in SI units.

    Attributes:
        points: [m], shape (n_points, dim).
        cells: blocks of a key of CELL_SHAPES and the points of its cells, shape (n_cells, k), as for `write_vtu`.
        point_arrays: fields of the points by name: displacement [m] and reaction [N], shape (n_points, 3).
        cell_arrays: fields of the cells of all blocks by name, see `Visible.cell_fields`.
    """

    points: Floats
    cells: Sequence[tuple[str, Ints]]
    point_arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    cell_arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    def write(self, file: Path) -> None:
        """Write it as VTU."""
        write_vtu(file, self.points, self.cells, self.point_arrays, self.cell_arrays)


def snapshot_of(path: Solution, state: State | None) -> Snapshot:
    """Return the undeformed body with the fields of a state; for None the surface of a path, or the body alone."""
    surface = path.surface or path.shell
    mesh = path.problem.mesh
    if state is None:
        if surface is not None:
            return Snapshot(surface.points, [("triangle", surface.triangles)])
        return Snapshot(mesh.nodes, [*mesh.cells.items()])
    visible = path.potential if isinstance(path.potential, Visible) else None
    return Snapshot(
        mesh.nodes,
        [*(visible.cells if visible else mesh.cells).items()],
        {"displacement": in_space(state.displacement), "reaction": in_space(state.reaction)},
        visible.cell_fields(state.all_positions) if visible else {},
    )


def write_series(path: Solution, folder: Path, name: str) -> None:
    """Write NAME.pvd and one .vtu per state, in SI units, into the folder NAME next to it.

    Points are undeformed: apply ParaView's "Warp By Vector". They have displacement and reaction; cells have the
    fields of their potential: tension, stretch, stiffness and strain energy of springs, stress and strain energy of
    elements. A path with a surface only is written as that surface. States out of equilibrium (Solution.best) are left
    out.
    """
    levels = folder / name
    levels.mkdir(parents=True, exist_ok=True)
    for old in levels.glob(f"{name}_*.vtu"):
        old.unlink()
    entries = []
    for number, (time, state) in enumerate(_timed(path)):
        file = levels / f"{name}_{number:04d}.vtu"
        snapshot_of(path, state).write(file)
        entries.append(f'<DataSet timestep="{time!r}" file={quoteattr(f"{name}/{file.name}")}/>')
    collection = "\n".join(['<VTKFile type="Collection" version="0.1">', "<Collection>", *entries])
    (folder / f"{name}.pvd").write_text(f"{collection}\n</Collection>\n</VTKFile>\n", encoding="utf-8")


def write_vtkhdf_series(path: Solution, file: Path) -> None:
    """Write the states of a path as one .vtkhdf file, with the contents and times of `write_series`.

    The undeformed body is stored once. Raises OutputError if h5py is not installed.
    """
    timed = _timed(path)
    rest = snapshot_of(path, timed[0][1] if timed else None)
    shots = ((time, snapshot_of(path, state)) for time, state in timed)
    steps = (Step(float(time), shot.point_arrays, shot.cell_arrays) for time, shot in shots)
    write_vtkhdf(file, rest.points, rest.cells, steps)


def _timed(path: Solution) -> list[tuple[float, State | None]]:
    """Return the states with their times; without states the surface, as None.

    Times are load factors, those of a motion in seconds, or numbers if the load factors do not ascend.
    """
    surface = path.surface or path.shell
    if not path.states:
        return [(surface.load_factor, None)] if surface is not None else []
    factors = [state.load_factor for state in path.states]
    times = [state.moving.time for state in path.states if state.moving is not None] or factors
    if any(one >= other for one, other in pairwise(factors)):
        times = [*range(len(factors))]
    return list(zip(times, path.states, strict=True))


def _write_one_file(path: Solution, folder: Path, name: str) -> None:
    write_vtkhdf_series(path, folder / f"{name}{SERIES['vtkhdf'].suffix}")


class Series(NamedTuple):
    """A form of the files of all levels: the suffix of the file to open, and a function that writes them.

    The function takes the solution, the folder, and the name of the file without its suffix.
    """

    suffix: str
    write: Callable[[Solution, Path, str], None]


#: Forms of the files of all levels.
SERIES: Mapping[Form, Series] = MappingProxyType(
    {"vtu": Series(".pvd", write_series), "vtkhdf": Series(".vtkhdf", _write_one_file)}
)


def write_mesh(mesh: Mesh, file: Path, held: Bools | None = None) -> None:
    """Write the undeformed mesh as VTU [m], with a field `held` that is 1 in the directions that supports hold."""
    fields = {} if held is None else {"held": in_space(held.astype(float))}
    write_vtu(file, mesh.nodes, mesh.cells.items(), fields)


def write_stl(path: Solution, file: Path, state: State | None = None) -> None:
    """Write the deformed body of a state as binary STL [m]; nothing without states or elements.

    A plane body is written as its elements in the plane z = 0, one in 3D as its surface, anticlockwise from outside;
    quadrilaterals as two triangles. By default the state is the last one.
    """
    mesh, surface = path.problem.mesh, path.surface or path.shell
    if surface is not None:
        points, triangles = surface.points, surface.triangles
    elif path.states and mesh.element != "line":
        facets = mesh.elements if mesh.dim == 2 else facets_of(mesh)
        points, triangles = (state or path.states[-1]).positions, triangles_of(facets)
    else:
        return
    file.write_bytes(stl_bytes(in_space(points)[triangles]))


def write_difference(comparison: Comparison, file: Path) -> None:
    """Write the nodes at which two paths are compared as VTU: both displacements, their distance, nodes outside.

    The level is the last one that both have; without one, nothing is written.
    """
    level = float(comparison.load_factors[-1]) if comparison.load_factors.size else 0.0
    mine, theirs = comparison.model.at(level), comparison.reference.at(level)
    if mine is None or theirs is None or not level:
        return
    mesh = comparison.model.problem.mesh
    fields = {
        "displacement": in_space(mine.displacement),
        "reference_displacement": in_space(theirs.displacement),
        "distance": np.linalg.norm(mine.displacement - theirs.displacement, axis=1),
        "outside": comparison.outside.astype(np.uint8),
    }
    write_vtu(file, mesh.nodes, mesh.cells.items(), fields)
