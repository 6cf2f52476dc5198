"""Elements of second order: nodes in the middle of edges from files, curved edges, and no locking under pressure."""

import math
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from scipy.optimize import brentq

import truespring as ts
from truespring.arrays import Floats
from truespring.errors import MeshError
from truespring.mesh import CELL_SHAPES, SecondOrder, quadrature, read_mesh, refined
from truespring.models.laws import LAWS, Constants
from truespring.models.symmetric import trace
from truespring.study import read_study, run

INNER, OUTER = 0.01, 0.02


def with_round_edges(mesh: ts.Mesh) -> ts.Mesh:
    """Edges through points as far from the origin as their ends are in the mean."""
    middles = mesh.nodes[mesh.edges].mean(axis=1)
    radius = np.linalg.norm(mesh.nodes, axis=1)[mesh.edges].mean(axis=1)
    return replace(mesh, middles=middles * (radius / np.linalg.norm(middles, axis=1))[:, None])


def octant(n: int, layers: int) -> ts.Mesh:
    """An eighth of a thick sphere of tetrahedra: `n` by `n` triangles around, each prism between two cut in three."""
    flat = [(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)]
    at = {place: number for number, place in enumerate(flat)}
    up = [((i, j), (i + 1, j), (i, j + 1)) for i in range(n) for j in range(n - i)]
    down = [((i + 1, j), (i + 1, j + 1), (i, j + 1)) for i in range(n) for j in range(n - i - 1)]
    triangles = [sorted(at[i, j, n - i - j] for i, j in corners) for corners in up + down]
    directions = np.array(flat) / np.linalg.norm(flat, axis=1)[:, None]
    nodes = np.concatenate([radius * directions for radius in np.linspace(INNER, OUTER, layers + 1)])
    tetrahedra = [
        [*low[: k + 1], *high[k:]]
        for layer in range(layers)
        for corners in triangles
        for low, high in [([c + layer * len(flat) for c in corners], [c + (layer + 1) * len(flat) for c in corners])]
        for k in range(3)
    ]
    elements = np.array(tetrahedra)
    spans = nodes[elements[:, 1:]] - nodes[elements[:, :1]]
    elements[np.linalg.det(spans) < 0] = elements[np.linalg.det(spans) < 0][:, [0, 2, 1, 3]]
    inside = np.isclose(np.linalg.norm(nodes, axis=1), INNER)
    groups = {f"{axis}0": np.flatnonzero(np.isclose(nodes[:, k], 0.0)) for k, axis in enumerate("xyz")}
    return ts.Mesh(nodes, elements, "tetrahedron", {**groups, "inner": np.flatnonzero(inside)})


def quarter(element: str) -> ts.Mesh:
    """A quarter of a thick tube."""
    flat = ts.rectangle((1.0, 1.0), (4, 6), element)
    radius, angle = INNER + (OUTER - INNER) * flat.nodes[:, 0], flat.nodes[:, 1] * math.pi / 2
    nodes = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    nodes[flat.nodes[:, 1] == 1, 0] = 0.0
    sides = {"x0": flat.nodes[:, 1] == 1, "y0": flat.nodes[:, 1] == 0, "inner": flat.nodes[:, 0] == 0}
    return ts.Mesh(nodes, flat.elements, element, {name: np.flatnonzero(there) for name, there in sides.items()})


def pressed(mesh: ts.Mesh, poisson: float, pressure: float) -> ts.Problem:
    axes = "xyz"[: mesh.dim]
    return ts.Problem(
        mesh,
        ts.Material(100e3, poisson),
        ts.PlaneStrain(1e-3) if mesh.dim == 2 else None,
        [ts.Fixed(f"{axis}0", fix=[axis]) for axis in axes],
        ts.Pressure("inner", pressure),
    )


def widened(problem: ts.Problem, law: str, element: str | None = None, steps: int = 1) -> float:
    """The mean displacement of the inner face along its radius."""
    path = ts.solve(problem, ts.Fem(law, element), ts.Newton(load_steps=steps))
    assert path.status is ts.Status.CONVERGED
    inner = problem.mesh.node_groups["inner"]
    radius = problem.mesh.nodes[inner] / INNER
    return float((path.states[-1].displacement[inner] * radius).sum(axis=1).mean())


def sphere_of_rubber(pressure: float) -> float:
    """Inner displacement of an incompressible neo-Hookean sphere: p = mu [2/b + 1/(2 b^4) - 2/a - 1/(2 a^4)].

    With the stretches a inside and b outside (Green and Zerna, Theoretical Elasticity, 1954).
    """
    mu = 100e3 / 3

    def held(stretch: float) -> float:
        outside = (1 + (stretch**3 - 1) * (INNER / OUTER) ** 3) ** (1 / 3)
        part = [2 / one + 1 / (2 * one**4) for one in (outside, stretch)]
        return mu * (part[0] - part[1]) - pressure

    return INNER * (brentq(held, 1.0, 1.2) - 1)


