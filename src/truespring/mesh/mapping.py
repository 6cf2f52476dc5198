"""Meshes whose nodes are moved by a function of their coordinates."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from truespring.arrays import Floats
from truespring.errors import MeshError
from truespring.mesh.mesh import Mesh
from truespring.mesh.selections import SIDES, select


def mapped(mesh: Mesh, function: Callable[..., Sequence[Floats]]) -> Mesh:
    """Return a mesh with its nodes at other places, such as a ring made of a rectangle.

    Groups are kept, and the sides of the mesh become groups of nodes: "left" of a rectangle names the same nodes after
    it was bent.

    Args:
        mesh: a mesh of first order without vectors of elements.
        function: takes the coordinates of the nodes x, y[, z] [m], arrays of shape (n_nodes,), and returns the new
            ones [m], as many.

    Raises MeshError if the function returns other shapes, or if an element is inverted or degenerate at the new places:
    a function must not mirror.

    Example:
        >>> import numpy as np
        >>> import truespring as ts
        >>> flat = ts.rectangle(size=(0.01, np.pi / 2), elements=(2, 8))
        >>> ring = ts.mapped(flat, lambda x, angle: ((0.01 + x) * np.cos(angle), (0.01 + x) * np.sin(angle)))
        >>> float(np.linalg.norm(ring.nodes[ring.node_groups["left"]], axis=1).max().round(6))  # the inner radius
        0.01
    """
    if mesh.middles is not None or mesh.element_vectors:
        raise MeshError("a mesh with mid-edge nodes or vectors of elements cannot be mapped: map it before it has them")
    columns = [np.asarray(column, dtype=float) for column in function(*mesh.nodes.T)]
    shapes = [column.shape for column in columns]
    if shapes != [(mesh.n_nodes,)] * mesh.dim:
        raise MeshError(
            f"the function returns arrays of shapes {shapes}: it must return {mesh.dim} coordinates, each of shape "
            f"({mesh.n_nodes},)"
        )
    sides = {name: select(mesh, name) for name, (axis, _) in SIDES.items() if axis < mesh.dim}
    return replace(mesh, nodes=np.stack(columns, axis=1), node_groups={**sides, **mesh.node_groups})
