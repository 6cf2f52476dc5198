"""Terzopoulos' metric-tensor model: what it realises in closed form, its boundary, and the meshes it refuses."""

from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.studies import changed, written
from truespring.arrays import Floats
from truespring.errors import StudyError
from truespring.study import read_study, run
from truespring.study.plan import plan

YOUNG, POISSON, THICKNESS = 7.0, 0.3, 0.4
SECTIONS = (ts.PlaneStress(THICKNESS), ts.PlaneStrain(THICKNESS))


def body(mesh: ts.Mesh, poisson: float = POISSON, section: ts.PlaneStress | ts.PlaneStrain = SECTIONS[0]) -> ts.Problem:
    pull = [0.1, 0.0, 0.0][: mesh.dim]
    return ts.Problem(
        mesh,
        ts.Material(YOUNG, poisson),
        section if mesh.dim == 2 else None,
        [ts.Fixed("left")],
        [ts.Force("right", pull)],
    )


def strained(mesh: ts.Mesh, F: Floats) -> Floats:
    return np.asarray(mesh.nodes @ F.T)


F_PLANE = np.array([[1.3, 0.25], [-0.1, 0.8]])
F_SPACE = np.array([[1.3, 0.25, 0.1], [-0.1, 0.8, -0.2], [0.05, 0.15, 1.1]])


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("boundary", ["paper", "trapezoid"])
def test_an_affine_field_stores_what_the_weights_say(boundary: str, section: ts.PlaneStress | ts.PlaneStrain) -> None:
    """W / V = 4 (eta_11 E_11^2 + eta_22 E_22^2 + 2 eta_12 E_12^2), each with the factor of the boundary."""
    nx, ny = 5, 3
    problem = body(ts.rectangle((4.0, 1.2), (nx, ny)), section=section)
    E = (F_PLANE.T @ F_PLANE - np.eye(2)) / 2
    young = YOUNG if section is SECTIONS[0] else YOUNG / (1 - POISSON**2)
    mu = YOUNG / (2 * (1 + POISSON))
    across = ((ny + 1) / ny, (nx + 1) / nx) if boundary == "paper" else (1.0, 1.0)
    density = young / 2 * (across[0] * E[0, 0] ** 2 + across[1] * E[1, 1] ** 2) + 2 * mu * E[0, 1] ** 2
    energy = ts.Terzopoulos(boundary).potential(problem).energy(strained(problem.mesh, F_PLANE))
    assert energy == pytest.approx(density * 4.0 * 1.2 * THICKNESS, rel=1e-13)
    assert np.diag(ts.Terzopoulos(boundary).elasticity(problem)) == pytest.approx(
        [across[0] * young, across[1] * young, mu], rel=1e-13
    )


@pytest.mark.parametrize("boundary", ["paper", "trapezoid"])
def test_an_affine_field_in_space(boundary: str) -> None:
    """Stretching along x is across y and z at the outside, shear in the plane of x and y across z alone."""
    counts = np.array([4, 3, 2])
    problem = body(ts.box((4.0, 3.3, 1.8), counts.tolist()))
    E = (F_SPACE.T @ F_SPACE - np.eye(3)) / 2
    mu = YOUNG / (2 * (1 + POISSON))
    outside = (counts + 1) / counts if boundary == "paper" else np.ones(3)
    density = 0.0
    for i in range(3):
        for j in range(3):
            factor = np.prod([outside[k] for k in range(3) if k not in (i, j)])
            density += (YOUNG / 2 if i == j else mu) * factor * E[i, j] ** 2
    energy = ts.Terzopoulos(boundary).potential(problem).energy(strained(problem.mesh, F_SPACE))
    assert energy == pytest.approx(density * 4.0 * 3.3 * 1.8, rel=1e-13)


@pytest.mark.parametrize(("counts", "factor"), [((8, 8), 1.125), ((4, 4, 4), 1.5625)])
def test_the_boundary_of_the_paper_has_its_factor(counts: tuple[int, ...], factor: float) -> None:
    mesh = ts.rectangle((1.0, 1.0), counts) if len(counts) == 2 else ts.box((1.0, 1.0, 1.0), counts)
    problem = body(mesh)
    assert ts.Terzopoulos().elasticity(problem)[0, 0] / YOUNG == pytest.approx(factor, rel=1e-13)
    told = [text for text in ts.Terzopoulos().warnings(problem) if "boundary" in text]
    assert len(told) == 1 and f"{factor:.4g} along x, {factor:.4g} along y" in told[0]
    assert not [text for text in ts.Terzopoulos("trapezoid").warnings(problem) if "boundary" in text]


@pytest.mark.parametrize("mesh", [ts.rectangle((3.6, 2.0), (3, 2)), ts.box((2.0, 1.1, 0.9), (2, 2, 1))])
def test_without_lateral_contraction_it_is_saint_venant_kirchhoff(mesh: ts.Mesh) -> None:
    """Of affine fields; at any other Poisson's ratio it is not."""
    F = F_PLANE if mesh.dim == 2 else F_SPACE
    for poisson, same in ((0.0, True), (0.3, False)):
        problem = body(mesh, poisson)
        energies = [
            model.potential(problem).energy(strained(mesh, F))
            for model in (ts.Terzopoulos("trapezoid"), ts.Fem("saint-venant-kirchhoff"))
        ]
        assert (abs(energies[0] / energies[1] - 1) < 1e-12) == same
    assert not ts.Terzopoulos("trapezoid").warnings(body(mesh, 0.0))


