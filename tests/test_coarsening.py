"""Coarser problems: meshes of cells twice as large, the interpolation from them, restated supports and loads."""

from dataclasses import replace

import numpy as np
import pytest

import truespring as ts
from truespring.coarsening import CoarseBody, Interpolated, restated, weaker
from truespring.mesh import Mesh, coarser
from truespring.models.lattices import LATTICES
from truespring.potential import is_symmetric, tangent_of
from truespring.problem import Region

# Lattices whose nodes are not the corners of equal cells along the first element's sides.
NO_CELLS = {"equilateral triangles", "body-centred-cubic tetrahedra", "pyramids"}

SOFT, STIFF = ts.Material(3e3, 0.3), ts.Material(9e3, 0.3)


def stepped() -> Mesh:
    """A turned body of cubes with a step and a missing corner."""
    whole = ts.box((7.0, 5.0, 6.0), (7, 5, 6))
    cells = whole.elements[~((whole.centres[:, 0] > 4) & (whole.centres[:, 1] > 2)) & (whole.centres.sum(axis=1) > 3)]
    used, elements = np.unique(cells, return_inverse=True)
    turn = np.linalg.qr(np.array([[1.0, 0.2, -0.3], [0.1, 1.0, 0.4], [0.0, -0.5, 1.0]]))[0]
    turn *= np.sign(np.linalg.det(turn))
    return Mesh(whole.nodes[used] @ turn + [3.0, -1.0, 2.0], elements.reshape(cells.shape), "hexahedron")


BODIES = {name: make for name, make in LATTICES.items() if name not in NO_CELLS} | {
    "alternating": lambda: ts.rectangle((5.0, 4.0), (5, 4), "triangle", "alternating"),
    "steps": stepped,
}


@pytest.mark.parametrize("name", BODIES)
def test_a_linear_field_is_interpolated_exactly(name: str) -> None:
    mesh = BODIES[name]()
    found = coarser(mesh)
    assert found is not None
    slopes = np.arange(1.0, mesh.dim + 1)
    assert found.weights @ (found.mesh.nodes @ slopes + 2) == pytest.approx(mesh.nodes @ slopes + 2, abs=1e-12)
    assert (found.weights.data > 0).all() and np.diff(found.weights.indptr).max() == 2**mesh.dim
    largest = np.bincount(found.cells, found.mesh.measures)
    assert largest == pytest.approx(np.bincount(found.parents, mesh.measures).max())
    # The nodes of each element lie in the coarse cell that takes its place.
    for corner in mesh.elements.T:
        columns = [set(found.weights[[node]].indices) for node in corner]
        for inside, cell in zip(columns, found.parents, strict=True):
            assert inside <= set(found.mesh.elements[found.cells == cell].ravel())


@pytest.mark.parametrize("name", sorted(NO_CELLS))
def test_a_mesh_that_is_no_lattice_has_no_coarser_one(name: str) -> None:
    assert coarser(LATTICES[name]()) is None


def test_a_mesh_of_unequal_cells_has_no_coarser_one() -> None:
    mesh = ts.rectangle((4.0, 4.0), (4, 4))
    assert coarser(replace(mesh, nodes=mesh.nodes + 1e-3 * mesh.nodes**2)) is None


EVEN = {
    "squares": lambda: ts.rectangle((8.0, 4.0), (8, 4)),
    "halved squares": lambda: ts.rectangle((8.0, 4.0), (8, 4), "triangle", "left"),
    "bricks": lambda: ts.box((4.0, 6.0, 5.0), (4, 4, 4)),
    "wedges": lambda: ts.box((4.0, 4.0, 4.0), (4, 4, 4), "wedge"),
}


@pytest.mark.parametrize("name", EVEN)
def test_uniform_tension_is_the_same_on_two_coarser_meshes(name: str) -> None:
    mesh = EVEN[name]()
    sides = ("left", "bottom", "back")[: mesh.dim]
    pull = np.zeros(mesh.dim)
    pull[0] = 100.0
    problem = ts.Problem(
        mesh,
        SOFT,
        ts.PlaneStress(0.5) if mesh.dim == 2 else None,
        [ts.Fixed(on=side, fix=[axis]) for side, axis in zip(sides, "xyz", strict=False)],
        [ts.Traction(on="right", traction=pull)],
    )
    body = CoarseBody.finest(problem, problem.loading)
    strain = np.array([1, -0.3, -0.3])[: mesh.dim] * 100 / 3e3
    for _ in range(2):
        coarse = body.coarser()
        assert coarse is not None and (coarse.filled == 1).all()
        displacement = solved(coarse) - coarse.mesh.nodes
        assert coarse.weights @ displacement == pytest.approx(body.mesh.nodes * strain, abs=1e-12)
        body = coarse


def test_an_uneven_end_is_filled_by_its_share() -> None:
    """A bar of 7 cells is 4 coarse cells long, then 2: with the stiffness and the length of the fine one in tension."""
    mesh = ts.box((7.0, 4.0, 4.0), (7, 4, 4))
    sides = [ts.Fixed(on=side, fix=[axis]) for side, axis in zip(("left", "bottom", "back"), "xyz", strict=True)]
    problem = ts.Problem(mesh, SOFT, None, sides, [ts.Traction(on="right", traction=(100.0, 0.0, 0.0))])
    body = CoarseBody.finest(problem, problem.loading).coarser()
    assert body is not None
    assert sorted(set(body.filled)) == [0.5, 1.0] and body.mesh.upper == pytest.approx([8, 4, 4])
    displacement = body.weights @ (solved(body) - body.mesh.nodes)
    assert displacement == pytest.approx(mesh.nodes * np.array([1, -0.3, -0.3]) * 100 / 3e3, abs=1e-12)
    coarsest = body.coarser()
    assert coarsest is not None and sorted(set(coarsest.filled)) == [0.75, 1.0]


