"""Pictures of meshes with the names of their sides and groups."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import MeshError
from truespring.mesh import Mesh, loaded, select_elements
from truespring.mesh.facets import facet_keys, find_facets
from truespring.mesh.rows import distinct_rows
from truespring.mesh.selections import SIDES, named_facets
from truespring.report.bodies3d import BODY, one_color, solid
from truespring.report.render import Layer, rgb
from truespring.report.style import INK
from truespring.report.surfaces import edges_of, facets_of
from truespring.report.touching import view
from truespring.showing.frames import (
    Entry,
    draw_dots,
    draw_image,
    draw_legend,
    draw_lines,
    frame_plane,
    frame_space,
    new_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Names that have a colour of their own.
_MOST_NAMES = 10


@dataclass(frozen=True, eq=False)
class _Marked:
    """A named part of a mesh: elements, facets, and nodes that belong to no facet of it."""

    name: str
    color: str
    elements: Ints
    facets: Ints
    nodes: Ints


def plot_mesh(mesh: Mesh, names: Sequence[str] | None, axes: "Axes | None") -> "Axes":
    """Draw a mesh into axes, see `Mesh.plot`."""
    marked = _marked(mesh, _names(mesh) if names is None else names)
    points = view(mesh.nodes)
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    margin = 0.04 * float((high - low).max())
    low, high = low - margin, high + margin
    axes = new_axes(low, high) if axes is None else axes
    (_draw_plane if mesh.dim == 2 else _draw_space)(axes, mesh, points, marked, low, high)
    title = [f"{mesh.n_nodes} nodes, {len(mesh.elements)} elements: {mesh.kinds}"]
    draw_legend(axes, title, [Entry(one.name, one.color, "-", 3.0) for one in marked])
    return axes


def _names(mesh: Mesh) -> list[str]:
    """Return the names of groups, at most _MOST_NAMES; of a mesh without groups those of its sides."""
    groups = dict.fromkeys([*mesh.element_groups, *mesh.facet_groups, *mesh.node_groups])
    return [*groups][:_MOST_NAMES] or [name for name, (axis, _) in SIDES.items() if axis < mesh.dim]


def _marked(mesh: Mesh, names: Sequence[str]) -> list[_Marked]:
    """Return the parts of some names; raise MeshError for a name that matches no node."""
    import matplotlib

    if isinstance(names, str):
        raise MeshError(f"names = '{names}': a list of names is expected, such as ['{names}']")
    found = []
    for place, name in enumerate(names):
        color = matplotlib.colors.to_hex(matplotlib.colormaps["tab10"](place % 10))
        none = np.zeros(0, dtype=np.int64)
        if name in mesh.element_groups and name not in mesh.facet_groups:
            found.append(_Marked(name, color, select_elements(mesh, name), mesh.boundary[:0], none))
            continue
        nodes, facets = loaded(mesh, name), named_facets(mesh, name)
        if facets is None:
            inside = np.zeros(mesh.n_nodes, dtype=bool)
            inside[nodes] = True
            facets = mesh.boundary[inside[mesh.boundary].all(axis=1)] if mesh.element != "line" else mesh.elements[:0]
        found.append(_Marked(name, color, none, facets, np.setdiff1d(nodes, facets)))
    return found


def _largest_first(marked: list[_Marked]) -> list[_Marked]:
    """Return named parts in an order in which parts of others are drawn over these; facets over elements."""
    return sorted(marked, key=lambda one: (-len(one.elements), -len(one.facets)))


def _draw_plane(axes: "Axes", mesh: Mesh, points: Floats, marked: list[_Marked], low: Floats, high: Floats) -> None:
    from matplotlib.collections import PolyCollection

    for one in _largest_first(marked):
        if len(one.elements):
            parts = list(points[mesh.elements[one.elements]])
            axes.add_collection(PolyCollection(parts, facecolors=one.color, alpha=0.35, linewidths=0, gid=one.name))
    draw_lines(axes, points, mesh.edges, INK, 0.8, 2, "elements")
    for one in marked:
        if len(one.facets):
            draw_lines(axes, points, one.facets[:, :2], one.color, 3.0, 3, one.name)
        if len(one.nodes):
            draw_dots(axes, points[one.nodes], 4, one.name, color=one.color)
    frame_plane(axes, low, high)


def _draw_space(axes: "Axes", mesh: Mesh, points: Floats, marked: list[_Marked], low: Floats, high: Floats) -> None:
    facets = facets_of(mesh)
    low = frame_space(axes, low, high)
    if len(facets):
        draw_image(axes, _layers(mesh, points, facets, marked), low, high)
    else:
        draw_lines(axes, points, mesh.edges, INK, 1.0, 2, "elements")
    for one in marked:
        if len(one.nodes):
            draw_dots(axes, points[one.nodes], 4, one.name, color=one.color)


def _among(facets: Ints, others: Ints) -> Bools:
    """Return whether each facet is one of the others, whatever the order of its corners, shape (n_facets,)."""
    both = distinct_rows(facet_keys(np.concatenate([facets, others]).T)).of
    return np.isin(both[: len(facets)], both[len(facets) :])


def _layers(mesh: Mesh, points: Floats, facets: Ints, marked: list[_Marked]) -> list[Layer]:
    """Return the surface, coloured where named parts are, with its edges."""
    colors = one_color(facets, BODY).copy()
    owners = find_facets(mesh.elements, mesh.element, facets)[:, 0]
    for one in _largest_first(marked):
        here = np.isin(owners, one.elements) | _among(facets, one.facets)
        colors[here] = 0.35 * rgb(BODY) + 0.65 * rgb(one.color)
    return [solid(points, facets, colors, edges_of(facets), INK, 0.5)]
