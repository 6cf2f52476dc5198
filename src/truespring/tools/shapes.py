"""Shapes of tools: sphere, capsule, half-space and block; in the plane disc, stadium, half-plane and rectangle."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.errors import ToolError
from truespring.loading import vector_words
from truespring.tools.path import Path
from truespring.tools.skins import Skin, cuboid, flat, rounded
from truespring.tools.tool import Tool
from truespring.tools.values import positive, vector


class _Round(Tool):
    """A tool whose surface has a constant distance, `radius`, from a core."""

    radius: float

    @abstractmethod
    def core(self, places: Floats) -> tuple[Floats, Floats]:
        """Return vectors from the nearest point of the core to places [m], shape (n, dim), and projectors.

        A projector, shape (n, dim, dim) [-], takes out the directions along which the nearest point follows a place.
        """

    def gaps(self, places: Floats) -> tuple[Floats, Floats]:
        """Return the distance from the core minus the radius [m], and the normals."""
        arms, _ = self.core(places)
        length = np.linalg.norm(arms, axis=1)
        return length - self.radius, _unit(arms, length)

    def bends(self, places: Floats) -> Floats:
        """Return (projector - normal normal^T) / distance [1/m]."""
        arms, across = self.core(places)
        length = np.linalg.norm(arms, axis=1)
        normal = _unit(arms, length)
        return np.asarray(
            (across - normal[:, :, None] * normal[:, None, :]) / np.where(length > 0, length, np.inf)[:, None, None]
        )


@dataclass(frozen=True)
class Sphere(_Round):
    """A sphere, in the plane a disc, of a `radius` [m]; its path is that of the centre.

    Attributes as those of Tool and Touching.

    Example:
        >>> import truespring as ts
        >>> probe = ts.Sphere("probe", radius=0.005, path=[(0, 0.02, 0.016), (1, 0.02, 0.013)], friction=0.2)
        >>> probe.words()
        "'probe': sphere of radius 0.005 m, friction 0.2, from (0.02, 0.016) m to (0.02, 0.013) m"
    """

    name: str
    radius: float
    path: Path

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Smallest and largest coordinates relative to the place [m]."""
        return np.array(-self.radius), np.array(self.radius)

    def points(self, dim: int) -> Floats:
        """Return the centre."""
        return np.zeros((1, dim))

    def check(self, dim: int) -> None:
        """Raise ToolError unless the radius is positive."""
        positive(self.name, "radius", self.radius, "m")

    def form(self) -> str:
        """Return shape and dimensions."""
        return f"sphere of radius {self.radius:g} m"

    def skin(self, centre: Floats, size: float) -> Skin:
        """Return the surface."""
        return rounded(self.radius, np.zeros(len(centre)), np.zeros(len(centre)))

    def core(self, places: Floats) -> tuple[Floats, Floats]:
        """Return the places and identity matrices."""
        n, dim = places.shape
        return places, np.broadcast_to(np.eye(dim), (n, dim, dim))


