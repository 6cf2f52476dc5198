"""Springs that are no tendons, run by MuJoCo with the driver that is written beside them."""

import json
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
from truespring.exports import Exported, solve_springs, target_files, with_expectation
from truespring.mesh import in_simplices
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

    def make(one: Exported, **options: Any) -> tuple[ModuleType, Path]:
        folder = write(target_files(one, ["mujoco"], options)["mujoco"], tmp_path / "mujoco")
        return imported(folder / "drive.py"), folder

    yield make
    mujoco.set_mjcb_passive(None)


def settled(drive: ModuleType, folder: Path, times: float = 2.0) -> tuple[float, float]:
    """Distance from our equilibrium over the largest displacement, and the elastic energy."""
    drive.remove()
    model = mujoco.MjModel.from_xml_path(str(folder / "springs.xml"))
    springs, data = drive.install(model), mujoco.MjData(model)
    drive.settle(model, data, times)
    return drive.distance(model, data, springs.body), springs.energy(data)


@pytest.mark.parametrize(
    "name",
    [
        name if name in ("gaussian", "ten nodes", "volume term") else pytest.param(name, marks=pytest.mark.verification)
        for name in _BODIES
    ],
)
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
    ],
)
def test_shipped_bodies_settle_on_our_equilibrium(example: str, model: str, drive: Any) -> None:
    module, folder = drive(shipped(example, model))
    distance, _ = settled(module, folder, 1.6)
    assert distance < 1e-4


@pytest.mark.verification
def test_the_organ_settles_from_the_start(drive: Any) -> None:
    """Nearly ten thousand voxels, from the undeformed body but for its supports; this takes minutes."""
    one = shipped("organ", "gaussian")
    module, folder = drive(one)
    assert settled(module, folder, 0.0)[0] > 0.3
    distance, energy = settled(module, folder, 1.6)
    assert one.state is not None
    assert distance < 1e-4 and energy == pytest.approx(one.state.energy, rel=1e-4)


@pytest.mark.parametrize(
    ("key", "factor"),
    [
        ("stiffness", 1.01),
        pytest.param("mu", 1.01, marks=pytest.mark.verification),
        pytest.param("volume", 1.01, marks=pytest.mark.verification),
    ],
)
def test_a_number_of_the_arrays_that_changes_is_seen(key: str, factor: float, drive: Any) -> None:
    module, folder = drive(body("gaussian"))
    with np.load(folder / "springs.npz", allow_pickle=False) as arrays:
        values = {name: arrays[name] for name in arrays.files}
    np.savez(folder / "springs.npz", **(values | {key: factor * values[key]}))
    assert settled(module, folder)[0] > 1e-3


def test_the_driver_adds_nothing_to_other_models(drive: Any) -> None:
    module, folder = drive(body("gaussian"))
    model = mujoco.MjModel.from_xml_path(str(folder / "springs.xml"))
    other = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint type="slide"/><geom size="1"/></body></worldbody></mujoco>'
    )
    module.install(model)
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


_BALL = (
    '<body name="ball" pos="0.02 {y} 0.02"><joint type="slide" axis="0 1 0"/>'
    '<geom type="sphere" size="0.012" mass="0.01"/></body>'
)


