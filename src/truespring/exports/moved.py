"""What a motion of an exported body needs beyond its springs: mass, stable step, surface, sizes."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Loading, Refined, loading_of
from truespring.dynamics import Damping
from truespring.exports.exported import Exported
from truespring.material import WATER
from truespring.motion.explicit import stable_step
from truespring.motion.moving import Body
from truespring.potential import Massive
from truespring.tools.surface import surface

# Mass of a node of a network without masses [kg].
_NODE_MASS = 1.0
# Radius of a grasp by default: the larger of these shares of a typical edge and of the size of the body.
_PATCH, _SHARE = 1.6, 0.05
# Steps in which the load grows when the body settles: at least so many, and so many for a support to move by an edge.
_RAMP, _RAMP_PER_EDGE = 200, 100
# Step of a body in which nothing is free [s].
_STILL = 1.0


@dataclass(frozen=True, eq=False)
class Moved:
    """What a motion of the body needs beyond its springs.

    Attributes:
        exported: the exported model.
    """

    exported: Exported

    @cached_property
    def loading(self) -> Loading:
        """The loading of all nodes of the potential."""
        potential = self.exported.path.potential
        assert potential is not None  # springs have one
        return loading_of(potential, self.exported.problem.loading)

    @property
    def nodes(self) -> Floats:
        """Undeformed positions of all nodes of the potential [m], shape (n_nodes, dim)."""
        potential = self.exported.path.potential
        assert potential is not None  # springs have one
        return potential.nodes

    @cached_property
    def mass(self) -> Floats:
        """Lumped mass of each node [kg], shape (n_nodes,)."""
        potential: Any = self.exported.path.potential
        dense = self.exported.problem.dense
        if isinstance(potential, Refined):
            moved: Any = potential  # a frozen dataclass of the problem
            return np.asarray(replace(moved, problem=dense).lumped_mass())
        own = potential.mass if isinstance(potential, Massive) else np.zeros(0)
        if len(own):
            return own
        return dense.mass if dense.materials else np.full(len(self.nodes), _NODE_MASS)

    @cached_property
    def stable(self) -> float:
        """The largest stable step of leapfrog for small motion about the undeformed body [s]."""
        potential = self.exported.path.potential
        assert potential is not None  # springs have one
        step = stable_step(Body(potential, self.loading, self.mass, Damping(), None, 1.0, 1.0))
        return step if np.isfinite(step) and step > 0 else _STILL

    @cached_property
    def surface(self) -> tuple[Ints, Floats]:
        """Nodes that grasps hold and spheres touch, and their areas [m^2]; of a network all nodes, and equal shares."""
        mesh = self.exported.problem.mesh
        if mesh.element == "line":
            return np.arange(mesh.n_nodes), np.ones(mesh.n_nodes)
        return surface(self.exported.problem.body, None)

    @cached_property
    def edge(self) -> float:
        """A typical edge of an element [m]."""
        mesh = self.exported.problem.mesh
        dim = 1 if mesh.element == "line" else mesh.dim
        return float(np.median(np.abs(mesh.measures)) ** (1 / dim))

    @property
    def patch(self) -> float:
        """The radius of a grasp by default [m]."""
        return max(_PATCH * self.edge, _SHARE * float(np.linalg.norm(np.ptp(self.nodes, axis=0))))

    @property
    def ramp(self) -> int:
        """The number of steps in which the load grows when the body settles."""
        farthest = float(np.linalg.norm(self.loading.full.motion(), axis=1).max())
        return _RAMP + int(np.ceil(_RAMP_PER_EDGE * farthest / self.edge))

    @property
    def words(self) -> Iterator[str]:
        """Sentences on masses and steps."""
        problem = self.exported.problem
        if not problem.materials:
            yield f"A network without masses has {_NODE_MASS:g} kg per node."
        elif any(material.density is None for material in problem.materials):
            yield f"No density is given: that of water, {WATER:g} kg/m^3, is assumed."
        yield f"The largest stable step of the undeformed body is {self.stable:.6g} s; body.step is half of it."
