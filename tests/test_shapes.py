"""Meshes: the shapes made here, the checks at their door, selections in space and how a total is shared."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts
from truespring.errors import MeshError
from truespring.mesh import select, select_elements, shapes, shares
from truespring.mesh.kinds import ELEMENT_KINDS
from truespring.mesh.measures import facet_measures

PLANE = [("quadrilateral", "right"), *(("triangle", diagonal) for diagonal in ("right", "left", "alternating"))]
SOLID = ("hexahedron", "tetrahedron", "bcc-tetrahedron")

# Elements a cell, and facets that bound the body a cell's side.
PER_CELL = {"quadrilateral": (1, 1), "triangle": (2, 1), "hexahedron": (1, 1), "tetrahedron": (6, 2)}


def outward(mesh: ts.Mesh) -> np.ndarray:
    """The area [m^k] of every facet that bounds the body times its normal, by the order of its nodes."""
    at = mesh.nodes[mesh.boundary]
    if mesh.dim == 2:
        along = at[:, 1] - at[:, 0]
        return np.stack([along[:, 1], -along[:, 0]], axis=1)
    middle = at.mean(axis=1, keepdims=True)
    return sum(
        np.cross(at[:, i] - middle[:, 0], at[:, i - at.shape[1] + 1] - middle[:, 0]) / 2 for i in range(at.shape[1])
    )


def check_mesh(mesh: ts.Mesh, size: tuple[float, ...]) -> None:
    """What holds for any division of a block: its volume, no gaps, a closed surface seen from outside."""
    assert mesh.measures.min() > 0
    assert mesh.measures.sum() == pytest.approx(math.prod(size), rel=1e-12)
    assert mesh.lower == pytest.approx([0.0] * mesh.dim, abs=0)
    assert mesh.upper == pytest.approx(size, rel=1e-15)
    assert (mesh.corner_jacobians(mesh.nodes) > 0).all()
    assert len(np.unique(mesh.nodes.round(12), axis=0)) == mesh.n_nodes
    # A facet belongs to one element, at the boundary, or to two: no element overlaps or misses another.
    facets = np.sort(mesh.elements[:, np.array(mesh.kind.facets)].reshape(-1, len(mesh.kind.facets[0])), axis=1)
    _, count = np.unique(facets, axis=0, return_counts=True)
    assert set(count) <= {1, 2} and (count == 1).sum() == len(mesh.boundary)
    assert len(mesh.facets) == len(count)
    normals = outward(mesh)
    assert np.abs(normals.sum(axis=0)).max() < 1e-12 * np.abs(normals).sum()
    centres = mesh.nodes[mesh.boundary].mean(axis=1)
    assert (normals * centres).sum() / mesh.dim == pytest.approx(math.prod(size), rel=1e-12)
    on_a_side = np.isclose(centres, 0) | np.isclose(centres, mesh.upper)
    assert (on_a_side.sum(axis=1) == 1).all()
    towards = np.where(np.isclose(centres, 0), -1.0, 1.0) * on_a_side
    assert ((normals * towards).sum(axis=1) > 0).all()
    assert (mesh.parts == 0).all()


@settings(max_examples=10, deadline=None, derandomize=True)
@given(columns=st.integers(1, 6), rows=st.integers(1, 5), width=st.floats(1e-3, 1e2), height=st.floats(0.5, 2.0))
@pytest.mark.parametrize(("element", "diagonal"), PLANE)
def test_rectangles(element: str, diagonal: str, columns: int, rows: int, width: float, height: float) -> None:
    size = (width, width * height * rows / columns)
    mesh = ts.rectangle(size, (columns, rows), element, diagonal)
    assert mesh.element == element
    assert len(mesh.elements) == PER_CELL[element][0] * columns * rows
    assert mesh.n_nodes == (columns + 1) * (rows + 1)
    assert len(mesh.boundary) == 2 * (columns + rows)
    check_mesh(mesh, size)


@settings(max_examples=8, deadline=None, derandomize=True)
@given(
    counts=st.tuples(*[st.integers(1, 4)] * 3), sides=st.tuples(*[st.floats(0.4, 2.0)] * 3), unit=st.floats(1e-3, 1e2)
)
@pytest.mark.parametrize("element", SOLID)
def test_boxes(element: str, counts: tuple[int, ...], sides: tuple[float, ...], unit: float) -> None:
    size = tuple(unit * side * count for side, count in zip(sides, counts, strict=True))
    mesh = ts.box(size, counts, element)
    assert mesh.element == element.removeprefix("bcc-")
    x, y, z = counts
    sides_of_cells = 2 * (x * y + y * z + z * x)
    if element == "bcc-tetrahedron":
        assert mesh.n_nodes == (x + 1) * (y + 1) * (z + 1) + x * y * z + sides_of_cells
        assert len(mesh.elements) == 4 * (3 * x * y * z + sides_of_cells // 2)
        assert len(mesh.boundary) == 4 * sides_of_cells
    else:
        elements, facets = PER_CELL[element]
        assert mesh.n_nodes == (x + 1) * (y + 1) * (z + 1)
        assert len(mesh.elements) == elements * x * y * z
        assert len(mesh.boundary) == facets * sides_of_cells
    check_mesh(mesh, size)


def test_nodes_of_a_box_run_along_x_first() -> None:
    mesh = ts.box((2.0, 3.0, 4.0), (2, 3, 4))
    assert mesh.nodes[:4].tolist() == [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]]
    assert mesh.elements[0].tolist() == [0, 1, 4, 3, 12, 13, 16, 15]
    assert mesh.nodes[mesh.elements[[1, 2], 0]].tolist() == [[1, 0, 0], [0, 1, 0]]


def test_six_tetrahedra_share_one_diagonal_of_the_cube() -> None:
    mesh = ts.box((1.0, 1.0, 1.0), (1, 1, 1), "tetrahedron")
    assert mesh.measures == pytest.approx(np.full(6, 1 / 6), rel=1e-12)
    diagonal = {0, 7}  # from (0, 0, 0) to (1, 1, 1)
    assert all(diagonal <= set(element) for element in mesh.elements.tolist())


def test_body_centred_tetrahedra() -> None:
    """Inside, long edges (the cell's) are shared by four tetrahedra and short ones (sqrt(3)/2 of it) by six."""
    mesh = ts.box((4.0, 4.0, 4.0), (4, 4, 4), "bcc-tetrahedron")
    assert set(mesh.measures.round(12)) == {round(1 / 12, 12), round(1 / 24, 12)}
    outside = np.zeros(mesh.n_nodes, dtype=bool)
    outside[mesh.boundary] = True
    pairs = np.sort(mesh.elements[:, np.array(mesh.kind.edges)].reshape(-1, 2), axis=1)
    edges, shared = np.unique(pairs, axis=0, return_counts=True)
    inside = ~outside[edges].all(axis=1)
    length = np.linalg.norm(mesh.nodes[edges[:, 1]] - mesh.nodes[edges[:, 0]], axis=1)
    halves = np.isclose(length, 0.5)  # from a middle to that of a face on the outside
    long, short = inside & np.isclose(length, 1.0), inside & np.isclose(length, math.sqrt(3) / 2)
    assert set(shared[long]) == {4} and set(shared[short]) == {6} and set(shared[halves]) == {4}
    assert (long | short | halves)[inside].all()
    # 14 neighbours of every node inside: 8 near ones and 6 further ones.
    deep = ((mesh.nodes > 1.2) & (mesh.nodes < 2.8)).all(axis=1)
    neighbours = np.bincount(edges.ravel(), minlength=mesh.n_nodes)
    assert deep.sum() == 8 + 1 and set(neighbours[deep]) == {14}


@pytest.mark.parametrize(("diagonal", "slopes"), [("right", {1.0}), ("left", {-1.0}), ("alternating", {1.0, -1.0})])
def test_diagonals_go_where_their_name_says(diagonal: str, slopes: set[float]) -> None:
    mesh = ts.rectangle((4.0, 3.0), (4, 3), "triangle", diagonal)
    across = mesh.nodes[mesh.edges[:, 1]] - mesh.nodes[mesh.edges[:, 0]]
    slanted = np.abs(across).min(axis=1) > 0
    assert slanted.sum() == 12
    slope = across[slanted, 1] / across[slanted, 0]
    assert set(slope) == slopes
    if diagonal == "alternating":  # neighbours differ, the first is to the right
        middles = mesh.nodes[mesh.edges[slanted]].mean(axis=1)
        column, row = np.floor(middles).astype(int).T
        assert (slope == np.where((column + row) % 2 == 0, 1.0, -1.0)).all()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ts.rectangle((1.0, 1.0), (2, 2), "triangel"), r"element = 'triangel' is unknown.*'triangle'"),
        (lambda: ts.rectangle((1.0, 1.0), (2, 2), "hexahedron"), "allowed: quadrilateral, triangle"),
        (
            lambda: ts.rectangle((1.0, 1.0), (2, 2), "triangle", "up"),
            "diagonal = 'up' is unknown.*right, left, alternating",
        ),
        (lambda: ts.box((1.0, 1.0, 1.0), (2, 2, 2), "bcc"), r"element = 'bcc' is unknown.*bcc-tetrahedron"),
        (lambda: ts.box((1.0, 1.0), (2, 2, 2)), "a box has 3 values, along x, y and z"),
        (lambda: ts.box((1.0, 1.0, 1.0), (2, 2)), "a box has 3 values"),
        (lambda: ts.rectangle((1.0, 1.0, 1.0), (2, 2)), "a rectangle has 2 values, along x and y"),
        (lambda: ts.box((1.0, -1.0, 1.0), (2, 2, 2)), "lengths must be positive and finite"),
        (lambda: ts.box((1.0, math.inf, 1.0), (2, 2, 2)), "lengths must be positive and finite"),
        (lambda: ts.box((1.0, 1.0, 1.0), (2, 0, 2)), "counts must be whole numbers of at least 1"),
        (lambda: ts.box((1.0, 1.0, 1.0), (2, 1.5, 2)), "counts must be whole numbers of at least 1"),
        (lambda: ts.box(("a", 1.0, 1.0), (2, 2, 2)), "lengths in metres"),
        (lambda: ts.box((1.0, 1.0, 1.0), (1, 1, 1500)), "flatter than 1000:1"),
    ],
)
def test_shapes_that_cannot_be(make: object, said: str) -> None:
    with pytest.raises(MeshError, match=said):
        make()


