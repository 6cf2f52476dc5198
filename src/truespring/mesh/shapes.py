"""Meshes of simple shapes."""

import math
from collections.abc import Sequence

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError, nearest
from truespring.memory import available_memory
from truespring.mesh.kinds import ELEMENT_KINDS
from truespring.mesh.mesh import Mesh
from truespring.mesh.rows import ascending, distinct_rows

#: The elements of a rectangle and of a box: two triangles per rectangle; six tetrahedra, two wedges or six pyramids
#: per box, or the body-centred-cubic lattice, whose `elements` count its cubic cells.
PLANE_ELEMENTS = ("quadrilateral", "triangle")
SOLID_ELEMENTS = ("hexahedron", "tetrahedron", "bcc-tetrahedron", "wedge", "pyramid")

#: Diagonals of a rectangle of triangles: from the lower left corner to the upper right one, the
#: other one, or each in turn, so that no direction is preferred.
DIAGONALS = ("right", "left", "alternating")

# Peak memory of a solve per node [bytes], in 2D and in 3D: that of multigrid, which grows linearly with the number of
# nodes. A factorisation that would need more is not selected.
_BYTES_A_NODE = {2: 2560, 3: 10240}

_FLATTEST = 1e3


def rectangle(
    size: Sequence[float], elements: Sequence[int], element: str = "quadrilateral", diagonal: str = "right"
) -> Mesh:
    """Return a rectangle with its lower left corner in the origin.

    Args:
        size: length along x and y [m].
        elements: number of rectangles along x and y.
        element: "quadrilateral", or "triangle": two per rectangle.
        diagonal: how triangles halve it, one of DIAGONALS.

    Raises MeshError for sizes that are not positive, counts below one, elements flatter than
    1000:1 and a mesh that cannot fit in memory.

    Example:
        >>> import truespring as ts
        >>> ts.rectangle((0.16, 0.04), (16, 4))
        Mesh(85 nodes, 64 elements: quadrilateral)
        >>> ts.rectangle((0.16, 0.04), (16, 4), "triangle")
        Mesh(85 nodes, 128 elements: triangle)
    """
    _known(element, PLANE_ELEMENTS, "element")
    _known(diagonal, DIAGONALS, "diagonal")
    if element != "triangle" and diagonal != DIAGONALS[0]:
        raise MeshError(f"diagonal = '{diagonal}' applies to triangles only, the elements are {element}s")
    lengths, counts = _checked(size, elements, "rectangle", "xy")
    nodes, cells = _grid(lengths, counts)
    if element == "quadrilateral":
        return Mesh(nodes, cells, element)
    column, row = np.meshgrid(np.arange(counts[0]), np.arange(counts[1]))
    to_right = {"right": 0, "left": 1, "alternating": (column + row).ravel() % 2}[diagonal] == np.zeros(len(cells))
    halves = np.where(to_right[:, None], cells[:, [0, 1, 2, 0, 2, 3]], cells[:, [0, 1, 3, 1, 2, 3]])
    return Mesh(nodes, halves.reshape(-1, 3), element)


def box(size: Sequence[float], elements: Sequence[int], element: str = "hexahedron") -> Mesh:
    """Return a box with its left, bottom, back corner in the origin.

    Args:
        size: length along x, y and z [m].
        elements: number of cells along x, y and z.
        element: "hexahedron"; "tetrahedron", six per cell, all around the same body diagonal; "bcc-tetrahedron", the
            body-centred-cubic lattice with a node in the middle of each cell and of each face of the outside;
            "wedge", two per cell, their triangles across z; or "pyramid", six per cell around a node in its middle.

    Raises MeshError as `rectangle` does.

    Example:
        >>> import truespring as ts
        >>> ts.box((0.1, 0.04, 0.04), (5, 2, 2))
        Mesh(54 nodes, 20 elements: hexahedron)
        >>> ts.box((0.1, 0.04, 0.04), (5, 2, 2), "tetrahedron")
        Mesh(54 nodes, 120 elements: tetrahedron)
    """
    _known(element, SOLID_ELEMENTS, "element")
    lengths, counts = _checked(size, elements, "box", "xyz", 2 if element in ("bcc-tetrahedron", "pyramid") else 1)
    nodes, cells = _grid(lengths, counts)
    if element == "hexahedron":
        return Mesh(nodes, cells, element)
    if element == "wedge":
        return Mesh(nodes, cells[:, np.array(_TWO)].reshape(-1, 6), element)
    if element == "pyramid":
        return _six_pyramids(nodes, cells)
    if element == "tetrahedron":
        return Mesh(nodes, cells[:, np.array(_SIX)].reshape(-1, 4), "tetrahedron")
    return _body_centred(nodes, cells)


# The six tetrahedra about the diagonal from node 0 to node 6 of a hexahedron (Kuhn).
_SIX = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))


# The wedges on both sides of the diagonal from node 0 to node 2.
_TWO = ((0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7))


