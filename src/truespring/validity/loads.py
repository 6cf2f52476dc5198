"""Load types of a map: the study's own, and standard ones that a rectangle or box is put under."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.loading import Fixed, Force, Gravity, Moment, Pressure, Traction
from truespring.problem import Load, Problem


@dataclass(frozen=True, slots=True)
class LoadType:
    """A way to load a body.

    Attributes:
        name: what `--load` and the axis load-type call it.
        did: what was done to the body, the beginning of a sentence.
        how: supports and load in words.
        size: what its size is, a noun; `unit` the unit in which it is told and `scale` how many of it a size of 1 is.
        last: the size up to which it is mapped unless told otherwise; of the study's own load, as far as that goes.
        moved: whether a support drives the body instead of a force.
        dims: the dimensions of the bodies it is for.
    """

    name: str
    did: str
    how: str
    size: str
    unit: str
    scale: float
    last: float | None
    moved: bool = False
    dims: tuple[int, ...] = (2, 3)

    def told(self, size: float) -> str:
        """Return a size in its unit: "12 % strain"."""
        number = f"{self.scale * size:.2g}" if abs(self.scale * size) < 10 else f"{self.scale * size:.0f}"
        return f"{number}{'' if self.unit.startswith('°') else ' '}{self.unit}"

    @property
    def axis(self) -> str:
        """What stands at an axis of it."""
        return f"{self.size} [{self.unit.split()[0]}]"


#: The load types by name; a size of 1 is a strain of 1, a movement by the body's length, a radian.
LOADS: dict[str, LoadType] = {
    one.name: one
    for one in (
        LoadType(
            "own",
            "Loaded as in the study",
            "the study's own supports and loads; its size is how far the probe moves in the reference, over the "
            "largest extent of the body",
            "movement of the probe over the length of the body",
            "% of the length",
            100.0,
            None,
        ),
        LoadType(
            "stretch",
            "Stretched along x",
            "between smooth plates: the left end stands still, the right one is moved along x, the bottom lies on a "
            "smooth table (in space the back against another): uniform uniaxial stress; its size is the nominal strain",
            "nominal strain",
            "% strain",
            100.0,
            0.5,
            moved=True,
        ),
        LoadType(
            "compress",
            "Compressed along x",
            "as stretch, pushed together instead of pulled apart",
            "nominal compressive strain",
            "% strain",
            100.0,
            0.3,
            moved=True,
        ),
        LoadType(
            "bend",
            "Bent as a cantilever",
            "left end clamped, a dead force along -y spread over the right end; its size is the mean deflection of "
            "that end over the length",
            "deflection of the end over the length",
            "% of the length",
            100.0,
            0.5,
        ),
        LoadType(
            "shear",
            "Sheared top against bottom",
            "bottom and top clamped to plates that keep their distance, the top one moved along x; its size is that "
            "movement over the height",
            "nominal shear strain",
            "% shear strain",
            100.0,
            0.5,
            moved=True,
        ),
        LoadType(
            "twist",
            "Twisted about x",
            "both ends clamped, the right one turned about the axis of the body; its size is the angle from end to end",
            "twist from end to end",
            "° from end to end",
            180 / math.pi,
            math.pi / 2,
            moved=True,
            dims=(3,),
        ),
    )
}


@dataclass(frozen=True, slots=True)
class Asked:
    """Supports and loads at a share 1 of what they are scaled by, and where the probe is [m]."""

    supports: tuple[Fixed, ...]
    loads: tuple[Load, ...]
    probe: tuple[float, ...]


def standard(name: str, extent: Sequence[float], thickness: float, modulus: float) -> Asked:
    """Return supports and loads of size 1, of bending so by linear theory.

    `extent` are the sides of a rectangle or box from the origin on, `thickness` is 1 in space [m]; `modulus` is
    Young's [Pa].
    """
    dim, (length, height), width = len(extent), extent[:2], extent[2] if len(extent) == 3 else thickness
    end = (length, height / 2, width / 2)[:dim]
    along = tuple(float(axis == 0) for axis in range(dim))
    if name in ("stretch", "compress"):
        motion = tuple((length if name == "stretch" else -length) * part for part in along)
        smooth = [("left", "x"), ("bottom", "y"), ("back", "z")][:dim]
        held = tuple(Fixed(on, [axis]) for on, axis in smooth)
        corner = (length / 2, height, width)[:dim]  # the plates leave it free to move across
        return Asked((*held, Fixed("right", ["x"], displacement=motion)), (), corner)
    if name == "shear":
        motion = tuple(height * part for part in along)
        middle = (length / 2, height / 2, width / 2)[:dim]
        return Asked((Fixed("bottom"), Fixed("top", displacement=motion)), (), middle)
    if name == "twist":
        corner = (length / 2, height, width)
        return Asked((Fixed("left"), Fixed("right", rotation=1.0, axis=(1.0, 0.0, 0.0))), (), corner)
    slender = modulus * width * height**3 / (4 * length**3)  # 3 EI / length^3
    stocky = 0.4 * modulus * width * height / length  # about G A / length
    force = length / (1 / slender + 1 / stocky)
    return Asked((Fixed("left"),), (Force("right", tuple(-force * (axis == 1) for axis in range(dim))),), end)


def scaled(problem: Problem, factor: float) -> Problem:
    """Return the problem with every load and prescribed motion times a factor."""
    loads = [_times(load, factor) for load in problem.loads]
    supports = [
        replace(
            support,
            displacement=None
            if support.displacement is None
            else tuple(factor * part for part in support.displacement),
            rotation=factor * support.rotation,
        )
        for support in problem.supports
    ]
    return replace(problem, loads=loads, supports=supports)


def _times(load: Load, factor: float) -> Load:
    def several(values: Sequence[float]) -> tuple[float, ...]:
        return tuple(factor * one for one in values)

    match load:
        case Force():
            return replace(load, total=several(load.total))
        case Traction():
            return replace(load, traction=several(load.traction))
        case Gravity():
            return replace(load, acceleration=several(load.acceleration))
        case Pressure():
            return replace(load, pressure=factor * load.pressure)
        case Moment():
            return replace(load, moment=factor * load.moment)


def sizes(load: LoadType, problem: Problem, displacements: Floats, levels: Floats, probe: int, extent: Any) -> Floats:
    """Return the size of a load at each level of a path, shape (n_levels,), by its definition in LOADS.

    `displacements` [m] have the shape (n_levels, n_nodes, dim), `extent` is the body's along each direction [m].
    """
    if load.name == "own":
        return np.asarray(np.linalg.norm(displacements[:, probe], axis=1) / np.max(extent))
    if load.moved:
        moved = problem.supports[-1]
        way = moved.rotation or np.sum(moved.displacement or 0.0) / extent[1 if load.name == "shear" else 0]
        return np.asarray(levels * abs(way))
    force = problem.loading.external_force
    return np.asarray(np.einsum("ni,lni->l", force, displacements) / np.abs(force).sum() / extent[0])