def lame_sphere(pressure: float, poisson: float) -> float:
    share = pressure * INNER**3 / (100e3 * (OUTER**3 - INNER**3))
    return share * INNER * ((1 - 2 * poisson) + (1 + poisson) * (OUTER / INNER) ** 3 / 2)


def lame_tube(pressure: float, poisson: float) -> float:
    share = pressure * INNER * (1 + poisson) / (100e3 * (OUTER**2 - INNER**2))
    return share * ((1 - 2 * poisson) * INNER**2 + OUTER**2)


# --- under pressure, nearly incompressible ---------------------------------------------------------------------------


def test_a_sphere_of_rubber_widens_as_the_closed_forms_say() -> None:
    assert sphere_of_rubber(5e3) == pytest.approx(0.4718e-3, abs=1e-7)
    problem = pressed(with_round_edges(octant(3, 2)), 0.4995, 5e3)
    assert ts.Fem("linear").chosen_element(problem) == "quadratic-mean-dilatation"
    assert widened(problem, "linear") == pytest.approx(lame_sphere(5e3, 0.4995), rel=0.01)
    assert widened(problem, "neo-hookean", steps=1) == pytest.approx(sphere_of_rubber(5e3), rel=0.01)
    assert widened(problem, "linear", "linear") < 0.7 * lame_sphere(5e3, 0.4995)  # of first order it locks


@pytest.mark.parametrize("element", ["triangle", "quadrilateral"])
def test_a_tube_widens_as_lame_says(element: str) -> None:
    mesh = quarter(element)
    problem = pressed(with_round_edges(mesh) if element == "triangle" else mesh, 0.4999, 1e3)
    assert widened(problem, "linear") == pytest.approx(lame_tube(1e3, 0.4999), rel=0.01)
    assert widened(problem, "linear", "linear") < 0.9 * lame_tube(1e3, 0.4999)


def test_curved_edges_count() -> None:
    """At a Poisson's ratio of 0.3 straight edges cost a share of the sphere's own curvature, round ones do not."""
    straight, exact = octant(3, 2), lame_sphere(1e3, 0.3)
    errors = [widened(pressed(mesh, 0.3, 1e3), "linear") / exact - 1 for mesh in (straight, with_round_edges(straight))]
    assert abs(errors[1]) < 0.005 < 0.02 < abs(errors[0])


@pytest.mark.parametrize("law", [name for name, entry in LAWS.items() if entry.trace])
def test_a_law_is_a_part_of_mu_and_one_of_lambda(law: str) -> None:
    """Which the elements of mean dilatation take apart: lambda's is of the volume ratio or of the strain's trace."""
    generator = np.random.default_rng(3)
    tensor = generator.uniform(-0.2, 0.2, (6, 4, 1))
    tensor[:3] += 1.0 if LAWS[law].finite else 0.0
    entry, lam, mu = LAWS[law], 5.0, 2.0
    values = {name: constant.example for name, constant in entry.constants.items()}
    whole, shear = (entry.respond(tensor, Constants(one, mu, False, values)).energy for one in (lam, 0.0))
    xx, yy, zz, yz, xz, xy = tensor
    det = xx * (yy * zz - yz**2) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    traces = {"small": lambda: trace(tensor), "green": lambda: (trace(tensor) - 3) / 2}
    measure = {**traces, "logarithmic": lambda: np.log(det) / 2}[entry.trace or ""]()
    assert whole - shear == pytest.approx(lam / 2 * measure**2, rel=1e-9)
    assert np.abs(whole - shear).min() > 1e-4