@dataclass(frozen=True)
class Capsule(_Round):
    """A capsule, in the plane a stadium: the places nearer than `radius` [m] to the line from `start` to `end` [m].

    The ends are relative to the place on the path. Attributes as those of Tool and Touching.

    Example:
        >>> import truespring as ts
        >>> path = [(0, 0.02, 0.02), (1, 0.02, 0.015)]
        >>> ts.Capsule("rod", radius=0.002, start=(-0.01, 0.0), end=(0.01, 0.0), path=path).words()
        "'rod': capsule of radius 0.002 m from (-0.01, 0) to (0.01, 0) m, from (0.02, 0.02) m to (0.02, 0.015) m"
    """

    name: str
    radius: float
    start: Sequence[float]
    end: Sequence[float]
    path: Path

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Smallest and largest coordinates relative to the place [m]."""
        ends = np.array([self.start, self.end], dtype=float)
        return ends.min(axis=0) - self.radius, ends.max(axis=0) + self.radius

    def points(self, dim: int) -> Floats:
        """Return the ends of the axis."""
        return np.array([self.start, self.end], dtype=float)

    def check(self, dim: int) -> None:
        """Raise ToolError unless the radius is positive, and the ends are two points."""
        positive(self.name, "radius", self.radius, "m")
        start, end = (vector(self.name, key, getattr(self, key), dim, "m") for key in ("start", "end"))
        if np.array_equal(start, end):
            raise ToolError(self.name, f"{list(self.end)} is the start itself: use a sphere", "end")

    def form(self) -> str:
        """Return shape and dimensions."""
        return f"capsule of radius {self.radius:g} m from {vector_words(self.start)} to {vector_words(self.end)} m"

    def skin(self, centre: Floats, size: float) -> Skin:
        """Return the surface."""
        return rounded(self.radius, np.asarray(self.start, dtype=float), np.asarray(self.end, dtype=float))

    def core(self, places: Floats) -> tuple[Floats, Floats]:
        """Return the vectors from the nearest points of the line; between its ends they follow the places along it."""
        start, end = np.asarray(self.start, dtype=float), np.asarray(self.end, dtype=float)
        length = np.linalg.norm(end - start)
        axis = (end - start) / length
        along = (places - start) @ axis
        between = (along > 0) & (along < length)
        arms = places - start - np.clip(along, 0, length)[:, None] * axis
        return arms, np.eye(len(axis)) - between[:, None, None] * np.outer(axis, axis)


@dataclass(frozen=True)
class HalfSpace(Tool):
    """A half-space, in the plane a half-plane: its flat surface goes through the place on the path.

    Attributes:
        name, path: as those of Tool; further ones as those of Touching.
        normal: direction of any length that points out of the tool, towards the body [-].

    Example:
        >>> import truespring as ts
        >>> ts.HalfSpace("floor", normal=(0.0, 1.0), path=(0.0, 0.0)).words()
        "'floor': plane with normal (0, 1), at (0, 0) m"
    """

    name: str
    normal: Sequence[float]
    path: Path

    def check(self, dim: int) -> None:
        """Raise ToolError unless the normal is a direction."""
        if not vector(self.name, "normal", self.normal, dim, "-").any():
            raise ToolError(self.name, f"{list(self.normal)}: must not be zero", "normal")

    def form(self) -> str:
        """Return shape and dimensions."""
        return f"plane with normal {vector_words(self.normal)}"

    def skin(self, centre: Floats, size: float) -> Skin:
        """Return a part of the flat surface."""
        return flat(np.asarray(self.normal, dtype=float), centre, size)

    def gaps(self, places: Floats) -> tuple[Floats, Floats]:
        """Return the distance from the surface [m], and the normal."""
        normal = np.asarray(self.normal, dtype=float)
        normal = normal / np.linalg.norm(normal)
        return places @ normal, np.broadcast_to(normal, places.shape)

    def bends(self, places: Floats) -> Floats:
        """Return zeros."""
        n, dim = places.shape
        return np.zeros((n, dim, dim))


@dataclass(frozen=True)
class Block(Tool):
    """A box along the axes, in the plane a rectangle; its path is that of the centre.

    Attributes:
        name, path: as those of Tool; further ones as those of Touching.
        size: lengths along the axes [m].

    Example:
        >>> import truespring as ts
        >>> ts.Block("plate", size=(0.06, 0.01), path=[(0, 0.02, 0.016), (1, 0.02, 0.013)]).words()
        "'plate': box of (0.06, 0.01) m, from (0.02, 0.016) m to (0.02, 0.013) m"
    """

    name: str
    size: Sequence[float]
    path: Path

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Smallest and largest coordinates relative to the place [m]."""
        half = np.asarray(self.size, dtype=float) / 2
        return -half, half

    def points(self, dim: int) -> Floats:
        """Return the centre."""
        return np.zeros((1, dim))

    def check(self, dim: int) -> None:
        """Raise ToolError unless the lengths are positive."""
        if not (vector(self.name, "size", self.size, dim, "m") > 0).all():
            raise ToolError(self.name, f"{list(self.size)} m: must be positive", "size")

    def form(self) -> str:
        """Return shape and dimensions."""
        return f"box of {vector_words(self.size)} m"

    def skin(self, centre: Floats, size: float) -> Skin:
        """Return the surface."""
        return cuboid(np.asarray(self.size, dtype=float))

    def _outside(self, places: Floats) -> tuple[Floats, Bools]:
        """Return how far places are beyond the faces along each axis [m], and whether any is; (n, dim) and (n,)."""
        beyond = np.abs(places) - np.asarray(self.size, dtype=float) / 2
        return beyond, np.asarray((beyond > 0).any(axis=1))

    def gaps(self, places: Floats) -> tuple[Floats, Floats]:
        """Return the distance from the nearest point of the surface [m], inside from the nearest face; normals."""
        beyond, outside = self._outside(places)
        arms = np.maximum(beyond, 0.0) * np.sign(places)
        length = np.linalg.norm(arms, axis=1)
        face = beyond.argmax(axis=1)
        flat = np.zeros_like(places)
        rows = np.arange(len(places))
        flat[rows, face] = np.where(places[rows, face] < 0, -1.0, 1.0)
        return np.where(outside, length, beyond.max(axis=1)), np.where(outside[:, None], _unit(arms, length), flat)

    def bends(self, places: Floats) -> Floats:
        """Return the curvature of the distance from edges and corners [1/m]; zero at faces and inside."""
        beyond, outside = self._outside(places)
        arms = np.maximum(beyond, 0.0) * np.sign(places)
        length = np.linalg.norm(arms, axis=1)
        normal = _unit(arms, length)
        across = (beyond > 0)[:, :, None] * np.eye(places.shape[1]) - normal[:, :, None] * normal[:, None, :]
        return np.asarray(np.where(outside, 1 / np.where(outside, length, 1.0), 0.0)[:, None, None] * across)


def _unit(arms: Floats, length: Floats) -> Floats:
    """Return unit vectors, along the last axis where the length is zero; shape (n, dim) from (n, dim) and (n,)."""
    anywhere = np.zeros(arms.shape[1])
    anywhere[-1] = 1.0
    there = (length > 0)[:, None]
    return np.where(there, arms / np.where(length > 0, length, 1.0)[:, None], anywhere)
