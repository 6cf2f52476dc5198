"""Load types of a map: the study's own, and standard ones for rectangles and boxes.

A load type is a function that returns supports and loads of size 1 for a bar, and an entry of LOAD_TYPES.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.loading import Fixed, Force, Load
from truespring.problem import Problem


@dataclass(frozen=True, slots=True)
class Bar:
    """A rectangle or box with its lower corner at the origin.

    Attributes:
        extent: its sides [m].
        thickness: of a plane one [m], 1 in space.
        modulus: Young's, as a test within the mesh's directions finds it [Pa].
    """

    extent: tuple[float, ...]
    thickness: float
    modulus: float

    @property
    def dim(self) -> int:
        """The number of directions."""
        return len(self.extent)

    @property
    def width(self) -> float:
        """The side across the plane of bending [m]."""
        return self.extent[2] if self.dim == 3 else self.thickness

    def along_x(self, length: float) -> tuple[float, ...]:
        """Return a motion along x [m]."""
        return tuple(length * (axis == 0) for axis in range(self.dim))


@dataclass(frozen=True, slots=True)
class Asked:
    """Supports and loads of size 1, by linear theory where a force drives the body, and where the probe is [m]."""

    supports: tuple[Fixed, ...]
    loads: tuple[Load, ...]
    probe: tuple[float, ...]


class Course(NamedTuple):
    """A solved path under a load type.

    Attributes:
        problem: supports and loads at load factor 1.
        displacements: of the nodes at each level [m], shape (n_levels, n_nodes, dim).
        levels: load factors, shape (n_levels,).
        probe: number of the probe's node.
        extent: the body's sides [m].
    """

    problem: Problem
    displacements: Floats
    levels: Floats
    probe: int
    extent: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class LoadType:
    """A way to load a body.

    Attributes:
        name: its value of `--load` and of the axis load-type.
        did: what was done to the body, the beginning of a sentence.
        how: supports and load in words.
        size: a noun for its size; `unit` is the unit of texts and figures, `scale` how many of it a size of 1 is.
        last: the size up to which it is mapped by default; of the study's own load, as far as that goes.
        sizes: returns the size at each level of a path, shape (n_levels,).
        standard: returns supports and loads of size 1; None for those of the study.
        moved: whether a support drives the body instead of a force, so that the load factor is the size.
        dims: the dimensions of the bodies it is for.
    """

    name: str
    did: str
    how: str
    size: str
    unit: str
    scale: float
    last: float | None
    sizes: Callable[[Course], Floats]
    standard: Callable[[Bar], Asked] | None = None
    moved: bool = False
    dims: tuple[int, ...] = (2, 3)

    @property
    def own(self) -> bool:
        """Whether supports and loads are those of the study."""
        return self.standard is None

    def told(self, size: float) -> str:
        """Return a size in its unit: "12 % strain"."""
        number = f"{self.scale * size:.2g}" if abs(self.scale * size) < 10 else f"{self.scale * size:.0f}"
        return f"{number}{'' if self.unit.startswith('°') else ' '}{self.unit}"

    @property
    def axis(self) -> str:
        """The label of an axis of it."""
        return f"{self.size} [{self.unit.split()[0]}]"


# --- sizes ------------------------------------------------------------------------------------------


def _by_probe(course: Course) -> Floats:
    """The probe's displacement over the largest side."""
    return np.asarray(np.linalg.norm(course.displacements[:, course.probe], axis=1) / np.max(course.extent))


def _by_motion(side: int) -> Callable[[Course], Floats]:
    """The motion of the last support along an axis, over a side."""

    def sizes(course: Course) -> Floats:
        motion = np.sum(course.problem.supports[-1].displacement or 0.0) / course.extent[side]
        return np.asarray(course.levels * abs(motion))

    return sizes


def _by_rotation(course: Course) -> Floats:
    """The rotation of the last support [rad]."""
    return np.asarray(course.levels * abs(course.problem.supports[-1].rotation))


def _by_work(course: Course) -> Floats:
    """The mean displacement along the force, over the length."""
    force = course.problem.loading.external_force
    work = np.einsum("ni,lni->l", force, course.displacements)
    return np.asarray(work / np.abs(force).sum() / course.extent[0])


# --- standard loads -----------------------------------------------------------------------------------


def _between_plates(bar: Bar, motion: float) -> Asked:
    """Smooth plates, the right one moved along x [m]: uniform uniaxial stress. The probe is free to move across."""
    length, height = bar.extent[:2]
    smooth = [("left", "x"), ("bottom", "y"), ("back", "z")][: bar.dim]
    held = tuple(Fixed(on, [axis]) for on, axis in smooth)
    corner = (length / 2, height, bar.width)[: bar.dim]
    return Asked((*held, Fixed("right", ["x"], displacement=bar.along_x(motion))), (), corner)


def _stretch(bar: Bar) -> Asked:
    return _between_plates(bar, bar.extent[0])


def _compress(bar: Bar) -> Asked:
    return _between_plates(bar, -bar.extent[0])


def _bend(bar: Bar) -> Asked:
    length, height = bar.extent[:2]
    slender = bar.modulus * bar.width * height**3 / (4 * length**3)  # 3 EI / length^3
    stocky = 0.4 * bar.modulus * bar.width * height / length  # about G A / length
    force = length / (1 / slender + 1 / stocky)
    total = tuple(-force * (axis == 1) for axis in range(bar.dim))
    return Asked((Fixed("left"),), (Force("right", total),), (length, height / 2, bar.width / 2)[: bar.dim])


def _shear(bar: Bar) -> Asked:
    length, height = bar.extent[:2]
    middle = (length / 2, height / 2, bar.width / 2)[: bar.dim]
    return Asked((Fixed("bottom"), Fixed("top", displacement=bar.along_x(height))), (), middle)


def _twist(bar: Bar) -> Asked:
    length, height = bar.extent[:2]
    clamps = (Fixed("left"), Fixed("right", rotation=1.0, axis=(1.0, 0.0, 0.0)))
    return Asked(clamps, (), (length / 2, height, bar.width))


_ALL = (
    LoadType(
        "own",
        "Loaded as in the study",
        "the study's own supports and loads; its size is how far the probe moves in the reference, over the "
        "largest extent of the body",
        "movement of the probe over the length of the body",
        "% of the length",
        100.0,
        None,
        _by_probe,
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
        _by_motion(0),
        _stretch,
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
        _by_motion(0),
        _compress,
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
        _by_work,
        _bend,
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
        _by_motion(1),
        _shear,
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
        _by_rotation,
        _twist,
        moved=True,
        dims=(3,),
    ),
)

#: The load types by name; a size of 1 is a strain of 1, a movement by the body's length, a radian.
LOAD_TYPES: Mapping[str, LoadType] = MappingProxyType({one.name: one for one in _ALL})
