"""Read deformed bodies from STL files: triangles without connectivity and without a unit."""

from pathlib import Path

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.equilibrium import Solution, State, Status
from truespring.errors import MeshError, ReferenceFileError
from truespring.mesh import Grid, Mesh, Shell, Surface, corner_mesh
from truespring.mesh.files.stl import parse_stl
from truespring.mesh.joining import distinct_points
from truespring.mesh.selections import AXES
from truespring.opening import read_file
from truespring.problem import Problem
from truespring.reference.placing import Placing, known_state, unproven

# Fractions of a body's diameter.
_SAME_POINT = 1e-6  # vertices this near are one point: text files carry six digits or more
_FLAT = 1e-6  # a body this thin lies in a plane
_OUTSIDE = 1e-3  # a node this far from the undeformed body still belongs to it: chords of a curved side
_SAME_BODY = 1e-2  # boxes that differ by more are of different bodies

# No load changes the size of a body this much: a unit is wrong (inch, cm or mm read as m, or the reverse).
_WRONG_UNIT = 10.0

_EXPORT_AGAIN = "export the body again as STL, ASCII or binary"


def read_stl(
    problem: Problem,
    file: Path,
    load_factor: float = 1.0,
    undeformed: Path | None = None,
    unit: str = "m",
    axes: tuple[str, ...] = tuple(AXES),
    shift: tuple[float, ...] = (0.0, 0.0, 0.0),
) -> Solution:
    """Read the deformed body of `problem` from an STL file, ASCII or binary.

    The body lies in a plane of constant z, or is a solid that is thin along z, of which the upper face is used.

    Args:
        problem: the problem that the other program solved, possibly on another mesh.
        file: the deformed body.
        load_factor: its load level, above 0, at most 1.
        undeformed: the undeformed body, the same triangles in the same order; it gives the displacement at the nodes
            of the problem, linear between vertices.
        unit: the unit of length of both files, such as "mm".
        axes, shift: axes of the files, and translation after that [m]; see Placing.

    Returns a solution of kind "stl" with a surface, and with one state if `undeformed` is given. Raises
    ReferenceFileError if a file cannot be read, is not such a body, or does not match the problem.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> solution = ts.solve(problem, ts.Fem("neo-hookean"))
        >>> read = ts.read_stl(problem, solution.write("deformed.stl"))
        >>> ts.compare(solution, read).surface.outline_max < 1e-6  # [m]
        True
    """
    file = Path(file)
    mesh = problem.mesh
    if mesh.dim != 2 or mesh.kind.dim != 2:
        raise ReferenceFileError(f"{file}: an STL file can be compared with a plane body of elements only")
    try:
        placing = Placing(unit, axes, shift, load_factor)
    except ReferenceFileError as error:
        raise ReferenceFileError(f"{file}: {error}") from None
    deformed = read_facets(file, placing)
    warnings = [unproven(file.name)]
    if undeformed is None:
        surface = _surface(deformed[_face(deformed, file)][:, :, :2], load_factor, file)
        states: tuple[State, ...] = ()
        warnings += _unit_warnings(mesh, surface, unit)
    else:
        undeformed = Path(undeformed)
        rest, surface = _matched(read_facets(undeformed, placing), deformed, load_factor, undeformed, file)
        state = _state(problem, rest, surface, undeformed, unit)
        states = (state,)
        warnings += _state_warnings(problem, rest, state, undeformed)
    inverted = bool(states) and states[0].area_ratio <= 0
    return Solution(
        problem=problem,
        label=file.name,
        kind="stl",
        states=states,
        status=Status.INVERTED if inverted else Status.CONVERGED,
        warnings=tuple(warnings),
        surface=surface,
    )


def read_shell(file: Path, placing: Placing, problem: Problem | None) -> Solution:
    """Read a deformed surface in space from an STL file, ASCII or binary.

    Returns a solution of kind "stl" with a shell and no states, for the given problem, or without one for a mesh of
    the edges. Raises ReferenceFileError if the file cannot be read.
    """
    facets = read_facets(file, placing)
    first, numbers = distinct_vertices(facets.reshape(-1, 3))
    points, triangles = facets.reshape(-1, 3)[first], numbers.reshape(-1, 3)
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    problem = (
        Problem(corner_mesh(Grid(points, {"triangle": triangles}))[0], stated=False) if problem is None else problem
    )
    factor = 1.0 if placing.load_factor is None else placing.load_factor
    return Solution(
        problem=problem,
        label=file.name,
        kind="stl",
        states=(),
        status=Status.READ,
        warnings=(unproven(file.name),),
        shell=Shell(points, triangles, factor),
    )


# --- the file -------------------------------------------------------------------------------------


