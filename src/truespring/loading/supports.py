"""Supports: nodes that are held, or moved and turned as prescribed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ProblemError
from truespring.loading.values import components, number
from truespring.mesh import Mesh, Selection, select
from truespring.mesh.selections import AXES
from truespring.potential import Turn


@dataclass(frozen=True)
class Fixed:
    """A support: the directions `fix` of the nodes `on` are held (all of them by default).

    `on` is a group of the mesh, a side ("left", "right", "bottom", "top", "back", "front"), a point
    ("right-middle"), a Plane, a Box, a Near or node numbers.
    `displacement` [m], one value a direction, moves them instead, and `rotation` [rad] turns them as a rigid
    body about the point `about` [m], by default their centre, anticlockwise; in space about the direction `axis`.
    Both scale with the load factor.
    """

    on: Selection
    fix: Sequence[str] | None = None
    displacement: Sequence[float] | None = None
    rotation: float = 0.0
    about: Sequence[float] | None = None
    axis: Sequence[float] | None = None


class Held(NamedTuple):
    """What a support holds: `nodes`, the numbers of their `directions`, the motion [m], the turn if there is one."""

    nodes: Ints
    directions: list[int]
    motion: Floats
    turn: Turn | None


def held_by(mesh: Mesh, support: Fixed) -> Held:
    """Return what a support holds; raise ProblemError where its values do not fit."""
    axes = AXES[: mesh.dim]
    directions = list(axes) if support.fix is None else list(support.fix)
    if not directions or any(direction not in axes for direction in directions):
        raise ProblemError(f"fix = {directions}: allowed are the directions {', '.join(axes)}")
    given = [0.0] * mesh.dim if support.displacement is None else support.displacement
    motion = components(given, mesh.dim, "displacement", "m")
    idle = [axis for axis, part in zip(axes, motion, strict=True) if part and axis not in directions]
    if idle:
        raise ProblemError(
            f"displacement = {list(given)} [m] moves along {', '.join(idle)}, which fix = {directions} leaves free"
        )
    nodes = select(mesh, support.on)
    return Held(nodes, [axes.index(direction) for direction in directions], motion, _turn(mesh, support, nodes))


def _turn(mesh: Mesh, support: Fixed, nodes: Ints) -> Turn | None:
    angle = number(support.rotation, "rotation", "rad")
    if not angle:
        for name in ("about", "axis"):
            if getattr(support, name) is not None:
                raise ProblemError(f"{name} is given without a rotation")
        return None
    if support.fix is not None and set(support.fix) != set(AXES[: mesh.dim]):
        raise ProblemError(
            f"rotation = {angle:g} rad turns all directions, which fix = {list(support.fix)} does not hold"
        )
    centre = mesh.nodes[nodes].mean(axis=0)
    if support.about is not None:
        centre = components(support.about, mesh.dim, "about", "m")
    if mesh.dim == 2:
        if support.axis is not None:
            raise ProblemError("a plane body turns in its plane: it has no axis to choose")
        axis = np.array([0.0, 0.0, 1.0])
    elif support.axis is None:
        raise ProblemError("rotation needs an axis in space: the direction about which it turns, such as (1, 0, 0)")
    else:
        axis = components(support.axis, 3, "axis", "-")
        if not axis.any():
            raise ProblemError("axis = (0, 0, 0) is no direction")
    return Turn(nodes, mesh.nodes[nodes] - centre, axis / np.linalg.norm(axis), angle)
