"""The same bodies solved by CalculiX, a finite element program of its own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.calculix import continuum_deck, displacement, needs_ccx, spring_deck
from truespring.arrays import Floats

pytestmark = needs_ccx

LENGTH, HEIGHT = 0.16, 0.04
THIN, LONG = ts.PlaneStress(HEIGHT / 4), ts.PlaneStrain(HEIGHT / 4)
# Load over thickness [N/m]: the nonlinear bodies move by about half their length, or a sixth of it.
LOADS = {"bending": (0.0, -4.3), "stretching": (80.0, 0.0)}
LAWS = {"linear": None, "saint-venant-kirchhoff": 5}  # with the load increments of CalculiX

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


def gap(one: Floats, other: Floats) -> float:
    """The largest distance of two displacements over the largest displacement."""
    return float(np.linalg.norm(one - other, axis=1).max() / np.linalg.norm(other, axis=1).max())


def tip_gap(problem: ts.Problem, one: Floats, other: Floats) -> float:
    tip = ts.named_point(problem.mesh, "right-middle")
    return float(np.linalg.norm(one[tip] - other[tip]) / np.linalg.norm(other[tip]))


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
    assert gap(displacement(continuum_deck(problem, LAWS[law]), tmp_path), solved(problem, ts.Fem(law))) < PRINTED


@laws
def test_plane_strain_with_elements_that_are_no_rectangles(law: str, tmp_path: Path) -> None:
    problem = with_moved_nodes(cantilever("bending", section=LONG))
    assert gap(displacement(continuum_deck(problem, LAWS[law]), tmp_path), solved(problem, ts.Fem(law))) < PRINTED


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
    assert gap(displacement(continuum_deck(twin, LAWS[law]), tmp_path), ours) < PRINTED
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
    theirs = displacement(continuum_deck(problem, LAWS[law]), tmp_path)
    assert tip_gap(problem, theirs, solved(problem, ts.Fem(law))) < tolerance


@laws
def test_plane_stress_closes_with_thickness_and_element_size(law: str, tmp_path: Path) -> None:
    gaps = []
    for rows in (2, 4, 8):
        problem = cantilever("bending", (4 * rows, rows), ts.PlaneStress(HEIGHT / (2 * rows)))
        theirs = displacement(continuum_deck(problem, LAWS[law]), tmp_path)
        gaps.append(tip_gap(problem, theirs, solved(problem, ts.Fem(law))))
    orders = np.log2(np.divide(gaps[:-1], gaps[1:]))
    assert (orders > 1.6).all(), (gaps, orders)


@loads
@laws
def test_plane_stress_without_poisson_ratio(load: str, law: str, tmp_path: Path) -> None:
    """Thickness does not change: the layer of bricks is the plane element exactly."""
    problem = cantilever(load, poisson=0.0)
    assert gap(displacement(continuum_deck(problem, LAWS[law]), tmp_path), solved(problem, ts.Fem(law))) < PRINTED


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
    assert gap(displacement(spring_deck(problem, model.potential(problem), 10), tmp_path), ours) < PRINTED


# --- the checks themselves can fail -------------------------------------------------------------


def test_one_spring_a_thousandth_stiffer_is_noticed(tmp_path: Path) -> None:
    problem, model = cantilever("bending", (8, 2)), ts.Springs("lloyd")
    network = model.potential(problem)
    stiffness = network.stiffness.copy()
    stiffness[0] *= 1.001
    stiffer = ts.SpringNetwork(network.nodes, network.springs, stiffness)
    assert gap(displacement(spring_deck(problem, stiffer, 5), tmp_path), solved(problem, model)) > 10 * PRINTED


def test_a_wrong_deck_is_noticed(tmp_path: Path) -> None:
    problem = cantilever("bending")
    deck = continuum_deck(problem, None).replace("MATERIAL=M", "MATERIAL=OTHER")
    with pytest.raises(AssertionError, match="ERROR"):
        displacement(deck, tmp_path)