@pytest.mark.parametrize("element", SOLID)
def test_a_box_too_large_for_memory_is_refused_before_it_is_built(
    element: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(MeshError, match=r"8,012,006,001 nodes|16,012,006,001|nodes needs about .* GiB"):
        ts.box((1.0, 1.0, 1.0), (2000, 2000, 2000), element)
    # By estimate 10 KiB a node: of 1 GiB 104,857 nodes.
    monkeypatch.setattr(shapes, "available_memory", lambda: 2**30)
    ts.box((1.0, 1.0, 1.0), (20, 20, 20), element)
    with pytest.raises(MeshError, match=r"needs about \d GiB to be solved, .* has 1\.0 GiB: use fewer elements"):
        ts.box((1.0, 1.0, 1.0), (47, 47, 47), element)


def test_a_rectangle_too_large_for_memory_is_refused_before_it_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    """By estimate 2.5 KiB a node: of 1 GiB 419,430 nodes."""
    with pytest.raises(MeshError, match=r"a mesh of 10,000,200,001 nodes needs about 23,842 GiB to be solved"):
        ts.rectangle((1.0, 1.0), (100_000, 100_000))
    monkeypatch.setattr(shapes, "available_memory", lambda: 2**30)
    assert ts.rectangle((1.0, 1.0), (400, 400)).n_nodes == 160_801
    with pytest.raises(MeshError, match=r"420,200 nodes needs about 1 GiB to be solved, this machine has 1\.0 GiB"):
        ts.rectangle((1.0, 1.0), (549, 763))


# --- the door -------------------------------------------------------------------------------------


def test_inverted_elements_are_counted_and_located() -> None:
    mesh = ts.box((3.0, 1.0, 1.0), (3, 1, 1))
    turned = mesh.elements.copy()
    turned[1:] = turned[1:][:, [4, 5, 6, 7, 0, 1, 2, 3]]
    with pytest.raises(
        MeshError, match=r"2 of 3 elements are inverted: .*; the first is element 1 at \(1\.5, 0\.5, 0\.5\) m"
    ):
        ts.Mesh(mesh.nodes, turned, "hexahedron")
    bent = mesh.nodes.copy()
    bent[mesh.elements[2, 6]] = [1.9, -0.1, -0.1]  # one corner only
    with pytest.raises(MeshError, match="1 of 3 elements are inverted"):
        ts.Mesh(bent, mesh.elements, "hexahedron")


@pytest.mark.parametrize("element", [name for name, kind in ELEMENT_KINDS.items() if kind.dim > 1])
def test_every_kind_of_inverted_and_flat_element_is_refused(element: str) -> None:
    make = ts.rectangle if ELEMENT_KINDS[element].dim == 2 else ts.box
    dim = ELEMENT_KINDS[element].dim
    mesh = make((1.0,) * dim, (1,) * dim, element)
    mirror = np.array([-1.0] + [1.0] * (dim - 1))
    n = len(mesh.elements)
    with pytest.raises(MeshError, match=f"{n} of {n} elements are inverted"):
        ts.Mesh(mesh.nodes * mirror, mesh.elements, element)
    with pytest.raises(MeshError, match=f"{n} of {n} elements are degenerate: flat"):
        ts.Mesh(mesh.nodes * np.array([0.0] + [1.0] * (dim - 1)), mesh.elements, element)
    thin = ts.Mesh(mesh.nodes * np.array([1e-3] + [1.0] * (dim - 1)), mesh.elements, element)
    assert len(thin.elements) == n


def test_duplicate_and_unreferenced_are_counted_and_located() -> None:
    mesh = ts.rectangle((2.0, 1.0), (2, 1), "triangle")
    turned = np.vstack([mesh.elements, mesh.elements[2, [1, 2, 0]][None]])
    with pytest.raises(MeshError, match=r"1 of 5 elements are duplicate: .*; the first is element 4 at \("):
        ts.Mesh(mesh.nodes, turned, "triangle")
    stray = np.vstack([mesh.nodes, [[5.0, 6.0], [7.0, 8.0]]])
    with pytest.raises(MeshError, match=r"2 of 8 nodes are unreferenced: .*; the first is node 6 at \(5, 6\) m"):
        ts.Mesh(stray, mesh.elements, "triangle")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"element": "hexahedral"}, "element = 'hexahedral' is unknown"),
        ({"elements": np.zeros((0, 4), dtype=int)}, "is empty"),
        ({"elements": [[0, 1, 4, 9]]}, "elements name nodes 0 to 9, there are 0 to 5"),
        ({"elements": [[0, 1, 4]]}, "elements"),
        ({"nodes": np.zeros((6, 3))}, "a quadrilateral has 2 dimensions, the nodes have 3"),
        ({"nodes": np.full((6, 2), np.nan)}, "nodes"),
        ({"node_groups": {"rim": [0, 6]}}, "node group 'rim' is empty or has a number that no node has"),
        ({"element_groups": {"bone": []}}, "element group 'bone'"),
    ],
)
def test_meshes_that_do_not_fit_together(change: dict[str, object], said: str) -> None:
    plain = ts.rectangle((2.0, 1.0), (2, 1))
    with pytest.raises(MeshError, match=said):
        ts.Mesh(**({"nodes": plain.nodes, "elements": plain.elements, "element": "quadrilateral"} | change))


