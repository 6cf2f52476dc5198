"""A grasp: a patch of the surface that is held by springs to a place that moves."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Always, Interaction, Slide, Touch
from truespring.errors import ToolError
from truespring.loading import Body, vector_words
from truespring.tools.during import during_words, interval, limited
from truespring.tools.path import Path, Track, path_words, track_of
from truespring.tools.skins import Skin, circles
from truespring.tools.surface import surface
from truespring.tools.values import positive, vector


@dataclass(frozen=True)
class Grasp:
    """A patch of a body that is held by springs to a place that moves, as by forceps.

    The springs pull each node of the patch to its undeformed position plus the motion along the path since its begin,
    or from its `origin`: a body at rest is unloaded there.

    Attributes:
        name: name in tables.
        at: centre of the patch on the undeformed body [m], one value per direction.
        radius: distance within which nodes of the boundary belong to the patch [m].
        path: rows of place on the way and coordinates [m], see Path.
        stiffness: stiffness of all springs together [N/m], shared by the areas of the nodes; None for E times the
            radius, in the plane E times the thickness, with E the largest Young's modulus of the body.
        during: begin and end of the part of the way in which it holds the patch, shares at rest, times in motion [s];
            None for the whole way.
        origin: place on the path at which the undeformed patch is unloaded [m], one value per direction; None for the
            begin of the path.

    Example:
        >>> import truespring as ts
        >>> ts.Grasp("forceps", at=(0.04, 0.01), radius=0.004, path=[(0, 0.04, 0.01), (1, 0.05, 0.01)]).words()
        "'forceps': grasp within 0.004 m of (0.04, 0.01) m, from (0.04, 0.01) m to (0.05, 0.01) m"
    """

    name: str
    at: Sequence[float]
    radius: float
    path: Path
    stiffness: float | None = None
    during: Sequence[float] | None = None
    origin: Sequence[float] | None = None

    def words(self) -> str:
        """Return name, patch and path, for tables."""
        where = f"grasp within {self.radius:g} m of {vector_words(self.at)} m"
        return f"'{self.name}': {where}, {path_words(self.path)}{during_words(self.during)}"

    def skin(self, centre: Floats, size: float) -> Skin:
        """Return the circle, in space three circles, of the places within the radius; see `Tool.skin`."""
        return circles(self.radius, len(centre))

    def acting_on(self, body: Body, young: float | None, span: float) -> Interaction:
        """Return the springs of the grasp on a body; arguments and errors as `Tool.acting_on`."""
        dim, during = body.mesh.dim, interval(self.name, self.during, span)
        track = track_of(self.name, self.path, dim, span, during)
        origin = None if self.origin is None else vector(self.name, "origin", self.origin, dim, "m")
        nodes, stiffness = self.patch(body, young)
        return limited(Springs(self.name, track, nodes, stiffness, body.nodes, origin), during, span)

    def patch(self, body: Body, young: float | None) -> tuple[Ints, Floats]:
        """Return the held nodes and the stiffness of the spring of each [N/m], shape (n,); as `acting_on`."""
        dim = body.mesh.dim
        at, radius = vector(self.name, "at", self.at, dim, "m"), positive(self.name, "radius", self.radius, "m")
        if self.stiffness is None and young is None:
            raise ToolError(self.name, "is required for a body without a material [N/m]", "stiffness")
        default = (young or 0.0) * (radius if dim == 3 else body.thickness)
        stiffness = positive(self.name, "stiffness", default if self.stiffness is None else self.stiffness, "N/m")
        nodes, areas = _surface(body)
        distance = np.linalg.norm(body.nodes[nodes] - at, axis=1)
        inside = distance <= radius
        if not inside.any():
            nearest = int(distance.argmin())
            place = vector_words(body.nodes[nodes[nearest]])
            raise ToolError(
                self.name,
                f"no node of the boundary is within {radius:g} m of {vector_words(at)} m: the "
                f"nearest, at {place} m, is {distance[nearest]:.4g} m away; move the grasp or increase the radius",
                "at",
            )
        shares = areas[inside] / areas[inside].sum()
        return nodes[inside], stiffness * shares


def _surface(body: Body) -> tuple[Ints, Floats]:
    """Return nodes and areas of the boundary, of a network of springs all nodes and equal shares."""
    if body.mesh.element == "line":
        return np.arange(len(body.nodes)), np.ones(len(body.nodes))
    return surface(body, None)


@dataclass(frozen=True, eq=False)
class Springs(Always):
    """Springs from nodes to places that move together, an Interaction.

    Attributes:
        name: name of the grasp.
        track: its path.
        nodes: the held nodes, shape (n,).
        stiffness: of the spring of each [N/m], shape (n,).
        rest: undeformed positions of all nodes [m], shape (n_nodes, dim).
        origin: place on the path at which they are unloaded there [m], shape (dim,); None for that at level 0.
    """

    name: str
    track: Track
    nodes: Ints
    stiffness: Floats
    rest: Floats
    origin: Floats | None = None

    @property
    def corners(self) -> tuple[float, ...]:
        """The levels between 0 and 1 at which the path has a corner [-]."""
        return self.track.corners

    @property
    def dissipates(self) -> bool:
        """False: springs store their work."""
        return False

    def _stretch(self, positions: Floats, level: float) -> Floats:
        """Return the vectors from the ends of the springs to the nodes [m], shape (n, dim)."""
        motion = self.track.at(level) - (self.track.at(0.0) if self.origin is None else self.origin)
        return np.asarray(positions[self.nodes] - self.rest[self.nodes] - motion)

    def energy(self, positions: Floats, level: float) -> float:
        """Return the energy of the springs [J]."""
        return self.stored(positions, level)

    def stored(self, positions: Floats, level: float) -> float:
        """Return the energy of the springs [J]."""
        return float(self.stiffness @ (self._stretch(positions, level) ** 2).sum(axis=1)) / 2

    def gradient(self, positions: Floats, level: float) -> Floats:
        """Return minus the force on the nodes [N], shape (n_nodes, dim)."""
        found = np.zeros_like(positions)
        found[self.nodes] = self.stiffness[:, None] * self._stretch(positions, level)
        return found

    def blocks(self, positions: Floats, level: float) -> tuple[Ints, Floats]:
        """Return nodes, shape (n,), and the stiffness of their springs [N/m], shape (n, dim, dim)."""
        return self.nodes, self.stiffness[:, None, None] * np.eye(positions.shape[1])

    def since(self, positions: Floats, level: float, creep: float) -> Self:
        """Return the springs themselves."""
        return self

    def lagged(self, positions: Floats, level: float) -> Self:
        """Return the springs themselves."""
        return self

    def rubbed(self, force: Floats) -> Self:
        """Return the springs themselves."""
        return self

    def slide(self, positions: Floats, level: float) -> Slide:
        """Return no friction."""
        dim = positions.shape[1]
        return Slide(np.zeros(0, dtype=np.int64), np.zeros((0, dim)), np.zeros(0), self.track.velocity(level))

    def cleared(self, positions: Floats, level: float) -> Floats:
        """Return the positions themselves."""
        return positions

    def touch(self, positions: Floats, level: float) -> Touch:
        """Return place, force of the body on the grasp, and largest extension of a spring."""
        stretch = self._stretch(positions, level)
        return Touch(self.track.at(level), self.stiffness @ stretch, float(np.linalg.norm(stretch, axis=1).max()))

    def largest_stiffness(self) -> Floats:
        """Return the stiffness of the spring of each node [N/m], shape (n_nodes,)."""
        found = np.zeros(len(self.rest))
        found[self.nodes] = self.stiffness
        return found
