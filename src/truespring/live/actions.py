"""What acts on a live body within a frame: grasps and spheres that move linearly from its begin to its end."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, Self, runtime_checkable

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Amplitude, Interaction, Loading
from truespring.loading import Body
from truespring.tools import Grasp, Sphere
from truespring.tools.contact import Contact
from truespring.tools.grasp import Springs
from truespring.tools.laws import Penalty
from truespring.tools.path import Track


@runtime_checkable
class HasBody(Protocol):
    """A potential with nodes of its own that loads and grasps act on.

    Attributes:
        body: the body with these nodes.
    """

    @property
    def body(self) -> Body:
        """The body with these nodes."""
        ...


@dataclass(frozen=True, eq=False)
class Grip:
    """A patch of the surface that is held by springs to its undeformed places plus a motion.

    Attributes:
        name: its name.
        at: centre of the patch on the undeformed body [m], shape (dim,).
        radius: of the patch [m].
        nodes: the held nodes, shape (n,).
        stiffness: of the spring of each [N/m], shape (n,).
        rest: undeformed positions of the held nodes [m], shape (n, dim).
        begin, end: motion at the begin and the end of the frame [m], shape (dim,).
        since: when it was added [s]; it acts after that time.
    """

    name: str
    at: Floats
    radius: float
    nodes: Ints
    stiffness: Floats
    rest: Floats
    begin: Floats
    end: Floats
    since: float = 0.0

    def to(self, motion: Floats) -> Self:
        """Return the grasp with another motion at the end of the frame [m], shape (dim,)."""
        return replace(self, end=motion)

    def on(self, body: Body) -> Self:
        """Return the grasp on the nodes of a body: another one if that has second-order elements, or lacks nodes."""
        if body.second_order is None and self.nodes.max(initial=0) < len(body.nodes):
            return self
        at = self.at.tolist()
        nodes, stiffness = Grasp(self.name, at, self.radius, at, float(self.stiffness.sum())).patch(body, None)
        return replace(self, nodes=nodes, stiffness=stiffness, rest=body.nodes[nodes])

    @property
    def settled(self) -> Self:
        """The grasp in the frame after this one, at its end."""
        return self if self.begin is self.end else replace(self, begin=self.end)

    @property
    def moves(self) -> bool:
        """Whether the place changes within the frame."""
        return bool((self.begin != self.end).any())

    @property
    def place(self) -> Floats:
        """The place of the centre at the end of the frame [m], shape (dim,)."""
        return np.asarray(self.at + self.end)

    def mean_motion(self, positions: Floats) -> Floats:
        """Return the mean displacement of the patch [m], shape (dim,); `positions` [m], shape (n_nodes, dim)."""
        return np.asarray(self.stiffness @ (positions[self.nodes] - self.rest) / self.stiffness.sum())

    def stored(self, positions: Floats) -> float:
        """Return the energy of the springs at the end of the frame [J]."""
        away = positions[self.nodes] - self.rest - self.end
        return float(self.stiffness @ (away**2).sum(axis=1)) / 2

    def interaction(self, nodes: Floats, times: tuple[float, float], span: float) -> Interaction:
        """Return the grasp as an action on a body from the begin to the end of the frame [s].

        `nodes` are the undeformed positions [m], shape (n_nodes, dim), `span` the duration at level 1 [s].
        """
        track = Track(np.array(times), np.stack([self.begin, self.end]), span)
        rest = nodes + self.begin  # the springs add the motion since level 0, where the track is at its begin
        return Springs(self.name, track, self.nodes, self.stiffness, rest)


@dataclass(frozen=True, eq=False)
class Ball:
    """A sphere that pushes the surface, without friction.

    Attributes:
        name: its name.
        radius: [m].
        stiffness: pressure per depth [Pa/m].
        begin, end: centre at the begin and the end of the frame [m], shape (dim,).
        since: when it was added [s]; it acts after that time.
    """

    name: str
    radius: float
    stiffness: float
    begin: Floats
    end: Floats
    since: float = 0.0

    def to(self, centre: Floats) -> Self:
        """Return the sphere with another centre at the end of the frame [m], shape (dim,)."""
        return replace(self, end=centre)

    @property
    def settled(self) -> Self:
        """The sphere in the frame after this one, at its end."""
        return self if self.begin is self.end else replace(self, begin=self.end)

    @property
    def moves(self) -> bool:
        """Whether the place changes within the frame."""
        return bool((self.begin != self.end).any())

    @property
    def place(self) -> Floats:
        """The centre at the end of the frame [m], shape (dim,)."""
        return self.end

    def stored(self, positions: Floats, surface: tuple[Ints, Floats]) -> float:
        """Return the energy of the contact at the end of the frame [J]; `surface` has nodes and areas [m^2]."""
        nodes, areas = surface
        gap = np.linalg.norm(positions[nodes] - self.end, axis=1) - self.radius
        return float(areas @ Penalty(self.stiffness).energy(gap))

    def interaction(
        self, surface: tuple[Ints, Floats], n_nodes: int, times: tuple[float, float], span: float
    ) -> Interaction:
        """Return the sphere as a tool from the begin to the end of the frame [s]; see `Grip.interaction`."""
        track = Track(np.array(times), np.stack([self.begin, self.end]), span)
        shape = Sphere(self.name, self.radius, self.begin.tolist())
        return Contact(self.name, shape, track, Penalty(self.stiffness), *surface, n_nodes)


@dataclass(frozen=True, eq=False)
class Weight:
    """Gravity beyond that of the loads; it changes linearly over a frame.

    Attributes:
        force: weight of the nodes [N], shape (n_nodes, dim).
        begin, end: the share of it that acts at the begin and the end of the frame [-].
    """

    force: Floats
    begin: float
    end: float

    @property
    def settled(self) -> Self:
        """The weight in the frame after this one, at its end."""
        return replace(self, begin=self.end)

    @property
    def moves(self) -> bool:
        """Whether it changes within the frame."""
        return self.begin != self.end

    def at(self, share: float) -> Floats:
        """Return the force at a share of the frame [N], shape (n_nodes, dim)."""
        return np.asarray((self.begin + share * (self.end - self.begin)) * self.force)

    def added_to(self, loading: Loading, times: tuple[float, float], span: float) -> Loading:
        """Return a loading with the weight from the begin to the end of the frame [s]; `span` as of a grasp."""
        if not (self.begin or self.end):
            return loading
        amplitude = Amplitude((0.0,), (self.end,), span)
        if self.moves:
            amplitude = Amplitude(times, (self.begin, self.end), span)
        added = Loading(self.force, loading.held, np.zeros_like(self.force), amplitude=amplitude)
        return replace(loading, further=(*loading.further, added))


def stacked(rows: Sequence[Floats], dim: int) -> Floats:
    """Return rows of shape (dim,) as an array of shape (n, dim), also of none."""
    return np.array(rows, dtype=float).reshape(len(rows), dim)