def read_facets(file: Path, placing: Placing) -> Floats:
    """Return the vertices of every facet in the file's order [m], shape (n_facets, 3, 3)."""
    try:
        read = parse_stl(_bytes(file))
    except MeshError as error:
        raise ReferenceFileError(f"{file}: {error}: {_EXPORT_AGAIN}") from None
    facets = placing.positions(read.reshape(-1, 3)).reshape(-1, 3, 3)
    bad = np.flatnonzero(~np.isfinite(facets).all(axis=(1, 2)))
    if bad.size:
        raise ReferenceFileError(
            f"{file}: {bad.size} of {len(facets)} facets have a vertex that is not finite, the first is facet "
            f"{bad[0] + 1}: did the other program converge? {_EXPORT_AGAIN}"
        )
    size = np.ptp(facets, axis=(0, 1))
    normals = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
    if np.linalg.norm(normals, axis=1).sum() <= 1e-9 * (size**2).sum():
        raise ReferenceFileError(f"{file}: all {len(facets)} facets have no area: {_EXPORT_AGAIN}")
    return np.asarray(facets)


def _bytes(file: Path) -> bytes:
    if file.is_dir():
        raise ReferenceFileError(f"{file} is a folder: use the STL file in it")
    data = read_file(file, ReferenceFileError)
    if not data.strip():
        raise ReferenceFileError(f"{file} is empty: {_EXPORT_AGAIN}")
    return data


# --- from facets to a surface ---------------------------------------------------------------------


def _face(facets: Floats, file: Path) -> Bools:
    """Choose the facets of the face that lies in x and y, shape (n_facets,): all of a plane body, else the upper."""
    lower, upper = facets.min(axis=(0, 1)), facets.max(axis=(0, 1))
    size = upper - lower
    thin = int(size.argmin())
    if size[2] > 1.01 * size[thin]:
        raise ReferenceFileError(
            f"{file}: the body measures {_box(size)} m and is thinnest along {AXES[thin]}, the problem lies in x "
            "and y: export the body rotated so that z is its thickness, or only its face of constant z"
        )
    normals = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
    if size[2] <= _FLAT * np.linalg.norm(size):
        upwards = normals[:, 2] > 0
        two_sided = abs(normals[:, 2].sum()) < 1e-3 * np.abs(normals[:, 2]).sum()  # a shell with both its sides
        return np.asarray(upwards if two_sided else np.ones(len(facets), dtype=bool))
    lies = np.abs(normals[:, 2]) > 0.5 * np.linalg.norm(normals, axis=1)  # in either orientation of the facets
    above = facets[:, :, 2].mean(axis=1) > (lower[2] + upper[2]) / 2
    _refuse_no_solid(facets, lies & above, lies & ~above, file)
    return np.asarray(lies & above)


def _refuse_no_solid(facets: Floats, top: Bools, bottom: Bools, file: Path) -> None:
    """Raise ReferenceFileError if upper and lower face do not match: a tilted or warped sheet, an open solid."""
    if top.any() and bottom.any():
        boxes = [(facets[side, :, :2].min(axis=(0, 1)), facets[side, :, :2].max(axis=(0, 1))) for side in (top, bottom)]
        if np.ptp(boxes, axis=0).max() <= 0.1 * np.linalg.norm(np.ptp(facets, axis=(0, 1))):
            return
    raise ReferenceFileError(
        f"{file}: the body neither lies in a plane of constant z nor is a closed solid with an upper and a lower face "
        "across z: export all of its outer surface, or only its face of constant z"
    )


def _surface(facets: Floats, load_factor: float, file: Path) -> Surface:
    """Return the surface of facets [m], shape (n_facets, 3, 2), joined at their common vertices."""
    first, numbers = distinct_vertices(facets.reshape(-1, 2))
    return _triangulated(facets.reshape(-1, 2)[first], numbers.reshape(-1, 3), load_factor, file)


def _matched(
    rest: Floats, deformed: Floats, load_factor: float, rest_file: Path, file: Path
) -> tuple[Surface, Surface]:
    """Return the undeformed and the deformed surface, with the same numbering of points and triangles."""
    if len(rest) != len(deformed):
        raise ReferenceFileError(
            f"{file} has {len(deformed)} facets, {rest_file} has {len(rest)}: export both from one mesh, "
            "or leave undeformed out"
        )
    if np.array_equal(rest, deformed):
        raise ReferenceFileError(
            f"{file} and {rest_file} have the same shape: export one with and one without the load"
        )
    face = _face(rest, rest_file)
    before, after = rest[face, :, :2].reshape(-1, 2), deformed[face, :, :2].reshape(-1, 2)
    first, numbers = distinct_vertices(before)
    spread = np.linalg.norm(after - after[first][numbers], axis=1)
    worst = int(spread.argmax())
    if spread[worst] > 10 * _SAME_POINT * np.linalg.norm(np.ptp(after, axis=0)):
        raise ReferenceFileError(
            f"the vertex of {rest_file} at {_box(before[worst])} m moves to two positions in {file}, "
            f"{_box(after[worst])} and {_box(after[first][numbers][worst])} m: the files list their facets in "
            "different orders; export both in the same order, or leave undeformed out"
        )
    triangles = numbers.reshape(-1, 3)
    return (
        _triangulated(before[first], triangles, 0.0, rest_file),
        _triangulated(after[first], triangles, load_factor, file),
    )


