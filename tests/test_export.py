"""Springs carried to other simulators: the numbers that arrive are ours, and there and back gives our equilibrium.

Every file is read by another reader than its writer: MuJoCo itself, ElementTree, json, numpy, Python's own parser.
"""

import ast
import io
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

import truespring as ts
from tests.c_runtime import opened
from tests.calculix import displacements
from tests.exports import CASES, difference, expected, exported, write
from tests.studies import changed, written
from tests.test_export_surfaces import Glb, from_obj
from tests.wording import in_order
from truespring.arrays import Floats
from truespring.cli import main
from truespring.errors import ExportError
from truespring.exports import TARGETS, Exported, check_targets, solve_springs, target_files
from truespring.exports.calculix import fem_deck, spring_deck
from truespring.exports.features import Feature, features
from truespring.models.spring_data import SpringData


def text_of(one: Exported, target: str) -> str:
    (content,) = target_files(one, [target])[target].values()
    assert isinstance(content, str)
    return content


def network_of(one: Exported) -> ts.SpringNetwork:
    assert isinstance(one.path.potential, ts.SpringNetwork)
    return one.path.potential


def in_space(values: Any) -> Floats:
    """Plane vectors with a third component of zero."""
    return np.pad(np.asarray(values, dtype=float), ((0, 0), (0, 3 - np.shape(values)[1])))


# --- MuJoCo ----------------------------------------------------------------------------------------------------------


def moved(model: mujoco.MjModel, data: mujoco.MjData, case: str) -> float:
    """How far MuJoCo's nodes are from ours, over our largest displacement."""
    mujoco.mj_forward(model, data)
    nodes = exported(case).problem.mesh.nodes
    return difference(data.site_xpos[:, : nodes.shape[1]] - nodes, case)


@pytest.mark.parametrize("case", CASES)
def test_mujoco_settles_on_our_equilibrium(case: str) -> None:
    """Within 0.1 % when the file says so, and nearer and nearer."""
    text = text_of(exported(case), "mujoco")
    assert "did not settle" not in text and "settles within" in " ".join(text.split())
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    steps = round(model.numeric("settled").data[0] / model.opt.timestep)
    assert moved(model, data, case) > 0.1
    for bound in (1e-3, 1e-5, 1e-7):
        mujoco.mj_step(model, data, steps)
        assert moved(model, data, case) < bound
    assert not any(warning.number for warning in data.warning)  # a state that ran away is reset in silence
    state = exported(case).state
    assert state is not None
    assert data.energy[0] == pytest.approx(state.energy, rel=1e-6)


def test_mujoco_agrees_with_the_verification_manual() -> None:
    """Ansys VM9 prints 8.631 and 4.533; the springs have these."""
    model = mujoco.MjModel.from_xml_string(text_of(exported("two springs"), "mujoco"))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    mujoco.mj_forward(model, data)
    assert data.site("n1").xpos == pytest.approx([8.63207, 4.53191, 0.0], abs=1e-5)


@pytest.mark.parametrize("case", ["bending", "moved"])
def test_mujoco_starts_from_the_equilibrium_if_asked(case: str) -> None:
    model = mujoco.MjModel.from_xml_string(text_of(exported(case), "mujoco"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("equilibrium").id)
    mujoco.mj_step(model, data, 50)
    assert moved(model, data, case) < 1e-9


@pytest.mark.parametrize(("number", "factor"), [("stiffness", 0.99), ("springlength", 1.001), ("biasprm", 1.01)])
def test_a_number_that_drifts_by_a_hundredth_is_seen(number: str, factor: float) -> None:
    """The check of the settled state can fail."""
    root = ElementTree.fromstring(text_of(exported("bending"), "mujoco"))
    for one in root.iter():
        if number in one.attrib:
            first, *rest = one.attrib[number].split()
            one.set(number, " ".join([repr(factor * float(first)), *rest]))
    model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, "unicode"))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 2 * round(model.numeric("settled").data[0] / model.opt.timestep))
    assert moved(model, data, "bending") > 1e-3


@pytest.mark.parametrize("case", CASES)
def test_the_mujoco_file_holds_our_numbers(case: str) -> None:
    one, root = exported(case), ElementTree.fromstring(text_of(exported(case), "mujoco"))
    network, loading = network_of(one), one.problem.loading
    held, motion = loading.held, loading.motion()
    bodies = root.findall("worldbody/body")
    assert [body.get("name") for body in bodies] == [f"n{node}" for node in range(len(network.nodes))]
    places = np.array([numbers(body, "pos") for body in bodies])
    assert (places[:, held.shape[1] :] == 0).all()
    assert places[:, : held.shape[1]][held] == pytest.approx((network.nodes + motion)[held], rel=1e-15)
    if not motion.any():
        assert (places[:, : held.shape[1]] == network.nodes).all()
    for node, body in enumerate(bodies):
        axes = [numbers(joint, "axis").tolist() for joint in body.findall("joint")]
        assert axes == np.eye(3)[: held.shape[1]][~held[node]].tolist()
        assert (body.find("inertial") is None) == held[node].all()
    springs = root.findall("tendon/spatial")
    ends = [[int(str(site.get("site"))[1:]) for site in spring.findall("site")] for spring in springs]
    assert ends == network.springs.tolist()
    assert [float(str(spring.get("stiffness"))) for spring in springs] == network.stiffness.tolist()
    assert [float(str(spring.get("springlength"))) for spring in springs] == network.rest_length.tolist()
    force = np.zeros(held.shape)
    for actuator in root.findall("actuator/general"):
        name = str(actuator.get("joint"))
        force[int(name[1:-1]), "xyz".index(name[-1])] += numbers(actuator, "biasprm")[0]
    assert force[~held] == pytest.approx(our_force(one)[~held], rel=1e-12, abs=1e-15)
    assert force.any() or loading.driven_by_motion


