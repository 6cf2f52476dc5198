"""Sweeps: values, points, records, tables; nothing is lost or done twice, whatever is killed."""

import asyncio
import csv
import json
import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars
import psutil
import pytest

import truespring as ts
from tests.studies import STUDY, changed, written
from tests.sweeps import (
    cluster_of,
    finished,
    kill_group,
    records,
    sleep,
    square,
    started,
    threads,
    unclocked,
    wait_until,
    who,
    workers_of,
)
from truespring.cli import main
from truespring.errors import TruespringError
from truespring.kernels.threads import n_threads
from truespring.report.rows import table_of
from truespring.study import read_study, read_text, run, value_at
from truespring.sweeping import Failure, Pool, here, plan_sweep, run_sweep
from truespring.sweeping.figures import measured
from truespring.sweeping.here import run_here
from truespring.sweeping.store import FAILED, Store
from truespring.sweeping.sweep import _outcome, solve_point
from truespring.sweeping.table import rows_of
from truespring.sweeping.values import make_changes, read_points, read_value, read_values, read_vary

# The module, whose name in its package is that of the function.
sweeping = sys.modules["truespring.sweeping.sweep"]
FAST = changed(("load_steps = 2", "load_steps = 1"))


# --- values ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("4 kPa,8 kPa", ["4 kPa", "8 kPa"]),
        ("[8,2],[16,4]", [[8, 2], [16, 4]]),
        ("[0 N, -0.01 N]", [["0 N", "-0.01 N"]]),
        ("lloyd,isotropic", ["lloyd", "isotropic"]),
        ('true,"a, b",1e3', [True, "a, b", 1e3]),
        ('{ x = "0 mm" },left', [{"x": "0 mm"}, "left"]),
        ("pyvista:frog", ["pyvista:frog"]),
    ],
)
def test_values_are_read_as_a_study_writes_them(text: str, wanted: list[Any]) -> None:
    assert read_values("key", text) == wanted


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("0:0.45:10", np.linspace(0, 0.45, 10).round(12).tolist()),
        ("1:9:5", [1, 3, 5, 7, 9]),
        ("1:4:3", [1.0, 2.5, 4.0]),
        ("-2e-1:.2:3", [-0.2, 0.0, 0.2]),
        ("2 kPa:8 kPa:3", ["2 kPa", "5 kPa", "8 kPa"]),
        ("1:3 kg/m^3:3", ["1 kg/m^3", "2 kg/m^3", "3 kg/m^3"]),
    ],
)
def test_ranges_have_both_ends(text: str, wanted: list[Any]) -> None:
    found = read_values("key", text).values()  # type: ignore[union-attr]
    assert found == wanted and list(map(type, found)) == list(map(type, wanted))


def test_reading_one_value() -> None:
    assert read_vary("a.b=1,2") == ("a.b", [1, 2]) and read_value(" 4 kPa ") == "4 kPa"


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return written(tmp_path, FAST)


def test_the_grid_is_full(study: Path) -> None:
    found = make_changes(read_text(study), {"material.poisson": "0:0.4:3", "mesh.elements": [[8, 2], [16, 4]]})
    assert [(one["material.poisson"], one["mesh.elements"]) for one in found] == [
        (poisson, elements) for poisson in (0.0, 0.2, 0.4) for elements in ([8, 2], [16, 4])
    ]


def test_a_latin_hypercube_has_one_point_in_every_layer(study: Path) -> None:
    vary = {"material.poisson": "0:0.4", "material.young": "2 kPa:8 kPa", "models.springs.rule": "lloyd,isotropic"}
    found = make_changes(read_text(study), vary, lhs=10, seed=3)
    poisson = np.array([one["material.poisson"] for one in found])
    young = np.array([float(one["material.young"].removesuffix(" kPa")) for one in found])
    for values, (low, high) in ((poisson, (0, 0.4)), (young, (2, 8))):
        assert sorted((10 * (values - low) / (high - low)).astype(int)) == list(range(10))
    assert sorted(one["models.springs.rule"] for one in found) == ["isotropic"] * 5 + ["lloyd"] * 5
    assert (
        found
        == make_changes(read_text(study), vary, lhs=10, seed=3)
        != make_changes(read_text(study), vary, lhs=10, seed=4)
    )