def test_mean_dilatation_of_second_order_takes_lambda_at_the_mean() -> None:
    """One triangle whose middles move: its energy by an own quadrature of W = mu e : e, and lambda/2 (mean tr e)^2."""
    mesh = ts.Mesh([[0.0, 0.0], [2.0, 0.1], [0.3, 1.5]], [[0, 1, 2]], "triangle")
    material = ts.Material(7.0, 0.45)
    problem = ts.Problem(mesh, material, ts.PlaneStrain(1.0), ts.Fixed([0, 1]), ts.Force([2], (1.0, 0.0)))
    potential = ts.Fem("linear").potential(problem)
    moved = np.random.default_rng(2).uniform(-0.1, 0.1, (6, 2))
    shape = CELL_SHAPES["triangle6"]
    at, weights = quadrature("triangle", 3)
    (element,) = potential.elements
    jacobian = np.einsum("ki,qka->qia", potential.nodes[element], shape.slopes(at))
    slopes = np.einsum("qka,qai->qki", shape.slopes(at), np.linalg.inv(jacobian))
    gradient = np.einsum("ki,qkj->qij", moved[element], slopes)
    strain = (gradient + gradient.swapaxes(1, 2)) / 2
    area = weights * np.linalg.det(jacobian)
    traces = np.trace(strain, axis1=1, axis2=2)
    lam, mu = material.lame
    energy = mu * (area * (strain**2).sum(axis=(1, 2))).sum() + lam / 2 * (area @ traces) ** 2 / area.sum()
    assert potential.energy(potential.nodes + moved) == pytest.approx(energy, rel=1e-12)
    assert energy < 0.97 * ts.Fem("linear", "quadratic").potential(problem).energy(potential.nodes + moved)


# --- loads on curved elements ----------------------------------------------------------------------------------------


def measure_of(mesh: ts.Mesh) -> float:
    """Area or volume of the body of second order."""
    whole = SecondOrder(mesh)
    return float(whole.shares(whole.of(mesh.elements)).sum())


def test_loads_on_curved_elements_have_their_totals() -> None:
    mesh = replace(octant(4, 2), element_groups={})
    curved = with_round_edges(mesh)
    assert measure_of(curved) == pytest.approx(math.pi / 6 * (OUTER**3 - INNER**3), rel=2e-3)
    assert measure_of(mesh) == pytest.approx(float(mesh.measures.sum()), rel=1e-12)
    supports = [ts.Fixed(f"{axis}0", fix=[axis]) for axis in "xyz"]
    material = ts.Material(1e5, 0.3, density=10.0)

    def total(load: object) -> Floats:
        problem = ts.Problem(curved, material, None, supports, load)  # type: ignore[arg-type]
        return np.asarray(ts.Fem("linear").potential(problem).loading.external_force.sum(axis=0))  # type: ignore[attr-defined]

    assert total(ts.Gravity((1.0, 2.0, 3.0))) == pytest.approx(10 * measure_of(curved) * np.array([1, 2, 3]), rel=1e-12)
    assert total(ts.Force("inner", (1.0, 2.0, 3.0))) == pytest.approx([1, 2, 3], rel=1e-12)
    area = math.pi / 2 * INNER**2
    assert total(ts.Traction("inner", (0.0, 1.0, 0.0))) == pytest.approx([0, area, 0], rel=1e-3, abs=1e-12)
    # A pressure on an eighth of a sphere pushes on each plane of symmetry with p pi a^2 / 4, to the plane's own edge.
    potential = ts.Fem("linear").potential(pressed(curved, 0.3, 7.0))
    force = potential.loading.at_rest(potential.nodes).external_force.sum(axis=0)  # type: ignore[attr-defined]
    assert force == pytest.approx(7 * math.pi / 4 * INNER**2 * np.ones(3), rel=1e-3)


@pytest.mark.parametrize("section", [ts.PlaneStress(0.01), ts.PlaneStrain(0.01)])
def test_a_moment_bends_triangles_of_second_order_exactly(section: ts.PlaneStress | ts.PlaneStrain) -> None:
    """Rotation of the end M L / E I, and the linear stress across that a face of second order takes exactly."""
    mesh = ts.rectangle((0.16, 0.04), (6, 2), "triangle", "alternating")
    supports = [ts.Fixed("left", fix=["x"]), ts.Fixed("left-bottom")]
    problem = ts.Problem(mesh, ts.Material(1e4, 0.3), section, supports, ts.Moment("right", 1e-5))
    path = ts.solve(problem, ts.Fem("linear"), ts.Newton(load_steps=1))
    end = path.states[-1].displacement[[ts.named_point(mesh, name) for name in ("right-bottom", "right-top")]]
    young, _ = section.apparent_moduli(ts.Material(1e4, 0.3))
    wanted = 1e-5 * 0.16 / (young * 0.01 * 0.04**3 / 12)
    assert (end[0, 0] - end[1, 0]) / 0.04 == pytest.approx(wanted, rel=1e-9)


