"""Load types of a map: the load of the study, and standard ones for rectangles and boxes.

A standard load type is an entry of LOAD_TYPES with a function that returns supports and loads of size 1 for a bar.
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
        thickness: of a plane bar [m], 1 in 3D.
        modulus: Young's modulus, in plane strain the one within the plane [Pa].
    """

    extent: tuple[float, ...]
    thickness: float
    modulus: float

    @property
    def dim(self) -> int:
        """Number of space dimensions."""
        return len(self.extent)

    @property
    def width(self) -> float:
        """The side across the plane of bending [m]."""
        return self.extent[2] if self.dim == 3 else self.thickness

    def along_x(self, length: float) -> tuple[float, ...]:
        """Return a vector along x [m], shape (dim,)."""
        return tuple(length * (axis == 0) for axis in range(self.dim))


@dataclass(frozen=True, slots=True)
class StandardLoad:
    """Supports and loads of size 1, for forces by linear theory, and the probe [m]."""

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
    """A load type of a map.

    Attributes:
        name: value of `--load` and of the axis load-type.
        did: beginning of sentences on it: "Stretched along x".
        how: supports and load in words.
        size: name of its size.
        unit: unit of the size in texts and figures.
        scale: a size of 1 in that unit.
        last: largest size by default; None for the full load of the study.
        sizes: returns the size at each level of a path, shape (n_levels,).
        standard: returns supports and loads of size 1; None for those of the study.
        moved: whether a moved support drives the body, so that the load factor is the size.
        dims: space dimensions of bodies that it is for.
    """

    name: str
    did: str
    how: str
    size: str
    unit: str
    scale: float
    last: float | None
    sizes: Callable[[Course], Floats]
    standard: Callable[[Bar], StandardLoad] | None = None
    moved: bool = False
    dims: tuple[int, ...] = (2, 3)

    @property
    def own(self) -> bool:
        """Whether it is the load of the study."""
        return self.standard is None

    def text(self, size: float) -> str:
        """Return a size with its unit: "12 % strain"."""
        number = f"{self.scale * size:.2g}" if abs(self.scale * size) < 10 else f"{self.scale * size:.0f}"
        return f"{number}{'' if self.unit.startswith('°') else ' '}{self.unit}"

    @property
    def axis(self) -> str:
        """Label of an axis of sizes."""
        return f"{self.size} [{self.unit.split()[0]}]"


# --- sizes ------------------------------------------------------------------------------------------


def _by_probe(course: Course) -> Floats:
    """Return the probe's displacement over the longest side, shape (n_levels,)."""
    return np.asarray(np.linalg.norm(course.displacements[:, course.probe], axis=1) / np.max(course.extent))


def _by_motion(side: int) -> Callable[[Course], Floats]:
    """Return a function for the motion of the last support over a side."""

    def sizes(course: Course) -> Floats:
        motion = np.sum(course.problem.supports[-1].displacement or 0.0) / course.extent[side]
        return np.asarray(course.levels * abs(motion))

    return sizes


def _by_rotation(course: Course) -> Floats:
    """Return the rotation of the last support [rad], shape (n_levels,)."""
    return np.asarray(course.levels * abs(course.problem.supports[-1].rotation))


def _by_work(course: Course) -> Floats:
    """Return the mean displacement along the force over the length, shape (n_levels,)."""
    force = course.problem.loading.full.dead_force()
    work = np.einsum("ni,lni->l", force, course.displacements)
    return np.asarray(work / np.abs(force).sum() / course.extent[0])


# --- standard loads -----------------------------------------------------------------------------------


def _between_plates(bar: Bar, motion: float) -> StandardLoad:
    """Return frictionless plates, the right one moved along x [m]; the probe moves laterally."""
    length, height = bar.extent[:2]
    smooth = [("left", "x"), ("bottom", "y"), ("back", "z")][: bar.dim]
    held = tuple(Fixed(on, [axis]) for on, axis in smooth)
    corner = (length / 2, height, bar.width)[: bar.dim]
    return StandardLoad((*held, Fixed("right", ["x"], displacement=bar.along_x(motion))), (), corner)


def _stretch(bar: Bar) -> StandardLoad:
    return _between_plates(bar, bar.extent[0])


def _compress(bar: Bar) -> StandardLoad:
    return _between_plates(bar, -bar.extent[0])


def _bend(bar: Bar) -> StandardLoad:
    length, height = bar.extent[:2]
    slender = bar.modulus * bar.width * height**3 / (4 * length**3)  # 3 EI / length^3
    stocky = 0.4 * bar.modulus * bar.width * height / length  # about G A / length
    force = length / (1 / slender + 1 / stocky)
    total = tuple(-force * (axis == 1) for axis in range(bar.dim))
    return StandardLoad((Fixed("left"),), (Force("right", total),), (length, height / 2, bar.width / 2)[: bar.dim])


def _shear(bar: Bar) -> StandardLoad:
    length, height = bar.extent[:2]
    middle = (length / 2, height / 2, bar.width / 2)[: bar.dim]
    return StandardLoad((Fixed("bottom"), Fixed("top", displacement=bar.along_x(height))), (), middle)


def _twist(bar: Bar) -> StandardLoad:
    length, height = bar.extent[:2]
    clamps = (Fixed("left"), Fixed("right", rotation=1.0, axis=(1.0, 0.0, 0.0)))
    return StandardLoad(clamps, (), (length / 2, height, bar.width))


_ALL = (
    LoadType(
        "own",
        "Loaded as in the study",
        "supports and loads of the study; the size is the displacement of the probe in the reference over the longest "
        "side of the body",
        "displacement of the probe over the length of the body",
        "% of the length",
        100.0,
        None,
        _by_probe,
    ),
    LoadType(
        "stretch",
        "Stretched along x",
        "between frictionless plates: the left end is fixed along x, the right one is moved along x, the bottom is "
        "fixed along y (in 3D the back along z): uniform uniaxial stress; the size is the nominal strain",
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
        "as stretch, with the right end moved toward the left one",
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
        "left end clamped, a dead force along -y distributed over the right end; the size is the mean deflection of "
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
        "Sheared along x",
        "bottom and top clamped to plates at a fixed distance, the top one moved along x; the size is that motion "
        "over the height",
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
        "both ends clamped, the right one rotated about the axis of the body; the size is the angle from end to end",
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

#: Load types by name; a size of 1 is a strain of 1, a displacement by the body's length, or a radian.
LOAD_TYPES: Mapping[str, LoadType] = MappingProxyType({one.name: one for one in _ALL})
