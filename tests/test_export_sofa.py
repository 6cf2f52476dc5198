"""The module of forces beside a SOFA scene, run without SOFA from the written files alone, against our potentials."""

import io
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import truespring as ts
from tests.test_export_gaussian import BODIES, solved
from truespring.arrays import Floats
from truespring.exports import TARGETS, Exported, solve_springs, target_files
from truespring.exports.features import features

_STRIP = ts.rectangle(size=(0.04, 0.02), elements=(4, 2))
_MIXED = BODIES["mixed"][0]


def _of(mesh: ts.Mesh, section: Any, **rule: Any) -> Exported:
    load = ts.Force(on="right", total=(0.02, 0.03, 0.01)[: mesh.dim])
    problem = ts.Problem(mesh, ts.Material(10e3, 0.3), section, [ts.Fixed(on="left")], [load])
    return solve_springs(problem, ts.Springs(**rule), ts.Newton(load_steps=1))


#: A body of each kind of springs that SOFA has no component for.
OTHERS: dict[str, Callable[[], Exported]] = {
    "volume term": lambda: _of(ts.box((0.04, 0.02, 0.02), (2, 1, 1)), None, rule="isotropic", volume=True),
    "area term": lambda: _of(_STRIP, ts.PlaneStress(0.01), rule="isotropic", volume=True),
    "biquadratic": lambda: _of(ts.box((0.04, 0.02, 0.02), (2, 1, 1)), None, rule="biquadratic"),
    "biquadratic, mixed": lambda: _of(_MIXED, ts.PlaneStrain(0.01), rule="biquadratic"),
    "biquadratic tetrahedra": lambda: _of(
        ts.box((0.04, 0.02, 0.02), (2, 1, 1), element="tetrahedron"), None, rule="biquadratic"
    ),
    "gaussian tetrahedra": lambda: _of(
        ts.box((0.04, 0.02, 0.02), (2, 1, 1), element="tetrahedron"), None, rule="gaussian"
    ),
}
_TAKEN = TARGETS["sofa"].takes
GAUSSIAN = [name for name in BODIES if {"gent", "fibres"}.isdisjoint(name.replace(",", "").split())]


def body(name: str) -> Exported:
    one = OTHERS[name]() if name in OTHERS else solved(name)
    assert {feature for feature, _ in features(one.problem, one.springs)} <= _TAKEN
    return one


@pytest.fixture
def core(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[Exported], Any]:
    """Forces from the files that a target writes, by the module among them."""

    def load(one: Exported) -> Any:
        files = target_files(one, ["sofa"])["sofa"]
        values: dict[str, Any] = {"__name__": "truespring_forces"}
        source = str(files["truespring_forces.py"])
        assert "truespring." not in "".join(line for line in source.splitlines() if "import" in line)
        exec(compile(source, "truespring_forces.py", "exec"), values)
        with np.load(io.BytesIO(bytes(files["springs.npz"])), allow_pickle=False) as file:  # type: ignore[arg-type]
            return values["Forces"]({name: file[name] for name in file.files})

    return load


def deformed(nodes: Floats, size: float = 1.0) -> Floats:
    """Positions somewhere, no equilibrium: stretched, sheared, and each node moved a little."""
    rng, dim = np.random.default_rng(5), nodes.shape[1]
    gradient = np.eye(dim) + size * 0.3 * rng.random((dim, dim))
    return np.asarray(nodes @ gradient + size * 3e-4 * rng.random(nodes.shape))


@pytest.mark.parametrize("name", [*OTHERS, *GAUSSIAN])
def test_the_module_has_our_energy_forces_and_tangent(name: str, core: Callable[[Exported], Any]) -> None:
    one = body(name)
    potential, forces = one.path.potential, core(one)
    assert potential is not None and (forces.nodes == potential.nodes).all()
    x = deformed(potential.nodes)
    expected = potential.gradient(x)
    assert np.abs(forces.gradient(x) - expected).max() < 1e-12 * np.abs(expected).max() > 0
    assert forces.energy(x) == pytest.approx(potential.energy(x), rel=1e-11)
    rows, columns, values = forces.summed_tangent(x)
    matrix = np.zeros((x.size, x.size))
    matrix[rows, columns] = values
    wanted = potential.hessian(x).toarray()
    assert np.abs(matrix - wanted).max() < 1e-12 * np.abs(wanted).max() > 0
    rows, columns, values = forces.tangent(x)
    again = np.zeros_like(matrix)
    np.add.at(again, (rows, columns), values)
    assert np.abs(again - matrix).max() < 1e-14 * np.abs(matrix).max()


# --- the force field of the scene ------------------------------------------------------------------------------------


class Array:
    """A vector of SOFA as SofaPython3 hands it out."""

    def __init__(self, value: Floats) -> None:
        self.value = value

    @contextmanager
    def writeableArray(self) -> Iterator[Floats]:  # noqa: N802
        yield self.value