def test_a_rim_held_in_pieces_closes_a_pressed_surface() -> None:
    """As it does on elements of first order: the middles of its edges are held where both ends are."""
    mesh = ts.box((1.0, 1.0, 1.0), (2, 2, 2), "tetrahedron")
    x, y, z = mesh.nodes.T
    rim = (y == 1) & ((x == 0) | (x == 1) | (z == 0) | (z == 1))
    pieces = [ts.Fixed(np.flatnonzero(rim & there).tolist()) for there in (x < 0.3, x > 0.3)]
    problem = ts.Problem(mesh, ts.Material(1e3, 0.3), None, [*pieces, ts.Fixed("bottom")], ts.Pressure("top", 1.0))
    whole = replace(problem, supports=[ts.Fixed(np.flatnonzero(rim).tolist()), ts.Fixed("bottom")])
    held = [ts.Fem("linear").potential(one).loading.held for one in (problem, whole)]  # type: ignore[attr-defined]
    assert np.array_equal(*held)


def test_a_body_turned_by_its_curved_faces_is_not_strained() -> None:
    mesh = with_round_edges(quarter("triangle"))
    outer = np.flatnonzero(np.isclose(np.linalg.norm(mesh.nodes, axis=1), OUTER))
    turns = [ts.Fixed(on, rotation=1.0, about=(0.0, 0.0)) for on in ("inner", outer.tolist())]
    problem = ts.Problem(mesh, ts.Material(1e5, 0.3), ts.PlaneStrain(1.0), turns)
    path = ts.solve(problem, ts.Fem("neo-hookean"), ts.Newton(load_steps=2))
    assert path.status is ts.Status.CONVERGED
    assert path.states[-1].energy < 1e-12 * 1e5 * float(mesh.measures.sum())


# --- files -----------------------------------------------------------------------------------------------------------

#: Of each format, and the name of the cell with nodes between its corners.
FORMATS = [
    (suffix, how, kind)
    for kind in ("triangle", "tetrahedron")
    for suffix, how in (
        (".inp", {}),
        (".vtu", {}),
        (".vtk", {}),
        (".msh", {"file_format": "gmsh"}),
        (".msh", {"file_format": "gmsh22"}),
    )
]


@pytest.mark.parametrize(("suffix", "how", "kind"), FORMATS)
def test_files_keep_the_nodes_in_the_middle_of_edges(
    tmp_path: Path, suffix: str, how: dict[str, str], kind: str
) -> None:
    """As meshio writes them, in each format's own order: gmsh changes two of a tetrahedron's ten."""
    mesh = with_round_edges(octant(2, 1) if kind == "tetrahedron" else quarter(kind))
    written = as_written(mesh)
    written.write(tmp_path / f"body{suffix}", **how)
    found = read_mesh(tmp_path / f"body{suffix}", unit=2.0)
    assert found.middles is not None
    assert found.nodes == pytest.approx(2 * mesh.nodes, abs=1e-12)
    assert (found.elements == mesh.elements).all()
    assert found.middles == pytest.approx(2 * mesh.middles, abs=1e-12)
    (note,) = [note for note in found.notes if "second order" in note]
    assert f"finite elements use their {len(mesh.edges)} mid-edge nodes" in note


def as_written(mesh: ts.Mesh) -> meshio.Mesh:
    whole = SecondOrder(mesh)
    points = np.pad(whole.nodes, ((0, 0), (0, 3 - mesh.dim)))
    return meshio.Mesh(points, [(f"{mesh.kind.vtk}{6 if mesh.dim == 2 else 10}", whole.of(mesh.elements))])


def test_mirrored_elements_keep_them_too(tmp_path: Path) -> None:
    mesh = with_round_edges(octant(2, 1))
    written = as_written(mesh)
    written.points[:, 0] *= -1
    written.write(tmp_path / "body.vtu")
    found = read_mesh(tmp_path / "body.vtu")
    assert any("mirrored" in note for note in found.notes)
    assert measure_of(found) == pytest.approx(measure_of(mesh), rel=1e-12)


@pytest.mark.parametrize(("kind", "curved"), [(22, True), (69, True), (76, False)])
def test_control_points_are_no_middles(tmp_path: Path, kind: int, curved: bool) -> None:
    """Of Bezier cells the points between the corners lie beside the edges; of Lagrange's and quadratic ones on them."""
    points = "0 0 0  1 0 0  0 1 0  .5 -.1 0  .6 .6 0  -.1 .5 0"
    (tmp_path / "cell.vtk").write_text(
        f"# vtk DataFile Version 3.0\ncell\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 6 double\n{points}\n"
        f"CELLS 1 7\n6 0 1 2 3 4 5\nCELL_TYPES 1\n{kind}\n"
    )
    assert (read_mesh(tmp_path / "cell.vtk").middles is not None) == curved


