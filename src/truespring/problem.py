"""The problem: what is asked, stated once and frozen. Mesh, material, section, supports, loads."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.errors import NoLoadError, ProblemError
from truespring.material import Material, Section
from truespring.mesh import Mesh, Selection, select, shares
from truespring.mesh.selections import AXES
from truespring.potential import Loading


@dataclass(frozen=True)
class Fixed:
    """A support: the directions `fix` of the nodes `on` are held (all of them by default).

    `on` is a side ("left", "right", "bottom", "top"), a point ("right-middle"), a Plane, a Box, a Near or node numbers.
    `displacement` [m], one value a direction, moves them instead; it scales with the load factor.
    """

    on: Selection
    fix: Sequence[str] | None = None
    displacement: Sequence[float] | None = None


@dataclass(frozen=True)
class Force:
    """A dead load: the `total` force [N], one value a direction, shared consistently over the nodes `on`.

    `on` is a side ("left", "right", "bottom", "top"), a point ("right-middle"), a Plane, a Box, a Near or node numbers.
    """

    on: Selection
    total: Sequence[float]


@dataclass(frozen=True, eq=False)
class Problem:
    """A body, how it is held and what pulls at it.

    `material` and `section` may be absent where the model brings its own stiffness (a SpringNetwork).
    Raises ProblemError or MeshError where the parts do not fit, nothing loads the body, or the
    supports leave it free to move as a rigid body.
    """

    mesh: Mesh
    material: Material | None = None
    section: Section | None = None
    supports: Sequence[Fixed] = field(default=())
    loads: Sequence[Force] = field(default=())

    def __post_init__(self) -> None:
        object.__setattr__(self, "supports", _several(self.supports, Fixed, "supports"))
        object.__setattr__(self, "loads", _several(self.loads, Force, "loads"))
        if self.material is not None and self.mesh.kind.dim == 2 and self.section is None:
            raise ProblemError("a plane body needs a section: PlaneStress(thickness) or PlaneStrain(thickness)")
        loading = self.loading
        if not loading.external_force[~loading.held].any() and not loading.displacement.any():
            held = " in a direction that is free" if loading.external_force.any() else ""
            raise NoLoadError(
                f"nothing loads the body{held}: give a load, or a support with a displacement that is not zero"
            )
        self._refuse_rigid_motion()

    @cached_property
    def loading(self) -> Loading:
        """Forces and prescribed displacements at load factor 1."""
        held, displacement = self._supports()
        return Loading(self._forces(), held, displacement)

    def _forces(self) -> Floats:
        force = np.zeros(self.mesh.nodes.shape)
        for load in self.loads:
            total = _components(load.total, self.mesh.dim, "force", "N")
            nodes = select(self.mesh, load.on)
            force[nodes] += shares(self.mesh, nodes)[:, None] * total
        return force

    def _supports(self) -> tuple[Bools, Floats]:
        held = np.zeros(self.mesh.nodes.shape, dtype=bool)
        displacement = np.zeros(self.mesh.nodes.shape)
        axes = AXES[: self.mesh.dim]
        for support in self.supports:
            directions = list(axes) if support.fix is None else list(support.fix)
            if not directions or any(direction not in axes for direction in directions):
                raise ProblemError(f"fix = {directions}: allowed are the directions {', '.join(axes)}")
            given = [0.0] * self.mesh.dim if support.displacement is None else support.displacement
            motion = _components(given, self.mesh.dim, "displacement", "m")
            idle = [axis for axis, part in zip(axes, motion, strict=True) if part and axis not in directions]
            if idle:
                raise ProblemError(
                    f"displacement = {list(given)} [m] moves along {', '.join(idle)}, "
                    f"which fix = {directions} leaves free"
                )
            nodes = select(self.mesh, support.on)
            for axis in (axes.index(direction) for direction in directions):
                clash = nodes[held[nodes, axis] & (displacement[nodes, axis] != motion[axis])]
                if clash.size:
                    raise ProblemError(
                        f"two supports move node {clash[0]} along {axes[axis]} by "
                        f"{displacement[clash[0], axis]:g} m and by {motion[axis]:g} m: "
                        "a node has one prescribed motion"
                    )
                held[nodes, axis] = True
                displacement[nodes, axis] = motion[axis]
        return held, displacement

    def _refuse_rigid_motion(self) -> None:
        """Name a rigid motion that no support hinders: equilibrium would not be unique, or not exist."""
        modes = rigid_body_modes(self.mesh.nodes)
        hindered = modes[self.loading.held.ravel()]
        if hindered.size and np.linalg.matrix_rank(hindered, tol=1e-9 * np.sqrt(len(modes))) == modes.shape[1]:
            return
        free = [axis for axis, mode in zip(AXES[: self.mesh.dim], hindered.T, strict=False) if not mode.any()]
        raise ProblemError(
            f"the supports leave the body free to move {'along ' + ', '.join(free) if free else 'by turning'} "
            "as a rigid body: hold more directions or more nodes"
        )


def _several(given: object, kind: type, name: str) -> tuple[Any, ...]:
    """Return one or several of a kind as a tuple."""
    several = (given,) if isinstance(given, kind) else given
    if not isinstance(several, Sequence) or not all(isinstance(one, kind) for one in several):
        raise ProblemError(f"{name} = {given!r}: a list of {kind.__name__} is wanted")
    return tuple(several)


def rigid_body_modes(nodes: Floats) -> Floats:
    """Return translations, then infinitesimal rotations about the centre, shape (n_dof, 3 or 6), each of size 1."""
    n_nodes, dim = nodes.shape
    centred = nodes - nodes.mean(axis=0)
    centred = centred / max(float(np.abs(centred).max()), np.finfo(float).tiny)
    modes = [np.tile(np.eye(dim)[axis], n_nodes) for axis in range(dim)]
    for first in range(dim):
        for second in range(first + 1, dim):
            turn = np.zeros((n_nodes, dim))
            turn[:, first], turn[:, second] = -centred[:, second], centred[:, first]
            modes.append(turn.ravel())
    return np.stack(modes, axis=1)


def _components(values: Sequence[float], dim: int, name: str, unit: str) -> Floats:
    try:
        components = np.array([float(value) for value in values])
    except (TypeError, ValueError):
        raise ProblemError(f"{name} = {values!r}: one number [{unit}] a direction is wanted") from None
    if len(components) != dim:
        raise ProblemError(
            f"{name} = {list(values)} [{unit}] has {len(components)} values, the body has {dim} directions"
        )
    if not np.isfinite(components).all():
        raise ProblemError(f"{name} = {list(values)} [{unit}]: values must be finite")
    return components
