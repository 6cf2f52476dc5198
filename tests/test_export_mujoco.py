"""Springs that are no tendons, run by MuJoCo with the driver that is written beside them."""

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

import truespring as ts
from tests.exports import exported, imported, write
from tests.test_examples import EXAMPLES
from truespring.exports import Exported, solve_springs, target_files
from truespring.study import read_study

_BLOCK = ts.box(size=(0.08, 0.02, 0.02), elements=(4, 1, 1))
_TETS = ts.box(size=(0.04, 0.02, 0.02), elements=(2, 1, 1), element="tetrahedron")
_STRIP = ts.rectangle(size=(0.08, 0.02), elements=(8, 2))
_LIFTED = ts.Fixed(on="right", displacement=(0.0, 0.01, 0.004))

#: Mesh, section, springs, further supports.
_BODIES: dict[str, tuple[ts.Mesh, Any, ts.Springs, list[ts.Fixed]]] = {
    "gaussian": (_BLOCK, None, ts.Springs("gaussian"), []),
    "gaussian, moved": (_BLOCK, None, ts.Springs("gaussian"), [_LIFTED]),
    "gaussian, sheet": (_STRIP, ts.PlaneStress(0.01), ts.Springs("gaussian"), []),
    "ten nodes": (_TETS, None, ts.Springs("gaussian", element="quadratic"), []),
    "volume term": (_BLOCK, None, ts.Springs("isotropic", volume=True), []),
    "coupled": (_BLOCK, None, ts.Springs("biquadratic"), []),
    "force law": (_BLOCK, None, ts.Springs("isotropic", law="neo-hookean"), []),
}


def body(name: str, poisson: float | None = None) -> Exported:
    mesh, section, springs, supports = _BODIES[name]
    problem = ts.Problem(
        mesh,
        ts.Material(10e3, poisson or (0.25 if name == "force law" else 0.4)),
        section,
        supports=[ts.Fixed(on="left"), *supports],
        loads=[ts.Force(on="top", total=(0.0, -0.01, 0.005)[: mesh.dim])],
    )
    return solve_springs(problem, springs, ts.Newton(load_steps=2))


def shipped(example: str, model: str) -> Exported:
    study = read_study(EXAMPLES / f"{example}.toml")
    return solve_springs(study.problem, study.entries[model], study.solver, study.title)


@pytest.fixture
def drive(tmp_path: Path) -> Iterator[Any]:
    """Writes the files of a body and imports their driver."""
    modules: list[ModuleType] = []

    def make(one: Exported, **options: Any) -> tuple[ModuleType, Path]:
        folder = write(target_files(one, ["mujoco"], options)["mujoco"], tmp_path / str(len(modules)))
        modules.append(imported(folder / "drive.py"))
        return modules[-1], folder

    yield make
    for module in modules:
        module.remove()


def settled(drive: ModuleType, folder: Path, times: float = 2.0) -> tuple[float, float]:
    """Distance from our equilibrium over the largest displacement, and the elastic energy."""
    model = mujoco.MjModel.from_xml_path(str(folder / "springs.xml"))
    springs, data = drive.install(model), mujoco.MjData(model)
    drive.settle(model, data, times)
    return drive.distance(model, data, springs.body), springs.energy(data)


@pytest.mark.parametrize("name", _BODIES)
def test_the_driver_settles_on_our_equilibrium(name: str, drive: Any) -> None:
    one = body(name)
    assert one.state is not None
    module, folder = drive(one)
    assert "settles within" in " ".join((folder / "springs.xml").read_text(encoding="utf-8").split())
    assert settled(module, folder, 0.0)[0] > 0.1
    assert settled(module, folder, 1.0)[0] < 1e-3
    distance, energy = settled(module, folder)
    assert distance < 1e-4
    assert energy == pytest.approx(one.state.energy, rel=1e-4)


@pytest.mark.verification
@pytest.mark.parametrize(
    ("example", "model"),
    [
        ("bending", "gaussian"),
        ("soft_block", "gaussian"),
        ("soft_block", "springs"),
        ("tissue", "gaussian"),
        ("tissue", "biquadratic"),
        ("organ", "gaussian"),
    ],
)
def test_shipped_bodies_settle_on_our_equilibrium(example: str, model: str, drive: Any) -> None:
    module, folder = drive(shipped(example, model))
    distance, _ = settled(module, folder)
    assert distance < 1e-4


@pytest.mark.parametrize(("key", "factor"), [("stiffness", 1.01), ("lam", 1.05), ("volume", 1.01)])
def test_a_number_of_the_arrays_that_changes_is_seen(key: str, factor: float, drive: Any) -> None:
    module, folder = drive(body("gaussian"))
    with np.load(folder / "springs.npz", allow_pickle=False) as arrays:
        values = {name: arrays[name] for name in arrays.files}
    np.savez(folder / "springs.npz", **(values | {key: factor * values[key]}))
    assert settled(module, folder)[0] > 1e-3


def test_the_driver_adds_nothing_to_other_models(drive: Any) -> None:
    module, folder = drive(body("gaussian"))
    module.install(mujoco.MjModel.from_xml_path(str(folder / "springs.xml")))
    other = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint type="slide"/><geom size="1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(other)
    mujoco.mj_step(other, data)
    assert not data.qfrc_passive.any()


def test_the_surface_is_drawn_from_the_bodies(drive: Any) -> None:
    """The flex has the faces of the block, and follows its nodes; a network has none."""
    one = body("gaussian")
    _, folder = drive(one)
    root = ElementTree.parse(folder / "springs.xml").getroot()
    (flex,) = root.iter("flex")
    triangles = np.array(str(flex.get("element")).split(), dtype=int).reshape(-1, 3)
    nodes = np.array([int(name[1:]) for name in str(flex.get("body")).split()])
    corners = one.problem.mesh.nodes[nodes[triangles]]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(2 * (2 * 0.08 * 0.02 + 0.02 * 0.02))
    outwards = ((corners.mean(axis=1) - (0.04, 0.01, 0.01)) * areas).sum(axis=1)
    assert (outwards > 0).all()
    model = mujoco.MjModel.from_xml_path(str(folder / "springs.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.flexvert_xpos == pytest.approx(one.problem.mesh.nodes[nodes], abs=1e-15)
    springs = target_files(exported("two springs"), ["mujoco"])["mujoco"]["springs.xml"]
    assert "<flex" not in str(springs)
