"""Selections: from what a user writes (a side, a plane, a box, a point) to node numbers and their shares."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError, nearest
from truespring.mesh.mesh import Mesh

#: Side names: direction and whether it is the upper end.
SIDES: dict[str, tuple[int, bool]] = {
    "left": (0, False),
    "right": (0, True),
    "bottom": (1, False),
    "top": (1, True),
    "back": (2, False),
    "front": (2, True),
}
AXES = "xyz"

# A node lies on a side or plane within this share of the mesh's diameter: well above the rounding
# of units and shapes, well below any element.
_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True)
class Plane:
    """The nodes at one coordinate: `axis` "x", "y" or "z", `value` [m]."""

    axis: str
    value: float


@dataclass(frozen=True, slots=True)
class Box:
    """The nodes within two opposite corners [m], the border included."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Near:
    """The one node nearest to a point [m]; of several equally near, the one with smaller coordinates."""

    point: tuple[float, ...]


#: A side or named point ("left", "right-middle"), one of the classes above, or node numbers.
Selection = str | Plane | Box | Near | Sequence[int]


def select(mesh: Mesh, on: Selection) -> Ints:
    """Return the numbers of the nodes selected, ascending; raise MeshError where there is none."""
    match on:
        case str():
            return _side(mesh, on) if on in SIDES else np.array([named_point(mesh, on)])
        case Plane(axis, value):
            return _plane(mesh, axis, value)
        case Box(lower, upper):
            return _box(mesh, lower, upper)
        case Near(point):
            return np.array([nearest_node(mesh, point)])
        case _:
            return _numbers(mesh, on)


def _side(mesh: Mesh, name: str) -> Ints:
    axis, at_upper = SIDES[name]
    if axis >= mesh.dim:
        raise MeshError(f"'{name}' is a side of a body in 3D, this one has {mesh.dim} dimensions")
    value = (mesh.upper if at_upper else mesh.lower)[axis]
    return np.flatnonzero(np.abs(mesh.nodes[:, axis] - value) <= _TOLERANCE * mesh.diameter)


def _plane(mesh: Mesh, axis: str, value: float) -> Ints:
    if axis not in AXES[: mesh.dim]:
        raise MeshError(f"axis '{axis}' is unknown; allowed: {', '.join(AXES[: mesh.dim])}")
    coordinates = mesh.nodes[:, AXES.index(axis)]
    distance = np.abs(coordinates - value)
    found = np.flatnonzero(distance <= _TOLERANCE * mesh.diameter)
    if not found.size:
        raise MeshError(
            f"no node at {axis} = {value:g} m; the nearest nodes are at {axis} = {coordinates[distance.argmin()]:g} m"
        )
    return found


def _box(mesh: Mesh, lower: tuple[float, ...], upper: tuple[float, ...]) -> Ints:
    if len(lower) != mesh.dim or len(upper) != mesh.dim:
        raise MeshError(f"a box takes two corners of {mesh.dim} coordinates each: [[xmin, ymin], [xmax, ymax]]")
    if any(low > high for low, high in zip(lower, upper, strict=True)):
        raise MeshError(f"box from {list(lower)} to {list(upper)} m: the first corner must be the lower one")
    slack = _TOLERANCE * mesh.diameter
    inside = (mesh.nodes >= np.array(lower) - slack) & (mesh.nodes <= np.array(upper) + slack)
    found = np.flatnonzero(inside.all(axis=1))
    if not found.size:
        raise MeshError(
            f"no node in the box from {list(lower)} to {list(upper)} m; "
            f"the mesh lies between {mesh.lower.tolist()} and {mesh.upper.tolist()} m"
        )
    return found


def _numbers(mesh: Mesh, numbers: Sequence[int]) -> Ints:
    found = np.unique(np.asarray(numbers)) if isinstance(numbers, Sequence | np.ndarray) else np.zeros(0)
    if not found.size or not np.issubdtype(found.dtype, np.integer):
        raise MeshError(
            f"{numbers!r} selects no node: give a side such as 'left', a point such as 'right-middle', "
            "Plane('x', 0.0), Box((0.0, 0.0), (1.0, 1.0)), Near((0.0, 0.0)) or node numbers"
        )
    if found[0] < 0 or found[-1] >= mesh.n_nodes:
        raise MeshError(f"node {found[0] if found[0] < 0 else found[-1]} does not exist: 0 to {mesh.n_nodes - 1}")
    return found


def nearest_node(mesh: Mesh, point: Sequence[float]) -> int:
    """Return the node nearest to `point` [m]; of several equally near, the one with smaller coordinates."""
    if len(point) != mesh.dim:
        raise MeshError(f"point {list(point)}: {mesh.dim} coordinates are wanted")
    distance = np.linalg.norm(mesh.nodes - np.array(point), axis=1)
    ties = np.flatnonzero(distance <= distance.min() + 1e-9 * mesh.diameter)
    return int(min(ties, key=lambda node: tuple(mesh.nodes[node])))


def named_point(mesh: Mesh, name: str) -> int:
    """Return the node nearest to a point named by sides joined: "right-middle", "left-top", "middle"."""
    words = name.split("-")
    allowed = [side for side, (axis, _) in SIDES.items() if axis < mesh.dim]
    point = (mesh.lower + mesh.upper) / 2
    taken: set[int] = set()
    for word in words:
        if word == "middle":
            continue
        if word not in allowed or SIDES[word][0] in taken:
            raise MeshError(
                f"'{name}' is no side or point of this body{nearest(name, [*allowed, 'middle', 'right-middle'])}; "
                f"allowed: {', '.join(allowed)}, or sides joined such as right-middle, left-top"
            )
        axis, at_upper = SIDES[word]
        taken.add(axis)
        point[axis] = (mesh.upper if at_upper else mesh.lower)[axis]
    return nearest_node(mesh, point.tolist())


def shares(mesh: Mesh, nodes: Ints) -> Floats:
    """Return the share of a uniform total that each of `nodes` takes, shape (n,), sum 1.

    Consistent with linear elements: elements that lie wholly in the selection share by their
    measure, else facets that do; nodes that neither covers share equally.
    """
    if mesh.element != "line":
        inside = np.zeros(mesh.n_nodes, dtype=bool)
        inside[nodes] = True
        covering = mesh.elements[inside[mesh.elements].all(axis=1)]
        measures = mesh.measures[inside[mesh.elements].all(axis=1)]
        if not len(covering):
            covering = mesh.facets[inside[mesh.facets].all(axis=1)]
            measures = _facet_measures(mesh.nodes[covering])
        weight = np.zeros(mesh.n_nodes)
        np.add.at(weight, covering, measures[:, None])
        if len(covering) and weight[nodes].all():
            return np.asarray(weight[nodes] / weight[nodes].sum())
    return np.full(len(nodes), 1 / len(nodes))


def _facet_measures(corners: Floats) -> Floats:
    """Length of each edge [m]; corners of shape (n_facets, 2, dim)."""
    return np.asarray(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1))