def _six_pyramids(corners: Floats, cells: Ints) -> Mesh:
    """Return a mesh of six pyramids per cell, with their apex in its middle."""
    inwards = np.array(ELEMENT_KINDS["hexahedron"].facets)[:, ::-1]
    tips = np.repeat(len(corners) + np.arange(len(cells)), len(inwards))
    pyramids = np.column_stack([cells[:, inwards].reshape(-1, 4), tips])
    return Mesh(np.concatenate([corners, corners[cells].mean(axis=1)]), pyramids, "pyramid")


def _grid(lengths: Sequence[float], counts: Sequence[int]) -> tuple[Floats, Ints]:
    """Return nodes [m] of a grid, x fastest, shape (n_nodes, dim), and its cells, shape (n_cells, 4 or 8)."""
    axes = [np.linspace(0, length, count + 1) for length, count in zip(lengths, counts, strict=True)]
    nodes = np.stack([axis.ravel() for axis in np.meshgrid(*axes[::-1], indexing="ij")][::-1], axis=1)
    strides = np.cumprod([1, *(count + 1 for count in counts)])[:-1]
    places = np.meshgrid(*(np.arange(count) for count in counts[::-1]), indexing="ij")
    first = sum(stride * place.ravel() for stride, place in zip(strides, places[::-1], strict=True))
    base = np.array([0, strides[0], strides[0] + strides[1], strides[1]])
    local = base if len(counts) == 2 else np.concatenate([base, base + strides[2]])
    return nodes, np.asarray(first)[:, None] + local


def _body_centred(corners: Floats, cells: Ints) -> Mesh:
    """Return body-centred-cubic tetrahedra: four around the line between the middles of two cells that share a face.

    On the boundary the middle of the face replaces that of the other cell: the same tetrahedra, halved.
    """
    hexahedra = Mesh(corners, cells, "hexahedron")
    n_corners, n_cells, n_faces = len(corners), len(cells), len(hexahedra.kind.facets)
    faces = cells[:, np.array(hexahedra.kind.facets)].reshape(-1, 4)
    owner = n_corners + np.repeat(np.arange(n_cells), n_faces)
    found = distinct_rows(ascending(faces.T))
    first, face_of, count = found.first, found.of, found.count
    # The middles on both sides: of two cells, or of a cell and of its face on the outside.
    other_side = np.zeros(len(first), dtype=np.int64)
    later = np.flatnonzero(first[face_of] != np.arange(len(faces)))
    other_side[face_of[later]] = owner[later]
    outside = np.flatnonzero(count == 1)
    other_side[outside] = n_corners + n_cells + np.arange(len(outside))
    near, far, ring = owner[first], other_side, faces[first]
    tetrahedra = np.stack(
        [np.stack([near, ring[:, side], ring[:, (side + 1) % 4], far], axis=1) for side in range(4)], axis=1
    )
    middles = [corners[cells].mean(axis=1), corners[faces[first[outside]]].mean(axis=1)]
    return Mesh(np.concatenate([corners, *middles]), tetrahedra.reshape(-1, 4), "tetrahedron")


def refuse_too_large(n_nodes: int, dim: int) -> None:
    """Raise MeshError if a solve with `n_nodes` nodes does not fit in the available memory."""
    needed = _BYTES_A_NODE[dim] * n_nodes
    there = available_memory()
    if needed > there:
        raise MeshError(
            f"a mesh of {n_nodes:,} nodes needs about {needed / 2**30:,.0f} GiB to be solved, "
            f"this machine has {there / 2**30:,.1f} GiB: use fewer elements"
        )


def _known(value: str, allowed: Sequence[str], name: str) -> None:
    if value not in allowed:
        raise MeshError(f"{name} = '{value}' is unknown{nearest(value, allowed)}; allowed: {', '.join(allowed)}")


def _checked(
    size: Sequence[float], elements: Sequence[int], shape: str, axes: str, nodes_a_cell: int = 1
) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """Return lengths [m] and numbers of cells along the axes; raise MeshError if they are invalid."""
    lengths = _values(size, "size", shape, axes)
    counts = _values(elements, "elements", shape, axes)
    if not all(math.isfinite(length) and length > 0 for length in lengths):
        raise MeshError(f"size = {list(size)}: lengths must be positive and finite")
    if not all(float(count).is_integer() and count >= 1 for count in counts):
        raise MeshError(f"elements = {list(elements)}: counts must be whole numbers of at least 1")
    whole = tuple(int(count) for count in counts)
    cell = [length / count for length, count in zip(lengths, whole, strict=True)]
    if max(cell) > _FLATTEST * min(cell):
        raise MeshError(f"elements of {' by '.join(f'{extent:g} m' for extent in cell)} are flatter than 1000:1")
    refuse_too_large(nodes_a_cell * math.prod(count + 1 for count in whole), len(axes))
    return lengths, whole


def _values(values: Sequence[float], name: str, shape: str, axes: str) -> tuple[float, ...]:
    if len(values) != len(axes):
        along = f"{', '.join(axes[:-1])} and {axes[-1]}"
        raise MeshError(f"{name} = {list(values)}: a {shape} has {len(axes)} values, along {along}")
    try:
        return tuple(float(value) for value in values)
    except (TypeError, ValueError):
        raise MeshError(f"{name} = {list(values)}: must be numbers, lengths in metres") from None
