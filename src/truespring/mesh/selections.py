"""Selections by side, plane, box, point or group: node numbers, facets and nodal shares."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError, nearest, shown
from truespring.mesh.facets import facet_keys
from truespring.mesh.measures import corner_measures, element_corner_measures
from truespring.mesh.mesh import Mesh
from truespring.mesh.rows import distinct_rows

#: Sides by name: axis, and whether it is the upper end.
SIDES: dict[str, tuple[int, bool]] = {
    "left": (0, False),
    "right": (0, True),
    "bottom": (1, False),
    "top": (1, True),
    "back": (2, False),
    "front": (2, True),
}
AXES = "xyz"

# Tolerance of sides and planes as a fraction of the mesh's diameter: above rounding, below the size of any element.
_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True)
class Plane:
    """The nodes at one coordinate: `axis` "x", "y" or "z", `value` [m].

    Example:
        >>> import truespring as ts
        >>> ts.Fixed(ts.Plane("x", 0.02), fix=["y"]).words(2)
        'the nodes at x = 0.02 m held along y'
    """

    axis: str
    value: float


@dataclass(frozen=True, slots=True)
class Box:
    """The nodes in the box between two opposite corners [m], including its border.

    Example:
        >>> import truespring as ts
        >>> ts.Fixed(ts.Box((0.0, 0.0), (0.011, 0.01))).words(2)
        'the nodes from (0, 0) to (0.011, 0.01) m held along x, y'
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Near:
    """The node nearest to a point [m]; of several at equal distance, the one with smaller coordinates.

    Example:
        >>> import truespring as ts
        >>> ts.Force(ts.Near((0.04, 0.005)), (0.0, -0.1)).words()
        'force (0, -0.1) N in total on the node nearest to (0.04, 0.005) m'
    """

    point: tuple[float, ...]


#: A group of the mesh, a side or named point ("left", "right-middle"), one of the classes above, or node numbers.
Selection = str | Plane | Box | Near | Sequence[int]


def select(mesh: Mesh, on: Selection) -> Ints:
    """Return the numbers of the selected nodes, ascending, shape (n,); raise MeshError if no node is selected."""
    match on:
        case str() if on in mesh.node_groups:
            return mesh.node_groups[on]
        case str():
            return _side(mesh, on) if on in SIDES else np.array([named_point(mesh, on)])
        case Plane(axis, value):
            return _plane(mesh, axis, value)
        case Box(lower, upper):
            return _in_box(mesh, lower, upper, mesh.nodes, "node")
        case Near(point):
            return np.array([nearest_node(mesh, point)])
        case _:
            return _numbers(on, mesh.n_nodes, "node")


def select_elements(mesh: Mesh, on: Selection) -> Ints:
    """Return the numbers of the selected elements, ascending, shape (n,); raise MeshError if no element is selected.

    `on` is an element group of the mesh, a Box that contains their centres, or element numbers.
    """
    match on:
        case str() if on in mesh.element_groups:
            return mesh.element_groups[on]
        case str():
            groups = ", ".join(mesh.element_groups) or "this mesh has none"
            raise MeshError(
                f"'{on}' is no group of elements{nearest(on, mesh.element_groups)}; groups: {groups}; "
                "a box selects the elements whose centres it contains"
            )
        case Box(lower, upper):
            return _in_box(mesh, lower, upper, mesh.centres, "element with its centre")
        case Plane() | Near():
            raise MeshError(f"{on!r} selects nodes; elements are selected by a group, a box or numbers")
        case _:
            return _numbers(on, len(mesh.elements), "element")


def _side(mesh: Mesh, name: str) -> Ints:
    axis, at_upper = SIDES[name]
    if axis >= mesh.dim:
        raise MeshError(f"'{name}' is a side of a body in 3D, this one has {mesh.dim} dimensions")
    value = (mesh.upper if at_upper else mesh.lower)[axis]
    return np.flatnonzero(np.abs(mesh.nodes[:, axis] - value) <= _TOLERANCE * mesh.diameter)


def _plane(mesh: Mesh, axis: str, value: float) -> Ints:
    if axis not in tuple(AXES[: mesh.dim]):
        raise MeshError(f"axis {shown(axis)} is unknown; allowed: {', '.join(AXES[: mesh.dim])}")
    coordinates = mesh.nodes[:, AXES.index(axis)]
    distance = np.abs(coordinates - value)
    found = np.flatnonzero(distance <= _TOLERANCE * mesh.diameter)
    if not found.size:
        raise MeshError(
            f"no node at {axis} = {value:g} m; the nearest nodes are at {axis} = {coordinates[distance.argmin()]:g} m"
        )
    return found