def test_a_latin_hypercube_keeps_whole_what_must_be_whole(study: Path) -> None:
    found = make_changes(read_text(study), {"mesh.elements.1": "4:7", "material.young": "1:4"}, lhs=40)
    assert np.bincount([one["mesh.elements.1"] for one in found])[4:].tolist() == [10, 10, 10, 10]
    assert all(isinstance(one["material.young"], float) for one in found)


def test_points_come_from_a_table(study: Path) -> None:
    file = study.parent / "points.csv"
    file.write_text('material.young,mesh.elements\n4 kPa,"[8, 2]"\n\n8e3,"[16, 4]"\n', encoding="utf-8")
    points = read_points(file)
    assert points == [
        {"material.young": "4 kPa", "mesh.elements": [8, 2]},
        {"material.young": 8e3, "mesh.elements": [16, 4]},
    ]
    plan = plan_sweep(study, None, points=file)
    assert [one.values["material.young"] for one in plan.points.values()] == [4e3, 8e3]


@pytest.mark.parametrize(
    ("key", "value", "read"),
    [
        ("material.young", "4 kPa", lambda s: s.problem.material.young == 4e3),
        ("load.1.force", [0, 0.5], lambda s: s.problem.loading.force(s.problem.mesh.nodes).sum(0)[1] == 0.5),
        ("load.1.force.2", "-2 N", lambda s: s.problem.loading.force(s.problem.mesh.nodes).sum(0)[1] == -2),
        ("mesh.elements.1", 12, lambda s: len(s.problem.mesh.elements) == 24),
        ("solver.control", "arc-length", lambda s: type(s.solver).__name__ == "ArcLength"),
        ("compare.tolerance", 0.2, lambda s: s.tolerance == 0.2),
        ("section", {"kind": "plane-strain", "thickness": 1}, lambda s: s.problem.section.thickness == 1),
    ],
)
def test_any_key_can_have_another_value(tmp_path: Path, key: str, value: Any, read: Any) -> None:
    file = written(tmp_path, STUDY.replace('rule = "lloyd"', 'rule = "isotropic"'))
    assert not read(read_study(file)) and read(read_study(file, **{key: value}))
    assert value_at(read_text(file).keys({key: value}), "load.1.on") == "right"


