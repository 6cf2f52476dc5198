"""Supports of a body in 3D: hatching at the rim of clamped faces, pins and rollers at other nodes."""

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.problem import Problem
from truespring.report.lines import draw_lines
from truespring.report.quantity import Scale
from truespring.report.sheet import Area
from truespring.report.surfaces import VIEW, facets_of, normals, seen
from truespring.report.symbols import draw_pin

_SUPPORT = "#3d4248"


def clamped_nodes(problem: Problem) -> Bools:
    """Return which nodes are held in every direction, shape (n_nodes,)."""
    loading = problem.loading
    return np.asarray((loading.held & (loading.motion() == 0)).all(axis=1))


def draw_supports(area: Area, problem: Problem, scale: Scale, size: float) -> None:
    """Hatch the rim of clamped faces, draw other held nodes on pins or rollers; `size` is that of a stroke [m]."""
    mesh, loading = problem.mesh, problem.loading
    points, facets = seen(mesh.nodes), facets_of(mesh)
    facing = normals(points, facets)
    clamped = clamped_nodes(problem)
    patch = np.flatnonzero(clamped[facets].all(axis=1))
    _hatch(area, points, facets[patch], facing[patch], scale, size)
    hatched = np.zeros(mesh.n_nodes, dtype=bool)
    hatched[facets[patch]] = True
    visible = np.zeros(mesh.n_nodes, dtype=bool)
    visible[facets[facing[:, 2] > 0]] = True
    still = loading.held & (loading.motion() == 0) & ~hatched[:, None]
    pinned = still.all(axis=1)
    for node in _thinned(mesh.nodes, np.flatnonzero(pinned), 3.2 * size):
        at = points[node, :2] / scale.size
        draw_pin(area, at, np.array([0.0, -1.0]), roller=False, zorder=6 if visible[node] else 1.5)
    centre = (mesh.lower + mesh.upper) / 2
    for axis in range(3):
        for node in _thinned(mesh.nodes, np.flatnonzero(still[:, axis] & ~pinned), 3.2 * size):
            away = VIEW[:2, axis] * (1.0 if mesh.nodes[node, axis] > centre[axis] else -1.0)
            away = away / np.linalg.norm(away)
            draw_pin(area, points[node, :2] / scale.size, away, zorder=6 if visible[node] else 1.5)


def _thinned(places: Floats, nodes: Ints, spacing: float) -> Ints:
    """Return one of the nodes in each cube with edge `spacing` [m], shape (n,)."""
    cubes = np.floor(places[nodes] / spacing + 1e-6)
    return np.asarray(nodes[np.unique(cubes, axis=0, return_index=True)[1]])


def _hatch(area: Area, points: Floats, facets: Ints, facing: Floats, scale: Scale, size: float) -> None:
    """Draw short strokes at the rim of a patch of facets; those that face away are drawn behind the body."""
    if not len(facets):
        return
    edges = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2)
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    rim = first[(count == 1) & (edges[first, 0] != edges[first, 1])]  # a triangle may name a corner twice
    starts, ends, owner = points[edges[rim, 0]], points[edges[rim, 1]], rim // facets.shape[1]
    length = np.linalg.norm(ends - starts, axis=1)
    for front, zorder in ((True, 5), (False, 1.5)):
        strokes = []
        for at in np.flatnonzero((facing[owner, 2] > 0) == front):
            n_strokes = max(1, round(float(length[at]) / (0.6 * size)))
            along = (ends[at] - starts[at]) / n_strokes
            foot = starts[at] + along * (np.arange(n_strokes)[:, None] + 0.5)
            slant = size * (facing[owner[at]] - 0.7 * along / np.linalg.norm(along))
            strokes.append(np.stack([foot, foot + slant], axis=1))
        if strokes:
            strokes_on_paper = np.concatenate(strokes)[:, :, :2] / scale.size
            draw_lines(area, strokes_on_paper, _SUPPORT, 0.9, zorder, "support", clip_on=False)
            sides = points[edges[rim[(facing[owner, 2] > 0) == front]]][:, :, :2]
            draw_lines(area, sides / scale.size, _SUPPORT, 2.2, zorder, "clamped", clip_on=False)