def _in_box(mesh: Mesh, lower: tuple[float, ...], upper: tuple[float, ...], places: Floats, what: str) -> Ints:
    if len(lower) != mesh.dim or len(upper) != mesh.dim:
        low, high = (", ".join(f"{axis}{end}" for axis in AXES[: mesh.dim]) for end in ("min", "max"))
        raise MeshError(f"a box has two corners of {mesh.dim} coordinates each: [[{low}], [{high}]]")
    if any(low > high for low, high in zip(lower, upper, strict=True)):
        raise MeshError(f"box from {list(lower)} to {list(upper)} m: the first corner must be the lower one")
    slack = _TOLERANCE * mesh.diameter
    inside = (places >= np.array(lower) - slack) & (places <= np.array(upper) + slack)
    found = np.flatnonzero(inside.all(axis=1))
    if not found.size:
        raise MeshError(
            f"no {what} in the box from {list(lower)} to {list(upper)} m; "
            f"the mesh lies between {mesh.lower.tolist()} and {mesh.upper.tolist()} m"
        )
    return found


def _numbers(numbers: Sequence[int], n_there: int, what: str) -> Ints:
    found = np.unique(np.asarray(numbers)) if isinstance(numbers, Sequence | np.ndarray) else np.zeros(0)
    if not found.size or not np.issubdtype(found.dtype, np.integer):
        raise MeshError(
            f"{numbers!r} selects no {what}: use a side such as 'left', a point such as 'right-middle', "
            "Plane('x', 0.0), Box((0.0, 0.0), (1.0, 1.0)), Near((0.0, 0.0)) or numbers"
        )
    if found[0] < 0 or found[-1] >= n_there:
        raise MeshError(f"{what} {found[0] if found[0] < 0 else found[-1]} does not exist: 0 to {n_there - 1}")
    return found


def nearest_node(mesh: Mesh, point: Sequence[float]) -> int:
    """Return the node nearest to `point` [m]; of several at equal distance, the one with smaller coordinates.

    Example:
        >>> import truespring as ts
        >>> mesh = ts.rectangle((0.16, 0.04), (16, 4))
        >>> mesh.nodes[ts.nearest_node(mesh, (0.052, 0.0))].tolist()
        [0.05, 0.0]
    """
    try:
        place = np.array(point, dtype=float)
    except (TypeError, ValueError):
        place = np.zeros(0)
    if place.shape != (mesh.dim,) or not np.isfinite(place).all():
        raise MeshError(f"point {shown(point)}: {mesh.dim} coordinates are expected")
    distance = np.linalg.norm(mesh.nodes - place, axis=1)
    ties = np.flatnonzero(distance <= distance.min() + 1e-9 * mesh.diameter)
    return int(min(ties, key=lambda node: tuple(mesh.nodes[node])))


def probe_node(mesh: Mesh, probe: int | str | Sequence[float]) -> int:
    """Return the number of a node given by its number, by a named point or by a position [m], see `nearest_node`.

    Raises MeshError if there is no such node.
    """
    if isinstance(probe, str):
        return named_point(mesh, probe)
    if not isinstance(probe, int | np.integer):
        return nearest_node(mesh, probe)
    if not 0 <= probe < mesh.n_nodes:
        raise MeshError(f"probe = {probe}: nodes are 0 to {mesh.n_nodes - 1}; or a point such as 'right-middle'")
    return int(probe)


def named_point(mesh: Mesh, name: str) -> int:
    """Return the node nearest to a point named by joined sides, such as "right-middle", "left-top" or "middle".

    For the name of a node group, return the node of the group nearest to its centre.

    Example:
        >>> import truespring as ts
        >>> mesh = ts.rectangle((0.16, 0.04), (16, 4))
        >>> mesh.nodes[ts.named_point(mesh, "right-middle")].tolist()
        [0.16, 0.02]
    """
    if name in mesh.node_groups:
        group = mesh.node_groups[name]
        centre = mesh.nodes[group].mean(axis=0)
        return int(group[np.linalg.norm(mesh.nodes[group] - centre, axis=1).argmin()])
    words = name.split("-")
    sides = (side for side, (axis, _) in SIDES.items() if axis < mesh.dim)
    allowed = list(dict.fromkeys([*mesh.node_groups, *sides]))
    point = (mesh.lower + mesh.upper) / 2
    taken: set[int] = set()
    for word in words:
        if word == "middle":
            continue
        if word not in SIDES or SIDES[word][0] >= mesh.dim or SIDES[word][0] in taken:
            raise MeshError(
                f"'{name}' is no side or point of this body{nearest(name, [*allowed, 'middle', 'right-middle'])}; "
                f"allowed: {', '.join(allowed)}, or sides joined such as right-middle, left-top"
            )
        axis, at_upper = SIDES[word]
        taken.add(axis)
        point[axis] = (mesh.upper if at_upper else mesh.lower)[axis]
    return nearest_node(mesh, point.tolist())


