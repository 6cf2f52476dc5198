"""The logger `truespring`: silent by itself, with messages of each solution and iteration if asked for."""

import logging
import subprocess
import sys

import pytest

import truespring as ts


@pytest.fixture
def problem() -> ts.Problem:
    return ts.Problem(
        mesh=ts.rectangle(size=(0.04, 0.01), elements=(4, 1)),
        material=ts.Material(young=10e3, poisson=0.3),
        section=ts.PlaneStress(thickness=0.01),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.1, 0.0))],
    )


def test_a_solution_is_a_message_with_status_levels_and_time(
    problem: ts.Problem, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "truespring")
    path = ts.solve(problem, ts.Springs(rule="lloyd"), ts.Newton(load_steps=3))
    first, *more = caplog.messages
    assert first.startswith(f"{path.label}: converged, load factor 1, 4 levels, {path.newton_iterations} Newton")
    assert more == [f"{path.label}: warning: {warning}" for warning in path.warnings] and more
    assert {record.name for record in caplog.records} == {"truespring.equilibrium"}


def test_each_iteration_is_a_message_of_level_debug(problem: ts.Problem, caplog: pytest.LogCaptureFixture) -> None:
    seen: list[tuple[float, int, float]] = []
    caplog.set_level(logging.DEBUG, "truespring")
    path = ts.solve(problem, ts.Springs(rule="lloyd"), progress=lambda *one: seen.append(one))
    found = [record.args for record in caplog.records if record.levelno == logging.DEBUG]
    assert found == [(path.label, *one) for one in seen] and len(found) >= path.newton_iterations


def test_without_a_handler_nothing_is_written() -> None:
    code = "import truespring, logging; logging.getLogger('truespring').warning('not seen')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == done.stderr == ""
