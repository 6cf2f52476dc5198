"""The tables of a motion and of tools: units in the header line, numbers of the solution."""

import csv
from pathlib import Path

import pytest

import truespring as ts
from truespring.report.histories import write_histories
from truespring.report.result import Result


def tables(problem: ts.Problem, folder: Path) -> tuple[ts.Solution, dict[str, list[dict[str, str]]]]:
    path = ts.solve(problem, ts.Springs("gaussian"), ts.Newton(2))
    found = Result("fall", Path("fall.toml"), problem, {"springs": path}, 0, None, {}, 0.05, "")
    write_histories(found, folder)
    return path, {
        file.name: list(csv.DictReader(file.read_text(encoding="utf-8").splitlines())) for file in folder.glob("*.csv")
    }


def test_a_falling_body(tmp_path: Path) -> None:
    """By g t, g t^2 / 2 and m (g t)^2 / 2."""
    problem = ts.Problem(
        ts.rectangle((0.02, 0.01), (2, 1)),
        ts.Material(10e3, 0.3, density=1000.0),
        ts.PlaneStress(0.01),
        loads=[ts.Gravity((0.0, -9.81))],
        dynamics=ts.Dynamics(duration=0.02, step=0.01, record=0.01, scheme="midpoint"),
    )
    _, found = tables(problem, tmp_path)
    assert set(found) == {"motion.csv", "energies.csv"}
    last, energies = found["motion.csv"][-1], found["energies.csv"][-1]
    assert list(last) == ["model", "time [s]", "ux [m]", "uy [m]", "vx [m/s]", "vy [m/s]", "fx [N]", "fy [N]"]
    assert float(last["time [s]"]) == pytest.approx(0.02)
    assert float(last["uy [m]"]) == pytest.approx(-9.81 / 2 * 0.02**2, rel=1e-6)
    assert float(last["vy [m/s]"]) == pytest.approx(-9.81 * 0.02, rel=1e-6)
    assert float(last["fy [N]"]) == pytest.approx(-9.81 * 2e-3)
    assert float(energies["kinetic [J]"]) == pytest.approx(2e-3 / 2 * (9.81 * 0.02) ** 2, rel=1e-6)
    assert all(name in ("model", "time [s]") or name.endswith(" [J]") for name in energies)


def test_a_tool_at_rest_has_a_share_of_the_way(tmp_path: Path) -> None:
    ball = ts.Sphere("ball", 0.01, [[0, 0.01, 0.0201], [1, 0.01, 0.019]])
    mesh = ts.rectangle((0.02, 0.01), (4, 2))
    problem = ts.Problem(mesh, ts.Material(10e3, 0.3), ts.PlaneStrain(0.01), [ts.Fixed("bottom")], tools=[ball])
    path, found = tables(problem, tmp_path)
    last = found["tools.csv"][-1]
    assert list(last) == ["model", "tool", "share", "x [m]", "y [m]", "fx [N]", "fy [N]", "depth [m]"]
    assert float(last["share"]) == 1.0 and float(last["y [m]"]) == pytest.approx(0.019)
    carried = path.states[-1].reaction[path.problem.mesh.nodes[:, 1] == 0, 1].sum()
    assert float(last["fy [N]"]) == pytest.approx(carried, rel=1e-6) and carried > 0
