"""Paths carried to the mesh of another: node by node where the nodes are the same, else by their own elements."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints
from truespring.equilibrium import Solution, State
from truespring.errors import ProblemError
from truespring.mesh import Grid, Interpolation
from truespring.problem import Problem

# Nodes are the same where they are this near, a share of the diameter: other programs print six digits.
_SAME_NODE = 1e-5


@dataclass(frozen=True, eq=False)
class Carried:
    """A path on the nodes of a problem's mesh.

    Attributes:
        path: the path there.
        outside: the nodes that lie outside of the body it was known on, shape (n_nodes,); the nearest point of that
            stands for them.
        node_by_node: whether the nodes are the same, so that nothing was interpolated.
    """

    path: Solution
    outside: Bools
    node_by_node: bool


def carried(path: Solution, problem: Problem) -> Carried:
    """Return `path` on the nodes of `problem`, by the own interpolation of its elements.

    A solid is carried to a plane body at the middle of its depth. Raises ProblemError where the nodes are others and
    the path is not known between its own.
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
            f"{path.label} is known at its {len(grid.points)} points only, which are others than those it is compared "
            "at: one of both must be a body of elements"
        )
    return Carried(_on(path, problem, grid, found, same), found.outside, same is not None)


def matching_points(grid: Grid, places: Floats) -> Ints | None:
    """Return the number of the grid's point at each of `places` [m], None unless each place has one of its own."""
    from scipy.spatial import KDTree

    if places.shape[1] != grid.dim or len(places) > len(grid.points):
        return None
    distance, number = (np.asarray(one) for one in KDTree(grid.points).query(places))
    if distance.max() > _SAME_NODE * grid.diameter or len(np.unique(number)) < len(number):
        return None
    return np.asarray(number, dtype=np.int64)


def _equal(mine: Floats, theirs: Floats) -> bool:
    """Whether two meshes have the same nodes in the same order, to rounding."""
    if mine.shape != theirs.shape:
        return False
    return bool(np.allclose(mine, theirs, rtol=0, atol=1e-9 * float(np.linalg.norm(np.ptp(mine, axis=0)))))


def _in_its_dimensions(nodes: Floats, grid: Grid) -> Floats:
    if nodes.shape[1] == grid.dim:
        return nodes
    if nodes.shape[1] > grid.dim:
        raise ProblemError("a plane body says nothing of places in space: compare at the places of the plane one")
    middle = (grid.points[:, 2].min() + grid.points[:, 2].max()) / 2
    return np.column_stack([nodes, np.full(len(nodes), middle)])


def _picked(numbers: Ints, n_points: int) -> "sparse.csr_array":
    rows = np.arange(len(numbers))
    return sparse.csr_array((np.ones(len(rows)), (rows, numbers)), shape=(len(rows), n_points))


def _with_own_supports(path: Solution, state: State) -> State:
    """A state with what the supports of its own problem do, not those of the problem that it is carried to."""
    return replace(state, supports=path.support_forces(state)) if path.problem.stated else state


def _on(path: Solution, problem: Problem, grid: Grid, found: Interpolation, same: Ints | None) -> Solution:
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
