"""Force and torque of each moved support."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.loading import Held
from truespring.problem import Problem

# A resultant vanishes if it is below this share of the sum of the sizes of the nodes' reactions. The first number is
# for a resultant that does work with the prescribed motion: it vanishes by symmetry only. The second is for one that
# does no work, such as the torque of a straight pull: it may be an error of the mesh (coarse tetrahedra give 4 %).
_VANISHING, _IDLE = 1e-3, 0.1
# Shares of the motion at which the distance of a support is measured: after a full turn it is zero again.
_SHARES = (0.25, 0.5, 0.75, 1.0)
_EQUAL = 1e-9

Rows = sparse.csr_array[Any, tuple[int, int]]


@dataclass(frozen=True, eq=False)
class SupportForce:
    """Force and torque of a moved support on the body: the resultant of its reactions; or the force on a tool or grasp.

    Attributes:
        support: index among the supports of the problem; -1 of a tool or grasp.
        name: selection that it is on; "support 2" if that has no name; the name of a tool or grasp.
        force: sum of the reactions [N], shape (dim,).
        torque: sum of arm x reaction [N m], shape (1,) in the plane (about z), (3,) in space; arms are those of the
            deformed body, from `point_of_torque`. Empty of a tool or grasp.
        has_force, has_torque: whether the resultant does not vanish.
    """

    support: int
    name: str
    force: Floats
    torque: Floats
    has_force: bool
    has_torque: bool

    @property
    def key(self) -> tuple[int, str]:
        """What identifies it among supports, tools and grasps: its number, or its name."""
        return self.support, self.name if self.support < 0 else ""


def moved_supports(problem: Problem) -> list[int]:
    """Return the indices of the supports that are moved or turned; empty if the problem states no supports."""
    if not problem.stated:
        return []
    return [number for number, held in enumerate(problem.held) if held.motion.any() or held.turn is not None]


def leading_support(problem: Problem) -> int | None:
    """Return the index of the support whose nodes move farthest, the first of equal ones; None if none moves."""
    found = None
    largest = 0.0
    for number in moved_supports(problem):
        way = _way(problem.held[number])
        if way > largest * (1 + _EQUAL):
            found, largest = number, way
    return found


def support_forces(
    problem: Problem, positions: Floats, reaction: Floats, load_factor: float
) -> tuple[SupportForce, ...]:
    """Return force and torque of each moved support, in the order of the supports.

    A support acts only in the directions that it holds. If several supports hold a direction of a node, they share its
    reaction equally, so that the forces of all supports add up to the total reaction. The torque is about the point
    `about` of a turn, moved with the support, else about the centre of its deformed nodes.

    Args:
        problem: problem with the supports.
        positions: positions of the nodes [m], shape (n_nodes, dim).
        reaction: reactions at the nodes [N], shape (n_nodes, dim).
        load_factor: share of the prescribed motion [-].
    """
    moved = moved_supports(problem)
    if not moved:
        return ()
    shared = reaction / np.maximum(_holders(problem), 1)
    return tuple(_resultant(problem, number, positions, shared, load_factor) for number in moved)


def _holders(problem: Problem) -> Floats:
    """Return the number of supports that hold each direction of each node, shape (n_nodes, dim)."""
    holders = np.zeros(problem.mesh.nodes.shape)
    for held in problem.held:
        holders[held.nodes[:, None], held.directions] += 1
    return holders


def resultant_rows(problem: Problem, support: int, positions: Floats, load_factor: float) -> tuple[Rows, Rows]:
    """Return the matrices that map the reactions of all nodes, shape (n_dof,), to force and torque of a support.

    They are sparse, of shape (dim, n_dof) [-] and (1 or 3, n_dof) [m]. Arguments as support_forces.
    """
    held, dim = problem.held[support], problem.mesh.dim
    dofs = held.nodes[:, None] * dim + np.array(held.directions)
    shares = 1 / _holders(problem).ravel()[dofs]
    units = np.eye(dim)[held.directions]  # along each direction that is held
    arms = positions[held.nodes] - point_of_torque(problem, support, positions, load_factor)
    forces = np.broadcast_to(units, (len(arms), *units.shape)) * shares[:, :, None]
    torques = _cross(np.repeat(arms, len(units), axis=0), forces.reshape(-1, dim))
    size = problem.mesh.nodes.size

    def rows(values: Floats) -> Rows:
        several, columns = values.T, dofs.ravel()
        place = np.repeat(np.arange(len(several)), len(columns))
        return sparse.csr_array((several.ravel(), (place, np.tile(columns, len(several)))), shape=(len(several), size))

    return rows(forces.reshape(-1, dim)), rows(torques)


def torque_axes(dim: int) -> str:
    """Return the names of the axes of a torque: z in the plane, xyz in space."""
    return "xyz" if dim == 3 else "z"


def point_of_torque(problem: Problem, support: int, positions: Floats, load_factor: float) -> Floats:
    """Return the point about which the torque of a support acts [m], shape (dim,); arguments as support_forces."""
    held = problem.held[support]
    if held.turn is None:
        return np.asarray(positions[held.nodes].mean(axis=0))
    about = problem.mesh.nodes[held.nodes[0]] - held.turn.arms[0]
    return np.asarray(about + problem.share_of_support(support, load_factor) * held.motion)


def _resultant(problem: Problem, number: int, positions: Floats, shared: Floats, load_factor: float) -> SupportForce:
    """Return force and torque of a support from reactions that are shared between supports, shape (n_nodes, dim)."""
    held = problem.held[number]
    reaction = np.zeros((len(held.nodes), positions.shape[1]))
    reaction[:, held.directions] = shared[held.nodes[:, None], held.directions]
    arms = positions[held.nodes] - point_of_torque(problem, number, positions, load_factor)
    force, torque = reaction.sum(axis=0), _cross(arms, reaction).sum(axis=0)
    size, longest = float(np.linalg.norm(reaction, axis=1).sum()), float(np.linalg.norm(arms, axis=1).max())
    least_force = _VANISHING if held.motion.any() else _IDLE
    least_torque = _IDLE if held.turn is None else _VANISHING
    return SupportForce(
        support=number,
        name=support_name(problem, number),
        force=force,
        torque=torque,
        has_force=float(np.linalg.norm(force)) > least_force * size,
        has_torque=float(np.linalg.norm(torque)) > least_torque * size * longest,
    )


def support_name(problem: Problem, number: int) -> str:
    """Return the name of the selection that a support is on, if it is the only one there, else "support N" from 1."""
    on = problem.supports[number].on
    alone = sum(isinstance(one.on, str) and one.on == on for one in problem.supports) == 1
    return on if isinstance(on, str) and alone else f"support {number + 1}"


def _cross(arms: Floats, forces: Floats) -> Floats:
    """Return arm x force [N m], shape (n, 1) in the plane, (n, 3) in space."""
    if arms.shape[1] == 2:
        return np.asarray(arms[:, :1] * forces[:, 1:] - arms[:, 1:] * forces[:, :1])
    return np.asarray(np.cross(arms, forces))


def _way(held: Held) -> float:
    """Return the largest distance that a node of a support moves [m]."""
    ways = [share * held.motion + (0.0 if held.turn is None else held.turn.motion(share)) for share in _SHARES]
    return max(float(np.linalg.norm(np.atleast_2d(way), axis=1).max()) for way in ways)
