"""Boundary conditions of a potential: forces, prescribed motion, and loads that follow the body."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints
from truespring.potential import Potential


class Turn(NamedTuple):
    """Prescribed rotation of nodes as a rigid body.

    Attributes:
        nodes: node numbers, shape (n,).
        arms: vectors from the centre to the nodes [m], shape (n, dim).
        axis: unit vector in space, shape (3,).
        angle: [rad].
    """

    nodes: Ints
    arms: Floats
    axis: Floats
    angle: float

    def motion(self, share: float) -> Floats:
        """Return the displacement of the nodes for a share of the angle [m], shape (n, dim), by Rodrigues' formula."""
        sine, cosine = np.sin(share * self.angle), np.cos(share * self.angle)
        arms = np.zeros((len(self.arms), 3))
        arms[:, : self.arms.shape[1]] = self.arms
        along = np.outer(arms @ self.axis, self.axis)
        moved = sine * np.cross(self.axis, arms) + (cosine - 1) * (arms - along)
        return np.asarray(moved[:, : self.arms.shape[1]])


@dataclass(frozen=True)
class Loading:
    """Loads and prescribed motion of a potential at load factor 1; all scale with the load factor.

    Attributes:
        external_force: dead load [N], shape (n_nodes, dim).
        held: true for prescribed directions, shape (n_nodes, dim).
        displacement: prescribed displacement [m], zero in free directions, shape (n_nodes, dim).
        turns: prescribed rotations, added to the displacement.
        following: loads that follow the body, as potentials whose energy is minus the work of the load [J].
    """

    external_force: Floats
    held: Bools
    displacement: Floats
    turns: tuple[Turn, ...] = ()
    following: tuple[Potential, ...] = ()

    def __post_init__(self) -> None:
        for array in (self.external_force, self.held, self.displacement):
            array.setflags(write=False)

    def motion(self, load_factor: float = 1.0) -> Floats:
        """Return the prescribed displacement at a load factor [m], zero in free directions, shape (n_nodes, dim)."""
        motion = load_factor * self.displacement
        for turn in self.turns:
            motion[turn.nodes] += turn.motion(load_factor)
        return np.asarray(motion)

    def force(self, positions: Floats, load_factor: float = 1.0) -> Floats:
        """Return the external force on the nodes at these positions [N], shape (n_nodes, dim)."""
        force = load_factor * self.external_force
        for load in self.following:
            force -= load_factor * load.gradient(positions)
        return np.asarray(force)

    def at_rest(self, nodes: Floats) -> "Loading":
        """Return the loading of a linear theory: following loads become dead loads with their undeformed forces."""
        return replace(self, external_force=self.force(nodes), following=()) if self.following else self

    @property
    def driven_by_motion(self) -> bool:
        """Whether there are no loads but prescribed displacements."""
        return not self.external_force.any() and not self.following


@runtime_checkable
class Refined(Potential, Protocol):
    """A potential with further nodes after those of the problem's mesh."""

    @property
    def parents(self) -> Ints:
        """The two nodes of the mesh that each further node lies midway between, shape (n_further, 2)."""
        ...

    @property
    def elements(self) -> Ints:
        """Node numbers of each element in VTK's order, corners first, shape (n_elements, k)."""
        ...

    @property
    def loading(self) -> Loading:
        """The problem's loading on all nodes of the potential."""
        ...


def from_parents(parents: Ints, n_nodes: int) -> "sparse.csr_array[Any]":
    """Return the weights of all nodes of a refined potential from the `n_nodes` of the mesh, shape (n_all, n_nodes)."""
    n_further = len(parents)
    rows = np.concatenate([np.arange(n_nodes), n_nodes + np.repeat(np.arange(n_further), 2)])
    shares = np.repeat([1.0, 0.5], [n_nodes, 2 * n_further])
    at = rows, np.concatenate([np.arange(n_nodes), parents.ravel()])
    return sparse.csr_array((shares, at), shape=(n_nodes + n_further, n_nodes))


def on_the_mesh(force: Floats, parents: Ints) -> Floats:
    """Return the forces on the nodes of the mesh [N], shape (n_nodes, dim), from those on all nodes.

    The force on a further node acts by half on each of its two parents. `force` has shape (n_all, dim) [N], `parents`
    (n_further, 2).
    """
    n_nodes = len(force) - len(parents)
    found, further = force[:n_nodes].copy(), force[n_nodes:]
    for end in (0, 1):
        np.add.at(found, parents[:, end], further / 2)
    return found