@pytest.mark.verification
@pytest.mark.parametrize("name", ["gaussian", "isotropic"])
def test_a_ball_comes_to_rest_on_the_surface(name: str, drive: Any) -> None:
    """On a block that stands on its lower face, which carries the weight; with a driver and with tendons."""
    mesh, weight = ts.box(size=(0.04, 0.03, 0.04), elements=(4, 3, 4)), 0.0981
    problem = ts.Problem(
        mesh, ts.Material(10e3, 0.25), supports=[ts.Fixed("bottom")], loads=[ts.Force("top", (0.0, -1e-6, 0.0))]
    )
    one = solve_springs(problem, ts.Springs(name), ts.Newton(load_steps=1))
    files = dict(target_files(one, ["mujoco"], {"contact": True})["mujoco"])
    scene = str(files["springs.xml"]).replace("</worldbody>", _BALL.format(y=0.044) + "</worldbody>")
    scene = scene[: scene.index("<keyframe>")] + "</mujoco>"  # of positions of the nodes alone
    model = mujoco.MjModel.from_xml_string(scene)
    springs, potential = None, one.path.potential
    if name == "gaussian":
        module, folder = drive(one, contact=True)
        springs = module.install(model, folder / "springs.npz")
    data = mujoco.MjData(model)
    data.body("ball").xfrc_applied[1] = -weight
    mujoco.mj_step(model, data, round(3.0 / model.opt.timestep))
    assert not any(warning.number for warning in data.warning)
    assert springs is None or np.isfinite(springs.energy(data))
    assert np.abs(data.body("ball").cvel).max() < 1e-4 and data.ncon > 0
    depth = 0.03 + 0.012 - data.body("ball").xpos[1]
    assert 2e-4 < depth < 4e-3  # 1.4 mm by Hertz on a half-space
    assert potential is not None
    places = np.array([data.body(f"n{node}").xpos for node in range(mesh.n_nodes)])
    assert potential.gradient(places)[one.held[:, 1], 1].sum() == pytest.approx(weight, rel=0.01)


@pytest.mark.parametrize("name", ["gaussian", "gaussian, sheet", "coupled"])
def test_flex_is_biquadratic_springs_on_triangles_or_tetrahedra(name: str, drive: Any) -> None:
    """MuJoCo's own elements, which stand beside the springs as an approximation."""
    one = body(name)
    module, folder = drive(one)
    model = mujoco.MjModel.from_xml_path(str(folder / "flex.xml"))
    data, problem = mujoco.MjData(model), one.problem
    module.settle(model, data, 3.0)
    divided, _ = in_simplices(problem.mesh)
    loads = [ts.Force([node], force) for node, force in enumerate(one.external_force) if force.any()]
    twin = ts.Problem(divided, problem.material, problem.section, problem.supports, loads)
    expected = ts.solve(twin, ts.Springs("biquadratic"), ts.Newton(load_steps=2)).states[-1].positions
    away = data.site_xpos[:, : problem.mesh.dim] - expected
    assert np.abs(away).max() < 1e-6 * np.abs(expected - problem.mesh.nodes).max()
    distance = module.distance(model, data, module.Body.load(folder / "springs.npz"))
    assert 0.3 < distance < 0.95
    stated = json.loads(str(with_expectation(one, "mujoco", {})["exported.json"]))["flex"]
    assert stated["largest_difference"] == pytest.approx(distance, rel=1e-5) and stated["file"] == "flex.xml"
    place = data.site(f"n{one.probe}").xpos[: problem.mesh.dim] - problem.mesh.nodes[one.probe]
    assert place == pytest.approx(stated["probe_displacement"], rel=1e-4, abs=1e-6 * np.abs(place).max())


def test_bodies_that_move_have_no_flex() -> None:
    """MuJoCo takes initial positions as undeformed."""
    one = body("gaussian, moved")
    assert "flex.xml" not in target_files(one, ["mujoco"])["mujoco"]
    assert "flex" not in json.loads(str(with_expectation(one, "mujoco", {})["exported.json"]))


@pytest.mark.parametrize(("arguments", "bound"), [([], 1e-4), (["--file", "flex.xml"], 1.0)])
def test_the_driver_is_a_program(
    arguments: list[str], bound: float, drive: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module, _ = drive(body("gaussian, sheet"))
    monkeypatch.setattr("sys.argv", ["drive.py", *arguments])
    assert module.main() == 0
    shown = capsys.readouterr().out.splitlines()
    assert "has moved by" in shown[0] and float(shown[1].rpartition(":")[2]) < bound
