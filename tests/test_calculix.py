"""The same bodies solved by CalculiX, a finite element program of its own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.calculix import displacement, needs_ccx
from tests.meshes import plane_of_two, solid_of_four
from truespring.arrays import Floats
from truespring.exports.calculix import LAWS, fem_deck, spring_deck
from truespring.study import read_study

pytestmark = needs_ccx

LENGTH, HEIGHT = 0.16, 0.04
THIN, LONG = ts.PlaneStress(HEIGHT / 4), ts.PlaneStrain(HEIGHT / 4)
# Load over thickness [N/m]: the nonlinear bodies move by about half their length, or a sixth of it.
LOADS = {"bending": (0.0, -4.3), "stretching": (80.0, 0.0)}
LEVELS, TEN_LEVELS = np.linspace(0.2, 1, 5).tolist(), np.linspace(0.1, 1, 10).tolist()

# CalculiX prints seven digits: half a unit of the last one is at most 5e-7 of a component.
PRINTED = 1e-6

loads = pytest.mark.parametrize("load", LOADS)
laws = pytest.mark.parametrize("law", LAWS)


def cantilever(
    load: str,
    elements: tuple[int, int] = (16, 4),
    section: ts.PlaneStress | ts.PlaneStrain = THIN,
    poisson: float = 1 / 3,
) -> ts.Problem:
    return ts.Problem(
        mesh=ts.rectangle(size=(LENGTH, HEIGHT), elements=elements),
        material=ts.Material(young=10e3, poisson=poisson),
        section=section,
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=[force * section.thickness for force in LOADS[load]])],
    )


def solved(problem: ts.Problem, model: ts.Fem | ts.Springs) -> Floats:
    path = ts.solve(problem, model, ts.Newton(load_steps=4))
    assert path.status is ts.Status.CONVERGED and not path.states[-1].branched
    return path.states[-1].displacement


def gap(theirs: Floats, ours: Floats) -> float:
    """The largest distance of two displacements over the largest displacement, in the directions that ours has."""
    apart = theirs[:, : ours.shape[1]] - ours
    return float(np.linalg.norm(apart, axis=1).max() / np.linalg.norm(ours, axis=1).max())


def tip_gap(problem: ts.Problem, theirs: Floats, ours: Floats) -> float:
    tip = ts.named_point(problem.mesh, "right-middle")
    return float(np.linalg.norm(theirs[tip, : ours.shape[1]] - ours[tip]) / np.linalg.norm(ours[tip]))


def rms_gap(theirs: Floats, ours: Floats) -> float:
    """Root mean square of the distance over that of the displacement."""
    return float(np.linalg.norm(theirs - ours) / np.linalg.norm(ours))


def with_moved_nodes(problem: ts.Problem) -> ts.Problem:
    """Move inner nodes by up to a quarter of an element: no element remains a rectangle."""
    mesh = problem.mesh
    inner = ((mesh.nodes > mesh.lower) & (mesh.nodes < mesh.upper)).all(axis=1)
    moved = mesh.nodes.copy()
    moved[inner] += np.random.default_rng(4).uniform(-0.25, 0.25, (inner.sum(), 2)) * 0.01
    return replace(problem, mesh=ts.Mesh(moved, mesh.elements))


# --- four-node quadrilaterals ------------------------------------------------------------------


@loads
@laws
@pytest.mark.parametrize("elements, poisson", [((16, 4), 1 / 3), ((12, 5), 0.45), ((8, 2), 0.0)])
def test_plane_strain(load: str, law: str, elements: tuple[int, int], poisson: float, tmp_path: Path) -> None:
    problem = cantilever(load, elements, LONG, poisson)
    assert gap(displacement(fem_deck(problem, LEVELS, law), tmp_path), solved(problem, ts.Fem(law, "linear"))) < PRINTED


@laws
def test_plane_strain_with_elements_that_are_no_rectangles(law: str, tmp_path: Path) -> None:
    problem = with_moved_nodes(cantilever("bending", section=LONG))
    assert gap(displacement(fem_deck(problem, LEVELS, law), tmp_path), solved(problem, ts.Fem(law))) < PRINTED


@loads
@laws
@pytest.mark.parametrize("elements", [(16, 4), (24, 6)])
def test_plane_stress_as_plane_strain_of_another_material(
    load: str, law: str, elements: tuple[int, int], tmp_path: Path
) -> None:
    """A quadratic law in plane stress is the one in plane strain with E (1 + 2 nu) / (1 + nu)^2 and nu / (1 + nu).

    Timoshenko and Goodier, Theory of Elasticity, the exchange of constants between the plane problems.
    """
    problem = cantilever(load, elements)
    assert problem.material is not None
    young, poisson = problem.material.young, problem.material.poisson
    exchanged = ts.Material(young * (1 + 2 * poisson) / (1 + poisson) ** 2, poisson / (1 + poisson))
    twin = replace(problem, material=exchanged, section=LONG)
    ours = solved(problem, ts.Fem(law))
    assert gap(displacement(fem_deck(twin, LEVELS, law), tmp_path), ours) < PRINTED
    if law != "linear":
        assert np.linalg.norm(ours, axis=1).max() > {"bending": 0.5, "stretching": 0.15}[load] * LENGTH


# CalculiX makes plane stress of one layer of bricks whose faces are free: the stress across vanishes in the mean
# only, and the change of thickness from node to node costs shear. Both fade with thickness and element size.
@laws
@pytest.mark.parametrize("elements", [(16, 4), (24, 6)])
@pytest.mark.parametrize(
    "load, slenderness, tolerance",
    [("bending", 4, 6e-3), ("bending", 20, 2.5e-3), ("stretching", 4, 1e-4), ("stretching", 20, 5e-5)],
)
def test_plane_stress(
    load: str, slenderness: float, tolerance: float, law: str, elements: tuple[int, int], tmp_path: Path
) -> None:
    problem = cantilever(load, elements, ts.PlaneStress(HEIGHT / slenderness))
    theirs = displacement(fem_deck(problem, LEVELS, law), tmp_path)
    assert tip_gap(problem, theirs, solved(problem, ts.Fem(law))) < tolerance


@laws
def test_plane_stress_closes_with_thickness_and_element_size(law: str, tmp_path: Path) -> None:
    gaps = []
    for rows in (2, 4, 8):
        problem = cantilever("bending", (4 * rows, rows), ts.PlaneStress(HEIGHT / (2 * rows)))
        theirs = displacement(fem_deck(problem, LEVELS, law), tmp_path)
        gaps.append(tip_gap(problem, theirs, solved(problem, ts.Fem(law))))
    orders = np.log2(np.divide(gaps[:-1], gaps[1:]))
    assert (orders > 1.6).all(), (gaps, orders)


@loads
@laws
def test_plane_stress_without_poisson_ratio(load: str, law: str, tmp_path: Path) -> None:
    """Thickness does not change: the layer of bricks is the plane element exactly."""
    problem = cantilever(load, poisson=0.0)
    assert gap(displacement(fem_deck(problem, LEVELS, law), tmp_path), solved(problem, ts.Fem(law))) < PRINTED


# --- bodies in space ---------------------------------------------------------------------------

SHAPES = ("hexahedron", "tetrahedron", "bcc-tetrahedron")
BOX = (0.08, 0.02, 0.02)


def prism(load: str, element: str, counts: tuple[int, int, int] = (8, 2, 2), poisson: float = 0.3) -> ts.Problem:
    """A box held at its left end; its right end pulled aside, pulled, turned by 0.6 rad, or turned by forces."""
    mesh = ts.box(BOX, counts, element)
    supports, loads = [ts.Fixed("left")], []
    right = np.flatnonzero(mesh.nodes[:, 0] == mesh.upper[0])
    arms = mesh.nodes[right, 1:] - mesh.upper[1:] / 2
    match load:
        case "bending":
            loads = [ts.Force("right", (0.0, -0.05, 0.02))]
        case "tension":
            loads = [ts.Force("right", (0.8, 0.0, 0.0))]
        case "torsion":
            c, s = np.cos(0.6), np.sin(0.6)
            turned = arms @ np.array([[c, s], [-s, c]]) - arms
            supports += [
                ts.Fixed([node], displacement=[0.0, *motion]) for node, motion in zip(right, turned, strict=True)
            ]
        case "torsion by forces":
            force = 1.5 * np.stack([-arms[:, 1], arms[:, 0]], axis=1)
            loads = [ts.Force([node], [0.0, *one]) for node, one in zip(right, force, strict=True) if one.any()]
    return ts.Problem(mesh, ts.Material(10e3, poisson), None, supports, loads)


TURNS = ("bending", "tension", "torsion", "torsion by forces")


@laws
@pytest.mark.parametrize("load", TURNS)
@pytest.mark.parametrize("element", SHAPES)
def test_bodies_in_space(element: str, load: str, law: str, tmp_path: Path) -> None:
    """C3D8, which CalculiX integrates fully (eight points, no incompatible modes), and C3D4."""
    problem = prism(load, element)
    ours = solved(problem, ts.Fem(law, "linear"))
    assert np.linalg.norm(ours, axis=1).max() > 0.09 * BOX[0]
    theirs = displacement(fem_deck(problem, LEVELS, law), tmp_path)
    assert rms_gap(theirs, ours) < PRINTED
    assert gap(theirs, ours) < 2 * PRINTED


@laws
@pytest.mark.parametrize("poisson", [0.0, 0.49])
def test_bodies_that_lock_do_so_alike(poisson: float, law: str, tmp_path: Path) -> None:
    problem = prism("bending", "hexahedron", poisson=poisson)
    theirs = displacement(fem_deck(problem, LEVELS, law), tmp_path)
    assert rms_gap(theirs, solved(problem, ts.Fem(law, "linear"))) < PRINTED
    if poisson > 0.4:
        assert rms_gap(theirs, solved(problem, ts.Fem(law, "mean-dilatation"))) > 0.1


@laws
@pytest.mark.parametrize("element", ["hexahedron", "tetrahedron"])
def test_distorted_bodies_in_space(element: str, law: str, tmp_path: Path) -> None:
    plain = prism("bending", element, (6, 3, 3))
    mesh = plain.mesh
    inner = ((mesh.nodes > 0) & (mesh.nodes < mesh.upper)).all(axis=1)
    moved = mesh.nodes.copy()
    moved[inner] += np.random.default_rng(4).uniform(-0.25, 0.25, (inner.sum(), 3)) * 0.02 / 3
    problem = replace(plain, mesh=ts.Mesh(moved, mesh.elements, mesh.element))
    theirs = displacement(fem_deck(problem, LEVELS, law), tmp_path)
    assert rms_gap(theirs, solved(problem, ts.Fem(law, "linear"))) < PRINTED


@laws
def test_pyramids_are_bricks_with_corners_that_are_one(law: str, tmp_path: Path) -> None:
    """C3D8 with four corners at the tip, distorted: the same element to the digits that are printed."""
    plain = prism("bending", "pyramid", (4, 2, 2))
    mesh = plain.mesh
    inner = ((mesh.nodes > 0) & (mesh.nodes < mesh.upper)).all(axis=1)
    moved = mesh.nodes.copy()
    moved[inner] += np.random.default_rng(4).uniform(-0.15, 0.15, (inner.sum(), 3)) * 0.01
    problem = replace(plain, mesh=ts.Mesh(moved, mesh.elements, mesh.element))
    ours = solved(problem, ts.Fem(law, "linear"))
    assert np.linalg.norm(ours, axis=1).max() > 0.4 * BOX[0]
    theirs = displacement(fem_deck(problem, LEVELS, law), tmp_path)
    assert rms_gap(theirs, ours) < PRINTED


@laws
@pytest.mark.parametrize("element", ["wedge", "four kinds"])
def test_wedges_and_several_kinds(element: str, law: str, tmp_path: Path) -> None:
    """As bricks with corners that are one wedges are integrated at other points: alike but for large strain."""
    mesh = solid_of_four(0.02) if element == "four kinds" else ts.box(BOX, (8, 2, 2), element)
    problem = ts.Problem(mesh, ts.Material(10e3, 0.3), None, [ts.Fixed("left")], [ts.Force("right", (0.8, 0.0, 0.0))])
    theirs = displacement(fem_deck(problem, LEVELS, law), tmp_path)
    assert rms_gap(theirs, solved(problem, ts.Fem(law, "linear"))) < (PRINTED if law == "linear" else 1e-5)


@laws
@pytest.mark.parametrize("element", ["wedge", "pyramid", "four kinds"])
def test_pressure_on_triangles_and_quadrilaterals(element: str, law: str, tmp_path: Path) -> None:
    mesh = solid_of_four(0.02) if element == "four kinds" else ts.box(BOX, (4, 1, 1), element)
    planes = [(axis, float(value)) for axis in "xz" for value in (0.0, mesh.upper["xyz".index(axis)])]
    supports = [ts.Fixed("left"), *(ts.Fixed(ts.Plane(axis, value), fix=[axis]) for axis, value in planes)]
    problem = ts.Problem(mesh, ts.Material(10e3, 0.3), None, supports, [ts.Pressure("top", 300.0)])
    theirs = displacement(fem_deck(problem, LEVELS, law), tmp_path)
    assert rms_gap(theirs, solved(problem, ts.Fem(law, "linear"))) < (PRINTED if law == "linear" else 1e-5)


@laws
@loads
def test_triangles_beside_quadrilaterals(load: str, law: str, tmp_path: Path) -> None:
    problem = replace(cantilever(load, section=LONG, poisson=0.3), mesh=plane_of_two((LENGTH, HEIGHT), (15, 4)))
    theirs = displacement(fem_deck(problem, LEVELS, law), tmp_path)
    assert rms_gap(theirs[:, :2], solved(problem, ts.Fem(law, "linear"))) < PRINTED


@laws
@pytest.mark.parametrize("load", ["bending", "tension", "torsion"])
def test_quadratic_tetrahedra(load: str, law: str, tmp_path: Path) -> None:
    """C3D10: at every node, those in the middle of the edges too."""
    problem = prism(load, "tetrahedron", (4, 1, 1))
    path = ts.solve(problem, ts.Fem(law, "quadratic"), ts.Newton(load_steps=4))
    assert path.status is ts.Status.CONVERGED and path.potential is not None
    ours = path.states[-1].all_positions - path.potential.nodes
    theirs = displacement(fem_deck(problem, LEVELS, law, "quadratic"), tmp_path)
    assert len(ours) > 3 * problem.mesh.n_nodes
    assert rms_gap(theirs, ours) < PRINTED


@laws
@pytest.mark.parametrize("curved", [False, True])
def test_pressure_on_quadratic_tetrahedra(curved: bool, law: str, tmp_path: Path) -> None:
    """CalculiX's own pressure on faces of six nodes, straight and curved, which follows them under NLGEOM.

    It takes three points a face, which are exact on flat ones alone; ours are exact on all.
    """
    mesh = ts.box(BOX, (4, 1, 1), "tetrahedron")
    if curved:
        middles = mesh.nodes[mesh.edges].mean(axis=1)
        x, y = middles[:, 0] / BOX[0], middles[:, 1] / BOX[1]
        mesh = replace(mesh, middles=middles + np.outer(x * (1 - x) * y, (0.0, 0.3 * BOX[1], 0.0)))
    held = [ts.Fixed("left"), ts.Fixed("right"), ts.Fixed("back", fix=["z"]), ts.Fixed("front", fix=["z"])]
    problem = ts.Problem(mesh, ts.Material(10e3, 0.3), None, held, ts.Pressure("top", 600.0))
    path = ts.solve(problem, ts.Fem(law, "quadratic"), ts.Newton(load_steps=4))
    assert path.status is ts.Status.CONVERGED and path.potential is not None
    ours = path.states[-1].all_positions - path.potential.nodes
    assert np.linalg.norm(ours, axis=1).max() > 0.03 * BOX[0]
    flat = law == "linear" and not curved
    theirs = displacement(fem_deck(problem, LEVELS, law, "quadratic"), tmp_path)
    assert rms_gap(theirs, ours) < (PRINTED if flat else 3e-4)


# --- springs -----------------------------------------------------------------------------------


def pulled(problem: ts.Problem) -> ts.Problem:
    """The right side moved by a prescribed displacement, up to half the length, instead of a force."""
    motion = ts.Fixed(on="right", displacement=(0.4 * LENGTH, 0.3 * LENGTH))
    return replace(problem, loads=(), supports=(*problem.supports, motion))


SPRINGS = {
    "lloyd": (ts.Springs("lloyd"), (16, 4)),
    "isotropic": (ts.Springs("isotropic"), (16, 4)),
    "isotropic, rectangles": (ts.Springs("isotropic"), (18, 6)),
    "lloyd, single": (ts.Springs("lloyd", sharing="single"), (24, 6)),
}


@pytest.mark.parametrize("load", [*LOADS, "pulled"])
@pytest.mark.parametrize("name", SPRINGS)
def test_springs(name: str, load: str, tmp_path: Path) -> None:
    model, elements = SPRINGS[name]
    problem = pulled(cantilever("bending", elements)) if load == "pulled" else cantilever(load, elements)
    ours = solved(problem, model)
    assert np.linalg.norm(ours, axis=1).max() > (0.15 if load == "stretching" else 0.45) * LENGTH
    assert gap(displacement(spring_deck(problem, model.potential(problem), TEN_LEVELS), tmp_path), ours) < PRINTED


SPRINGS_IN_SPACE = {
    "isotropic cubes": (ts.Springs("isotropic"), "hexahedron"),
    "projected cubes": (ts.Springs("projected"), "hexahedron"),
    "lloyd, body-centred": (ts.Springs("lloyd"), "bcc-tetrahedron"),
    "van-gelder, body-centred": (ts.Springs("van-gelder"), "bcc-tetrahedron"),
}


@pytest.mark.parametrize("load", ["bending", "tension", "torsion"])
@pytest.mark.parametrize("name", SPRINGS_IN_SPACE)
def test_springs_in_space(name: str, load: str, tmp_path: Path) -> None:
    model, element = SPRINGS_IN_SPACE[name]
    problem = prism(load, element, poisson=0.25)
    network = model.potential(problem)
    assert isinstance(network, ts.SpringNetwork)
    ours = solved(problem, model)
    assert np.linalg.norm(ours, axis=1).max() > 0.09 * BOX[0]
    theirs = displacement(spring_deck(problem, network, TEN_LEVELS), tmp_path)
    assert rms_gap(theirs, ours) < PRINTED


# --- the checks themselves can fail -------------------------------------------------------------


def test_one_spring_a_thousandth_stiffer_is_noticed(tmp_path: Path) -> None:
    problem, model = cantilever("bending", (8, 2)), ts.Springs("lloyd")
    network = model.potential(problem)
    stiffness = network.stiffness.copy()
    stiffness[0] *= 1.001
    stiffer = ts.SpringNetwork(network.nodes, network.springs, stiffness)
    assert gap(displacement(spring_deck(problem, stiffer, LEVELS), tmp_path), solved(problem, model)) > 10 * PRINTED


def test_a_wrong_deck_is_noticed(tmp_path: Path) -> None:
    problem = cantilever("bending")
    deck = fem_deck(problem, [1.0], "linear").replace("MATERIAL=M1", "MATERIAL=OTHER")
    with pytest.raises(AssertionError, match="ERROR"):
        displacement(deck, tmp_path)


# --- loads other than forces -----------------------------------------------------------------------------------------


def slab(loads: object, **more: object) -> ts.Problem:
    """A slab of 8 by 2 by 4 cubes' worth, clamped on the left unless said otherwise."""
    values = {"supports": ts.Fixed("left"), **more}
    return ts.Problem(
        ts.box((0.16, 0.03, 0.08), (8, 2, 4)), ts.Material(10e3, 0.3, density=1000.0), None, loads=loads, **values
    )  # type: ignore[arg-type]