def numbers(element: ElementTree.Element, name: str) -> Floats:
    return np.array(str(element.get(name)).split(), dtype=float)


def our_force(one: Exported) -> Floats:
    """Of the loads on our body at full load [N]."""
    state = one.state
    assert state is not None
    return one.problem.loading.force(state.positions)


def test_the_masses_in_the_mujoco_file_are_those_of_the_material() -> None:
    """The block's halves weigh 900 and 1100 kg/m^3; of the face that is held nothing moves."""
    root = ElementTree.fromstring(text_of(exported("block"), "mujoco"))
    mass = sum(float(str(one.get("mass"))) for one in root.iter("inertial"))
    volume = 0.08 * 0.04 * 0.02
    assert mass == pytest.approx(900 * volume / 2 * 3 / 4 + 1100 * volume / 2, rel=1e-12)


def test_a_body_that_goes_another_way_under_the_whole_load_at_once_is_told() -> None:
    """Just below its limit load a truss stands if loaded slowly; loaded at once it overshoots and snaps through.

    A soft corner beside it, with which it has nothing to do, has the lowest frequency and so rules the damping.
    """
    nodes = [[-1.0, 0.0], [0.0, 0.2], [1.0, 0.0], [0.0, -1.0], [0.0, -2.0], [1.0, -1.0]]
    springs, stiffness = [[0, 1], [1, 2], [3, 4], [3, 5]], [1000.0, 1000.0, 0.5, 0.5]
    network = ts.SpringNetwork(nodes, springs, stiffness)
    length = np.hypot(1.0, 0.2)
    limit = 2000 * length * (1 - length ** (-2 / 3)) ** 1.5
    load = ts.Force([1], (0.0, -0.95 * limit))
    one = solve_springs(ts.Problem(network.mesh, supports=[ts.Fixed([0, 2, 4, 5])], loads=[load]), network, probe=1)
    assert one.state is not None and one.state.positions[1, 1] > 0
    text = text_of(one, "mujoco")
    assert "did not settle" in text
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 5000)
    assert data.site("n1").xpos[1] < 0
    mujoco.mj_resetDataKeyframe(model, data, model.key("equilibrium").id)
    mujoco.mj_step(model, data, 5000)
    assert data.site("n1").xpos[1] == pytest.approx(one.state.positions[1, 1], abs=1e-9)


def test_a_block_of_some_hundred_nodes_is_no_matter() -> None:
    """MuJoCo reserves memory by the square of the nodes if it is not told how much."""
    problem = ts.Problem(
        ts.box(size=(0.1, 0.05, 0.05), elements=(10, 5, 5)),
        ts.Material(10e3, 0.25),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, -0.5, 0.1))],
    )
    one = solve_springs(problem, ts.Springs("isotropic"), ts.Newton(load_steps=2))
    assert one.state is not None
    model = mujoco.MjModel.from_xml_string(text_of(one, "mujoco"))
    data = mujoco.MjData(model)
    assert model.nbody == 397 and model.narena < 20e6
    mujoco.mj_step(model, data, round(model.numeric("settled").data[0] / model.opt.timestep))
    away = np.linalg.norm(data.site_xpos - one.state.positions, axis=1).max()
    assert away < 1e-3 * np.linalg.norm(one.state.displacement, axis=1).max()


# --- arrays ----------------------------------------------------------------------------------------------------------


def from_npz(one: Exported) -> dict[str, Any]:
    (content,) = target_files(one, ["npz"])["npz"].values()
    assert isinstance(content, bytes)
    import io

    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def from_json(one: Exported) -> dict[str, Any]:
    values: dict[str, Any] = json.loads(text_of(one, "json"))
    return values


READERS: dict[str, Callable[[Exported], dict[str, Any]]] = {"npz": from_npz, "json": from_json}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("case", CASES)
def test_arrays_alone_give_our_equilibrium_again(case: str, reader: str) -> None:
    values = READERS[reader](exported(case))
    network = ts.SpringNetwork(*(values[name] for name in ("nodes", "springs", "stiffness", "rest_length")))
    held, motion, force = (np.array(values[name]) for name in ("held", "prescribed_displacement", "external_force"))
    supports = [
        ts.Fixed([node], fix="xyz"[axis], displacement=np.eye(held.shape[1])[axis] * motion[node, axis])
        for node, axis in np.argwhere(held).tolist()
    ]
    loads = [ts.Force([node], force[node]) for node in np.flatnonzero(force.any(axis=1)).tolist()]
    problem = ts.Problem(network.mesh, supports=supports, loads=loads)
    state = ts.solve(problem, network, ts.Newton(load_steps=5)).at(1.0)
    assert state is not None
    assert difference(state.displacement, case) < 1e-9
    assert np.array(values["displacement"]).tolist() == expected(case).tolist()
    assert float(values["energy"]) == pytest.approx(state.energy, rel=1e-9)


@pytest.mark.parametrize("case", CASES)
def test_both_files_hold_the_same_keys_and_numbers(case: str) -> None:
    arrays, lists, problem = from_npz(exported(case)), from_json(exported(case)), exported(case).problem
    assert set(arrays) == set(lists)
    for name in set(arrays) - {"units"}:
        if isinstance(lists[name], str):
            assert str(arrays[name]) == lists[name]
        else:
            given = np.array(lists[name], dtype=arrays[name].dtype)
            assert np.array_equal(arrays[name], given, equal_nan=arrays[name].dtype.kind == "f"), name
    assert dict(line.split(": ") for line in arrays["units"].tolist()) == lists["units"]
    assert lists["nodes"] == problem.mesh.nodes.tolist()
    assert lists["elements"] == problem.mesh.elements.tolist() and lists["element"] == problem.mesh.element
    assert np.array(lists["external_force"]) == pytest.approx(our_force(exported(case)), abs=1e-15)
    assert lists["young"] == [material.young for material in problem.materials]
    assert lists["material_numbers"] == problem.material_numbers.tolist()


