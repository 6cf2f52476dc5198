"""Convert a record in the unit and axes of its file to a solution in metres, in the axes of the study."""

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from truespring.arrays import Floats, Ints, along_axes
from truespring.equilibrium import Solution, State, Status
from truespring.errors import MeshError, ReferenceFileError
from truespring.mesh import Grid, Mesh, corner_mesh
from truespring.mesh.selections import AXES
from truespring.problem import Problem
from truespring.reference.record import Record
from truespring.units import unit_of

# Tolerance of a plane body as a fraction of its diameter, and of the largest displacement.
_FLAT = 1e-6


@dataclass(frozen=True)
class Placing:
    """Unit, axes and position of the body of a file.

    Attributes:
        unit: the file's unit of length, such as "mm".
        axes: axes of the file along x, y and z of the study: with ("x", "z", "-y") the study's y is the file's z, and
            the study's z is the file's -y.
        shift: translation after that [m], shape (3,).
        load_factor: load factor of a file with one level; None means full load.
        full_time: time of full load in the file; None means 1, or the last time if that is later.
        force_unit: unit of force in the file, such as "N"; None omits energies, unless the file has them in J.
        duration: duration of the motion that the file belongs to [s], None at rest: the time of full load of a file of
            several levels for which no other is set.
    """

    unit: str = "m"
    axes: tuple[str, ...] = tuple(AXES)
    shift: tuple[float, ...] = (0.0, 0.0, 0.0)
    load_factor: float | None = None
    force_unit: str | None = None
    full_time: float | None = None
    duration: float | None = None

    def __post_init__(self) -> None:
        letters = [axis.removeprefix("-") for axis in self.axes]
        if sorted(letters) != list(AXES):
            raise ReferenceFileError(
                f"axes = {','.join(self.axes)}: must be x, y and z in any order, each with or without a minus"
            )
        if self.load_factor is not None and not 0 < self.load_factor <= 1:
            raise ReferenceFileError(f"load_factor = {self.load_factor:g} must be above 0 and at most 1")
        if self.full_time is not None and not (math.isfinite(self.full_time) and self.full_time > 0):
            raise ReferenceFileError(f"full_time = {self.full_time:g} must be above 0")
        _ = self.scale, self.joules

    @property
    def scale(self) -> float:
        """The file's unit of length [m]."""
        return unit_of(self.unit, "length", "unit", ReferenceFileError)

    @property
    def joules(self) -> float:
        """The file's unit of energy [J], NaN if the unit of force is not given."""
        if self.force_unit is None:
            return math.nan
        return self.scale * unit_of(self.force_unit, "force", "force_unit", ReferenceFileError)

    def positions(self, points: Floats) -> Floats:
        """Convert points of the file, shape (n, 3), to positions along the axes of the study [m], shape (n, 3)."""
        return np.asarray(self.scale * along_axes(points, self.axes) + np.array(self.shift))

    def displacement(self, vectors: Floats) -> Floats:
        """Convert displacements of the file, shape (n, 3), to the axes of the study [m], shape (n, 3)."""
        return self.scale * along_axes(vectors, self.axes)


def placed(record: Record, placing: Placing, label: str) -> Solution:
    """Return a record as a solution on the mesh of the corners of its cells (see mesh.corner_mesh).

    Its stability, convergence, loads and supports are unknown. Raises ReferenceFileError if the cells are not a valid
    mesh, or the levels are not load levels.
    """
    record, left_out = _without_unknown(record)
    points = placing.positions(record.points)
    factors, notes = _load_factors(record, placing)
    moves = [placing.displacement(level.displacement) for level in record.levels]
    dim = _dim(record, points, moves)
    try:
        whole = Grid(points[:, :dim], record.cells)
        mesh, nodes = corner_mesh(whole)
    except MeshError as error:
        raise ReferenceFileError(f"{record.file}: {error}") from None
    order = _mesh_first(whole, nodes)
    grid = _picked(whole, order)
    # Energies in VTK files are truespring's own, in joules; others are in the file's units.
    joules = 1.0 if record.kind in ("vtu", "pvd") else placing.joules
    states = [
        known_state(
            mesh, grid.points, move[order, :dim], factor, math.nan if level.energy is None else joules * level.energy
        )
        for level, move, factor in zip(record.levels, moves, factors, strict=True)
    ]
    if len(states) > 1 and factors[0] > 0:
        states.insert(0, known_state(mesh, grid.points, np.zeros(grid.points.shape), 0.0, energy=0.0))
    return Solution(
        problem=Problem(mesh, stated=False),
        label=label,
        kind=record.kind,
        states=tuple(states),
        status=Status.NOT_CONVERGED if record.stopped else Status.READ,
        warnings=(*record.notes, *left_out, *mesh.notes, *notes, unproven(label)),
        grid=grid,
    )


