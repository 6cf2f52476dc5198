"""Stress, stretch and energy density at nodes, against the closed form of a bar that is pulled."""

import base64
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from truespring.models import Model
from truespring.report.nodal import node_fields
from truespring.report.result import Result
from truespring.report.viewer import viewer

SIZE = (0.08, 0.02, 0.02)


def pulled(model: Model, poisson: float = 0.25, element: str = "hexahedron") -> ts.Solution:
    """A bar without friction at its supports: every element has the same strain."""
    problem = ts.Problem(
        ts.box(SIZE, (4, 1, 1), element),
        ts.Material(1e4, poisson),
        None,
        [ts.Fixed("left", ("x",)), ts.Fixed("back", ("z",)), ts.Fixed("bottom", ("y",))],
        [ts.Force("right", (1.0, 0.0, 0.0))],
    )
    return ts.solve(problem, model, ts.Newton(load_steps=2))


@pytest.mark.parametrize(
    ("model", "element"),
    [
        (ts.Springs("isotropic"), "hexahedron"),
        (ts.Springs("biquadratic"), "hexahedron"),
        (ts.Springs("gaussian"), "hexahedron"),
        (ts.Springs("gaussian"), "tetrahedron"),
        (ts.Fem("neo-hookean"), "hexahedron"),
    ],
    ids=["pairs", "coupled", "gaussian", "gaussian tetrahedra", "elements"],
)
def test_fields_of_a_bar(model: Model, element: str) -> None:
    path = pulled(model, element=element)
    state = path.states[-1]
    extent = np.ptp(state.positions, axis=0)
    fields = node_fields(path, state)
    assert fields["stress"] == pytest.approx(1.0 / (extent[1] * extent[2]), rel=1e-6)
    assert fields["stretch"] == pytest.approx(extent[0] / SIZE[0], rel=1e-6)
    assert fields["energy"] == pytest.approx(state.energy / np.prod(SIZE), rel=1e-6)


@pytest.mark.parametrize(
    "model", [ts.Springs("lloyd"), ts.Springs("gaussian"), ts.Fem("linear")], ids=lambda one: one.kind
)
def test_fields_of_a_strip(model: Model) -> None:
    """In plane stress; the thickness of springs does not change, that of linear elements is the undeformed one."""
    problem = ts.Problem(
        ts.rectangle((0.08, 0.02), (4, 1)),
        ts.Material(1e4, 1 / 3),
        ts.PlaneStress(0.01),
        [ts.Fixed("left", ("x",)), ts.Fixed("bottom", ("y",))],
        [ts.Force("right", (0.4, 0.0))],
    )
    path = ts.solve(problem, model, ts.Newton(load_steps=2))
    state = path.states[-1]
    wide, high = np.ptp(state.positions, axis=0)
    fields = node_fields(path, state)
    assert fields["stretch"] == pytest.approx(wide / 0.08, rel=1e-6)
    assert fields["energy"] == pytest.approx(state.energy / (0.08 * 0.02 * 0.01), rel=1e-6)
    if not path.finite:
        assert fields["stress"] == pytest.approx(0.4 / (0.02 * 0.01), rel=1e-6)
    elif model.rule == "lloyd":
        assert fields["stress"] == pytest.approx(0.4 / (high * 0.01), rel=1e-6)
    else:  # the thickness shrinks as the width does
        assert fields["stress"] == pytest.approx(0.4 / (high * 0.01 * high / 0.02), rel=1e-6)


def test_stress_of_springs_is_not_known_in_plane_strain() -> None:
    problem = ts.Problem(
        ts.rectangle((0.08, 0.02), (4, 1)),
        ts.Material(1e4, 1 / 3),
        ts.PlaneStrain(0.01),
        [ts.Fixed("left")],
        [ts.Force("right", (0.4, 0.0))],
    )
    path = ts.solve(problem, ts.Springs("lloyd"), ts.Newton(load_steps=1))
    assert set(node_fields(path, path.states[-1])) == {"stretch", "energy"}


def test_energy_and_stress_are_not_known_where_springs_have_a_part_of_them() -> None:
    path = pulled(ts.Springs("isotropic", volume=True), 0.4)
    assert set(node_fields(path, path.states[-1])) == {"stretch"}


def test_a_view_holds_the_values_of_its_nodes() -> None:
    springs, elements = pulled(ts.Springs("gaussian")), pulled(ts.Fem("neo-hookean"))
    paths = {"springs": springs, "elements": elements}
    compared = {"elements": ts.compare(springs, elements, 0)}
    data = viewer(Result("Bar", Path("bar.toml"), springs.problem, paths, 0, "springs", compared, 0.05, ""), 400_000)
    assert data is not None
    stress, stretch, energy = data["fields"]
    assert [one["unit"] for one in data["fields"]] == ["kPa", "", "J/m³"]
    assert stretch["low"] == 1.0 and energy["low"] == stress["low"] == 0.0
    for path, known in zip(data["paths"], paths.values(), strict=True):
        for packed, state in zip(path["fields"]["stress"], known.states, strict=True):
            steps = np.frombuffer(base64.b64decode(packed), dtype="<u2")
            extent = np.ptp(state.positions, axis=0)
            found = stress["low"] + (stress["high"] - stress["low"]) * steps / 65535
            assert 1e3 * found == pytest.approx(state.load_factor / (extent[1] * extent[2]), abs=1e-4 * 2.8e3)
    tetrahedra = np.frombuffer(base64.b64decode(data["tetrahedra"]), dtype="<u2").reshape(-1, 4)
    corners = springs.problem.mesh.nodes[tetrahedra]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    assert volumes.sum() == pytest.approx(np.prod(SIZE)) and (volumes > 0).all()