@pytest.fixture
def field(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[Exported], Any]:
    """The force field that a scene adds, with nothing of SOFA but the class that it derives from."""
    sofa, of_core = ModuleType("Sofa"), ModuleType("Sofa.Core")
    for name in ("Controller", "ForceFieldVec3d"):
        setattr(of_core, name, type(name, (), {"__init__": lambda self, **data: None}))
    sofa.Core = of_core  # type: ignore[attr-defined]
    for name, module in {"Sofa": sofa, "Sofa.Core": of_core}.items():
        monkeypatch.setitem(sys.modules, name, module)
    for name in ("Sofa.Simulation", "SofaRuntime"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, "truespring_forces", raising=False)

    def make(one: Exported) -> tuple[Any, list[tuple[Any, dict[str, Any]]]]:
        for name, content in target_files(one, ["sofa"])["sofa"].items():
            (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        scene = tmp_path / "springs_scene.py"
        values: dict[str, Any] = {"__name__": "springs_scene", "__file__": str(scene)}
        exec(compile(scene.read_text(encoding="utf-8"), str(scene), "exec"), values)
        added: list[tuple[Any, dict[str, Any]]] = []

        class Node:
            def addObject(self, kind: Any, **data: Any) -> Any:  # noqa: N802
                added.append((kind, data))
                return SimpleNamespace(**data)

            def addChild(self, name: str) -> "Node":  # noqa: N802
                return Node()

        values["createScene"](Node())
        (found,) = [kind for kind, _ in added if hasattr(kind, "addForce")]
        return found, added

    yield make
    sys.modules.pop("truespring_forces", None)


@pytest.mark.parametrize("name", ["plane stress", "cubes", "ten nodes", "area term"])
def test_the_force_field_gives_sofa_forces_and_their_derivatives(
    name: str, field: Callable[[Exported], tuple[Any, list[tuple[Any, dict[str, Any]]]]]
) -> None:
    """SOFA adds forces, k K dx and k K, with K = df/dx, three directions a node."""
    one = body(name)
    potential, (springs, _) = one.path.potential, field(one)
    assert potential is not None
    x = deformed(potential.nodes)
    n, dim = x.shape
    in_space = np.pad(x, ((0, 0), (0, 3 - dim)))
    force = Array(np.ones((n, 3)))
    springs.addForce({}, force, Array(in_space), Array(0 * in_space))
    expected = potential.gradient(x)
    assert np.abs(1 - force.value[:, :dim] - expected).max() < 1e-12 * np.abs(expected).max()
    assert (force.value[:, dim:] == 1).all()
    wanted = potential.hessian(x).toarray()
    step = np.random.default_rng(2).random((n, 3))
    change = Array(np.zeros((n, 3)))
    springs.addDForce({"kFactor": 0.5}, change, Array(step))
    product = -0.5 * wanted @ step[:, :dim].ravel()
    assert np.abs(change.value[:, :dim].ravel() - product).max() < 1e-11 * np.abs(product).max()
    entries = springs.addKToMatrix({"kFactor": 2.0}, n, 3)
    matrix = np.zeros((3 * n, 3 * n))
    np.add.at(matrix, (entries[:, 0].astype(int), entries[:, 1].astype(int)), entries[:, 2])
    inside = (np.arange(3 * n) % 3) < dim
    assert np.abs(matrix[np.ix_(inside, inside)] + 2 * wanted).max() < 1e-12 * np.abs(wanted).max()
    assert not matrix[~inside].any() and not matrix[:, ~inside].any()


@pytest.mark.parametrize(
    ("name", "material"), [("gaussian tetrahedra", "StableNeoHookean"), ("biquadratic tetrahedra", "StVenantKirchhoff")]
)
def test_tetrahedra_have_the_material_of_sofa_beside_them(
    name: str, material: str, field: Callable[[Exported], tuple[Any, list[tuple[Any, dict[str, Any]]]]]
) -> None:
    one = body(name)
    (own,) = [data for kind, data in field(one)[1] if kind == "TetrahedronHyperelasticityFEMForceField"]
    lame = one.problem.materials[0].lame
    assert own["materialName"] == material and own["ParameterSet"] == [lame.mu, lame.lam]
    x = deformed(one.problem.mesh.nodes, 1e-6)
    F = tetrahedra(one.problem.mesh, x)
    energy = {
        "StableNeoHookean": stable_neo_hookean,
        "StVenantKirchhoff": lambda F: saint_venant_kirchhoff(F, lame.lam, lame.mu),
    }[material]
    found = energy(F, lame.lam, lame.mu) if material == "StableNeoHookean" else energy(F)
    at_rest = stable_neo_hookean(np.eye(3)[None], lame.lam, lame.mu) if material == "StableNeoHookean" else 0.0
    total = float(((found - at_rest) * one.problem.mesh.measures).sum())
    assert one.path.potential is not None
    assert total == pytest.approx(one.path.potential.energy(x), rel=1e-3)


def tetrahedra(mesh: ts.Mesh, x: Floats) -> Floats:
    before, after = (np.diff(at[mesh.elements][:, [[0, 1], [0, 2], [0, 3]]], axis=2)[:, :, 0] for at in (mesh.nodes, x))
    return np.linalg.solve(before, after).swapaxes(1, 2)


def stable_neo_hookean(F: Floats, lam: float, mu: float) -> Floats:
    """SOFA's StableNeoHookean::getStrainEnergy."""
    alpha = 1 + mu / (lam + mu)
    return np.asarray((mu * ((F**2).sum(axis=(1, 2)) - 3) + (lam + mu) * (np.linalg.det(F) - alpha) ** 2) / 2)


def saint_venant_kirchhoff(F: Floats, lam: float, mu: float) -> Floats:
    E = (F.swapaxes(1, 2) @ F - np.eye(3)) / 2
    return np.asarray(mu * (E**2).sum(axis=(1, 2)) + lam / 2 * np.trace(E, axis1=1, axis2=2) ** 2)