def test_every_number_with_a_dimension_has_its_unit() -> None:
    without = {"truespring", "poisson", "load_factor", "probe", "springs", "elements", "material_numbers", "held"}
    without |= {"dimension"}
    for case in CASES:
        values = from_json(exported(case))
        texts = {name for name, value in values.items() if isinstance(value, str)} | {"header", "units"}
        assert set(values) - texts - without == set(values["units"])


def beyond_springs(**rule: Any) -> Exported:
    problem = ts.Problem(
        ts.box(size=(0.08, 0.04, 0.04), elements=(4, 2, 2)),
        ts.Material(10e3, 0.4),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, -0.3, 0.0))],
    )
    return solve_springs(problem, ts.Springs(**rule), ts.Newton(load_steps=2))


@pytest.mark.parametrize("reader", READERS)
def test_arrays_carry_a_volume_term(reader: str) -> None:
    """The energy, by hand from the arrays: springs, and kappa/2 V0 (V/V0 - 1)^2 of each brick, split in five twice."""
    one = beyond_springs(rule="isotropic", volume=True)
    values = {name: np.asarray(value) for name, value in READERS[reader](one).items() if name != "units"}
    nodes = values["nodes"]
    now = nodes + values["displacement"]
    length = np.linalg.norm(now[values["springs"][:, 1]] - now[values["springs"][:, 0]], axis=1)
    energy = (values["stiffness"] / 2 * (length - values["rest_length"]) ** 2).sum()
    before, after = (brick_volumes(at[values["elements"]]) for at in (nodes, now))
    energy += (values["kappa"] / 2 * before * (after / before - 1) ** 2).sum()
    assert energy == pytest.approx(float(values["energy"]), rel=1e-12)
    assert (values["kappa"] > 0).all()


def brick_volumes(corners: Floats) -> Floats:
    """By the mean of both divisions into five tetrahedra, corners of shape (n, 8, 3)."""
    five = [(0, 1, 3, 4), (1, 2, 3, 6), (1, 4, 5, 6), (3, 4, 6, 7), (1, 3, 4, 6)]
    five += [(0, 1, 2, 5), (0, 2, 3, 7), (0, 4, 5, 7), (2, 5, 6, 7), (0, 2, 7, 5)]
    total = np.zeros(len(corners))
    for a, b, c, d in five:
        total += np.linalg.det(corners[:, [b, c, d]] - corners[:, [a]]) / 12
    return total


@pytest.mark.parametrize("reader", READERS)
def test_arrays_carry_coupled_springs(reader: str) -> None:
    """The energy, by hand from the arrays: q . M q with q the change of an element's squared link lengths."""
    one = beyond_springs(rule="biquadratic")
    values = {name: np.asarray(value) for name, value in READERS[reader](one).items() if name != "units"}
    before, after = (
        (np.diff(at[values["elements"]][:, values["links"]], axis=2)[:, :, 0] ** 2).sum(axis=-1)
        for at in (values["nodes"], values["nodes"] + values["displacement"])
    )
    change = after - before
    energy = np.einsum("ek,ekl,el->", change, values["coupling"], change)
    assert energy == pytest.approx(float(values["energy"]), rel=1e-10)
    assert "stiffness" not in values


# --- SOFA ------------------------------------------------------------------------------------------------------------

# The data of components as SOFA's sources name them at commit 2a278d8, by initData and initLink in the files of these
# names, in BaseLinearElasticityFEMForceField.inl, TopologyAccessor.cpp and PairInteractionForceField.h.
_ELASTIC = {"topology", "method", "youngModulus", "poissonRatio"}
SOFA_DATA = {
    "RequiredPlugin": {"pluginName"},
    "DefaultAnimationLoop": set[str](),
    "VisualStyle": {"displayFlags"},
    "StaticSolver": {"newtonSolver"},
    "NewtonRaphsonSolver": {
        "maxNbIterationsNewton",
        "maxNbIterationsLineSearch",
        "warnWhenLineSearchFails",
        "relativeInitialStoppingThreshold",
        "relativeSuccessiveStoppingThreshold",
        "absoluteResidualStoppingThreshold",
    },
    "SparseLDLSolver": set[str](),
    "MechanicalObject": {"position", "rest_position"},
    "MeshTopology": {"position", "triangles", "tetrahedra", "hexahedra"},
    "SpringForceField": {
        *("object1", "object2", "springsIndices1", "springsIndices2"),
        *("stiffness", "damping", "lengths", "elongationOnly", "enabled"),
    },
    "ConstantForceField": {"indices", "forces"},
    "FixedProjectiveConstraint": {"indices"},
    "PartialFixedProjectiveConstraint": {"indices", "fixedDirections"},
    "TriangleFEMForceField": {*_ELASTIC, "thickness", "planeStrain"},
    "TetrahedronFEMForceField": _ELASTIC,
    "HexahedronFEMForceField": _ELASTIC,
}


class Data:
    """A value of a component, set and written to as SofaPython3 lets do it."""

    def __init__(self, value: Any) -> None:
        self.value = value

    @contextmanager
    def writeableArray(self) -> Iterator[Any]:  # noqa: N802
        array = np.array(self.value, dtype=float)
        yield array
        self.value = array.tolist()