def test_straight_edges_have_no_middles_of_their_own(tmp_path: Path) -> None:
    as_written(octant(2, 1)).write(tmp_path / "body.vtu")
    found = read_mesh(tmp_path / "body.vtu")
    assert found.middles is None and any("second order" in note for note in found.notes)


def test_folded_elements_get_straight_edges_and_are_counted(tmp_path: Path) -> None:
    mesh = with_round_edges(octant(2, 1))
    written = as_written(mesh)
    edge = mesh.n_nodes + 3
    first, last = mesh.edges[3]
    written.points[edge] = written.points[first] + 1.6 * (written.points[last] - written.points[first])
    written.write(tmp_path / "body.vtu")
    found = read_mesh(tmp_path / "body.vtu")
    assert found.middles is not None
    n_there = int((np.sort(mesh.elements[:, np.array(mesh.kind.edges)], axis=2) == mesh.edges[3]).all(axis=2).sum())
    assert any(note.startswith(f"{n_there} elements of second order are folded") for note in found.notes)
    assert found.middles[3] == pytest.approx(mesh.nodes[mesh.edges[3]].mean(axis=0))
    assert ts.Fem("linear").potential(pressed(replace(found, node_groups=mesh.node_groups), 0.3, 1.0)).energy(
        SecondOrder(found).nodes
    ) == pytest.approx(0.0, abs=1e-20)


def test_middles_that_do_not_fit_are_refused() -> None:
    mesh = with_round_edges(quarter("triangle"))
    assert mesh.middles is not None
    with pytest.raises(MeshError, match="middles has shape"):
        replace(mesh, middles=mesh.middles[1:])
    folded = mesh.middles.copy()
    folded[0] = mesh.nodes[mesh.edges[0, 0]] + 3 * (mesh.nodes[mesh.edges[0, 1]] - mesh.nodes[mesh.edges[0, 0]])
    with pytest.raises(MeshError, match="folded by their mid-edge nodes"):
        replace(mesh, middles=folded)
    squares = quarter("quadrilateral")
    with pytest.raises(MeshError, match="middles are supported for triangles and tetrahedra"):
        replace(squares, middles=squares.nodes[squares.edges].mean(axis=1))


@pytest.mark.parametrize("kind", ["triangle", "tetrahedron"])
def test_a_refined_mesh_is_the_same_curved_body(kind: str) -> None:
    """Parts of a polynomial of second order are polynomials of second order."""
    mesh = with_round_edges(octant(2, 1) if kind == "tetrahedron" else quarter(kind))
    finer = refined(mesh)
    assert finer.middles is not None
    assert measure_of(finer) == pytest.approx(measure_of(mesh), rel=1e-12)
    there = SecondOrder(mesh).nodes
    assert finer.nodes[: len(there)] == pytest.approx(there, abs=1e-15)


def test_where_parts_would_be_folded_edges_are_divided_as_straight() -> None:
    """A tetrahedron whose Jacobian is positive though the chord of a part goes over its middle."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    plain = ts.Mesh(corners, [[0, 1, 2, 3]], "tetrahedron")
    aside = np.random.default_rng(38).uniform(-0.3, 0.3, (6, 3))
    curved = replace(plain, middles=corners[plain.edges].mean(axis=1) + aside)
    straight = refined(curved)
    assert straight.middles is None and "divided along straight edges" in straight.notes[0]
    assert (straight.nodes == refined(plain).nodes).all()
    assert refined(replace(curved, middles=corners[plain.edges].mean(axis=1) + aside / 2)).middles is not None


def test_a_file_of_second_order_is_solved_by_its_own_elements(tmp_path: Path) -> None:
    """A cantilever of one tetrahedral layer: F L^3 / 3 E I within 2 %; springs of its corners are too stiff."""
    body = ts.box((8.0, 1.0, 1.0), (8, 1, 1), "tetrahedron")
    as_written(body).write(tmp_path / "beam.vtu")
    (tmp_path / "beam.toml").write_text("""
mesh = { file = "beam.vtu" }
material = { young = "210 GPa", poisson = 0.3 }
support = [{ on = "left" }]
load = [{ on = "right", force = ["0 N", "0 N", "-9 MN"] }]
solver = { load_steps = 1 }
models = { fem = { kind = "fem", law = "linear" }, springs = { kind = "springs", rule = "biquadratic" } }
""")
    result = run(read_study(tmp_path / "beam.toml"), comparing=False)
    tip = {name: float(-path.states[-1].displacement[:, 2].min()) for name, path in result.solutions.items()}
    beam = 9e6 * 8**3 / (3 * 210e9 / 12)
    assert tip["fem"] == pytest.approx(beam, rel=0.02)
    assert tip["springs"] < 0.6 * beam
