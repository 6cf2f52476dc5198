"""Solutions interpolated at the nodes of another mesh."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import ProblemError
from truespring.mesh import Grid, Interpolation
from truespring.problem import Problem
from truespring.solution import Solution, State

# Nodes closer than this share of the diameter are the same: other programs print six digits.
_SAME_NODE = 1e-5


@dataclass(frozen=True, eq=False)
class Carried:
    """A solution on the nodes of a problem's mesh.

    Attributes:
        path: the solution on that mesh.
        outside: true for nodes outside of the body of the original solution, shape (n_nodes,); their displacement is
            that of the nearest point of the body.
        node_by_node: whether the nodes are the same, so that nothing was interpolated.
    """

    path: Solution
    outside: Bools
    node_by_node: bool


def carried(path: Solution, problem: Problem) -> Carried:
    """Return the solution `path` on the nodes of `problem`: as it is if the nodes are the same, else interpolated.

    Its elements interpolate; a solid is interpolated on a plane mesh at the middle of its depth. Raises ProblemError
    if the nodes differ and the solution has no elements.
    """
    nodes = problem.mesh.nodes
    nowhere = np.zeros(len(nodes), dtype=bool)
    if path.problem is problem:
        return Carried(path, nowhere, True)
    if _equal(nodes, path.problem.mesh.nodes):
        states = tuple(_with_own_supports(path, state) for state in path.states)
        return Carried(replace(path, problem=problem, states=states), nowhere, True)
    grid = path.whole
    places = _in_its_dimensions(nodes, grid)
    same = matching_points(grid, places)
    if same is not None:
        found = Interpolation(_picked(same, len(grid.points)), np.zeros(len(nodes)), nowhere)
    elif grid.fills:
        found = grid.locate(places)
    else:
        raise ProblemError(
            f"{path.label} is known at {len(grid.points)} points only, and these are not the nodes of the other: one "
            "of the two must consist of elements"
        )
    return Carried(_on(path, problem, grid, found, same), found.outside, same is not None)


def matching_points(grid: Grid, places: Floats) -> Ints | None:
    """Return the number of the grid's point at each of `places`, shape (n,); None unless all have different ones.

    `places` [m] has shape (n, dim).
    """
    from scipy.spatial import KDTree

    if places.shape[1] != grid.dim or len(places) > len(grid.points):
        return None
    distance, number = (np.asarray(one) for one in KDTree(grid.points).query(places))
    if distance.max() > _SAME_NODE * grid.diameter or len(np.unique(number)) < len(number):
        return None
    return np.asarray(number, dtype=np.int64)


def _equal(mine: Floats, theirs: Floats) -> bool:
    """Return whether two arrays of nodes are equal to rounding, in the same order."""
    if mine.shape != theirs.shape:
        return False
    return bool(np.allclose(mine, theirs, rtol=0, atol=1e-9 * float(np.linalg.norm(np.ptp(mine, axis=0)))))


def _in_its_dimensions(nodes: Floats, grid: Grid) -> Floats:
    """Return nodes in the dimension of a grid: plane nodes at the middle of its depth, shape (n_nodes, grid.dim)."""
    if nodes.shape[1] == grid.dim:
        return nodes
    if nodes.shape[1] > grid.dim:
        raise ProblemError("a plane body has no displacement at positions in space: compare at the plane body's nodes")
    middle = (grid.points[:, 2].min() + grid.points[:, 2].max()) / 2
    return np.column_stack([nodes, np.full(len(nodes), middle)])


def _picked(numbers: Ints, n_points: int) -> "sparse.csr_array":
    """Return the matrix that selects points by their numbers, shape (len(numbers), n_points)."""
    rows = np.arange(len(numbers))
    return sparse.csr_array((np.ones(len(rows)), (rows, numbers)), shape=(len(rows), n_points))


def _with_own_supports(path: Solution, state: State) -> State:
    """Return a state that keeps the forces of the supports of its original problem."""
    return replace(state, supports=path.support_forces(state)) if path.problem.stated else state


def _on(path: Solution, problem: Problem, grid: Grid, found: Interpolation, same: Ints | None) -> Solution:
    """Return a solution interpolated from a grid to the nodes of a problem; `same` are the points there, if equal."""
    mesh = problem.mesh
    as_many = mesh.dim == path.problem.mesh.dim

    def moved(state: State) -> State:
        displacement = found.carry(state.all_positions - grid.points)[:, : mesh.dim]
        positions = mesh.nodes + displacement
        return replace(
            state,
            positions=positions,
            all_positions=positions,
            displacement=displacement,
            reaction=np.full(positions.shape, np.nan),
            applied_force=state.applied_force[: mesh.dim],
            area_ratio=mesh.smallest_area_ratio(positions),
            mode=None,
            supports=path.support_forces(state) if as_many else (),
        )

    states = tuple(moved(state) for state in path.states)
    held = None
    if path.held is not None and same is not None and as_many and same.max(initial=-1) < len(path.held):
        held = path.held[same]
    return replace(path, problem=problem, states=states, potential=None, grid=None, best=None, held=held)