@pytest.mark.parametrize(
    ("vary", "told"),
    [
        (["material.young"], "KEY=VALUES"),
        (["=3"], "is not a key"),
        (["material.yung=1,2"], "did you mean 'young'"),
        (["materal.young=1,2"], "did you mean 'material'"),
        (["models.sprngs.rule=lloyd"], "did you mean 'springs'"),
        (["load.2.force=[0,1]"], "no entry 2: the list has 1, counted from 1"),
        (["load.0.force=[0,1]"], "counted from 1"),
        (["load.force=[0,1]"], "load.1.force"),
        (["material.young.1=3"], "not follow a list"),
        (["material.young.x=3"], "not a table"),
        (["material.young=4 kPa,4 kg"], "point 2 (material.young = 4 kg): "),
        (["material.young=4 kPa,4 kg"], "study.toml:9: material.young: '4 kg' is in kilogram, not in Pa"),
        (["material.young=1,,2"], "material.young = '1,,2'"),
        (["material.young="], "material.young = ''"),
        (["mesh.elements=[8,2],[8.5,2]"], "point 2 (mesh.elements = [8.5, 2])"),
        (["material.poisson=0:0.4"], "0:0.4:5"),
        (["material.poisson=0:0.4:1"], "at least 2 values"),
        (["material.young=1 kPa:2:3"], "'kPa' and ''"),
        (["models.springs.rule=lloyd,loyd"], "did you mean 'lloyd'"),
        (["material.young=1", "material.young=2"], "given twice"),
        (["mesh.elements=[8,2]", "mesh.elements.1=8"], "both varied"),
        (["material.poisson=0:0.4:2000", "material.young=1:2:2000"], "more than 1,000,000"),
        ([], "nothing is varied"),
        (["material.young=1,2", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"], "--workers"),
        (["material.young=1,2", "--points", "there.csv"], "give one of them"),
    ],
)
def test_what_is_wrong_is_said_before_anything_is_solved(
    study: Path, vary: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments: list[str] = []
    for one in vary:
        plain = one.startswith("--") or (arguments and arguments[-1] in ("--workers", "--scheduler", "--points"))
        arguments += [one] if plain else ["--vary", one]
    assert main(["sweep", str(study), *arguments, "--out", str(study.parent / "out")]) == 2
    assert told in capsys.readouterr().err
    assert not list((study.parent / "out").glob("points/*.json"))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("material.young\n", "points.csv has no points"),
        ("material.young,material.young\n1,2\n", ":1: material.young"),
        ("material.young,material.poisson\n1,0.3\n1\n", ":3: 1 values for 2 keys"),
        ("material.young,material.poisson\n1,\n", ":2: material.poisson has no value"),
        ("material.young\n4 kg\n", "point 1 (material.young = 4 kg)"),
    ],
)
def test_a_faulty_table_of_points_is_refused(study: Path, text: str, told: str) -> None:
    file = study.parent / "points.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(TruespringError) as error:
        plan_sweep(study, None, points=file)
    assert told in str(error.value)


# --- records and tables ---------------------------------------------------------------------------


def names(study: Path, values: str = "4 kPa,8 kPa") -> list[str]:
    return list(plan_sweep(study, {"material.young": values}).points)


def test_a_point_is_known_by_all_that_its_result_depends_on(tmp_path: Path) -> None:
    (tmp_path / "nodes.csv").write_text("x,y\n0,0\n1,0\n", encoding="utf-8")
    study = written(tmp_path, FAST)
    first = names(study)
    assert len(set(first)) == 2
    assert names(study, "4000,8e3") == first, "4 kPa and 4000 Pa are one value"
    assert names(written(tmp_path, f"# a comment\n{FAST}")) == first
    assert not set(names(written(tmp_path, FAST.replace("0.3", "0.31")))) & set(first)
    # A file that the study names is a part of it, whatever key it stands at.
    study = written(tmp_path, FAST.replace('title = "A small cantilever"', 'title = "nodes.csv"'))
    before = names(study)
    (tmp_path / "nodes.csv").write_text("x,y\n0,0\n2,0\n", encoding="utf-8")
    assert not set(names(study)) & set(before)


def test_points_that_are_given_twice_are_solved_once(study: Path) -> None:
    plan = plan_sweep(study, {"material.young": ["4 kPa", 4000, "5 kPa"]})
    assert len(plan.points) == 2 and plan.n_twice == 1


def test_records_are_whole_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path)
    store.write({"point": "a", "status": "converged"})

    def killed(handle: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", killed)
    for name in ("a", "b"):
        with pytest.raises(KeyboardInterrupt):
            store.write({"point": name, "status": "failed"})
    assert list(store.read()) == [{"point": "a", "status": "converged"}]
    (tmp_path / "points" / "c.json").write_text('{"point": "c", "sta', encoding="utf-8")
    (tmp_path / "points" / "d.json").write_text('{"point": "a", "status": "converged"}', encoding="utf-8")
    assert [record["point"] for record in Store(tmp_path).read()] == ["a"]


def test_rows_are_sorted_and_columns_complete() -> None:
    def record(values: dict[str, Any], models: dict[str, Any] | None) -> dict[str, Any]:
        summary = models and {"models": models, "comparison": {"fem": {"rms_error": 0.1}}, "closest": "fem"}
        return {"values": values, "status": "converged", "reason": None, "summary": summary}

    made = [
        record({"a": 10, "b": [16, 4]}, {"springs": {"status": "converged", "force": [1.0, 2.0]}}),
        record({"a": 9, "b": [8, 2]}, None),
        record({"a": 10, "b": [8, 2]}, {"springs": {"status": "converged", "force": [1.0, 3.0]}}),
    ]
    rows = rows_of(["a", "b"], made)
    assert [(row["a"], row["b"]) for row in rows] == [(9, [8, 2]), (10, [8, 2]), (10, [16, 4])]
    assert len({tuple(row) for row in rows}) == 1 and rows[0]["models.springs.force.y"] is None
    table = table_of(rows)
    assert table["b"].to_list() == ["[8, 2]", "[8, 2]", "[16, 4]"]
    assert table["models.springs.force.y"].to_list() == [None, 3.0, 2.0]


# --- the pool -------------------------------------------------------------------------------------


@pytest.mark.verification
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="signals of POSIX")
def test_whatever_dies_no_point_is_lost() -> None:
    """A point that kills its workers, or fails, does so alone; workers and schedulers that are killed cost none."""
    said: list[str] = []
    with Pool(1, note=said.append) as pool:
        found = dict(pool.run({str(number): number for number in range(9)}, square))
        assert "killed" in found.pop("3").reason
        assert found.pop("4") == Failure("ValueError: four") and found.pop("5") == Failure("five")
        assert found == {str(number): number**2 for number in (0, 1, 2, 6, 7, 8)}
        wait_until(lambda: len(pool.pids) == 2)
        assert refuses_whoever_has_no_key(pool)
        scheduler, worker = pool.pids
        done = []
        for key, pid in pool.run({number: number for number in range(40)}, who):
            done.append((key, pid))
            if len(done) == 5:
                os.kill(worker, signal.SIGKILL)
            if len(done) == 20:
                os.kill(scheduler, signal.SIGKILL)
        assert sorted(key for key, _ in done) == list(range(40)), "each once"
        assert worker not in {pid for _, pid in done[20:]} and len({pid for _, pid in done}) >= 3
        assert len(said) == 1 and "the scheduler died" in said[0]
        ((_, (ours, blas, around)),) = pool.run({0: 0}, threads)
        assert ours == blas == 1 and around["NUMBA_NUM_THREADS"] == around["OPENBLAS_NUM_THREADS"] == "1"