def test_it_says_what_it_cannot_realise() -> None:
    (told,) = ts.Terzopoulos("trapezoid").warnings(body(ts.rectangle((2.0, 1.0), (2, 1)), 1 / 3))
    assert "Poisson's ratio is 0" in told and "0.3333" in told
    # (C11 - 2 C66) / (C11 + 2 C66) of C11 = E, C66 = 3/8 E, and E at 45 degrees 4 / (2 / E + 8 / (3 E))
    assert f"{6 * YOUNG / 7:.6g} Pa" in told and f"{1 / 7:.4g}" in told
    (told,) = ts.Terzopoulos("trapezoid").warnings(body(ts.rectangle((2.0, 1.0), (2, 1)), 0.3, SECTIONS[1]))
    assert f"{0.3 / 0.7:.4g} in plane strain" in told


@pytest.mark.parametrize(
    ("boundary", "load", "expected"),
    [
        ("paper", (0.0, 1e-4), -0.494),
        ("trapezoid", (0.0, 1e-4), -0.182),
        ("paper", (0.0, 0.0107), -0.382),
        ("trapezoid", (0.0, 0.0107), -0.124),
    ],
)
def test_the_cantilever_of_an_independent_implementation(
    boundary: str, load: tuple[float, float], expected: float
) -> None:
    """4 by 1, 16 by 4 cells, E = t = 1, pulled up: the end against converged FEM, 0.00668281 and 0.5314 lengths."""
    problem = ts.Problem(
        ts.rectangle((4.0, 1.0), (16, 4)),
        ts.Material(1.0, 1 / 3),
        ts.PlaneStress(1.0),
        [ts.Fixed("left")],
        [ts.Force("right", load)],
    )
    path = ts.solve(problem, ts.Terzopoulos(boundary), ts.Newton(load_steps=2))
    assert path.status == "converged"
    weight = problem.loading.external_force[:, 1] / load[1]
    end = float(weight @ path.states[-1].displacement[:, 1]) / 4
    converged = 0.00668281 if load[1] == 1e-4 else 0.5314
    assert end / converged - 1 == pytest.approx(expected, abs=0.001)


def test_the_order_of_an_element_s_nodes_does_not_matter() -> None:
    mesh = ts.box((2.0, 1.1, 0.9), (2, 1, 1))
    turned = [3, 2, 6, 7, 0, 1, 5, 4]  # about the x axis
    elements = np.stack([mesh.elements[0], mesh.elements[1][turned]])
    other = ts.Mesh(mesh.nodes, elements, mesh.element)
    positions = strained(mesh, F_SPACE) + np.random.default_rng(5).uniform(-0.1, 0.1, mesh.nodes.shape)
    energies = [ts.Terzopoulos().potential(body(one)).energy(positions) for one in (mesh, other)]
    assert energies[0] == pytest.approx(energies[1], rel=1e-13)


def bent_grid() -> ts.Mesh:
    mesh = ts.rectangle((3.0, 2.0), (3, 2))
    nodes = mesh.nodes.copy()
    nodes[5] += 0.1
    return ts.Mesh(nodes, mesh.elements, mesh.element)


@pytest.mark.parametrize(
    ("mesh", "said"),
    [
        (ts.rectangle((3.0, 2.0), (3, 2), "triangle"), "regular grid.*triangle elements"),
        (ts.box((1.0, 1.0, 1.0), (1, 1, 1), "tetrahedron"), "regular grid.*tetrahedron elements"),
        (bent_grid(), "4 of 6 elements .*rectangle.* 1 x 1 m"),
    ],
)
def test_meshes_that_are_no_grid_are_refused(mesh: ts.Mesh, said: str) -> None:
    with pytest.raises(ts.TruespringError, match=said):
        ts.Terzopoulos().potential(body(mesh))


def test_an_unknown_boundary_is_refused() -> None:
    with pytest.raises(ts.TruespringError, match=r"'trapezium' is unknown \(did you mean 'trapezoid'"):
        ts.Terzopoulos("trapezium")


STUDY = changed(('kind = "springs"\nrule = "lloyd"', 'kind = "terzopoulos"\nboundary = "trapezoid"'))


def test_a_study_takes_it(tmp_path: Path) -> None:
    study = read_study(written(tmp_path, STUDY))
    assert study.entries["springs"] == ts.Terzopoulos("trapezoid")
    told = plan(study)["models"]["springs"]
    assert told["kind"] == "terzopoulos" and told["label"] == "Terzopoulos (trapezoid boundary)"
    assert "Poisson's ratio is 0" in told["warnings"][0]
    result = run(study)
    assert result.converged
    assert result.solutions["springs"].kind == "terzopoulos"
    assert 0 < result.comparisons["linear"].rms_error < 0.5


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('"trapezoid"', '"midpoint"'), "boundary = 'midpoint': allowed: 'paper' or 'trapezoid'"),
        (('boundary = "trapezoid"', 'rule = "lloyd"'), "unknown key; allowed: kind, boundary"),
        (("elements = [8, 2]", 'elements = [8, 2]\nelement = "triangle"'), "regular grid.*triangle elements"),
    ],
)
def test_a_faulty_study_is_refused(change: tuple[str, str], said: str, tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=said):
        read_study(written(tmp_path, STUDY.replace(*change)))
