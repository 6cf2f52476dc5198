"""Surface, lengths and stiffnesses of a body: what grasps and spheres have by default."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import LiveError
from truespring.live.actions import HasBody
from truespring.loading import Body as LoadedBody
from truespring.potential import Potential
from truespring.problem import Problem
from truespring.tools.surface import surface

# Radius of a grasp by default: the larger of these shares of a typical edge and of the size of the body.
_PATCH, _SHARE = 1.6, 0.05
# The stiffness of a contact on a node is at most this share of the stiffness that limits the step.
_CONTACT = 0.5


@dataclass(frozen=True, eq=False)
class Sizes:
    """The sizes of a body.

    Attributes:
        problem: its problem.
        potential: its potential.
        mass: of the nodes [kg], shape (n,).
        size: the diagonal of the undeformed body's bounding box [m].
        stable: the largest stable step of leapfrog, or the time between frames without one [s].
    """

    problem: Problem
    potential: Potential
    mass: Floats
    size: float
    stable: float

    @cached_property
    def surface(self) -> tuple[Ints, Floats]:
        """Nodes of the surface, and their shares of its undeformed area [m^2], shape (n,) each.

        Of a network of springs, which has no surface, all nodes without area.
        """
        mesh = self.problem.mesh
        if mesh.element == "line":
            return np.arange(mesh.n_nodes), np.zeros(mesh.n_nodes)
        return surface(self.problem.body, None)

    @property
    def acted_on(self) -> LoadedBody:
        """The body that grasps and spheres act on, with the further nodes of second-order elements."""
        potential = self.potential
        return potential.body if isinstance(potential, HasBody) else self.problem.body

    @cached_property
    def touched(self) -> tuple[Ints, Floats]:
        """As `surface`, with the further nodes of second-order elements: what spheres push."""
        body = self.acted_on
        return self.surface if body.second_order is None else surface(body, None)

    @cached_property
    def edge(self) -> float:
        """A typical edge of an element [m]."""
        mesh = self.problem.mesh
        return float(np.median(np.abs(mesh.measures)) ** (1 / mesh.dim))

    @property
    def patch(self) -> float:
        """The radius of a grasp by default [m]."""
        return max(_PATCH * self.edge, _SHARE * self.size)

    @property
    def ball(self) -> float:
        """The radius of a sphere by default [m]."""
        return 2 * _SHARE * self.size

    @cached_property
    def contact_stiffness(self) -> float:
        """The pressure per depth of a sphere [Pa/m]: that which does not shorten the step much."""
        nodes, areas = self.touched
        stiffest = float((areas / self.mass[nodes]).max())
        if not stiffest:
            raise LiveError("a sphere needs the surface of elements, and the body is a network of springs")
        return _CONTACT * (2 / self.stable) ** 2 / stiffest

    def grasp_stiffness(self, radius: float, stiffness: float | None) -> float:
        """Return the stiffness of a grasp [N/m], by default Young's modulus times the radius."""
        if stiffness is not None:
            return stiffness
        young = max((one.young for one in self.problem.materials), default=None)
        if young is None:
            raise LiveError("the stiffness of a grasp is required for a body without a material [N/m]")
        return young * (radius if self.problem.mesh.dim == 3 else self.problem.body.thickness)

    def undeformed(self, node: int) -> list[float]:
        """Return the undeformed place of a node [m]."""
        return [float(one) for one in self.problem.mesh.nodes[node]]

    def node_at(self, point: int | Sequence[float], positions: Floats) -> int:
        """Return the number of the node of the surface that is nearest to a place [m]; `positions` are those now [m].

        Of a number of a node, that number; raises LiveError if the body has no such node.
        """
        nodes, _ = self.surface
        if isinstance(point, int | np.integer):
            if not 0 <= point < self.problem.mesh.n_nodes:
                raise LiveError(f"node {point}: the body has nodes 0 to {self.problem.mesh.n_nodes - 1}")
            return int(point)
        away = positions[nodes] - np.asarray(point, dtype=float)
        return int(nodes[(away**2).sum(axis=1).argmin()])
