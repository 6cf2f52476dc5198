"""The script of Warp kernels, run by Warp on the CPU."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.exports import exported, imported, write
from tests.test_export_mujoco import body
from truespring.exports import Exported, target_files

pytestmark = pytest.mark.verification


def folder_of(one: Exported, tmp_path: Path) -> Path:
    return write(target_files(one, ["warp"])["warp"], tmp_path / "warp")


def script(folder: Path, monkeypatch: pytest.MonkeyPatch, double: bool = True) -> Any:
    pytest.importorskip("warp", reason="Warp is not installed: pip install 'truespring[warp]'")
    monkeypatch.setenv("SPRINGS_FLOAT64", str(int(double)))
    return imported(folder / "springs_warp.py")


_BODIES = ["gaussian", "gaussian, moved", "gaussian, sheet", "ten nodes", "volume term", "coupled", "force law"]


@pytest.mark.parametrize("double", [True, False])
@pytest.mark.parametrize("name", _BODIES)
def test_warp_settles_on_our_equilibrium(
    name: str, double: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = script(folder_of(body(name), tmp_path), monkeypatch, double)
    springs = module.Springs(device="cpu")
    assert springs.distance() > 0.1
    springs.settle(4.0)
    assert springs.distance() < (1e-6 if double else 1e-3)


@pytest.mark.parametrize("name", _BODIES)
def test_forces_of_kernels_are_ours(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At random positions, to rounding; of a network with rest lengths, too."""
    one = body(name)
    module = script(folder_of(one, tmp_path), monkeypatch)
    springs, potential = module.Springs(device="cpu"), one.path.potential
    assert potential is not None
    rng, dim = np.random.default_rng(4), potential.nodes.shape[1]
    x = potential.nodes @ (np.eye(dim) + 0.2 * rng.random((dim, dim))) + 4e-4 * rng.random(potential.nodes.shape)
    springs.x = springs._vectors(x)
    springs.f.zero_()
    springs.add_forces(springs.x, springs.f)
    expected = -potential.gradient(x)
    assert np.abs(springs.f.numpy()[:, :dim] - expected).max() < 1e-12 * np.abs(expected).max()
    assert not springs.f.numpy()[:, dim:].any() or dim == 3


def test_a_network_with_rest_lengths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = script(folder_of(exported("bending"), tmp_path), monkeypatch)
    springs = module.Springs(device="cpu")
    springs.settle(4.0)
    assert springs.distance() < 1e-6
    monkeypatch.setattr("sys.argv", ["springs_warp.py", "--device", "cpu", "--times", "1"])
    assert module.main() == 0


def test_leapfrog_keeps_the_energy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of elastic energy, load and motion, for some periods; the error falls with the square of the step."""
    one = body("gaussian")
    module, potential = script(folder_of(one, tmp_path), monkeypatch), one.path.potential
    assert potential is not None
    errors = []
    for factor in (0.5, 0.25):
        springs = module.Springs(device="cpu")
        totals = []
        for _ in range(40):
            springs.leapfrog(factor * springs.time_step, round(10 / factor))
            x, v, mass = springs.positions(), springs.v.numpy(), springs.mass.numpy()
            work = (springs.load.numpy() * (x - potential.nodes)).sum()
            totals.append(potential.energy(x) - work + (mass[:, None] * v**2).sum() / 2)
            largest = (mass[:, None] * v**2).sum() / 2
        assert largest > 0
        errors.append(np.ptp(totals) / max(abs(work), largest))
    assert errors[0] < 0.02 and errors[1] < 0.35 * errors[0]


def test_a_grasp_holds_and_pulls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At equilibrium the springs of the grasp carry what the body pulls with."""
    one = body("gaussian")
    module, potential = script(folder_of(one, tmp_path), monkeypatch), one.path.potential
    assert potential is not None
    springs = module.Springs(device="cpu")
    corner = potential.nodes[one.probe]
    hand = springs.grasp(corner, 1e-6)
    springs.move(hand, (0.0, 0.004, 0.0))
    springs.settle(4.0)
    x = springs.positions()
    goal = corner + np.array([0.0, 0.004, 0.0])
    pull = float(springs.grasps[hand][2].value) * (goal - x[one.probe])
    needed = potential.gradient(x)[one.probe] - one.external_force[one.probe]
    assert pull == pytest.approx(needed, rel=1e-5, abs=1e-5 * np.linalg.norm(needed))
    assert x[one.probe, 1] > corner[1] + 0.001
    with pytest.raises(ValueError, match="no node is within"):
        springs.grasp((1.0, 1.0, 1.0), 1e-3)
