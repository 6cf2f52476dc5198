"""Boundary conditions of a potential: forces, prescribed motion, and loads that follow the body."""

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.potential import Potential


class Turn(NamedTuple):
    """Nodes turned as a rigid body: `arms` [m] to them from the centre, a unit `axis` in space, `angle` [rad]."""

    nodes: Ints
    arms: Floats
    axis: Floats
    angle: float

    def motion(self, share: float) -> Floats:
        """Return the displacement of the nodes [m] turned by a share of the angle, by Rodrigues' formula."""
        sine, cosine = np.sin(share * self.angle), np.cos(share * self.angle)
        arms = np.zeros((len(self.arms), 3))
        arms[:, : self.arms.shape[1]] = self.arms
        along = np.outer(arms @ self.axis, self.axis)
        moved = sine * np.cross(self.axis, arms) + (cosine - 1) * (arms - along)
        return np.asarray(moved[:, : self.arms.shape[1]])


@dataclass(frozen=True)
class Loading:
    """What acts on a potential from outside at load factor 1; every part of it scales with the load factor.

    Attributes:
        external_force: dead load [N], shape (n_nodes, dim).
        held: true where the displacement is prescribed, shape (n_nodes, dim).
        displacement: the prescribed displacement [m], zero where free, shape (n_nodes, dim).
        turns: prescribed rotations, which come on top.
        following: loads that follow the body, as potentials: the energy is minus the work of the load [J].
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
        """Return the prescribed displacement at a load factor [m], zero where free, shape (n_nodes, dim)."""
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
        """Return the loading of a linear theory: loads that follow the body act as they do on the body at rest."""
        return replace(self, external_force=self.force(nodes), following=()) if self.following else self

    @property
    def driven_by_motion(self) -> bool:
        """Whether nothing but prescribed displacements loads the body."""
        return not self.external_force.any() and not self.following


@runtime_checkable
class Refined(Potential, Protocol):
    """A potential with more nodes than the problem's mesh, whose nodes come first."""

    @property
    def parents(self) -> Ints:
        """The two nodes of the mesh midway between which each further node stands, shape (n_further, 2)."""
        ...

    @property
    def elements(self) -> Ints:
        """The nodes of each element, corners first, in VTK's order, shape (n_elements, k)."""
        ...

    @property
    def loading(self) -> Loading:
        """The problem's loading on all its nodes."""
        ...


def on_the_mesh(force: Floats, parents: Ints) -> Floats:
    """Return forces on all nodes of a refined potential [N] as forces on those of the mesh, shape (n_nodes, dim).

    What acts between two nodes of the mesh acts on both by half.
    """
    n_nodes = len(force) - len(parents)
    found, further = force[:n_nodes].copy(), force[n_nodes:]
    for end in (0, 1):
        np.add.at(found, parents[:, end], further / 2)
    return found
