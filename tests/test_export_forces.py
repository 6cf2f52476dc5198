"""The module of forces that is written beside scripts: energy and gradient of our models, from the arrays alone."""

import io
import re
from typing import Any

import numpy as np
import pytest

import truespring as ts
from tests.exports import imported
from tests.test_export_gaussian import BODIES, solved
from truespring.exports import Exported, solve_springs, target_files
from truespring.exports.forces import spring_forces

_LAWS = {
    "yeoh": {"c20": 2e3, "c30": 500.0},
    "gent": {"jm": 30.0},
    "arruda-boyce": {"locking_stretch": 2.8},
}
_MIXED = BODIES["mixed"][0]
_CUBES = ts.box(size=(0.04, 0.02, 0.02), elements=(2, 1, 1))
_SOLIDS = ts.Mesh.of_kinds(
    np.array([*np.ndindex(2, 2, 2), (2, 0, 0), (2, 0, 1)]) * 0.01,
    {"hexahedron": np.array([[0, 4, 6, 2, 1, 5, 7, 3]]), "wedge": np.array([[4, 8, 6, 5, 9, 7]])},
)
_SHEET, _SLICE = ts.PlaneStress(0.01), ts.PlaneStrain(0.02)
_STRIP = ts.rectangle((0.04, 0.02), (4, 2))

#: Mesh, section, parameters of the rule, constants of the material.
_OTHERS: dict[str, tuple[ts.Mesh, Any, dict[str, Any], dict[str, float]]] = {
    "straight": (_CUBES, None, {"rule": "isotropic"}, {}),
    "force law": (_CUBES, None, {"rule": "isotropic", "law": "neo-hookean"}, {}),
    "force law in the plane": (
        ts.rectangle((0.04, 0.02), (4, 2)),
        _SLICE,
        {"rule": "isotropic", "law": "neo-hookean"},
        {},
    ),
    "volume term": (_CUBES, None, {"rule": "isotropic", "volume": True}, {}),
    "area term": (_STRIP, _SLICE, {"rule": "isotropic", "volume": True}, {}),
    "coupled": (_CUBES, None, {"rule": "biquadratic"}, {}),
    "coupled, mixed": (_MIXED, _SHEET, {"rule": "biquadratic"}, {}),
    "coupled, mixed solids": (_SOLIDS, None, {"rule": "biquadratic"}, {}),
    "gaussian, mixed solids": (_SOLIDS, None, {"rule": "gaussian"}, {}),
    **{f"{law}, 3D": (_CUBES, None, {"rule": "gaussian", "law": law}, own) for law, own in _LAWS.items()},
    **{f"{law}, sheet": (_MIXED, _SHEET, {"rule": "gaussian", "law": law}, own) for law, own in _LAWS.items()},
}


def other(name: str) -> Exported:
    mesh, section, rule, constants = _OTHERS[name]
    problem = ts.Problem(
        mesh,
        ts.Material(10e3, 0.25, constants=constants),
        section,
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on=[int(mesh.nodes[:, 0].argmax())], total=(1e-3, 2e-3, 1e-3)[: mesh.dim])],
    )
    return solve_springs(problem, ts.Springs(**rule), ts.Newton(load_steps=1))


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The module as it is written."""
    text, file = spring_forces(), tmp_path_factory.mktemp("forces") / "spring_forces.py"
    assert not re.search(r"^(from|import) (?!collections|dataclasses|pathlib|typing|numpy)", text, re.MULTILINE)
    file.write_text(text, encoding="utf-8")
    return imported(file)


@pytest.mark.parametrize("body", [*BODIES, *_OTHERS])
def test_the_module_alone_gives_energy_and_gradient(body: str, module: Any, tmp_path: Any) -> None:
    one = solved(body) if body in BODIES else other(body)
    (content,) = target_files(one, ["npz"])["npz"].values()
    assert isinstance(content, bytes)
    found, potential = module.Body.load(io.BytesIO(content)), one.path.potential
    assert potential is not None
    assert np.array_equal(found.nodes, potential.nodes) and found.held.any() and found.force.any()
    rng, dim = np.random.default_rng(4), found.nodes.shape[1]
    x = found.nodes @ (np.eye(dim) + 0.2 * rng.random((dim, dim))) + 4e-4 * rng.random(found.nodes.shape)
    energy, gradient = found.evaluate(x)
    expected = potential.gradient(x)
    assert np.abs(gradient - expected).max() < 1e-12 * np.abs(expected).max() > 0
    assert energy == pytest.approx(potential.energy(x), rel=1e-11)
    balance = np.abs((found.evaluate(found.nodes + found.displacement)[1] - found.force)[~found.held]).max()
    assert balance < 1e-6 * np.abs(found.force).max()


def test_an_inverted_element_is_no_number(module: Any) -> None:
    one = solved("cubes")
    (content,) = target_files(one, ["npz"])["npz"].values()
    assert isinstance(content, bytes)
    body = module.Body.load(io.BytesIO(content))
    energy, gradient = body.evaluate(body.nodes * (-1.0, 1.0, 1.0))
    assert np.isnan(energy) and np.isnan(gradient).any()