def refuses_whoever_has_no_key(pool: Pool) -> bool:
    """Whoever could connect to a scheduler or worker could run code as the user who sweeps."""
    from distributed import Security

    scheduler = psutil.Process(pool.pids[0])
    listening = {
        connection.laddr.port
        for process in (scheduler, *scheduler.children(recursive=True))
        for connection in process.net_connections()
        if connection.status == psutil.CONN_LISTEN
    }
    address = pool._cluster.address if pool._cluster else ""
    assert address.startswith("tls://") and int(address.rpartition(":")[2]) in listening and len(listening) > 2
    other: Any = Security.temporary()  # type: ignore[no-untyped-call]
    foreign = [
        (f"{scheme}://127.0.0.1:{port}", None if scheme == "tcp" else other)
        for port in listening
        for scheme in ("tcp", "tls")
    ]
    assert pool._cluster and asyncio.run(takes(address, pool._cluster.security, 20))

    async def any_takes() -> bool:
        return any(await asyncio.gather(*(takes(*one, 3) for one in foreign)))

    return not asyncio.run(any_takes())


async def takes(address: str, security: Any, patience: float) -> bool:
    """Whether a scheduler or worker takes a connection; one that does not answer within `patience` [s] does not."""
    from distributed.comm import connect

    arguments = security.get_connection_args("client") if security else {}
    try:
        comm = await asyncio.wait_for(connect(address, timeout=patience, **arguments), patience)
    except OSError:  # also where the time is up
        return False
    comm.abort()
    return True


def test_a_point_that_takes_too_long_fails(study: Path) -> None:
    (point,) = plan_sweep(study, {"material.poisson": [0.25]}).points.values()
    found = solve_point((read_text(study), point), 1e-9)
    assert all(any("--timeout" in one for one in model["warnings"]) for model in found["models"].values())
    assert _outcome(found)["status"] == FAILED


@pytest.mark.verification
def test_a_point_that_never_comes_back_is_killed() -> None:
    with Pool(1, timeout=0.2) as pool:
        assert "more memory or time" in dict(pool.run({60: 60}, sleep))[60].reason


def test_a_scheduler_that_is_not_there_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    for address, told in (("tcp://127.0.0.1:9", "no Dask scheduler answers"), ("nonsense://x:1", "is not an address")):
        monkeypatch.setattr("truespring.sweeping.pool.FIRST_PATIENCE", 1.0)
        with pytest.raises(TruespringError, match=told):
            Pool(scheduler=address)