ALL_AROUND = [ts.Fixed("left"), ts.Fixed("right"), ts.Fixed("back"), ts.Fixed("front")]
LOADED = {
    "gravity": lambda: slab(ts.Gravity((0.3, -0.4, 0.1))),
    "traction": lambda: slab(ts.Traction("top", (0.0, -4.0, 2.0))),
    "pressure": lambda: slab(ts.Pressure("top", 1200.0), supports=ALL_AROUND),
    "pressure from below": lambda: slab(ts.Pressure("bottom", 1200.0), supports=ALL_AROUND),
    "pressure on an open side": lambda: slab(ts.Pressure("top", 30.0)),
    "pressure on a free end": lambda: slab((ts.Pressure("right", -150.0), ts.Force("right", (0.0, -0.04, 0.0)))),
    "twist": lambda: slab((), supports=[ts.Fixed("left"), ts.Fixed("right", rotation=1.0, axis=(1.0, 0.0, 0.0))]),
    "pressure in the plane": lambda: ts.Problem(
        ts.rectangle((0.16, 0.04), (16, 4)),
        ts.Material(10e3, 0.3, density=1000.0),
        ts.PlaneStrain(0.01),
        [ts.Fixed("left"), ts.Fixed("right")],
        [ts.Pressure("top", 900.0), ts.Gravity((0.2, -0.5))],
    ),
    "pressure on an open side in the plane": lambda: ts.Problem(
        ts.rectangle((0.16, 0.04), (16, 4)),
        ts.Material(10e3, 0.3),
        ts.PlaneStrain(0.01),
        ts.Fixed("left"),
        ts.Pressure("top", 60.0),
    ),
}