def solved(body: CoarseBody) -> np.ndarray:
    """Positions under the linear law."""
    potential = ts.Fem("linear", "linear").potential(body.problem)
    *_, last = ts.Newton(load_steps=1).follow(potential, body.loading)
    assert last.converged
    return last.positions


def test_supports_hold_and_move_coarse_nodes_as_the_fine_ones() -> None:
    mesh = ts.box((4.0, 6.0, 2.0), (4, 6, 2))
    on_top = ts.Fixed(on="top", rotation=0.7, axis=(0.0, 1.0, 0.2), displacement=(0.1, 0.2, 0.3))
    problem = ts.Problem(mesh, SOFT, supports=[ts.Fixed(on="bottom", fix=["y"]), on_top])
    body = CoarseBody.finest(problem, problem.loading).coarser()
    assert body is not None
    at = np.flatnonzero(np.diff(body.weights.indptr) == 1)
    coarse = body.weights[at].indices
    assert len(at) == body.mesh.n_nodes
    assert (body.loading.held[coarse] == problem.loading.held[at]).all()
    for share in (0.3, 1.0):
        assert body.loading.motion(share)[coarse] == pytest.approx(problem.loading.motion(share)[at], abs=1e-14)


def test_no_support_is_lost() -> None:
    """Each node alone holds the coarse nodes nearest to it, two at the middle of an edge."""
    mesh = ts.rectangle((4.0, 4.0), (4, 4))
    found = coarser(mesh)
    assert found is not None
    for node, place in enumerate(mesh.nodes):
        held = np.zeros(mesh.nodes.shape, dtype=bool)
        held[node, 1] = True
        loading = ts.Problem(mesh, SOFT, ts.PlaneStress(1.0), [ts.Fixed(on="left", displacement=(1.0, 0.0))]).loading
        coarse = restated(replace(loading, held=held), mesh.nodes, found.mesh.nodes, found.weights)
        distance = np.abs(found.mesh.nodes - place).sum(axis=1)
        assert (coarse.held[:, 1] == (distance == distance.min())).all() and not coarse.held[:, 0].any()


@pytest.mark.parametrize("edge", ["held", "free"])
def test_a_following_load_is_that_of_the_interpolated_positions(edge: str) -> None:
    mesh = ts.box((4.0, 4.0, 2.0), (4, 4, 2))
    ends = [ts.Fixed(on="left")]
    if edge == "held":
        ends += [ts.Fixed(on="top", fix=["y"]), ts.Fixed(on="bottom", fix=["y"])]
        ends += [ts.Fixed(on="front", fix=["z"]), ts.Fixed(on="back", fix=["z"])]
    problem = ts.Problem(mesh, SOFT, supports=ends, loads=[ts.Pressure(on="right", pressure=5.0)])
    (pressure,) = problem.loading.following
    body = CoarseBody.finest(problem, problem.loading).coarser()
    assert body is not None
    (load,) = body.loading.following
    assert isinstance(load, Interpolated)
    generator = np.random.default_rng(3)
    positions, step = body.mesh.nodes + 0.2 * generator.random((2, body.mesh.n_nodes, 3))
    free = ~body.loading.held
    positions, step = np.where(free, positions, body.mesh.nodes), np.where(free, step - body.mesh.nodes, 0.0)
    fine = mesh.nodes + body.weights @ (positions - body.mesh.nodes)
    assert load.energy(positions) == pytest.approx(pressure.energy(fine), rel=1e-12)
    assert load.gradient(positions).sum(axis=0) == pytest.approx(pressure.gradient(fine).sum(axis=0))
    h = 1e-5
    slope = (load.gradient(positions + h * step) - load.gradient(positions - h * step)) / (2 * h)
    tangent = tangent_of(load, positions)
    assert (tangent @ step.ravel()).reshape(step.shape)[free] == pytest.approx(slope[free], abs=1e-7)
    assert is_symmetric(load) == (edge == "held")
    assert (abs(tangent - tangent.T).max() < 1e-12 * abs(tangent).max()) == (edge == "held")


def test_a_coarse_cell_is_of_the_material_of_most_of_its_elements() -> None:
    mesh = ts.rectangle((6.0, 4.0), (6, 4))
    right = Region(on=np.flatnonzero(mesh.centres[:, 0] > 3), material=STIFF)  # type: ignore[arg-type]
    spot = Region(on=np.array([0]), material=STIFF)  # type: ignore[arg-type]
    problem = ts.Problem(
        replace(mesh, element_vectors={"grain": mesh.centres}),
        SOFT,
        ts.PlaneStress(1.0),
        [ts.Fixed(on="left")],
        [ts.Force(on="right", total=(1.0, 0.0))],
        [right, spot],
    )
    body = CoarseBody.finest(problem, problem.loading).coarser()
    assert body is not None
    coarse = body.problem
    at = coarse.mesh.centres
    assert [coarse.materials[number] for number in coarse.material_numbers] == [
        STIFF if x > 4 else SOFT for x in at[:, 0]
    ]
    assert np.abs(coarse.mesh.element_vectors["grain"] - at).max() == 0.5


def test_a_cell_filled_in_part_has_that_share_of_all_moduli() -> None:
    fibres = ts.Fibres(along=(1.0, 0.0), k1=8.0, k2=2.0)
    material = ts.Material(3.0, 0.3, 5.0, {"mu2": 4.0, "alpha2": 2.0}, fibres)
    assert weaker(material, 0.25) == ts.Material(0.75, 0.3, 5.0, {"mu2": 1.0, "alpha2": 2.0}, replace(fibres, k1=2.0))
