"""Bodies as points, lines and facets: what is drawn of a mesh, of points or of a surface that was read."""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.mesh import Mesh
from truespring.report.bodies import path_lines
from truespring.report.surfaces import edges_of, facets_of, outline
from truespring.report.touching import view
from truespring.solution import Solution, State


@dataclass(frozen=True, eq=False)
class Shape:
    """A body to draw, in the coordinates of the picture.

    Attributes:
        points: [m], shape (n_points, dim), in space as `surfaces.seen` returns them.
        lines: springs, or the edges of elements, shape (n_lines, 2).
        rim: boundary edges of a plane body, all lines of a network, shape (n, 2); of others see `outline`.
        facets: boundary facets of a body in space, shape (n_facets, 3 or 4); none in the plane and of networks.
        is_cloud: whether it consists of points only.
    """

    points: Floats
    lines: Ints
    rim: Ints
    facets: Ints
    is_cloud: bool = False

    @property
    def outline(self) -> Ints:
        """The lines that bound the body as it is seen, shape (n, 2)."""
        return outline(self.points, self.facets, silhouette=True) if len(self.facets) else self.rim


def shape_of(solution: Solution, state: State | None, factor: float) -> Shape:
    """Return a state of a solution with displacements magnified by a factor; its surface if it has no states."""
    surface = solution.surface or solution.shell
    if state is None and surface is not None:
        lines = edges_of(surface.triangles)
        flat = solution.surface is not None
        return Shape(
            view(surface.points),
            lines,
            solution.surface.outline if solution.surface is not None else lines,
            surface.triangles[: 0 if flat else None],
        )
    mesh = solution.problem.mesh
    moved = mesh.nodes if state is None else mesh.nodes + factor * state.displacement
    return Shape(view(moved), path_lines(solution), _rim(mesh), facets_of(mesh), solution.is_cloud)


def rest_shape(solution: Solution) -> Shape:
    """Return the undeformed body of a solution."""
    mesh = solution.problem.mesh
    rim = mesh.edges[:0] if solution.is_cloud else _rim(mesh)
    return Shape(view(mesh.nodes), path_lines(solution), rim, facets_of(mesh), solution.is_cloud)


def _rim(mesh: Mesh) -> Ints:
    if mesh.element == "line":
        return mesh.edges
    return mesh.boundary if mesh.dim == 2 else np.zeros((0, 2), dtype=np.int64)
