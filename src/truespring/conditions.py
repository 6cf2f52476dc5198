"""Boundary conditions of a potential: forces, prescribed motion, and loads that follow the body."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints
from truespring.potential import Potential, SparseMatrix, is_symmetric, tangent_of


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
class Amplitude:
    """Share of a load or of a prescribed motion that acts along the way: linear between points, constant outside.

    Without points, the share is the level itself.

    Attributes:
        places: ascending, as shares of the way [-] at rest, as times [s] in motion, shape (n,).
        shares: share of the full load or motion at these places [-], shape (n,).
        span: place at the end of the way: 1 at rest, the duration in motion [s].
    """

    places: tuple[float, ...] = ()
    shares: tuple[float, ...] = ()
    span: float = 1.0

    def at(self, level: float) -> float:
        """Return the share at a level, from 0 to 1 on the way [-]."""
        return level if not self.places else float(np.interp(level * self.span, self.places, self.shares))

    @property
    def corners(self) -> tuple[float, ...]:
        """The levels between 0 and 1 at which the slope changes [-]."""
        return tuple(place / self.span for place in self.places if 0 < place < self.span)


#: The amplitude of loads at rest by default: the level itself.
PROPORTIONAL = Amplitude()


class Touch(NamedTuple):
    """What a tool or a grasp does at one state.

    Attributes:
        place: position of the tool [m], shape (dim,).
        force: force of the body on it [N], shape (dim,).
        depth: largest depth to which it enters the body, or largest extension of a grasp [m].
        acts: whether it is there: False outside of the interval in which it acts.
    """

    place: Floats
    force: Floats
    depth: float
    acts: bool = True


class Slide(NamedTuple):
    """Coulomb friction at one state, for schemes that apply it node by node.

    Attributes:
        nodes: numbers of the nodes that touch the tool, shape (n,).
        normals: unit normals that point away from the tool, shape (n, dim).
        limit: coefficient of friction times normal force [N], shape (n,).
        velocity: velocity of the tool [m/s], shape (dim,).
    """

    nodes: Ints
    normals: Floats
    limit: Floats
    velocity: Floats


@runtime_checkable
class Interaction(Protocol):
    """An action on single nodes that depends on the level: contact with a tool, or a grasp; frozen.

    Friction depends on the path: `since` begins a step, `lagged` updates the normal forces that it uses.
    """

    @property
    def name(self) -> str:
        """The name, for tables."""
        ...

    @property
    def corners(self) -> tuple[float, ...]:
        """The levels between 0 and 1 at which the path has a corner, or at which it begins or ceases to act [-]."""
        ...

    @property
    def switches(self) -> tuple[float, ...]:
        """The levels between 0 and 1 at which it begins or ceases to act [-]."""
        ...

    @property
    def dissipates(self) -> bool:
        """Whether it has friction: states then depend on those before them."""
        ...

    def acts(self, level: float) -> bool:
        """Return whether it acts at a level."""
        ...

    def brought(self, positions: Floats, before: float, level: float) -> float:
        """Return the energy that it brings if it begins to act in a step between two levels [J], from outside.

        Minus the energy that it takes along if it ceases to act. `positions` are those at the begin of the step [m],
        shape (n_nodes, dim).
        """
        ...

    def energy(self, positions: Floats, level: float) -> float:
        """Return the stored energy plus the dissipation since the begin of the step [J]; infinite where not allowed."""
        ...

    def stored(self, positions: Floats, level: float) -> float:
        """Return the stored energy alone [J]."""
        ...

    def gradient(self, positions: Floats, level: float) -> Floats:
        """Return minus the force on the nodes [N], shape (n_nodes, dim)."""
        ...

    def blocks(self, positions: Floats, level: float) -> tuple[Ints, Floats]:
        """Return nodes, shape (n,), and their second derivatives [N/m], shape (n, dim, dim), symmetric."""
        ...

    def since(self, positions: Floats, level: float, creep: float) -> "Interaction":
        """Return the action in a step that begins at a state; friction is full from a slip of `creep` [m] on."""
        ...

    def lagged(self, positions: Floats, level: float) -> "Interaction":
        """Return the action with the normal forces of a state, for friction; the step begins where it did."""
        ...

    def rubbed(self, force: Floats) -> "Interaction":
        """Return the action with friction on the nodes that a scheme has found [N], shape (n_nodes, dim)."""
        ...

    def slide(self, positions: Floats, level: float) -> Slide:
        """Return the largest friction at a state; without nodes if there is none."""
        ...

    def cleared(self, positions: Floats, level: float) -> Floats:
        """Return positions of finite energy near others [m], shape (n_nodes, dim): the start of a solver."""
        ...

    def touch(self, positions: Floats, level: float) -> Touch:
        """Return place, force and depth at a state."""
        ...

    def largest_stiffness(self) -> Floats:
        """Return an upper bound of the stiffness of each node [N/m], shape (n_nodes,)."""
        ...


class Always:
    """The part of an Interaction that acts on the whole way."""

    @property
    def switches(self) -> tuple[float, ...]:
        """None."""
        return ()

    def acts(self, level: float) -> bool:
        """Return True."""
        return True

    def brought(self, positions: Floats, before: float, level: float) -> float:
        """Return 0: what it stores is work of the body and of its own motion [J]."""
        return 0.0


@dataclass(frozen=True)
class Loading:
    """Loads and prescribed motion of a potential.

    Attributes:
        external_force: dead load at share 1 [N], shape (n_nodes, dim).
        held: true for prescribed directions, shape (n_nodes, dim).
        displacement: prescribed displacement at share 1 [m], zero in free directions, shape (n_nodes, dim).
        turns: prescribed rotations, added to the displacement.
        following: loads that follow the body, as potentials whose energy is minus the work of the load [J], see also
            Unsymmetric.
        amplitude: share of all of these along the way.
        further: loads and motion with other amplitudes, each with the same `held`.
        interactions: contacts with tools and grasps.
    """

    external_force: Floats
    held: Bools
    displacement: Floats
    turns: tuple[Turn, ...] = ()
    following: tuple[Potential, ...] = ()
    amplitude: Amplitude = PROPORTIONAL
    further: tuple["Loading", ...] = ()
    interactions: tuple[Interaction, ...] = ()

    def __post_init__(self) -> None:
        for array in (self.external_force, self.held, self.displacement):
            array.setflags(write=False)

    @property
    def parts(self) -> tuple["Loading", ...]:
        """This and the further loads."""
        return (self, *self.further)

    def mapped(self, change: Callable[["Loading"], "Loading"]) -> "Loading":
        """Return the loading with a function applied to each of its parts; `change` leaves `further` as it is."""
        return replace(change(self), further=tuple(change(one) for one in self.further))

    @property
    def proportional(self) -> bool:
        """Whether all loads and motion grow in proportion to the level."""
        return not self.interactions and all(one.amplitude == PROPORTIONAL for one in self.parts)

    @property
    def full(self) -> "Loading":
        """The loading with all loads and motion in proportion to the level, without tools and grasps."""
        return replace(self.mapped(lambda part: replace(part, amplitude=PROPORTIONAL)), interactions=())

    @property
    def corners(self) -> tuple[float, ...]:
        """The levels between 0 and 1 at which an amplitude or the path of a tool has a corner [-], ascending."""
        return tuple(sorted({*self.history_corners, *(corner for one in self.interactions for corner in one.corners)}))

    @property
    def history_corners(self) -> tuple[float, ...]:
        """The levels between 0 and 1 at which an amplitude has a corner, or a tool begins or ceases to act [-]."""
        found = {corner for part in self.parts for corner in part.amplitude.corners}
        return tuple(sorted(found.union(*(one.switches for one in self.interactions))))

    def largest_stiffness(self) -> Floats:
        """Return an upper bound of the stiffness of each node by tools and grasps that act together [N/m].

        Shape (n_nodes,).
        """
        still, several = np.zeros(len(self.held)), self.interactions
        ends = sorted({1.0, *(switch for one in several for switch in one.switches)})  # the last to act together end
        together = {tuple(one.acts(level) for one in several) for level in ends}
        sizes = [one.largest_stiffness() for one in several]
        sums = [sum((size for size, acts in zip(sizes, flags, strict=True) if acts), still) for flags in together]
        return np.asarray(np.max(sums, axis=0))

    def vanishes(self, level: float, positions: Floats | None = None) -> bool:
        """Return whether no load acts at a level, and no prescribed motion.

        Tools and grasps count as loads, unless they exert no force at `positions` [m], shape (n_nodes, dim).
        """
        if not all(one._idle or one.amplitude.at(level) == 0 for one in self.parts):
            return False
        return not any(positions is None or one.gradient(positions, level).any() for one in self.interactions)

    @property
    def _idle(self) -> bool:
        """Whether this part has neither loads nor prescribed motion."""
        return not (self.following or self.turns or self.external_force.any() or self.displacement.any())

    def motion(self, level: float = 1.0) -> Floats:
        """Return the prescribed displacement at a level [m], zero in free directions, shape (n_nodes, dim)."""
        motion = np.zeros(self.displacement.shape)
        turned = np.zeros(len(motion), dtype=bool)
        for part in self.parts:
            share = part.amplitude.at(level)
            motion += share * part.displacement
            for turn in part.turns:  # several supports may state the same rotation of a node
                first = ~turned[turn.nodes]
                motion[turn.nodes[first]] += turn.motion(share)[first]
                turned[turn.nodes] = True
        return motion

    def dead_force(self, level: float = 1.0) -> Floats:
        """Return the dead loads at a level [N], shape (n_nodes, dim)."""
        force = self.amplitude.at(level) * self.external_force
        for part in self.further:
            force += part.amplitude.at(level) * part.external_force
        return np.asarray(force)

    def followers(self, level: float) -> Iterator[tuple[float, Potential]]:
        """Yield the loads that follow the body with their share at a level, unless that is zero."""
        for part in self.parts:
            share = part.amplitude.at(level)
            if share:
                yield from ((share, load) for load in part.following)

    @property
    def follows(self) -> bool:
        """Whether a load follows the body."""
        return any(part.following for part in self.parts)

    @property
    def symmetric(self) -> bool:
        """Whether all loads have potentials, so that tangents are symmetric."""
        return all(is_symmetric(load) for part in self.parts for load in part.following)

    def has_potential(self, level: float) -> bool:
        """Return whether all loads that act at a level have potentials."""
        return all(is_symmetric(load) for _, load in self.followers(level))

    def tangents(self, positions: Floats, level: float) -> Iterator[SparseMatrix]:
        """Yield the tangents of the loads that follow the body [N/m], shape (n_dof, n_dof)."""
        for share, load in self.followers(level):
            yield share * tangent_of(load, positions)

    def loads(self, positions: Floats, level: float = 1.0) -> Floats:
        """Return the force of the loads on the nodes at these positions [N], shape (n_nodes, dim)."""
        force = self.dead_force(level)
        for share, load in self.followers(level):
            force -= share * load.gradient(positions)
        return force

    def force(self, positions: Floats, level: float = 1.0) -> Floats:
        """Return the force of loads, tools and grasps at these positions [N], shape (n_nodes, dim)."""
        force = self.loads(positions, level)
        for one in self.interactions:
            force -= one.gradient(positions, level)
        return force

    def energies(self, positions: Floats, level: float) -> Iterator[float]:
        """Yield the energies of following loads that have a potential, of tools and of grasps [J]."""
        for share, load in self.followers(level):
            if is_symmetric(load):
                yield share * load.energy(positions)
        for one in self.interactions:
            yield one.energy(positions, level)

    def since(self, positions: Floats, level: float, creep: float) -> "Loading":
        """Return the loading in a step that begins at a state, see Interaction."""
        if not self.interactions:
            return self
        return replace(self, interactions=tuple(one.since(positions, level, creep) for one in self.interactions))

    def lagged(self, positions: Floats, level: float) -> "Loading":
        """Return the loading with the normal forces of a state, see Interaction."""
        if not self.interactions:
            return self
        return replace(self, interactions=tuple(one.lagged(positions, level) for one in self.interactions))

    @property
    def dissipates(self) -> bool:
        """Whether a tool has friction: states then depend on those before them."""
        return any(one.dissipates for one in self.interactions)

    def cleared(self, positions: Floats, level: float) -> Floats:
        """Return positions with the free nodes inside of barriers moved out of them [m], shape (n_nodes, dim)."""
        moved = positions
        for one in self.interactions:
            moved = one.cleared(moved, level)
        return positions if moved is positions else np.where(self.held, positions, moved)

    def touches(self, positions: Floats, level: float) -> tuple[Touch, ...]:
        """Return what each tool and grasp does at a state."""
        return tuple(one.touch(positions, level) for one in self.interactions)

    def at_rest(self, nodes: Floats) -> "Loading":
        """Return the loading of a linear theory: following loads become dead loads with their undeformed forces."""

        def dead(part: Loading) -> Loading:
            force = part.external_force - sum(load.gradient(nodes) for load in part.following)
            return replace(part, external_force=force, following=())

        return self.mapped(dead) if self.follows else self

    @property
    def driven_by_motion(self) -> bool:
        """Whether there are no loads but prescribed displacements, tools and grasps."""
        return not any(part.external_force.any() or part.following for part in self.parts)


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

    def lumped_mass(self) -> Floats:
        """Return the problem's lumped mass on all nodes of the potential [kg], shape (n_nodes,)."""
        ...


def loading_of(potential: Potential, loading: Loading) -> Loading:
    """Return the loading of all nodes of a potential; `loading` is that of the nodes of the mesh."""
    return potential.loading if isinstance(potential, Refined) else loading


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