def distinct_vertices(places: Floats) -> tuple[Ints, Ints]:
    """Number distinct positions.

    Return the first row of each, shape (n_distinct,), and the number of each row, (n,).
    """
    return distinct_points(places, _SAME_POINT * float(np.linalg.norm(np.ptp(places, axis=0))))


def _triangulated(points: Floats, triangles: Ints, load_factor: float, file: Path) -> Surface:
    """Return the surface without collapsed triangles; raise ReferenceFileError if it is empty or has no outline."""
    a, b, c = triangles.T
    try:
        return Surface(points, triangles[(a != b) & (b != c) & (c != a)], load_factor)
    except MeshError as error:
        raise ReferenceFileError(f"{file}: {error}; {_EXPORT_AGAIN}") from None


# --- from surfaces to a state ---------------------------------------------------------------------


def _state(problem: Problem, rest: Surface, surface: Surface, file: Path, unit: str) -> State:
    """Return the state at the nodes, by linear interpolation of the displacement of the vertices."""
    mesh = problem.mesh
    ratio = rest.diameter / mesh.diameter
    if not 1 / _WRONG_UNIT <= ratio <= _WRONG_UNIT:
        raise ReferenceFileError(f"{file}, read in {unit}, {_boxes(rest, mesh)}: check unit")
    triangle, shares, distance = rest.locate(mesh.nodes)
    far = int(distance.argmax())
    if distance[far] > _OUTSIDE * mesh.diameter:
        raise ReferenceFileError(
            f"node {far} at {_box(mesh.nodes[far])} m lies {distance[far]:.4g} m outside of {file}, which, "
            f"read in {unit}, {_boxes(rest, mesh)}: check unit, and that both have the same origin"
        )
    moved = (surface.points - rest.points)[rest.triangles[triangle]]
    displacement = (shares[:, :, None] * moved).sum(axis=1)
    level = surface.load_factor
    loads = problem.loading.force(mesh.nodes + displacement, level).sum(axis=0) if problem.stated else None
    return known_state(mesh, mesh.nodes, displacement, level, applied_force=loads)


def _unit_warnings(mesh: Mesh, surface: Surface, unit: str) -> list[str]:
    if 1 / _WRONG_UNIT <= surface.diameter / mesh.diameter <= _WRONG_UNIT:
        return []
    return [f"the deformed body, read in {unit}, {_boxes(surface, mesh)}: check unit"]


def _state_warnings(problem: Problem, rest: Surface, state: State, file: Path) -> list[str]:
    mesh, loading = problem.mesh, problem.loading.full
    warnings = []
    if max(np.abs(rest.lower - mesh.lower).max(), np.abs(rest.upper - mesh.upper).max()) > _SAME_BODY * mesh.diameter:
        warnings.append(f"{file.name} {_boxes(rest, mesh)}: are these the same body?")
    prescribed = sum(state.load_factor * part.displacement for part in loading.parts)
    off = np.abs(state.displacement - prescribed) * loading.held
    if off.max() > _SAME_BODY * np.abs(state.displacement).max() + _SAME_POINT * mesh.diameter:
        node = int(off.max(axis=1).argmax())
        warnings.append(
            f"node {node} at {_box(mesh.nodes[node])} m is held by a support, but moves in the files by "
            f"{off.max():.4g} m in a held direction: check supports, load_factor and the order of the facets"
        )
    if state.area_ratio <= 0:
        warnings.append(
            f"an element is inverted (smallest area ratio {state.area_ratio:.3g}): the other program's law allows it, "
            "or the files list their facets in different orders"
        )
    return warnings


def _boxes(surface: Surface, mesh: Mesh) -> str:
    """Return the bounding boxes of surface and mesh in words."""
    return (
        f"lies between {_box(surface.lower)} and {_box(surface.upper)} m, "
        f"the mesh between {_box(mesh.lower)} and {_box(mesh.upper)} m"
    )


def _box(values: Floats) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"