def test_what_is_missing_is_named(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(TruespringError, match=r"pip install 'truespring\[sweep\]'"):
        ts.sweep(study, {"material.young": [1e3]})


# --- in this process ------------------------------------------------------------------------------


def test_points_are_solved_here_until_workers_are_faster(monkeypatch: pytest.MonkeyPatch) -> None:
    points = {number: number for number in (0, 1, 4, 5, 6)}
    monkeypatch.setattr(here, "START", math.inf)
    assert list(run_here(points, square, workers=2, threads=1)) == [
        (0, 0),
        (1, 1),
        (4, Failure("ValueError: four")),
        (5, Failure("five")),
        (6, 36),
    ]
    monkeypatch.setattr(here, "START", 0.0)
    assert dict(run_here(points, square, workers=2, threads=1)) == {0: 0, 1: 1}
    assert len(list(run_here(points, square, workers=1, threads=1))) == 5, "one worker is never faster"
    before = n_threads()
    ((_, (ours, blas, _)),) = run_here({0: 0}, threads, workers=2, threads=1)
    assert ours == blas == 1 and n_threads() == before


def test_a_small_sweep_starts_no_workers(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = plan_sweep(study, {"mesh.elements": [[8, 2], [9, 2]], "material.poisson": [0.1, 0.2]})
    given: list[str] = []

    class Recorded(Pool):
        def __init__(self, *_: object, **__: object) -> None:
            pass

        def close(self) -> None:
            pass

        def run(self, points: Any, task: Any) -> Any:
            given.extend(points)
            return ((name, Failure("not solved here")) for name in points)

    monkeypatch.setattr(sweeping, "Pool", Recorded)
    small = run_sweep(plan, study.parent / "small")
    assert not given and [row["status"] for row in small.rows] == ["converged", "converged", "failed", "failed"]
    for name, more in (("timeout", {"timeout": 60.0}), ("scheduler", {"scheduler": "tcp://127.0.0.1:9"})):
        run_sweep(plan, study.parent / name, **more)  # type: ignore[arg-type]
        assert sorted(given) == sorted(plan.points)
        given.clear()
    monkeypatch.setattr(sweeping, "_MOST_ELEMENTS", 17)  # [9, 2] has 18
    run_sweep(plan, study.parent / "large")
    assert len(given) == 2


def test_an_interrupted_sweep_keeps_what_was_solved(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = plan_sweep(study, {"material.poisson": [0.1, 0.2, 0.3]})
    solved: list[object] = []

    def interrupted(job: Any) -> Any:
        if len(solved) == 2:
            raise KeyboardInterrupt
        solved.append(job)
        return solve_point(job)

    monkeypatch.setattr(sweeping, "solve_point", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_sweep(plan, study.parent / "out", workers=1)
    assert len(records(study.parent / "out")) == 2
    monkeypatch.undo()
    assert run_sweep(plan, study.parent / "out", workers=1).n_before == 2


# --- sweeps ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A scheduler and two workers, started as processes of their own; the scheduler's address."""
    folder = tmp_path_factory.mktemp("dask")
    file = folder / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    quiet: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    scheduler = ["scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
    worker = ["worker", "--scheduler-file", str(file), "--nthreads", "1", "--no-dashboard"]
    processes = [subprocess.Popen([*dask, *scheduler], **quiet)]
    processes += [
        subprocess.Popen([*dask, *worker, "--local-directory", str(folder / name)], **quiet) for name in ("a", "b")
    ]
    try:
        wait_until(lambda: file.exists() and file.read_text(encoding="utf-8").endswith("}"))
        yield json.loads(file.read_text(encoding="utf-8"))["address"]
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            process.wait(20)


VARY = ["--vary", "material.poisson=0:0.4:3", "--vary", "mesh.elements=[8,2],[9,2]"]


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], str]:
    """A sweep of six points, three of which fail, for the rule lloyd requires squares; what it printed and said."""
    folder = tmp_path_factory.mktemp("sweep")
    process = started(written(folder, FAST), *VARY, "--out", folder / "out", "--json", "--workers", 1)
    told, errors = process.communicate(timeout=120)
    assert process.returncode == 1, errors
    return folder, json.loads(told), errors


def test_a_failed_point_is_recorded_and_the_rest_goes_on(swept: tuple[Path, dict[str, Any], str]) -> None:
    folder, told, errors = swept
    assert (told["n_points"], told["n_failed"], told["n_before"]) == (6, 3, 0)
    for row in told["rows"]:
        failed = row["mesh.elements"] == [9, 2]
        assert row["status"] == ("failed" if failed else "converged")
        assert ("requires squares" in row["reason"]) if failed else row["reason"] is None
    assert errors.count("requires squares") == 3
    assert len(records(folder / "out")) == 6


def test_the_table_has_the_figures_of_the_summary(swept: tuple[Path, dict[str, Any], str]) -> None:
    folder, told, _ = swept
    (row,) = [one for one in told["rows"] if (one["mesh.elements"], one["material.poisson"]) == ([8, 2], 0.2)]
    result = run(read_study(folder / "study.toml", **{"material.poisson": 0.2}))
    springs, one = result.solutions["springs"], result.comparisons["linear"]
    last = springs.states[-1]
    assert row["comparison.linear.rms_error"] == pytest.approx(one.rms_error, rel=1e-9)
    assert row["models.springs.energy"] == pytest.approx(last.energy, rel=1e-9)
    assert row["models.springs.probe_displacement.y"] == pytest.approx(last.displacement[result.probe, 1], rel=1e-9)
    assert row["models.springs.force.y"] == pytest.approx(-0.01) and row["closest"] == "linear"
    assert row["models.springs.young"] == pytest.approx(springs.moduli.young())  # type: ignore[union-attr]
    with (folder / "out" / "sweep.csv").open(newline="", encoding="utf-8") as stream:
        lines = list(csv.DictReader(stream))
    assert list(lines[0]) == list(row) and [float(line["material.poisson"]) for line in lines] == [
        0,
        0,
        0.2,
        0.2,
        0.4,
        0.4,
    ]
    table = polars.read_parquet(folder / "out" / "sweep.parquet")
    assert table.columns == list(row)
    for column in ("material.poisson", "models.springs.load_factor", "comparison.linear.max_error"):
        assert table[column].to_list() == [one[column] for one in told["rows"]]


def test_displacement_and_force_are_drawn_where_they_vary() -> None:
    def row(young: float, moved: float, force: float) -> dict[str, Any]:
        at_probe = {"models.a.probe_displacement.x": 3 * moved, "models.a.probe_displacement.y": 4 * moved}
        forces = {"models.a.force.x": 0.0, "models.a.force.y": force}
        return {"material.young": young, "status": "converged", **at_probe, **forces, "comparison.b.rms_error": 0.1}

    loaded = list(measured([row(1e3, 2e-3, -5.0), row(2e3, 1e-3, -5.0)]))
    assert [(one.title, one.label) for one in loaded] == [
        ("Displacement of the probe", "displacement [mm]"),
        ("Rms error", "rms error [%]"),
    ]
    assert loaded[0].values == {"a": [pytest.approx(10.0), pytest.approx(5.0)]}
    moved = list(measured([row(1e3, 2e-3, 5.0), row(2e3, 2e-3, 10.0)]))
    assert [one.title for one in moved] == ["Force", "Rms error"] and moved[0].values == {"a": [5.0, 10.0]}


def test_the_page_loads_nothing(swept: tuple[Path, dict[str, Any], str]) -> None:
    page = (swept[0] / "out" / "report.html").read_text(encoding="utf-8")
    assert "3 of 6 points failed" in page and page.count("requires squares") == 3
    assert "http://" not in page.replace("http://www.w3.org", "") and "https://" not in page
    assert "data:image/svg+xml" in page and "--vary &#39;mesh.elements=[8,2],[9,2]&#39;" in page


def test_what_is_done_is_not_done_twice(swept: tuple[Path, dict[str, Any], str]) -> None:
    folder, told, _ = swept
    plan = plan_sweep(folder / "study.toml", {"material.poisson": "0:0.4:3", "mesh.elements": "[8,2],[9,2]"})
    before = records(folder / "out")
    again = run_sweep(plan, folder / "out", scheduler="nobody is asked")
    assert again.n_before == 6 and again.rows == told["rows"] and records(folder / "out") == before
    # What failed, and that alone, is tried again where that is asked for.
    failed = {name for name, record in again.records.items() if record["status"] == "failed"}
    retried = run_sweep(plan, folder / "out", workers=1, retry_failed=True)
    now = records(folder / "out")
    assert retried.n_before == 3 and {name for name in now if now[name] != before[name]} == failed
    assert retried.rows == told["rows"]


def test_a_changed_study_starts_anew_and_says_so(swept: tuple[Path, dict[str, Any], str], tmp_path: Path) -> None:
    folder = swept[0]
    before = records(folder / "out")
    plan = plan_sweep(
        written(tmp_path, FAST.replace("-0.01", "-0.02")), {"material.poisson": [0.0], "mesh.elements": [[8, 2]]}
    )
    said: list[str] = []
    done = run_sweep(plan, folder / "out", workers=1, note=said.append)
    assert done.n_before == 0 and done.rows[0]["comparison.linear.rms_error"] is not None
    assert "has changed since 6 results" in said[0]
    now = records(folder / "out")
    assert all(now[name] == before[name] for name in before) and len(now) == len(before) + 1
    for name in set(now) - set(before):  # as it was, for the other tests
        (folder / "out" / "points" / f"{name}.json").unlink()


def test_a_file_that_changes_meanwhile_fails_its_points(tmp_path: Path) -> None:
    (tmp_path / "named.csv").write_text("1", encoding="utf-8")
    plan = plan_sweep(written(tmp_path, f'title = "named.csv"\n{FAST.split(chr(10), 1)[1]}'), {"material.young": [5e3]})
    (point,) = plan.points.values()
    assert solve_point((plan.text, point))["models"]["springs"]["status"] == "converged"
    (tmp_path / "named.csv").write_text("2", encoding="utf-8")
    with pytest.raises(TruespringError, match=r"named\.csv: .*changed"):
        solve_point((plan.text, point))


@pytest.mark.verification
def test_any_cluster_will_do(cluster: str, study: Path) -> None:
    vary = {"material.poisson": "0:0.4:5"}
    with Pool(scheduler=cluster) as pool:
        wait_until(lambda: len(pool._client.scheduler_info()["workers"]) == 2)
        pids = {pid for _, pid in pool.run({number: number for number in range(20)}, who)}
        assert len(pids) == 2 and os.getpid() not in pids and pool.pids == ()
    theirs = ts.sweep(study, vary, scheduler=cluster).table()
    # Here, without any cluster.
    for row in theirs.iter_rows(named=True):
        here = run(read_study(study, **{"material.poisson": row["material.poisson"]}))
        assert row["comparison.linear.rms_error"] == pytest.approx(here.comparisons["linear"].rms_error, rel=1e-9)
    assert theirs["material.poisson"].to_list() == [0.0, 0.1, 0.2, 0.3, 0.4]


# --- killed ---------------------------------------------------------------------------------------


@pytest.mark.verification
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="signals of POSIX")
def test_a_sweep_that_is_killed_goes_on_where_it_stopped(study: Path) -> None:
    out, undisturbed = study.parent / "out", study.parent / "undisturbed"
    told = [study, "--vary", "material.poisson=0:0.45:6", "--vary", "mesh.elements=[8,2],[16,4]"]
    told += ["--workers", 1, "--out", out, "--json"]
    sweep = started(*told, "--timeout", 60)  # with a time limit points are solved by workers
    wait_until(lambda: len(list(out.glob("points/*.json"))) >= 3)
    children = psutil.Process(sweep.pid).children(recursive=True)
    sweep.kill()  # it alone, and without a warning
    sweep.communicate()
    _, alive = psutil.wait_procs(children, timeout=60)
    assert len(children) >= 2 and not alive, "workers end with their sweep"
    before = records(out)
    assert 3 <= len(before) < 12
    found = finished(started(*told))
    now = records(out)
    assert found["n_before"] == len(before), "what was solved counts"
    assert all(now[name] == before[name] for name in before), "and is not solved again"
    plan = plan_sweep(study, {"material.poisson": "0:0.45:6", "mesh.elements": [[8, 2], [16, 4]]})
    assert set(now) == set(plan.points)
    wanted = run_sweep(plan, undisturbed, workers=1)
    assert unclocked(found["rows"]) == unclocked(wanted.rows), "the results are those of an undisturbed run"


@pytest.mark.verification
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="process groups of POSIX")
def test_a_machine_that_fails_loses_nothing(tmp_path: Path) -> None:
    """All processes are killed at once, over and over at random moments, until the sweep is done."""
    random = np.random.default_rng()
    told = [written(tmp_path, STUDY), "--vary", "material.poisson=0:0.45:40", "--vary", "mesh.elements=[32,8]"]
    before: dict[str, tuple[int, int]] = {}
    for _ in range(6):  # of 40 points at most 6 times 5, and what is solved while it is killed
        sweep = started(*told, "--out", tmp_path / "out")
        wanted_now = len(before) + int(random.integers(0, 4))
        wait_until(lambda at=wanted_now: len(list((tmp_path / "out").glob("points/*.json"))) >= at, 300)  # type: ignore[misc]
        assert sweep.poll() is None, "it runs, and is killed"
        kill_group(sweep)
        assert sweep.returncode == -signal.SIGKILL
        now = records(tmp_path / "out")
        assert all(now[name] == before[name] for name in before)
        before = now
    found = finished(started(*told, "--out", tmp_path / "out", "--json"))
    wanted = finished(started(*told, "--out", tmp_path / "undisturbed", "--json"))
    assert found["n_before"] == len(before) < 40 and unclocked(found["rows"]) == unclocked(wanted["rows"])


@pytest.mark.verification
def test_workers_are_started_again_however_they_end() -> None:
    with Pool(1) as pool:
        for _ in range(2):  # the second dies as it starts
            wait_until(lambda: bool(workers_of(os.getpid())))
            worker = workers_of(os.getpid())[0]
            worker.kill()
            wait_until(lambda gone=worker: not gone.is_running())  # type: ignore[misc]
        assert dict(pool.run({2: 2}, square)) == {2: 4}
        pool._client.retire_workers(close_workers=True)  # it takes its leave, and whoever watches over it as well
        assert dict(pool.run({2: 2}, square)) == {2: 4}


@pytest.mark.verification
def test_a_scheduler_of_others_is_waited_for(tmp_path: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    quiet: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    running: list[subprocess.Popen[bytes]] = []

    def start() -> None:
        dask = [sys.executable, "-m", "dask"]
        listening = ["scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
        running.append(subprocess.Popen([*dask, *listening], **quiet))
        working = ["worker", address, "--nthreads", "1", "--no-dashboard", "--local-directory", str(tmp_path)]
        running.append(subprocess.Popen([*dask, *working], **quiet))

    def end() -> None:
        for process in running:
            process.kill()
            process.wait()
        running.clear()

    said: list[str] = []
    start()
    try:
        with Pool(scheduler=address, note=said.append) as pool:
            done = []
            for key, _ in pool.run({number: number for number in range(60)}, who):
                done.append(key)
                if len(done) == 5:
                    end()
                    start()
            assert sorted(done) == list(range(60)) and "is lost" in said[-1]
            pool.patience = 1.0
            with pytest.raises(TruespringError, match="solved points are kept"):
                for number, _ in enumerate(pool.run({number: number for number in range(60)}, who)):
                    if number == 5:
                        end()
    finally:
        end()


@pytest.mark.verification
def test_two_hundred_points_whose_workers_and_scheduler_are_killed(tmp_path: Path) -> None:
    """One of two workers every three seconds, the scheduler once: the results are those of an undisturbed run."""
    study = written(tmp_path, STUDY)
    vary = [study, "--vary", "material.poisson=0:0.45:40", "--vary", "load.1.force.2=-0.002:-0.01:5", "--workers", 2]
    vary += ["--vary", "mesh.elements=[48,12]", "--timeout", 600]
    wanted = finished(started(*vary, "--out", tmp_path / "undisturbed", "--json"))
    sweep = started(*vary, "--out", tmp_path / "out", "--json")
    killed, schedulers, seen, due = 0, 0, 0, 0.0
    while sweep.poll() is None and (done := len(list((tmp_path / "out").glob("points/*.json")))) < 200:
        time.sleep(0.1)
        if done == seen or time.monotonic() < due:  # where all is slow, some points are solved between
            continue
        seen, due = done, time.monotonic() + 3.0
        scheduler, workers = cluster_of(sweep.pid), workers_of(sweep.pid)
        if done > 60 and not schedulers and scheduler is not None:
            scheduler.kill()
            schedulers += 1
        elif workers:
            workers[killed % len(workers)].kill()
            killed += 1
    found = finished(sweep)
    assert killed >= 3 and schedulers == 1, "it was disturbed"
    assert found["n_points"] == len(records(tmp_path / "out")) == 200 and not found["n_failed"]
    assert unclocked(found["rows"]) == unclocked(wanted["rows"])


@pytest.mark.parametrize("workers", [0, -3])
def test_without_workers_nothing_is_solved(workers: int) -> None:
    with pytest.raises(ts.TruespringError, match=f"workers = {workers}"):
        ts.sweep("examples/bending.toml", {"material.young": ["1 kPa"]}, workers=workers)