def named_facets(mesh: Mesh, on: Selection) -> Ints | None:
    """Return the facets of a facet group, anticlockwise from outside, shape (n, 2 to 4); None for other selections.

    A facet between two elements is listed once, as that of one of them.
    """
    if not isinstance(on, str) or on not in mesh.facet_groups:
        return None
    facets = mesh.facet_nodes(mesh.facet_groups[on])
    return np.asarray(facets[np.sort(distinct_rows(facet_keys(facets.T)).first)])


def loaded(mesh: Mesh, on: Selection) -> Ints:
    """Return the nodes that a load acts on, ascending, shape (n,); for a facet group the nodes of its facets."""
    facets = named_facets(mesh, on)
    return select(mesh, on) if facets is None else np.unique(facets)


def shares(mesh: Mesh, on: Selection) -> tuple[Ints, Floats]:
    """Return the nodes that a load acts on and their fractions of a uniform load [-], both of shape (n,), sum 1.

    Consistent with linear elements: by the measures of the cells that carry the load (`covering`). Equal for nodes
    without such cells.
    """
    nodes = loaded(mesh, on)
    covered = covering(mesh, on)
    if covered is None:
        return nodes, np.full(len(nodes), 1 / len(nodes))
    cells, measures = covered
    weight = np.zeros(mesh.n_nodes)
    np.add.at(weight, cells, measures)
    return nodes, np.asarray(weight[nodes] / weight[nodes].sum())


def covering(mesh: Mesh, on: Selection) -> tuple[Ints, Floats] | None:
    """Return the cells that carry a load on a selection and each corner's part of their measures [m^k].

    Both have shape (n, corners). For a facet group the cells are its facets. For other selections they are the first of
    these that cover all nodes: elements within the selection, boundary facets within it, inner facets, edges. None if
    none of them does.
    """
    named = named_facets(mesh, on)
    if named is not None:
        return named, corner_measures(mesh.nodes[named])
    nodes = select(mesh, on)
    if mesh.element == "line":
        return None
    inside = np.zeros(mesh.n_nodes, dtype=bool)
    inside[nodes] = True
    n_inside = np.zeros(len(mesh.elements), dtype=np.int64)
    for corner in mesh.elements.T:
        n_inside += inside[corner]
    whole = n_inside == mesh.elements.shape[1]
    if _reach(mesh.elements[whole], nodes):
        return mesh.elements[whole], element_corner_measures(mesh)[whole]
    facets, alone = mesh.facets_of(mesh.elements[n_inside >= mesh.dim], inside)
    for cells in (facets[alone], facets):
        if _reach(cells, nodes):
            return cells, corner_measures(mesh.nodes[cells])
    edges = mesh.edges[inside[mesh.edges].all(axis=1)]
    return (edges, corner_measures(mesh.nodes[edges])) if _reach(edges, nodes) else None


def _reach(cells: Ints, nodes: Ints) -> bool:
    """Return whether the cells, which have no other nodes, cover all `nodes`."""
    return len(np.unique(cells)) == len(nodes)


def facets_within(mesh: Mesh, on: Selection) -> Ints:
    """Return the facets that a load per area acts on, anticlockwise seen from outside, shape (n, 2 to 4).

    For a facet group they are its facets, on the boundary or inside; for other selections the boundary facets whose
    nodes are all selected. In a table with quadrilaterals, triangles repeat their last corner. Raises MeshError if
    no facet is selected.
    """
    named = named_facets(mesh, on)
    if named is not None:
        return named
    nodes = select(mesh, on)
    inside = np.zeros(mesh.n_nodes, dtype=bool)
    inside[nodes] = True
    found = mesh.boundary[inside[mesh.boundary].all(axis=1)] if mesh.element != "line" else mesh.boundary[:0]
    if not len(found):
        raise MeshError(
            f"the {len(nodes)} node{'s' * (len(nodes) != 1)} selected contain no complete facet of the boundary: "
            "select a side, or all nodes of a face"
        )
    return found


def outer_facets(mesh: Mesh, on: Selection) -> Ints:
    """Return `facets_within`, shape (n, 2 to 4).

    Raise MeshError if one lies between two elements, where a pressure has no outer side.
    """
    facets = facets_within(mesh, on)
    within = np.zeros(mesh.n_nodes, dtype=bool)
    within[facets] = True
    every, alone = mesh.facets_of(mesh.elements, within)
    inner = (
        len(facets)
        + int((~alone).sum())
        - len(distinct_rows(facet_keys(np.concatenate([facets, every[~alone]]).T)).starts)
    )
    if inner:
        raise MeshError(
            f"{inner} of {len(facets)} facets of '{on}' lie inside the body, between two elements, where a pressure "
            "has no outer side: select facets of the boundary, or use a traction, which has a direction"
        )
    return facets