@laws
@pytest.mark.parametrize("name", LOADED)
def test_loads_have_their_twins(name: str, law: str, tmp_path: Path) -> None:
    """The body moves by a share of its size that rotations of the surface matter for."""
    problem = LOADED[name]()
    ours = solved(problem, ts.Fem(law))
    theirs = displacement(fem_deck(problem, LEVELS, law), tmp_path)
    assert np.linalg.norm(ours, axis=1).max() > 0.05 * problem.mesh.diameter
    assert gap(theirs, ours) < 1e-3


@pytest.mark.verification
@pytest.mark.parametrize(("law", "share"), [("linear", 1.0), ("saint-venant-kirchhoff", 0.3)])
def test_the_organ_has_its_twin(law: str, share: float, tmp_path: Path) -> None:
    """Ten thousand voxels under gravity, one end pulled; St. Venant-Kirchhoff's law by less, as it collapses."""
    whole = read_study(Path(__file__).parent.parent / "examples" / "organ.toml").problem
    held, grasped = whole.supports
    motion = tuple(share * part for part in grasped.displacement or ())
    problem = replace(
        whole,
        material=ts.Material(3e3, 0.3, density=1060.0),
        supports=(held, replace(grasped, displacement=motion)),
        loads=(ts.Gravity((0.0, -9.81 * share, 0.0)),),
    )
    ours = solved(problem, ts.Fem(law, "linear"))
    theirs = displacement(fem_deck(problem, LEVELS, law), tmp_path)
    assert gap(theirs, ours) < 1e-3
