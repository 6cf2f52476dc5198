"""Supports: nodes that are fixed, or moved and rotated as prescribed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Self

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Turn
from truespring.errors import ProblemError
from truespring.loading.history import History
from truespring.loading.load import Mark
from truespring.loading.values import components, number, rotated, times
from truespring.loading.words import selection_words, vector_words
from truespring.mesh import Mesh, Selection, select
from truespring.mesh.selections import AXES

# Rotation [rad] that is small enough to draw its motion as a direction.
_SMALL = 1e-3


@dataclass(frozen=True)
class Fixed:
    """A support that holds the nodes `on`, or moves them as prescribed.

    Prescribed motion is multiplied by the load factor, or follows a history.

    Attributes:
        on: a group of the mesh, a side ("left", "right", "bottom", "top", "back", "front"), a point ("right-middle"), a
            Plane, a Box, a Near or node numbers.
        fix: the directions that are held or prescribed, such as ["x"]; None for all.
        displacement: prescribed displacement [m], one value per direction; None for zero.
        rotation: prescribed rotation [rad] of the nodes as a rigid body, anticlockwise in 2D, about `axis` in 3D.
        about: centre of the rotation [m]; None for the centre of the nodes.
        axis: direction of the axis of rotation in 3D.
        over: share of the prescribed motion along the way or over time, see History; None in proportion to the way at
            rest, and in motion for the whole motion at once.

    Example:
        >>> import truespring as ts
        >>> ts.Fixed("left").words(2)
        "'left' held along x, y"
        >>> ts.Fixed("right", displacement=(0.01, 0.0)).words(2)
        "'right' held along x, y, moved by (0.01, 0) m"
    """

    on: Selection
    fix: Sequence[str] | None = None
    displacement: Sequence[float] | None = None
    rotation: float = 0.0
    about: Sequence[float] | None = None
    axis: Sequence[float] | None = None
    over: History | None = field(default=None, kw_only=True)

    def scaled(self, factor: float) -> Self:
        """Return the support with its prescribed motion multiplied by a factor."""
        moved = None if self.displacement is None else times(self.displacement, factor)
        return replace(self, displacement=moved, rotation=factor * self.rotation)

    @property
    def vector(self) -> Floats | None:
        """The prescribed displacement [m], shape (dim,); None without one, or if `fix` leaves directions free."""
        if self.displacement is None or self.fix is not None:
            return None
        return np.array(self.displacement, dtype=float)

    def turned(self, rotation: Floats) -> Self:
        """Return the support with `vector` rotated by a matrix of shape (dim, dim); unchanged without a vector."""
        if self.displacement is None or self.vector is None:
            return self
        return replace(self, displacement=rotated(self.displacement, rotation))

    def moved_to(self, on: Selection) -> Self:
        """Return the support on another selection, such as a group of another mesh."""
        return replace(self, on=on)

    def words(self, dim: int) -> str:
        """Return a description without a full stop: "'left' held along x, y"."""
        axes = ", ".join(AXES[:dim] if self.fix is None else self.fix)
        words = f"{selection_words(self.on)} held along {axes}"
        if self.displacement is not None:
            words += f", moved by {vector_words(self.displacement)} m"
        if self.rotation:
            words += f", turned by {self.rotation:g} rad"
        return words


class Held(NamedTuple):
    """The nodes and directions of a mesh that a support holds.

    Attributes:
        nodes: numbers of the held nodes, shape (n,).
        directions: numbers of the held directions, from 0.
        motion: prescribed displacement [m], shape (dim,).
        turn: prescribed rotation; None without one.
    """

    nodes: Ints
    directions: list[int]
    motion: Floats
    turn: Turn | None

    def marks(self) -> Iterator[Mark]:
        """Yield an arrow for the prescribed displacement and one for the rotation, if they are not zero."""
        if self.motion.any():
            yield Mark(self.nodes, self.motion, "u", float(np.linalg.norm(self.motion)), "m")
        if self.turn is not None:
            small = self.turn.motion(_SMALL / abs(self.turn.angle))
            outermost = int(np.linalg.norm(small, axis=1).argmax())
            yield Mark(self.nodes, small[outermost], "turn", float(np.degrees(self.turn.angle)), "°")


def held_by(mesh: Mesh, support: Fixed) -> Held:
    """Return the nodes and directions that a support holds; raise ProblemError if its values do not fit the mesh."""
    axes = AXES[: mesh.dim]
    directions = list(axes) if support.fix is None else list(support.fix)
    if not directions or any(direction not in axes for direction in directions):
        raise ProblemError(f"fix = {directions}: allowed: {', '.join(axes)}, at least one")
    displacement = [0.0] * mesh.dim if support.displacement is None else support.displacement
    motion = components(displacement, mesh.dim, "displacement", "m")
    idle = [axis for axis, part in zip(axes, motion, strict=True) if part and axis not in directions]
    if idle:
        raise ProblemError(
            f"displacement = {list(displacement)} [m] moves along {', '.join(idle)}, "
            f"which fix = {directions} leaves free"
        )
    nodes = select(mesh, support.on)
    return Held(nodes, [axes.index(direction) for direction in directions], motion, _turn(mesh, support, nodes))


def _turn(mesh: Mesh, support: Fixed, nodes: Ints) -> Turn | None:
    """Return the prescribed rotation of a support, None without one; raise ProblemError if its values do not fit."""
    angle = number(support.rotation, "rotation", "rad")
    if not angle:
        for name in ("about", "axis"):
            if getattr(support, name) is not None:
                raise ProblemError(f"{name} is given without a rotation: leave it out")
        return None
    if support.fix is not None and set(support.fix) != set(AXES[: mesh.dim]):
        raise ProblemError(
            f"rotation = {angle:g} rad needs all directions held, "
            f"fix = {list(support.fix)} leaves some free: leave out fix"
        )
    centre = mesh.nodes[nodes].mean(axis=0)
    if support.about is not None:
        centre = components(support.about, mesh.dim, "about", "m")
    if mesh.dim == 2:
        if support.axis is not None:
            raise ProblemError("a plane body rotates in its plane: leave out axis")
        axis = np.array([0.0, 0.0, 1.0])
    elif support.axis is None:
        raise ProblemError("rotation needs an axis in 3D, a direction such as (1, 0, 0)")
    else:
        axis = components(support.axis, 3, "axis", "-")
        if not axis.any():
            raise ProblemError("axis = (0, 0, 0) is not a direction")
    return Turn(nodes, mesh.nodes[nodes] - centre, axis / np.linalg.norm(axis), angle)
