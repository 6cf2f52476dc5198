"""What a page draws of a body: nodes of its surface, triangles and lines, in units of the body about its middle."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.mesh import Mesh
from truespring.mesh.facets import triangles_of
from truespring.report.packing import Packing
from truespring.report.quantity import natural_scale
from truespring.report.style import error_colors
from truespring.report.surfaces import edges_of, facets_of, outline

_SPACE = 3


@dataclass(frozen=True, eq=False)
class Drawn:
    """The drawn part of a body.

    A place on the page is (place in metres - middle) / longest; a plane body lies at z = 0.

    Attributes:
        number: of this description; a body that was cut has another one.
        mesh: the mesh.
        nodes: numbers of the drawn nodes, ascending, shape (n,).
        triangles: of the surface, or of the elements of a plane body, by node numbers, shape (n, 3).
        edges: of elements on the surface, shape (n, 2).
        outline: sharp edges, or the boundary of a plane body, shape (n, 2).
    """

    number: int
    mesh: Mesh
    nodes: Ints
    triangles: Ints
    edges: Ints
    outline: Ints

    @cached_property
    def middle(self) -> Floats:
        """The middle of the undeformed body's box [m], shape (dim,)."""
        return np.asarray((self.mesh.nodes.min(axis=0) + self.mesh.nodes.max(axis=0)) / 2)

    @cached_property
    def longest(self) -> float:
        """The longest edge of the undeformed body's box [m]."""
        return float(np.ptp(self.mesh.nodes, axis=0).max())

    def on_page(self, points: Floats) -> Floats:
        """Return points [m], shape (n, dim), in units of the page, shape (n, 3), single precision."""
        places = np.zeros((len(points), _SPACE), dtype="<f4")
        places[:, : self.mesh.dim] = (points - self.middle) / self.longest
        return places

    def in_metres(self, place: Sequence[float]) -> tuple[float, ...]:
        """Return a place on the page as coordinates [m], one value per direction of the body."""
        at = self.middle + self.longest * np.asarray(place, dtype=float)[: self.mesh.dim]
        return tuple(float(one) for one in at)

    @cached_property
    def values(self) -> dict[str, Any]:
        """The description as JSON values; arrays are base64 of little-endian uint32 and float32."""
        mesh, pack = self.mesh, Packing(self.middle, self.longest, self.nodes, self.mesh.n_nodes)
        scale = natural_scale(self.longest, "m")
        return {
            "kind": "body",
            "number": self.number,
            "dim": mesh.dim,
            "nodes": len(self.nodes),
            "elements": len(mesh.elements),
            "meshNodes": mesh.n_nodes,
            "longest": self.longest,
            "middle": [*self.middle.tolist(), 0.0][:_SPACE],
            "unit": scale.unit,
            "size": self.longest / scale.size,
            "rest": pack.numbers(self.on_page(mesh.nodes[self.nodes]).view("<u4")),
            "triangles": pack.pairs(self.triangles),
            "edges": pack.pairs(self.edges),
            "outline": pack.pairs(self.outline),
            "colors": np.rint(255 * error_colors(np.linspace(0, 1, 33))).astype(int).tolist(),
        }


def drawn(mesh: Mesh, number: int = 0) -> Drawn:
    """Return what is drawn of a body of a mesh; `number` is that of the description."""
    if mesh.dim == _SPACE:
        facets = facets_of(mesh)
        edges, sharp = edges_of(facets), outline(mesh.nodes, facets)
    else:
        facets = mesh.elements
        edges, sharp = mesh.edges, mesh.boundary
    return Drawn(number, mesh, np.unique(facets), triangles_of(facets), edges, sharp)