class Node:
    """Records what a scene adds."""

    def __init__(self, name: str) -> None:
        self.name, self.objects, self.children = name, list[tuple[str, dict[str, Any]]](), dict[str, Node]()
        self.controllers: list[Any] = []

    def addObject(self, kind: Any, **data: Any) -> Any:  # noqa: N802
        if not isinstance(kind, str):
            self.controllers.append(kind)
            return kind
        assert set(data) - {"name", "template"} <= SOFA_DATA[kind], kind
        self.objects.append((kind, data))
        return SimpleNamespace(**{name: Data(value) for name, value in data.items()})

    def addChild(self, name: str) -> "Node":  # noqa: N802
        self.children[name] = Node(name)
        return self.children[name]

    def all(self, kind: str) -> list[dict[str, Any]]:
        return [data for one, data in self.objects if one == kind]

    def one(self, kind: str) -> dict[str, Any]:
        (found,) = self.all(kind)
        return found


@pytest.fixture
def scene_of(monkeypatch: pytest.MonkeyPatch) -> Callable[[Exported], Node]:
    """The scene that a file makes, with nothing of SOFA but the class that it derives its controller from."""
    sofa, core = ModuleType("Sofa"), ModuleType("Sofa.Core")
    core.Controller = type("Controller", (), {"__init__": lambda self, **data: None})  # type: ignore[attr-defined]
    sofa.Core = core  # type: ignore[attr-defined]
    for name, module in {"Sofa": sofa, "Sofa.Core": core}.items():
        monkeypatch.setitem(sys.modules, name, module)
    for name in ("Sofa.Simulation", "SofaRuntime"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))

    def make(one: Exported) -> Node:
        values: dict[str, Any] = {"__name__": "springs_scene"}
        exec(compile(text_of(one, "sofa"), "springs_scene.py", "exec"), values)
        root = Node("root")
        assert values["createScene"](root) is root
        return root

    return make


@pytest.mark.parametrize("case", CASES)
def test_the_sofa_scene_holds_our_numbers(case: str, scene_of: Callable[[Exported], Node]) -> None:
    one, root = exported(case), scene_of(exported(case))
    network, held = network_of(one), one.problem.loading.held
    body = root.children["springs"]
    springs = body.one("SpringForceField")
    assert body.one("MechanicalObject")["rest_position"] == in_space(network.nodes).tolist()
    assert [*zip(springs["springsIndices1"], springs["springsIndices2"], strict=True)] == [
        tuple(pair) for pair in network.springs.tolist()
    ]
    assert springs["stiffness"] == network.stiffness.tolist()
    assert springs["lengths"] == network.rest_length.tolist()
    assert springs["damping"] == [0.0] * len(network.springs)
    assert (
        fixed(body, len(network.nodes)) == np.pad(held, ((0, 0), (0, 3 - held.shape[1])), constant_values=True)
    ).all()
    assert ("fem" in root.children) == bool(one.problem.materials)


def fixed(body: Node, n_nodes: int) -> Any:
    """Which directions of which nodes the constraints of a body hold, each once."""
    times = np.zeros((n_nodes, 3), dtype=int)
    for data in body.all("FixedProjectiveConstraint"):
        times[data["indices"]] += 1
    for data in body.all("PartialFixedProjectiveConstraint"):
        times[data["indices"]] += data["fixedDirections"]
    assert times.max() == 1
    return times == 1


@pytest.mark.parametrize("case", CASES)
def test_static_states_of_the_sofa_scene_end_in_our_equilibrium(
    case: str, scene_of: Callable[[Exported], Node]
) -> None:
    """SOFA's own algorithm (NewtonRaphsonSolver.cpp: whole Newton steps) on the numbers of the scene alone."""
    body = scene_of(exported(case)).children["springs"]
    (levels,), springs = body.controllers, body.one("SpringForceField")
    network = ts.SpringNetwork(
        body.one("MechanicalObject")["rest_position"],
        np.stack([springs["springsIndices1"], springs["springsIndices2"]], axis=1),
        springs["stiffness"],
        springs["lengths"],
    )
    free = ~fixed(body, len(network.nodes))
    newton, tight = body.one("NewtonRaphsonSolver"), body.one("NewtonRaphsonSolver")["relativeInitialStoppingThreshold"]
    assert newton["maxNbIterationsLineSearch"] == 1
    full = np.where(free, in_space(our_force(exported(case))), 0.0)
    for level in range(1, exported(case).load_steps + 1):
        levels.onAnimateBeginEvent({})
        positions, force = np.array(levels.dofs.position.value), np.zeros((len(network.nodes), 3))
        for data in body.all("ConstantForceField"):
            force[data["indices"]] = levels.forces.forces.value
        assert force == pytest.approx(level / exported(case).load_steps * full, rel=1e-12, abs=1e-15)
        first = None
        for _ in range(newton["maxNbIterationsNewton"]):
            residual = (force - network.gradient(positions))[free]
            first = first or np.linalg.norm(residual)
            if np.linalg.norm(residual) <= tight * first:
                break
            tangent = sparse.csc_array(sparse.csr_array(network.hessian(positions))[free.ravel()][:, free.ravel()])
            positions[free] += spsolve(tangent, residual)
        levels.dofs.position.value = positions.tolist()
    assert difference(positions - network.nodes, case) < 1e-6
    assert (positions[:, 2] == network.nodes[:, 2]).all() or exported(case).problem.mesh.dim == 3