def _without_unknown(record: Record) -> tuple[Record, list[str]]:
    """Return a record without the points of unknown displacement and their cells, and a note on these."""
    known = np.logical_and.reduce([np.isfinite(level.displacement).all(axis=1) for level in record.levels])
    if known.all():
        return record, []
    cells = {kind: nodes[known[nodes].all(axis=1)] for kind, nodes in record.cells.items()}
    n_left = sum(len(nodes) for nodes in record.cells.values()) - sum(len(nodes) for nodes in cells.values())
    number = np.cumsum(known) - 1
    return replace(
        record,
        points=record.points[known],
        cells={kind: number[nodes] for kind, nodes in cells.items() if len(nodes)},
        levels=tuple(replace(level, displacement=level.displacement[known]) for level in record.levels),
        names=tuple(name for name, there in zip(record.names, known, strict=False) if there),
    ), [
        f"the displacement of {(~known).sum()} of {len(known)} points is unknown: they were left out, and {n_left} "
        "cells with them"
    ]


def unproven(label: str) -> str:
    """Return the warning that a result was read, not solved."""
    return (
        f"read from {label}, not solved here: its convergence and stability are those of the program that wrote it; "
        "stability not proven"
    )


def _load_factors(record: Record, placing: Placing) -> tuple[list[float], list[str]]:
    """Return the load factor of each level, and notes on their origin."""
    times = [level.time for level in record.levels]
    if placing.load_factor is not None:
        if len(times) > 1:
            raise ReferenceFileError(
                f"{record.file} has {len(times)} levels, a load factor needs a file with one: set the time of full "
                "load (--full-time) if its times are not load factors"
            )
        return [placing.load_factor], []
    if any(later <= earlier for earlier, later in itertools.pairwise(times)) or times[0] < 0:
        factors = [(number + 1) / len(times) for number in range(len(times))]
        return factors, [f"its {len(times)} levels have no ascending times and count as equal fractions of the load"]
    last = times[-1]
    if placing.full_time is not None:
        return _over(times, placing.full_time, f"{record.file} ends", "time of full load"), []
    if placing.duration is not None and len(times) > 1 and not record.in_load_factors:
        return _over(times, placing.duration, f"{record.file} ends", "duration of the motion"), [
            f"its times are over the duration of the motion, {placing.duration:g} s; change this by --full-time"
        ]
    if last <= 1 + 1e-6:
        short = (
            [] if last >= 1 - 1e-6 else [f"it ends at time {last:.6g}, which is used as load factor: full load is 1"]
        )
        return [_rounded(time) for time in times], short
    if len(times) == 1:
        return [1.0], [f"its only level, of time {last:.6g}, is used as full load"]
    return [_rounded(time / last) for time in times], [
        f"its times {times[0]:.6g} to {last:.6g} are used as load factors {times[0] / last:.6g} to 1, the last as "
        "full load; change this by --full-time"
    ]


def _over(times: list[float], whole: float, file_ends: str, name: str) -> list[float]:
    """Return times as shares of a time; raise ReferenceFileError if they end after it."""
    if times[-1] > whole * (1 + 1e-6):
        raise ReferenceFileError(f"{file_ends} at time {times[-1]:g}, after the {name}, {whole:g}: set --full-time")
    return [_rounded(time / whole) for time in times]


def _rounded(load_factor: float) -> float:
    """Return a load factor, exactly 1 if it is 1 up to the digits of a file."""
    return 1.0 if math.isclose(load_factor, 1.0, rel_tol=1e-6) else load_factor


def _dim(record: Record, points: Floats, moves: list[Floats]) -> int:
    """Return 2 if all points stay in a plane of constant z and no cell is solid, else 3."""
    if any(kind.startswith(("tetra", "hexahedron", "wedge", "pyramid")) for kind in record.cells):
        return 3
    flat = np.ptp(points[:, 2]) <= _FLAT * np.linalg.norm(np.ptp(points, axis=0))
    largest = max((float(np.abs(move).max()) for move in moves), default=0.0)
    return 2 if flat and all(np.abs(move[:, 2]).max() <= _FLAT * largest for move in moves) else 3


def _mesh_first(grid: Grid, nodes: Ints) -> Ints:
    """Return the numbers of the points of the cells and of the mesh, those of the mesh first."""
    used = np.zeros(len(grid.points), dtype=bool)
    for cells in grid.cells.values():
        used[cells] = True
    used[nodes] = False
    return np.concatenate([nodes, np.flatnonzero(used)])


def _picked(grid: Grid, order: Ints) -> Grid:
    number = np.full(len(grid.points), -1)
    number[order] = np.arange(len(order))
    return Grid(grid.points[order], {kind: number[cells] for kind, cells in grid.cells.items()})


def known_state(
    mesh: Mesh,
    points: Floats,
    displacement: Floats,
    load_factor: float,
    energy: float = math.nan,
    applied_force: Floats | None = None,
) -> State:
    """Return a state with known displacement [m], shape (n_points, dim); unknown quantities are NaN or None.

    The first points are the nodes of the mesh. `energy` [J] and the total applied force [N] may be known.
    """
    positions = mesh.nodes + displacement[: mesh.n_nodes]
    unknown = np.full(mesh.dim, math.nan if load_factor else 0.0)
    return State(
        load_factor=load_factor,
        positions=positions,
        all_positions=points + displacement,
        displacement=displacement[: mesh.n_nodes],
        reaction=np.full(positions.shape, math.nan),
        applied_force=unknown if applied_force is None else applied_force,
        energy=energy,
        iterations=0,
        residual=math.nan,
        negative_eigenvalues=None,
        branched=False,
        area_ratio=mesh.smallest_area_ratio(positions),
        stretch=None,
        level=load_factor,
    )