def test_a_mesh_is_frozen() -> None:
    mesh = replace(ts.rectangle((2.0, 1.0), (2, 1)), node_groups={"rim": [3, 0, 3]})
    assert mesh.node_groups["rim"].tolist() == [0, 3]
    for array in (mesh.nodes, mesh.elements, mesh.node_groups["rim"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(TypeError):
        mesh.node_groups["other"] = [1]


def test_volumes_of_distorted_elements_are_exact() -> None:
    """Of a hexahedron, by the flux of the place through its ruled sides, each integrated by Gauss points."""
    generator = np.random.default_rng(4)
    regular = ts.box((2.0, 1.0, 1.0), (2, 1, 1))
    mesh = ts.Mesh(regular.nodes + generator.uniform(-0.2, 0.2, regular.nodes.shape), regular.elements, "hexahedron")
    point = 0.5 + np.array([-1, 1]) / (2 * math.sqrt(3))
    for number, element in enumerate(mesh.elements):
        flux = 0.0
        for facet in mesh.kind.facets:
            a, b, c, d = mesh.nodes[element[list(facet)]]
            for s in point:
                for t in point:
                    place = (1 - s) * (1 - t) * a + s * (1 - t) * b + s * t * c + (1 - s) * t * d
                    along = (1 - t) * (b - a) + t * (c - d)
                    up = (1 - s) * (d - a) + s * (c - b)
                    flux += place @ np.cross(along, up) / 4
        assert mesh.measures[number] == pytest.approx(flux / 3, rel=1e-12)


# --- selections -----------------------------------------------------------------------------------


def test_sides_of_a_box() -> None:
    mesh = ts.box((3.0, 2.0, 1.0), (3, 2, 1))
    for name, axis, value in (
        ("left", 0, 0),
        ("right", 0, 3),
        ("bottom", 1, 0),
        ("top", 1, 2),
        ("back", 2, 0),
        ("front", 2, 1),
    ):
        assert select(mesh, name).tolist() == np.flatnonzero(mesh.nodes[:, axis] == value).tolist()
        assert select(mesh, ts.Plane("xyz"[axis], value)).tolist() == select(mesh, name).tolist()
    assert mesh.nodes[ts.named_point(mesh, "right-top-front")].tolist() == [3, 2, 1]
    assert mesh.nodes[ts.named_point(mesh, "back-left-middle")].tolist() == [0, 1, 0]
    assert mesh.nodes[ts.named_point(mesh, "right-middle")].tolist() == [3, 1, 0]  # of two as near, the smaller
    assert mesh.nodes[select(mesh, ts.Near((3.1, 1.9, 0.8)))].tolist() == [[3, 2, 1]]
    assert len(select(mesh, ts.Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))) == 8
    with pytest.raises(MeshError, match="'back' is a side of a body in 3D, this one has 2 dimensions"):
        select(ts.rectangle((1.0, 1.0), (1, 1)), "back")
    for wrong in ("back-front", "left-left", "upper"):
        with pytest.raises(MeshError, match="no side or point of this body"):
            select(mesh, wrong)
    for wrong, said in (
        (ts.Plane("z", 0.4), "nearest nodes are at z = 0 m"),
        (ts.Plane("w", 0.0), "allowed: x, y, z"),
        (ts.Plane(2, 0.0), "axis 2 is unknown; allowed: x, y, z"),  # type: ignore[arg-type]
        (ts.Box((0.0, 0.0), (1.0, 1.0)), "corners of 3 coordinates"),
        (ts.Box((0.1, 0.1, 0.1), (0.2, 0.2, 0.2)), "no node in the box"),
        (ts.Near((0.0, 0.0)), "3 coordinates"),
        ([0, 24], "node 24 does not exist: 0 to 23"),
    ):
        with pytest.raises(MeshError, match=said):
            select(mesh, wrong)


def test_groups_come_before_sides() -> None:
    plain = ts.box((2.0, 1.0, 1.0), (2, 1, 1))
    mesh = replace(plain, node_groups={"left": [2, 5], "tip": [11, 5, 8]})
    assert select(mesh, "left").tolist() == [2, 5]
    assert select(mesh, "tip").tolist() == [5, 8, 11]
    assert select(mesh, "right").tolist() == select(plain, "right").tolist()
    assert ts.named_point(mesh, "tip") in (5, 8, 11)
    with pytest.raises(MeshError, match=r"'tipp' is no side or point.*'tip'.*: left, tip, right, bottom, top, back"):
        select(mesh, "tipp")


def test_elements_are_selected_by_their_centres() -> None:
    mesh = replace(ts.box((4.0, 2.0, 2.0), (4, 2, 2)), element_groups={"core": [5, 2]})
    assert select_elements(mesh, "core").tolist() == [2, 5]
    assert select_elements(mesh, ts.Box((1.2, 0.0, 0.0), (2.7, 1.0, 1.0))).tolist() == [1, 2]
    assert select_elements(mesh, [3, 3, 0]).tolist() == [0, 3]


# --- shares ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", SOLID)
def test_a_total_on_a_side_is_shared_by_area(element: str) -> None:
    """Hexahedra: a quarter of an inner node's share at a corner, half at an edge; all kinds: no moment, sum 1."""
    mesh = ts.box((2.0, 3.0, 4.0), (2, 3, 4), element)
    for side, axis in (("right", 0), ("bottom", 1), ("front", 2)):
        nodes = select(mesh, side)
        share = shares(mesh, nodes)[1]
        assert share.sum() == pytest.approx(1.0, rel=1e-14)
        assert (share > 0).all()
        centre = (share[:, None] * mesh.nodes[nodes]).sum(axis=0)
        middle = mesh.upper / 2
        across = np.arange(3) != axis
        assert centre[across] == pytest.approx(middle[across], rel=1e-12)
        if element == "hexahedron":
            at_rim = (np.isclose(mesh.nodes[nodes], 0) | np.isclose(mesh.nodes[nodes], mesh.upper))[:, across].sum(
                axis=1
            )
            cells = np.prod([(2, 3, 4)[i] for i in range(3) if i != axis])
            assert share == pytest.approx(np.array([1.0, 0.5, 0.25])[at_rim] / cells, rel=1e-12)


def test_a_total_is_consistent_with_a_uniform_traction() -> None:
    """On any facets the share of a node is the integral of its shape function: a linear field does the same work."""
    generator = np.random.default_rng(6)
    for element in ("hexahedron", "tetrahedron", "bcc-tetrahedron"):
        regular = ts.box((2.0, 2.0, 2.0), (2, 2, 2), element)
        on = np.isclose(regular.nodes[:, 0], 2)
        inner = on & ((regular.nodes[:, 1:] > 0.1) & (regular.nodes[:, 1:] < 1.9)).all(axis=1)
        moved = regular.nodes.copy()
        moved[inner, 1:] += generator.uniform(-0.2, 0.2, (inner.sum(), 2))
        mesh = ts.Mesh(moved, regular.elements, regular.element)
        nodes = np.flatnonzero(on)
        share = shares(mesh, nodes)[1]
        assert share @ mesh.nodes[nodes, 1:] == pytest.approx([1.0, 1.0], rel=1e-12)
        facets = mesh.boundary[np.isin(mesh.boundary, nodes).all(axis=1)]
        areas = facet_measures(mesh.nodes[facets])
        assert areas.sum() == pytest.approx(4.0, rel=1e-12)
        if element == "hexahedron":  # of a quadrilateral corners carry unlike parts
            continue
        expected = np.bincount(facets.ravel(), np.repeat(areas, facets.shape[1]) / facets.shape[1] / 4, mesh.n_nodes)
        assert share == pytest.approx(expected[nodes], rel=1e-12)


def test_lines_points_and_bodies_share_too() -> None:
    mesh = ts.box((4.0, 1.0, 1.0), (4, 1, 1))
    edge = np.flatnonzero((mesh.nodes[:, 1] == 0) & (mesh.nodes[:, 2] == 0))
    assert shares(mesh, edge)[1] == pytest.approx(np.array([1, 2, 2, 2, 1]) / 8)
    everything = shares(mesh, np.arange(mesh.n_nodes))[1]
    inner = (mesh.nodes[:, 0] > 0) & (mesh.nodes[:, 0] < 4)
    assert everything == pytest.approx(np.where(inner, 2, 1) / 32)
    assert shares(mesh, np.array([3]))[1] == pytest.approx([1.0])
    assert shares(mesh, np.array([0, 19]))[1] == pytest.approx([0.5, 0.5])


# --- parts that hang in the air -------------------------------------------------------------------


def apart(*distances: float) -> ts.Mesh:
    """Cubes that nothing joins."""
    one = ts.box((1.0, 1.0, 1.0), (1, 1, 1))
    nodes = np.concatenate([one.nodes + np.array([distance, 0.0, 0.0]) for distance in distances])
    elements = np.concatenate([one.elements + 8 * number for number in range(len(distances))])
    return ts.Mesh(nodes, elements, "hexahedron")


def test_parts_are_counted() -> None:
    assert np.unique(apart(0.0, 2.0, 5.0).parts).tolist() == [0, 1, 2]
    assert (ts.box((2.0, 1.0, 1.0), (2, 1, 1)).parts == 0).all()


@pytest.mark.parametrize("model", [ts.Fem("linear"), ts.Springs("isotropic")])
def test_a_part_without_support_is_refused_by_count_and_place(model: ts.Fem | ts.Springs) -> None:
    mesh, material = apart(0.0, 2.0, 5.0), ts.Material(1.0, 0.25)
    load = ts.Force([23], (1e-3, 0.0, 0.0))
    said = r"one of 3 disconnected parts .*8 nodes .*\(2\.5, 0\.5, 0\.5\) m.* free to move"
    with pytest.raises(ts.TruespringError, match=said):
        ts.Problem(mesh, material, None, [ts.Fixed("left"), ts.Fixed(range(16, 20))], load)
    weak = [ts.Fixed("left"), ts.Fixed(range(16, 20)), ts.Fixed([8, 9], fix="xyz")]
    with pytest.raises(ts.TruespringError, match=r"one of 3 disconnected parts.*by turning"):
        ts.Problem(mesh, material, None, weak, load)
    held = ts.Problem(mesh, material, None, [ts.Fixed("left"), ts.Fixed(range(16, 20)), ts.Fixed(range(8, 12))], load)
    path = ts.solve(held, model, ts.Newton(load_steps=1))
    assert path.status is ts.Status.CONVERGED
    assert np.abs(path.states[-1].displacement[:16]).max() < 1e-14  # of lengths of 1: rounding


def test_parts_that_share_less_than_a_facet_may_turn() -> None:
    """Two cubes at one corner are one part to the mesh, and the supports of one leave the other free to turn."""
    one = ts.box((1.0, 1.0, 1.0), (1, 1, 1))
    nodes = np.concatenate([one.nodes, one.nodes[1:] + 1.0])
    elements = np.concatenate([one.elements, np.where(one.elements == 0, 7, one.elements + 7)])
    mesh = ts.Mesh(nodes, elements, "hexahedron")
    assert (mesh.parts == 0).all()
    problem = ts.Problem(mesh, ts.Material(1.0, 0.25), None, [ts.Fixed("left")], [ts.Force([14], (1e-3, 0.0, 0.0))])
    path = ts.solve(problem, ts.Fem("linear"), ts.Newton(load_steps=1))
    assert path.status is not ts.Status.CONVERGED


@pytest.mark.parametrize("element", ["hexahedron", "tetrahedron", "bcc-tetrahedron"])
def test_a_load_on_two_sides_is_shared_by_area(element: str) -> None:
    """Though a tetrahedron at their common edge has all its nodes on them."""
    mesh = ts.box((3.0, 2.0, 1.0), (3, 2, 1), element)
    nodes = np.flatnonzero((mesh.nodes[:, 0] == 0) | (mesh.nodes[:, 1] == 0))
    force = shares(mesh, nodes)[1]
    assert force.sum() == pytest.approx(1.0, rel=1e-12)
    left, bottom = mesh.nodes[nodes, 0] == 0, mesh.nodes[nodes, 1] == 0
    # Areas 2 and 3; nodes of the common edge carry a share of both.
    assert force[left & ~bottom].sum() < 0.4 < force[left].sum()
    moment = (force[:, None] * mesh.nodes[nodes]).sum(axis=0)
    assert moment == pytest.approx([0.6 * 1.5, 0.4 * 1.0, 0.5], rel=1e-12)


def test_groups_are_numbers() -> None:
    plain = ts.rectangle((2.0, 1.0), (2, 1))
    for wrong in ([0.7], [True, False]):
        with pytest.raises(MeshError, match="must be a list of element numbers"):
            ts.Mesh(plain.nodes, plain.elements, element_groups={"a": np.array(wrong)})
    with pytest.raises(MeshError, match=r"node numbers, such as np\.flatnonzero\(mask\)$"):
        ts.Mesh(plain.nodes, plain.elements, node_groups={"a": plain.nodes[:, 0] > 1.0})


@pytest.mark.parametrize(
    ("mesh", "there"),
    [
        (ts.box((1.0, 1.0, 1.0), (1, 1, 1)), "quadrilateral'; use element = 'hexahedron'$"),
        (ts.box((1.0, 1.0, 1.0), (1, 1, 1), "tetrahedron"), "has 2 dimensions, .* 3; use element = 'tetrahedron'$"),
        (ts.rectangle((1.0, 1.0), (1, 1), "triangle"), "quadrilateral'; use element = 'triangle'$"),
    ],
)
def test_arrays_of_another_kind_of_element_name_the_kinds_that_fit(mesh: ts.Mesh, there: str) -> None:
    with pytest.raises(MeshError, match=there):
        ts.Mesh(mesh.nodes, mesh.elements)
    with pytest.raises(MeshError, match=r"\(1, 7\), expected \(n, 4\) for element = 'quadrilateral'$"):
        ts.Mesh(mesh.nodes, np.zeros((1, 7), dtype=int))


def test_a_mapped_mesh_keeps_elements_groups_and_the_names_of_its_sides() -> None:
    """A quarter of a ring: its area is that of the polygons, (b^2 - a^2) / 2 n sin(angle / n); "left" is inside."""
    (inner, outer), n = (1.0, 2.0), 12
    flat = replace(ts.rectangle((outer - inner, math.pi / 2), (3, n)), node_groups={"top": np.array([0])})
    ring = ts.mapped(flat, lambda x, y: ((inner + x) * np.cos(y), (inner + x) * np.sin(y)))
    area = (outer**2 - inner**2) / 2 * n * math.sin(math.pi / 2 / n)
    assert ring.measures.sum() == pytest.approx(area, rel=1e-12)
    for side, radius in (("left", inner), ("right", outer)):
        nodes = ring.nodes[ring.node_groups[side]]
        assert len(nodes) == n + 1
        assert np.linalg.norm(nodes, axis=1) == pytest.approx(radius, rel=1e-12)
    assert ring.node_groups["top"].tolist() == [0]  # a group of the mesh counts before a side
    assert "front" not in ring.node_groups


def test_functions_that_do_not_map_a_mesh_are_errors() -> None:
    flat = ts.rectangle((1.0, 1.0), (2, 2))
    with pytest.raises(MeshError, match=r"4 of 4 elements are inverted.*exchange two coordinates of its map"):
        ts.mapped(flat, lambda x, y: (y, x))
    with pytest.raises(MeshError, match=r"shapes \[\(9,\)\]: it must return 2 coordinates, each of shape \(9,\)"):
        ts.mapped(flat, lambda x, y: (x,))
    with pytest.raises(MeshError, match="vectors of elements"):
        ts.mapped(replace(flat, element_vectors={"fibres": np.ones((4, 2))}), lambda x, y: (x, y))