def test_the_finite_element_twin_in_the_sofa_scene(scene_of: Callable[[Exported], Node]) -> None:
    """Two triangles a square; the material of each element, and how it carries the third direction."""
    strip = scene_of(exported("pressed")).children["fem"]
    triangles = np.array(strip.one("MeshTopology")["triangles"])
    corners = np.array(strip.one("MeshTopology")["position"])[triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2
    assert len(areas) == 2 * 8 * 4 and areas == pytest.approx(np.full(64, 5e-5))
    centres = corners.mean(axis=1).reshape(2, -1, 3).mean(axis=0)[:, :2]
    assert centres == pytest.approx(exported("pressed").problem.mesh.centres)
    elements = strip.one("TriangleFEMForceField")
    assert (elements["youngModulus"], elements["poissonRatio"]) == ([10e3], [0.25])
    assert (elements["thickness"], elements["planeStrain"], elements["method"]) == (0.02, True, "large")
    block, problem = scene_of(exported("block")).children["fem"], exported("block").problem
    assert block.one("MeshTopology")["hexahedra"] == problem.mesh.elements.tolist()
    young = block.one("HexahedronFEMForceField")["youngModulus"]
    assert young == problem.of_elements(lambda material: material.young).tolist() and len(set(young)) == 2
    sheet = scene_of(exported("bending")).children["fem"].one("TriangleFEMForceField")
    assert (sheet["thickness"], sheet["planeStrain"]) == (0.01, False)


def test_the_sofa_scene_says_that_it_was_not_run() -> None:
    told = ast.get_docstring(ast.parse(text_of(exported("bending"), "sofa")))
    assert told is not None and "EXPERIMENTAL" in told and "2a278d8" in told


# --- what every file says, and what is refused -----------------------------------------------------------------------


@pytest.mark.parametrize("target", ["mujoco", "sofa", "json"])
@pytest.mark.parametrize("case", CASES)
def test_files_tell_units_supports_loads_and_what_to_expect(case: str, target: str) -> None:
    one, text = exported(case), text_of(exported(case), target)
    head = {
        "mujoco": lambda: text[text.index("<!--") : text.index("-->")],
        "sofa": lambda: str(ast.get_docstring(ast.parse(text))),
        "json": lambda: "\n".join(json.loads(text)["header"]),
    }[target]()
    head = " ".join(head.split())
    assert f"Case: {case}" in head and "Units are SI: m, N, N/m, kg, s." in head
    assert head.count("Support ") == len(one.problem.supports) and head.count("Load ") == len(one.problem.loads)
    vector = re.search(r"node (\d+), counted from 0, at rest at \((.*?)\) m, has moved by \((.*?)\) m", head)
    assert vector is not None and int(vector[1]) == one.probe
    for text_, wanted in ((vector[2], one.problem.mesh.nodes), (vector[3], expected(case))):
        assert [float(part) for part in text_.split(",")] == pytest.approx(wanted[one.probe], rel=1e-8, abs=1e-15)
    assert ("dead forces" in head) == (case == "pressed")
    assert ("rotated positions" in head) == (case == "turned")


# --- the contract of every target ------------------------------------------------------------------------------------

_BLOCK = ts.box(size=(0.08, 0.04, 0.04), elements=(4, 2, 2))
_CLAMPED = [ts.Fixed(on="left")]


def _pulled(mesh: ts.Mesh = _BLOCK) -> ts.Problem:
    section = ts.PlaneStress(0.01) if mesh.dim == 2 else None
    pull = ts.Force(on="right", total=(0.01, 0.0, 0.0)[: mesh.dim])
    return ts.Problem(mesh, ts.Material(10e3, 0.25), section, supports=_CLAMPED, loads=[pull])


def _with_feature() -> dict[Feature, tuple[ts.Problem, Any]]:
    """A body that has a feature, of each."""
    flat = _pulled(ts.rectangle(size=(0.3, 0.02), elements=(10, 2)))
    prestressed = exported("prestressed")
    return {
        Feature.VOLUME_TERM: (_pulled(), ts.Springs("isotropic", volume=True)),
        Feature.COUPLING: (_pulled(), ts.Springs("biquadratic")),
        Feature.PRESSURE: (_pulled(), ts.Springs("gaussian")),
        Feature.STIFFENING: (
            replace(_pulled(), material=ts.Material(10e3, 0.25, constants={"jm": 30.0})),
            ts.Springs("gaussian", law="gent"),
        ),
        Feature.FIBRES: (
            replace(_pulled(), material=ts.Material(10e3, 0.25, fibres=ts.Fibres([(1.0, 0.0, 0.0)], 5e3, 2.0))),
            ts.Springs("gaussian"),
        ),
        Feature.NEGATIVE: (flat, ts.Springs("isotropic", allow_negative=True)),
        Feature.PRESTRESS: (prestressed.problem, network_of(prestressed)),
        Feature.FORCE_LAW: (_pulled(), ts.Springs("isotropic", law="neo-hookean")),
        Feature.FOLLOWING: (exported("pressed").problem, ts.Springs("lloyd")),
    }


def _named(feature: Feature, problem: ts.Problem, springs: SpringData) -> tuple[str, ...]:
    """The numbers and names that the error for a feature states, in their order."""
    network = springs.network
    if feature in (Feature.NEGATIVE, Feature.PRESTRESS):
        assert network is not None
        distance = np.linalg.norm(network.nodes[network.springs[:, 1]] - network.nodes[network.springs[:, 0]], axis=1)
        has = network.stiffness < 0 if feature is Feature.NEGATIVE else ~np.isclose(network.rest_length, distance)
        first = int(np.argmax(has))
        of_first = (
            (f"{network.stiffness[first]:g} N/m", "rule")
            if feature is Feature.NEGATIVE
            else (f"{network.rest_length[first]:g} m", f"{distance[first]:g} m")
        )
        return f"{has.sum()} springs", f"spring {first}", *of_first
    if feature is Feature.FOLLOWING:
        (load,) = problem.loads
        assert load.instead
        return load.words(), load.instead
    return {
        Feature.VOLUME_TERM: ("volume = true",),
        Feature.COUPLING: ("biquadratic", "rule"),
        Feature.PRESSURE: ("gaussian", "npz or json"),
        Feature.STIFFENING: ("gent", "neo-hookean"),
        Feature.FIBRES: ("fibres", "k1"),
        Feature.FORCE_LAW: ("neo-hookean",),
    }[feature]


#: Features that come with another.
_BESIDE = {Feature.STIFFENING: {Feature.PRESSURE}, Feature.FIBRES: {Feature.PRESSURE}}


@pytest.mark.parametrize("feature", Feature)
def test_a_target_takes_what_it_names_and_no_more(
    feature: Feature, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, model = _with_feature()[feature]
    solved = solve_springs(problem, model, ts.Newton(load_steps=1))
    found = {one for one, _ in features(problem, solved.springs)}
    assert found - _BESIDE.get(feature, set()) == {feature}, "the body shows nothing else"
    monkeypatch.setattr("truespring.exports.exported.solve", None)
    taking = [name for name, target in TARGETS.items() if feature in target.takes]
    assert taking
    for name, target in TARGETS.items():
        if found <= target.takes:
            check_targets([name], problem, model)
            assert target_files(solved, [name])[name]
            continue
        first = next(one for one, _ in features(problem, solved.springs) if one not in target.takes)
        named = _named(first, problem, solved.springs)
        taking = [other for other, known in TARGETS.items() if first in known.takes]
        words = re.escape(target.program) + f" .*{first}: .*targets .*: {', '.join(taking)}$"
        with pytest.raises(ExportError, match=words) as raised:
            ts.export(problem, model, name, tmp_path)
        assert in_order(str(raised.value), *named)
        with pytest.raises(ExportError, match=words):
            target_files(solved, [name])
    assert not list(tmp_path.iterdir())


_RISE = [[0, 0], [0.5, 1], [1, 0]]
_BALL = ts.Sphere("ball", 0.01, [[0, 0.04, 0.06, 0.02], [1, 0.04, 0.05, 0.02]], on="top")
_HAND = ts.Grasp("hand", (0.08, 0.04, 0.02), 0.03, [[0, 0.08, 0.04, 0.02], [1, 0.09, 0.04, 0.02]])
#: What no target has: changes to a pulled body, and words of the error.
_UNWRITTEN: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "motion": (
        {"dynamics": ts.Dynamics(1.0), "material": ts.Material(10e3, 0.25, density=1e3)},
        ("a motion", "leave [dynamics] out"),
    ),
    "load history": (
        {"loads": [ts.Force("right", (0.01, 0.0, 0.0), over=_RISE)]},
        ("history of force (0.01, 0, 0) N", "leave over out"),
    ),
    "history of a support": (
        {"supports": [*_CLAMPED, ts.Fixed("right", fix="x", displacement=(0.01, 0.0, 0.0), over=_RISE)], "loads": []},
        ("history of 'right' held along x", "leave over out"),
    ),
    "tool": ({"tools": [_BALL]}, ("tools and grasps", "'ball'")),
    "grasp": ({"grasps": [_HAND]}, ("tools and grasps", "'hand'")),
}


@pytest.mark.parametrize("name", _UNWRITTEN)
def test_what_no_target_has_is_an_error_before_anything_is_solved(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    changes, words = _UNWRITTEN[name]
    problem, springs = replace(_pulled(), **changes), ts.Springs("isotropic")
    assert problem.loading.held.any()  # the problem itself is sound
    monkeypatch.setattr("truespring.exports.exported.solve", None)
    for target in TARGETS:
        with pytest.raises(ExportError) as raised:
            ts.export(problem, springs, target, tmp_path)
        assert in_order(str(raised.value), TARGETS[target].program, *words)
    for make in (
        lambda: fem_deck(problem, [1.0], "saint-venant-kirchhoff"),
        lambda: spring_deck(problem, springs.potential(problem), [1.0]),
    ):
        with pytest.raises(ExportError) as raised:
            make()
        assert in_order(str(raised.value), *words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("target", TARGETS)
def test_a_target_writes_the_files_that_it_names(target: str) -> None:
    names, seen = TARGETS[target].names, set()
    coupled, gaussian = (_with_feature()[one] for one in (Feature.COUPLING, Feature.PRESSURE))
    others = [solve_springs(*one, ts.Newton(load_steps=1)) for one in (coupled, gaussian)]
    for one in (*map(exported, CASES), *others):
        if {feature for feature, _ in features(one.problem, one.springs)} <= TARGETS[target].takes:
            files = target_files(one, [target])[target]
            assert next(iter(files)) in names and all(files.values())
            seen |= files.keys()
    if target == "mujoco":
        seen |= target_files(beyond_springs(rule="gaussian"), [target])[target].keys()
    assert seen == set(names)


def _by_calculix(files: Mapping[str, str | bytes], folder: Path) -> Floats:
    return displacements(str(files["springs.inp"]), folder)[-1]


def _by_mujoco(files: Mapping[str, str | bytes], folder: Path) -> Floats:
    model = mujoco.MjModel.from_xml_string(str(files["springs.xml"]))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("equilibrium").id)
    mujoco.mj_step(model, data, 50)
    mujoco.mj_forward(model, data)
    return np.asarray(data.site_xpos - in_space(exported("bending").problem.mesh.nodes))


def _by_arrays(values: Mapping[str, Any]) -> Floats:
    """Newton's method in a few lines, from the arrays alone."""
    nodes, springs, held = (np.asarray(values[name]) for name in ("nodes", "springs", "held"))
    stiffness, rest, force = (np.asarray(values[name]) for name in ("stiffness", "rest_length", "external_force"))
    here, free = nodes + np.asarray(values["prescribed_displacement"]), ~held.ravel()
    for share in np.linspace(0.1, 1.0, 10):
        for _ in range(20):
            along = here[springs[:, 1]] - here[springs[:, 0]]
            length = np.linalg.norm(along, axis=1)
            unit = along / length[:, None]
            residual, tangent = share * force, np.zeros((nodes.size, nodes.size))
            outer = unit[:, :, None] * unit[:, None, :]
            blocks = (1 - rest / length)[:, None, None] * (np.eye(2) - outer) + outer
            for (a, b), block, pull in zip(
                springs, stiffness[:, None, None] * blocks, (stiffness * (length - rest))[:, None] * unit, strict=True
            ):
                residual[a] += pull
                residual[b] -= pull
                for row, column, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                    tangent[2 * row : 2 * row + 2, 2 * column : 2 * column + 2] += sign * block
            step = np.zeros(nodes.size)
            step[free] = np.linalg.solve(tangent[free][:, free], residual.ravel()[free])
            here = here + step.reshape(nodes.shape)
            if np.abs(step).max() < 1e-13:
                break
    return here - nodes


def _by_warp(files: Mapping[str, str | bytes], folder: Path) -> Floats:
    """In float64, in a process of its own."""
    pytest.importorskip("warp", reason="Warp is not installed: pip install 'truespring[warp]'")
    write(files, folder)
    ask = "import numpy, springs_warp as s; b = s.Springs(device='cpu'); b.settle(4.0); numpy.save('x', b.positions())"
    subprocess.run(
        [sys.executable, "-c", ask],
        cwd=folder,
        env=os.environ | {"SPRINGS_FLOAT64": "1", "PYTHONPATH": str(folder)},
        check=True,
        capture_output=True,
    )
    return np.asarray(np.load(folder / "x.npy") - in_space(exported("bending").problem.mesh.nodes))


def _by_gltf(files: Mapping[str, str | bytes], folder: Path) -> Floats:
    """The last morph target; of a plane body all nodes are shown."""
    file = Glb(bytes(files["surface.glb"]))  # type: ignore[arg-type]
    (primitive,) = file.json["meshes"][0]["primitives"]
    return np.asarray(file.array(primitive["targets"][-1]["POSITION"]))


def _by_obj(files: Mapping[str, str | bytes], folder: Path) -> Floats:
    return from_obj(str(files["deformed.obj"]))[0] - from_obj(str(files["rest.obj"]))[0]


def _by_usd(files: Mapping[str, str | bytes], folder: Path) -> Floats:
    pxr = pytest.importorskip("pxr", reason="usd-core is not installed")
    from pxr import Usd, UsdGeom

    assert pxr
    write(files, folder)
    stage = Usd.Stage.Open(str(folder / "surface.usda"))
    points = UsdGeom.Mesh(stage.GetDefaultPrim()).GetPointsAttr()
    return np.array(points.Get()) - np.array(points.Get(0))


def _by_c(files: Mapping[str, str | bytes], folder: Path) -> Floats:
    with opened(bytes(files["body.bin"])) as body:  # type: ignore[arg-type]
        body.call("reset", 0.0)
        assert body.call("settle", 1e-10, 100_000) > 0
        return np.asarray(body.x - in_space(exported("bending").problem.mesh.nodes))


#: How a file is run, by target.
RUNS: dict[str, Callable[[Mapping[str, str | bytes], Path], Floats]] = {
    "calculix": _by_calculix,
    "mujoco": _by_mujoco,
    "warp": _by_warp,
    "gltf": _by_gltf,
    "obj": _by_obj,
    "usd": _by_usd,
    "c": _by_c,
    "npz": lambda files, folder: _by_arrays(dict(np.load(io.BytesIO(bytes(files["springs.npz"]))))),  # type: ignore[arg-type]
    "json": lambda files, folder: _by_arrays(json.loads(files["springs.json"])),
}


def test_the_page_on_export_lists_every_target_with_its_files() -> None:
    page = (Path(__file__).parents[1] / "docs/export/README.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| [")]
    for name, target in TARGETS.items():
        (row,) = [row for row in rows if f"`{name}`" in row.split("|")[1]]
        assert set(target.names) <= set(re.findall(r"`([\w.]+)`", row.split("|")[2]))


def test_every_target_is_run_or_says_why_not() -> None:
    assert RUNS.keys() == {name for name, target in TARGETS.items() if not target.unrun}


_SLOW = {"warp": pytest.mark.verification}  # its kernels are compiled


@pytest.mark.parametrize("target", [pytest.param(one, marks=[_SLOW[one]] if one in _SLOW else []) for one in RUNS])
def test_the_files_of_a_target_give_our_equilibrium_elsewhere(target: str, tmp_path: Path) -> None:
    program = {"calculix": "ccx", "c": "cc"}.get(target)
    if program is not None and shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")
    found = RUNS[target](target_files(exported("bending"), [target])[target], tmp_path)
    assert difference(found, "bending") < 1e-6


def test_models_and_targets_that_are_none_are_errors(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=r"Fem.*Springs\(rule"):
        ts.export(_pulled(), ts.Fem("linear"), "npz", tmp_path)  # type: ignore[arg-type]
    with pytest.raises(ExportError, match="did you mean 'mujoco'"):
        ts.export(_pulled(), ts.Springs("isotropic"), "mujocco", tmp_path)
    assert not list(tmp_path.iterdir())


def test_export_returns_what_it_wrote(tmp_path: Path) -> None:
    one = exported("two springs")
    files = ts.export(one.problem, network_of(one), "json", tmp_path / "new", title="VM9", probe=1)
    assert files == (tmp_path / "new" / "springs.json", tmp_path / "new" / "exported.json")
    told = json.loads(files[1].read_text(encoding="utf-8"))
    assert told["files"] == ["springs.json"] and told["target"] == "json"
    assert told["expected"]["probe_displacement"] == pytest.approx([8.63207, 4.53191], abs=1e-5)
    assert np.add(told["expected"]["applied_force"], told["expected"]["support_force"]) == pytest.approx(0, abs=1e-5)
    values = json.loads(files[0].read_text(encoding="utf-8"))
    assert values["title"] == "VM9" and values["probe"] == 1
    assert values["displacement"][1] == pytest.approx([8.63207, 4.53191], abs=1e-5)


def test_a_load_that_follows_the_body_is_not_carried_from_nowhere() -> None:
    """Its forces at full load are those on the body there, which must be known."""
    one = exported("pressed")
    unfinished = Exported(one.title, one.problem, stopped(one), one.probe, one.load_steps)
    assert unfinished.state is None
    with pytest.raises(ExportError, match="full load, which was not reached"):
        target_files(unfinished, ["json"])


def stopped(one: Exported) -> ts.Solution:
    from dataclasses import replace

    return replace(one.path, states=one.path.states[:-1], status=ts.Status.NOT_CONVERGED)


# --- the verb --------------------------------------------------------------------------------------------------------


def test_the_verb_writes_and_tells(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = str(written(tmp_path))
    assert main(["export", study, "--to", "mujoco", "--to", "npz", "--out", str(tmp_path / "out"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert set(told) == {"mujoco", "npz"}
    folder = tmp_path / "out" / "study" / "mujoco"
    assert told["mujoco"]["files"] == [str(folder / "springs.xml"), str(folder / "exported.json")]
    assert main(["solve", study, "--out", str(tmp_path / "solved"), "--json"]) == 0
    solved = json.loads(capsys.readouterr().out)
    for target, one in told.items():
        assert (one["target"], one["model"], one["status"], one["load_factor"]) == (target, "springs", "converged", 1.0)
        assert all(Path(file).stat().st_size for file in one["files"])
        assert one["probe"]["node"] == solved["probe"]["node"]
        assert one["probe"]["displacement"] == solved["models"]["springs"]["probe_displacement"]
    assert main(["export", study, "--to", "json", "--out", str(tmp_path / "out")]) == 0
    assert "has moved by" in capsys.readouterr().out


def test_a_target_that_cannot_take_the_springs_does_not_stop_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    curved = str(written(tmp_path, changed(('rule = "lloyd"', 'rule = "lloyd"\nlaw = "neo-hookean"'))))
    both = ["--to", "abaqus", "--to", "json"]
    assert main(["export", curved, *both, "--out", str(tmp_path), "--json"]) == 1
    told = capsys.readouterr()
    assert in_order(told.err, "not written", "Abaqus does not support", "force law")
    assert (tmp_path / "study" / "json" / "exported.json").exists() and not (tmp_path / "study" / "abaqus").exists()
    assert main(["export", curved, "--to", "abaqus", "--out", str(tmp_path)]) == 2
    # the same files of two targets
    assert main(["export", str(written(tmp_path)), "--to", "calculix", "--to", "abaqus", "--out", str(tmp_path)]) == 0
    assert all((tmp_path / "study" / name / "springs.inp").exists() for name in ("calculix", "abaqus"))


def test_the_verb_takes_the_springs_that_are_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    two = '[models.springs]\nkind = "springs"\nrule = "lloyd"\n'
    study = str(
        written(tmp_path, changed((two, two + "\n" + two.replace("springs]", "bulk]").replace("lloyd", "isotropic"))))
    )
    stiffness = {}
    for name in ("springs", "bulk"):
        assert main(["export", study, "--to", "json", "--model", name, "--out", str(tmp_path)]) == 0
        stiffness[name] = max(json.loads((tmp_path / "study" / "springs.json").read_text())["stiffness"])
    assert stiffness["springs"] != stiffness["bulk"]
    for name, why in (("linear", "not a springs model"), ("bulc", "did you mean 'bulk'")):
        assert main(["export", study, "--to", "json", "--model", name, "--out", str(tmp_path)]) == 2
        assert why in capsys.readouterr().err


def test_springs_that_do_not_get_there_are_written_all_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Pushed together beyond what they bear; the file tells how far they came."""
    pushed = changed(('force = ["0 N", "-0.01 N"]', 'force = ["-40 N", "0 N"]'))
    code = main(
        ["export", str(written(tmp_path, pushed)), "--to", "mujoco", "--to", "sofa", "--out", str(tmp_path), "--json"]
    )
    told = capsys.readouterr()
    assert code == 1 and "reached load factor" in told.err
    assert json.loads(told.out)["mujoco"]["status"] != "converged"
    text = (tmp_path / "study" / "mujoco" / "springs.xml").read_text(encoding="utf-8")
    if json.loads(told.out)["mujoco"]["load_factor"] < 1:
        assert "full load was not reached" in text and "Expected at full load" not in text
        assert json.loads(told.out)["mujoco"]["probe"]["displacement"] is None
    assert mujoco.MjModel.from_xml_string(text).ntendon > 0


def test_the_verb_refuses_in_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = str(written(tmp_path))
    assert main(["export", study, "--to", "mujocco", "--out", str(tmp_path)]) == 2
    assert f"allowed: {', '.join(TARGETS)}" in capsys.readouterr().err
    assert not (tmp_path / "study").exists()
    assert main(["export", "--help"]) == 0
    assert set(TARGETS) <= set(re.findall(r"[\w-]+", capsys.readouterr().out))
