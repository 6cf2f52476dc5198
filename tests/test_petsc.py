"""Bodies that processes share: pieces against the whole, and PETSc against factorisations, on one process and two."""

import importlib.util
import json
import os
import pickle
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truespring as ts
from tests.test_linear import ILL_CONDITIONED, block, cantilever
from tests.test_potentials import CASES, LATER, deformed, potential_of
from truespring import linear
from truespring import ranks as ranks_module
from truespring.arrays import Floats
from truespring.cli import main
from truespring.cli.launch import launch
from truespring.errors import ModelError, ProblemError
from truespring.kernels import threads, vectors
from truespring.linear import choice, petsc
from truespring.linear.gradients import IndefiniteError, SlowError, conjugate_gradients, lowest_eigenvalue, norm
from truespring.piecewise import Piece, Piecewise, own_rows
from truespring.ranks import Layout, OneProcess, Processes, bisected
from truespring.solvers.balance import Balance, Watch
from truespring.solvers.line_search import descend

INSTALLED = all(importlib.util.find_spec(name) for name in ("petsc4py", "mpi4py"))
needs_petsc = pytest.mark.skipif(not INSTALLED, reason="petsc4py is not installed, see docs/large.md")
needs_mpiexec = pytest.mark.skipif(not (INSTALLED and shutil.which("mpiexec")), reason="needs petsc4py and mpiexec")

# --- pieces of a potential, without MPI ---------------------------------------------------------------


class Rank(OneProcess):
    """One of several processes that exchange nothing."""

    def __init__(self, rank: int, size: int) -> None:
        self.rank, self.size = rank, size  # type: ignore[misc]


def pieces(name: str, size: int) -> list[Piece]:
    model, problem = CASES[name].model, CASES[name].problem
    assert model is not None and problem is not None
    summed = model.on_pieces(problem)
    assert summed is not None
    owner = bisected(problem.mesh.nodes, size)
    return [Piece(summed, problem, Layout(Rank(rank, size), owner)) for rank in range(size)]


DIVISIBLE = [
    name
    for name, case in CASES.items()
    if case.model is not None and case.problem is not None and case.model.on_pieces(case.problem) is not None
]
# One case of each kind of model and element is held every time, all others in verification.
EVERY_TIME = {
    (case.model.kind, str(getattr(case.model, "rule", "")), case.problem.mesh.element): name
    for name, case in reversed(CASES.items())
    if name in DIVISIBLE and name not in LATER and case.model is not None and case.problem is not None
}.values()


@pytest.mark.parametrize(
    "name",
    [name if name in EVERY_TIME else pytest.param(name, marks=pytest.mark.verification) for name in DIVISIBLE],
)
def test_pieces_add_up_to_the_whole(name: str) -> None:
    whole, parts = potential_of(name), pieces(name, 3)
    positions = deformed(whole.nodes, 31)
    assert sum(part.energy(positions) for part in parts) == pytest.approx(whole.energy(positions), rel=1e-12)
    force, tangent = whole.gradient(positions), whole.hessian(positions).toarray()
    assert np.abs(sum(part.gradient(positions) for part in parts) - force).max() <= 1e-12 * np.abs(force).max()
    size = np.abs(tangent).max()
    assert np.abs(sum(part.hessian(positions).toarray() for part in parts) - tangent).max() <= 1e-12 * size
    projected = whole.projected_hessian(positions).toarray()  # type: ignore[attr-defined]
    assert np.abs(sum(part.projected_hessian(positions).toarray() for part in parts) - projected).max() <= 1e-12 * size
    # The geometric part of another state's stress, extrapolated along a step.
    step = 0.1 * deformed(whole.nodes, 32)
    of_whole = whole.hessian(positions, whole.extrapolated_stress(whole.nodes, step))  # type: ignore
    mixed = [part.hessian(positions, part.extrapolated_stress(whole.nodes, step)).toarray() for part in parts]
    assert np.abs(sum(mixed) - of_whole.toarray()).max() <= 1e-11 * np.abs(of_whole.data).max()
    # Each row belongs to one piece.
    rows = np.array([np.diff(part.hessian(positions).indptr) > 0 for part in parts])
    assert (rows.sum(axis=0) == 1).all()


def test_defaults_of_the_whole_mesh_hold_on_pieces() -> None:
    """A block is no stepped body, and parts of it with ghost elements may be one."""
    mesh = ts.box((2, 2, 1), (4, 4, 2))
    stiff = ts.Region(np.arange(6), ts.Material(1e5, 0.1))  # type: ignore[arg-type]
    problem = cantilever(mesh, 1.0, regions=[stiff])
    owner = bisected(mesh.nodes, 5)
    positions = deformed(mesh.nodes, 4, 0.02)
    for model in (ts.Springs("gaussian"), ts.Fem("neo-hookean"), ts.Springs("isotropic")):
        summed = model.on_pieces(problem)
        assert summed is not None
        force = model.potential(problem).gradient(positions)
        parts = [Piece(summed, problem, Layout(Rank(rank, 5), owner)).gradient(positions) for rank in range(5)]
        assert np.abs(sum(parts) - force).max() <= 1e-12 * np.abs(force).max()


def test_the_nodes_are_bisected_evenly_and_pieces_have_few_ghosts() -> None:
    problem = cantilever(ts.box((4, 1, 1), (32, 8, 8)), 1.0)
    for size in (1, 2, 3, 7):
        owner = bisected(problem.mesh.nodes, size)
        counts = np.bincount(owner, minlength=size)
        assert counts.sum() == len(owner) and counts.max() - counts.min() <= np.log2(size) + 1
        layout = Layout(Rank(size - 1, size), owner)
        assert np.array_equal(np.sort(layout.numbers), np.arange(len(owner)))
        assert np.array_equal(np.diff(layout.numbers[layout.owned]), np.ones(len(layout.owned) - 1))
    halves = [
        Piece(ts.Fem("linear", "linear"), problem, Layout(Rank(r, 2), bisected(problem.mesh.nodes, 2))) for r in (0, 1)
    ]
    assert sum(half.n_elements - half.n_ghosts for half in halves) == len(problem.mesh.elements)
    assert 0 < max(half.n_ghosts for half in halves) <= 2 * 8 * 8


@pytest.mark.parametrize(
    "model",
    [
        ts.Fem("neo-hookean", "quadratic"),
        ts.Springs("gaussian", element="quadratic"),
        ts.Springs("lloyd", sharing="single"),
        ts.Springs("lloyd", volume=True),
        ts.MassTensor("linear"),
    ],
)
def test_models_without_a_sum_over_elements_of_first_order_need_one_process(model: Any) -> None:
    problem = cantilever(ts.rectangle((2, 1), (4, 2), "triangle"), 0.1)
    with pytest.raises(ModelError, match=r"several processes need .* start one process"):
        Piecewise(model, problem, Rank(0, 2))
    with pytest.raises(ModelError, match="cannot be shared among 99 processes"):
        Piecewise(ts.Springs("lloyd"), problem, Rank(0, 99))


def test_a_spring_that_is_negative_on_a_piece_alone_is_none_and_one_on_the_whole_is_an_error() -> None:
    problem = cantilever(ts.box((2, 1, 1), (2, 1, 1)), 0.1)
    with pytest.raises(ModelError, match="negative"):
        ts.Springs(stiffness=ts.UserStiffness(-0.4, 0.3, 0.1)).on_pieces(problem)
    summed = ts.Springs("isotropic").on_pieces(problem)
    assert summed is not None and summed.allow_negative


# --- sums over processes ------------------------------------------------------------------------------


class Crew:
    """Threads in the place of processes: a communicator as mpi4py has it, of the calls that `Processes` makes."""

    def __init__(self, size: int) -> None:
        self.size, self._barrier = size, threading.Barrier(size, timeout=20)
        self._slots: list[Any] = [None] * size
        self._aside: dict[int, dict[int, Any]] = {}

    def run(self, work: Callable[[Processes], Any]) -> list[Any]:
        found: list[Any] = [None] * self.size

        def one(rank: int) -> None:
            try:
                found[rank] = work(Processes(_Handle(self, rank)))
            except Exception as error:
                found[rank] = error

        threads = [threading.Thread(target=one, args=(rank,)) for rank in range(self.size)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return found


class _Handle:
    def __init__(self, crew: Crew, rank: int) -> None:
        self._crew, self.rank, self.size, self._calls = crew, rank, crew.size, 0

    def Dup(self) -> "_Handle":  # noqa: N802
        return _Handle(self._crew, self.rank)

    def Iallgather(self, given: Floats, found: Floats) -> "_Request":  # noqa: N802
        self._calls += 1
        slots = self._crew._aside.setdefault(self._calls, {})
        slots[self.rank] = given
        return _Request(slots, found)

    def allgather(self, value: Any) -> list[Any]:
        self._crew._slots[self.rank] = value
        self._crew._barrier.wait()
        found = list(self._crew._slots)
        self._crew._barrier.wait()
        return found

    def Allgather(self, given: Floats, found: Floats) -> None:  # noqa: N802
        found[:] = np.concatenate(self.allgather(given))

    def Allreduce(self, given: Floats, found: Floats) -> None:  # noqa: N802
        found[:] = sum(self.allgather(given))


class _Request:
    def __init__(self, slots: dict[int, Any], found: Floats) -> None:
        self._slots, self._found = slots, found

    def Test(self) -> bool:  # noqa: N802
        if len(self._slots) < len(self._found):
            return False
        self._found[:] = np.concatenate([self._slots[rank] for rank in range(len(self._found))])
        return True


def test_an_exception_on_one_process_is_raised_on_all() -> None:
    class LocalError(Exception):
        """Cannot be sent: its class is not found in a module."""

    def work(ranks: Processes) -> tuple[str, bool]:
        def fails() -> None:
            if ranks.rank == 1:
                raise LocalError("no such side")

        assert ranks.together(lambda: ranks.rank) == ranks.rank
        try:
            ranks.together(fails)
        except Exception as error:
            return str(error), ranks.is_on_all(error)
        return "", False

    with pytest.raises((AttributeError, pickle.PicklingError)):
        pickle.dumps(LocalError("no such side"))
    assert Crew(3).run(work) == [("LocalError: no such side", True)] * 3


def test_exceptions_of_the_same_class_on_all_processes_are_no_failure_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def compared(*errors: Exception | None) -> list[bool | None]:
        def work(ranks: Processes) -> bool | None:
            error = errors[ranks.rank]
            return None if error is None else ranks.is_on_all(error)

        return Crew(2).run(work)

    assert compared(SlowError(np.zeros(2)), SlowError(np.ones(2))) == [True, True]
    assert compared(SlowError(np.zeros(2)), IndefiniteError("negative")) == [False, False]
    monkeypatch.setattr(ranks_module, "_PATIENCE", 0.05)
    assert compared(None, ValueError("alone")) == [None, False]


def test_numbers_that_decide_are_the_same_on_unequal_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes with one and with three threads, whose sums over all nodes differ by rounding errors."""
    of_this = threading.local()
    monkeypatch.setattr(threads, "n_threads", lambda: getattr(of_this, "n_threads", 1))
    monkeypatch.setattr(threads, "_SMALLEST_PIECE", 1)
    monkeypatch.setattr(vectors, "SMALLEST", 1)
    problem = cantilever(ts.rectangle((2, 1), (40, 20)), 0.1)
    positions = deformed(problem.mesh.nodes, 7)

    def work(ranks: Processes) -> tuple[Any, ...]:
        of_this.n_threads = 1 + 2 * ranks.rank
        potential = Piecewise(ts.Springs("lloyd"), problem, ranks)
        loading = own_rows(problem.loading, potential.layout)
        balance = Balance(potential, loading, 1e-10, 50, choice.choose("direct", potential.nodes, loading.held))
        watch = Watch(balance, 0.7, positions)
        assert watch.at(positions, 0)
        several = [(1 + one) * watch.force for one in range(30)]
        local = [norm(one) for one in several]
        force, scale = balance.unbalanced(potential.gradient(positions), loading.force(positions, 0.7))
        slope = balance.scalar_product(force, positions)
        energy, same = balance.total_energy(positions, 0.7), [balance.norm(one) for one in several]
        return local, watch.residual, scale, energy, slope, same

    one, other = Crew(2).run(work)
    assert one[0] != other[0] and one[0] == pytest.approx(other[0], rel=1e-12)
    assert one[1:] == other[1:]


def test_a_full_step_takes_the_last_iterate_of_slow_iterations() -> None:
    class Slow:
        lasting = False

        def ready(self, matrix: Any, positions: Floats) -> "Slow":
            return self

        def solve(self, right: Floats) -> Floats:
            raise SlowError(1e-3 * right)

    problem = cantilever(ts.rectangle((2, 1), (4, 2)), 0.1)
    potential = ts.Springs("lloyd").potential(problem)
    balance = Balance(potential, problem.loading, 1e-10, 5, Slow())  # type: ignore[arg-type]
    found = descend(balance, 1.0, potential.nodes, undamped_iterations=2).state
    assert found.iterations == 2 and not found.converged


def test_iterations_with_shared_rows_are_those_of_one_process() -> None:
    generator = np.random.default_rng(8)
    root = generator.normal(size=(60, 60))
    matrix, right = root @ root.T + 5 * np.eye(60), generator.normal(size=(60, 1))
    scale = np.diag(matrix)[:, None]

    def work(ranks: Processes, wanted: Floats = matrix) -> tuple[Floats, int, Any]:
        rows = np.arange(ranks.rank * 30, ranks.rank * 30 + 60 // ranks.size)

        def product(x: Floats, result: Floats) -> float:
            whole = np.zeros((60, 1))
            whole[rows] = x
            result[:] = wanted[rows] @ ranks.joined(whole)
            return ranks.sum(float((x * result).sum()))

        def precondition(r: Floats) -> Floats:
            return r / scale[rows]

        lowest = lowest_eigenvalue(product, precondition, right[rows], ranks.sum)
        found = conjugate_gradients(product, precondition, right[rows], 1e-12, 200, ranks.sum)
        return found.solution, found.iterations, lowest

    alone, shared = Crew(1).run(work), Crew(2).run(work)
    exact = np.linalg.solve(matrix, right)
    assert np.abs(np.concatenate([one[0] for one in shared]) - exact).max() <= 1e-9 * np.abs(exact).max()
    assert abs(shared[0][1] - alone[0][1]) <= 1 and shared[0][1] == shared[1][1] > 5
    assert shared[0][2] == shared[1][2] and shared[0][2].iterations == alone[0][2].iterations
    assert shared[0][2].eigenvalue == pytest.approx(alone[0][2].eigenvalue, rel=1e-6)
    indefinite = matrix - 40 * np.eye(60)
    assert all(isinstance(one, IndefiniteError) for one in Crew(2).run(lambda ranks: work(ranks, indefinite)))


# --- errors -------------------------------------------------------------------------------------------


def test_a_missing_petsc_is_an_error_with_the_way_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "_missing", lambda names: ["petsc4py"])
    with pytest.raises(ProblemError, match=r"linear = 'petsc' needs petsc4py.*docs/large\.md"):
        ts.Newton(linear="petsc")


def test_other_controls_than_load_need_a_factorisation() -> None:
    for make in (ts.ArcLength, lambda linear: ts.DisplacementControl("right", 0, 0.1, linear=linear)):
        with pytest.raises(ProblemError, match="linear = 'petsc'"):
            make(linear="petsc")


STUDY = """
[mesh]
shape = "rectangle"
size = [2.0, 1.0]
elements = [8, 4]
[material]
young = 1e4
poisson = 0.3
[section]
kind = "plane-stress"
thickness = 0.01
[[support]]
on = "left"
[[load]]
on = "right"
force = [0.0, -0.5]
[solver]
load_steps = 2
linear = "multigrid"
[models.springs]
kind = "springs"
rule = "gaussian"
[models.fem]
kind = "fem"
law = "neo-hookean"
"""


def test_several_processes_solve_and_do_so_with_petsc_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    study = tmp_path / "beam.toml"
    study.write_text(STUDY, encoding="utf-8")
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "0")
    assert main(["verify", str(study), "--out", str(tmp_path)]) == 2
    assert "verify runs in one process, mpiexec started 2" in capsys.readouterr().err
    assert main(["solve", str(study), "--out", str(tmp_path)]) == 2
    assert "solver.linear = 'multigrid' runs in one process" in capsys.readouterr().err
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "1")
    assert main(["verify", str(study), "--out", str(tmp_path)]) == 2
    assert capsys.readouterr() == ("", "")
    assert {path.name for path in tmp_path.iterdir()} == {"beam.toml"}
    shared = tmp_path / "petsc.toml"
    shared.write_text(STUDY.replace("multigrid", "petsc"), encoding="utf-8")
    monkeypatch.setattr(choice, "_missing", lambda names: [])
    monkeypatch.setattr(linear, "processes_of", lambda name: Rank(0, 3))
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "0")
    monkeypatch.delenv("OMPI_COMM_WORLD_SIZE")
    assert main(["solve", str(shared), "--out", str(tmp_path / "out")]) == 2  # as by srun --mpi=pmix
    assert "mpi4py finds 3 processes, but none of the environment" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    assert launch({}).size == launch({"PMI_SIZE": "x", "PMI_RANK": "0"}).size == 1
    assert (launch({"PMI_SIZE": "4", "PMI_RANK": "3"}).size, launch({"PMI_SIZE": "4", "PMI_RANK": "3"}).rank) == (4, 3)


# --- PETSc on one process -----------------------------------------------------------------------------


@needs_petsc
@pytest.mark.verification
@pytest.mark.parametrize("name", ILL_CONDITIONED)
def test_petsc_has_the_answer_of_a_factorisation(name: str) -> None:
    build, model = ILL_CONDITIONED[name]
    problem = build()
    exact, found = (ts.solve(problem, model, ts.Newton(load_steps=1, linear=one)) for one in ("scipy", "petsc"))
    assert exact.status is found.status is ts.Status.CONVERGED
    size = np.abs(exact.states[-1].displacement).max()
    assert np.abs(found.states[-1].displacement - exact.states[-1].displacement).max() <= 1e-8 * size
    assert found.states[-1].negative_eigenvalues == 0
    assert found.cost is not None and found.cost.cg_iterations > 0 and found.cost.memory > 0
    assert "PETSc" in found.cost.linear or any("instead of PETSc" in note for note in found.cost.notes)


@needs_petsc
@pytest.mark.verification
def test_petsc_solves_a_tangent_and_new_coarse_levels_are_made_when_the_last_are_slow(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = block()
    potential = ts.Springs("isotropic").potential(problem)
    nodes, held = problem.mesh.nodes, problem.loading.held
    solver = choice.choose("petsc", nodes, held)
    right = np.where(held, 0.0, np.random.default_rng(0).normal(size=nodes.shape))
    turned = nodes + 0.1 * np.sin(nodes[:, ::-1])
    for positions in (nodes, turned):
        matrix = potential.hessian(positions)
        found = solver.ready(matrix, positions).solve(right, 1e-10)
        left = np.where(held, 0.0, (matrix @ found.ravel()).reshape(right.shape) - right)
        assert np.linalg.norm(left) <= 1e-9 * np.linalg.norm(right) and not found[held].any()
    assert solver.factorisations == 1
    mesh = problem.mesh
    stiff = [ts.Region(np.arange(0, len(mesh.elements), 3), ts.Material(1e8, 0.3))]  # type: ignore[arg-type]
    contrast = cantilever(mesh, 25.0, regions=stiff)
    matrix = ts.Springs("isotropic").potential(contrast).hessian(nodes)
    with pytest.raises(SlowError):
        solver.ready(matrix, nodes).solve(right, 1e-10)
    solver.ready(matrix, nodes)
    assert solver.factorisations == 2
    monkeypatch.setattr(petsc, "_MAX_ITERATIONS", 3)
    slow_at_first = choice.choose("petsc", nodes, held)
    for builds in (1, 2):
        with pytest.raises(SlowError):
            slow_at_first.ready(matrix, nodes).solve(right, 1e-10)
        assert slow_at_first.factorisations == builds


@needs_petsc
@pytest.mark.verification
def test_petsc_sees_a_negative_direction() -> None:
    problem = cantilever(ts.rectangle((10, 1), (80, 8)), 0.1)
    potential = ts.Springs(rule="isotropic").potential(problem)
    nodes, held = problem.mesh.nodes, problem.loading.held
    solver = choice.choose("petsc", nodes, held)
    assert solver.ready(potential.hessian(nodes), nodes).negative_eigenvalues == 0
    pressed = nodes * [0.99, 1.0]
    tangent = solver.ready(potential.hessian(pressed), pressed)
    assert tangent.negative_eigenvalues == 1
    with pytest.raises(IndefiniteError):
        tangent.solve(np.where(held, 0.0, np.random.default_rng(0).normal(size=nodes.shape)), 1e-10)


# --- PETSc on two processes ---------------------------------------------------------------------------

BLOCK = """
[mesh]
shape = "box"
size = [3.0, 1.0, 1.0]
elements = [9, 3, 3]
[material]
young = 1e4
poisson = 0.4
density = 100.0
[[support]]
on = "left"
[[support]]
on = "right"
fix = ["x"]
displacement = [0.3, 0.0, 0.0]
[[support]]
on = "front"
fix = ["z"]
[[support]]
on = "back"
fix = ["z"]
[[load]]
on = "top"
pressure = 300.0
[[load]]
gravity = [1.0, -9.81, 0.0]
[solver]
load_steps = 2
linear = "petsc"
method = "line-search"
[models.springs]
kind = "springs"
rule = "gaussian"
[models.fem]
kind = "fem"
law = "neo-hookean"
[models.linear]
kind = "fem"
law = "linear"
[models.heml]
kind = "heml"
law = "saint-venant-kirchhoff"
"""

COLUMN = """
[mesh]
shape = "rectangle"
size = [20.0, 1.0]
elements = [80, 4]
[material]
young = 1e4
poisson = 0.3
[section]
kind = "plane-stress"
thickness = 0.01
[[support]]
on = "left"
[[load]]
on = "right"
force = [-0.068, 0.0]
[solver]
load_steps = 2
linear = "petsc"
[models.springs]
kind = "springs"
rule = "isotropic"
"""


def two(*arguments: str, program: tuple[str, ...] = ("-m", "truespring")) -> subprocess.CompletedProcess[str]:
    """Run truespring on two processes of one thread each."""
    root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    environment = os.environ | root | {"OMPI_MCA_mpi_yield_when_idle": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1"}
    command = ["mpiexec", "-n", "2", sys.executable, *program, *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240)


def written(folder: Path, text: str) -> str:
    """Write a study; return its path."""
    file = folder / "study.toml"
    file.write_text(text, encoding="utf-8")
    return str(file)


def numbers(folder: Path) -> tuple[list[str], Floats]:
    """Models and numbers of curves.csv."""
    rows = [line.split(",") for line in (folder / "curves.csv").read_text().splitlines()[1:]]
    return [row[0] for row in rows], np.array([[float(one) for one in row[1:]] for row in rows])


@needs_mpiexec
@pytest.mark.verification
@pytest.mark.parametrize("text", [BLOCK, STUDY.replace("multigrid", "petsc")], ids=["block", "beam"])
def test_two_processes_have_the_answer_of_one(text: str, tmp_path: Path) -> None:
    """Pressure that follows, gravity, prescribed motion; line search and mixed integration points."""
    study = written(tmp_path, text)
    run = two("solve", study, "--out", str(tmp_path / "two"), "--json", "--threads", "1")
    assert run.returncode == 0, run.stderr
    summary = json.loads(run.stdout)  # one process prints
    assert main(["solve", study, "--out", str(tmp_path / "one"), "--quiet"]) == 0
    exact = written(tmp_path, text.replace('"petsc"', '"scipy"'))
    assert main(["solve", exact, "--out", str(tmp_path / "exact"), "--quiet"]) == 0
    names, found = numbers(tmp_path / "two" / "study")
    for other in ("one", "exact"):
        same, expected = numbers(tmp_path / other / "study")
        assert same == names and len(names) >= 6
        for column in np.array_split(np.arange(found.shape[1]), [1, 1 + found.shape[1] // 2]):
            size = np.abs(expected[:, column]).max()
            assert np.abs(found[:, column] - expected[:, column]).max() <= 1e-8 * size
    assert all(one["status"] == "converged" for one in summary["models"].values())
    folder = tmp_path / "two" / "study"
    alone = {path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*")}
    assert {path.relative_to(tmp_path / "two") for path in folder.parent.rglob("*")} == alone


@needs_mpiexec
@pytest.mark.verification
def test_two_processes_say_that_a_state_is_unstable_and_one_leaves_it(tmp_path: Path) -> None:
    study = written(tmp_path, COLUMN)
    run = two("solve", study, "--out", str(tmp_path / "two"), "--json", "--threads", "1")
    assert run.returncode == 1, run.stderr
    assert json.loads(run.stdout)["models"]["springs"]["status"] == "unstable"
    assert main(["solve", study, "--out", str(tmp_path / "one"), "--quiet"]) == 0


@needs_mpiexec
@pytest.mark.verification
def test_exit_codes_of_two_processes(tmp_path: Path) -> None:
    text = STUDY.replace("multigrid", "petsc")
    ended = "truespring: study: model '{}' is not-converged"
    single = text.replace('rule = "gaussian"', 'rule = "lloyd"\nsharing = "single"')
    short = text.replace("load_steps = 2", "load_steps = 1\nmax_iterations = 1")
    faults = {
        text.replace("poisson = 0.3", "poisson = 3"): (2, ["poisson = 3.0"]),
        STUDY: (2, ["runs in one process, mpiexec started 2"]),
        single: (1, ["several processes need", ended.format("springs")]),
        short: (1, [ended.format("springs"), ended.format("fem")]),
    }
    for fault, (code, words) in faults.items():
        run = two("solve", written(tmp_path, fault), "--out", str(tmp_path / "out"), "--threads", "1")
        assert run.returncode == code, run.stderr
        for one in words:
            assert (run.stderr + run.stdout).count(one) == 1, "one process prints"


# A process on which a function raises: within the exchange all know of it, elsewhere they do not.
BROKEN = """
import sys
from mpi4py import MPI
from truespring.cli import main
from truespring import piecewise
from truespring.linear import petsc
from truespring.solvers import balance

def fails(*_):
    raise RuntimeError("broken on one")

if MPI.COMM_WORLD.rank == RANK:
    WHERE = fails
sys.exit(main())
"""


@needs_mpiexec
@pytest.mark.verification
@pytest.mark.parametrize(
    ("where", "rank"),
    [
        ("piecewise.Piece.gradient", 1),
        ("balance.Balance.unbalanced", 0),
        ("balance.Balance.unbalanced", 1),
        ("petsc.slices", 1),  # in the middle of copying rows
        ("petsc.modes_at", 0),  # between exchanges of PETSc
    ],
)
def test_a_process_that_fails_ends_all(where: str, rank: int, tmp_path: Path) -> None:
    study = written(tmp_path, STUDY.replace("multigrid", "petsc"))
    program = BROKEN.replace("RANK", str(rank)).replace("WHERE", where)
    run = two("solve", study, "--out", str(tmp_path / "out"), "--threads", "1", program=("-c", program))
    assert run.returncode == 1, run.stderr
    assert "broken on one" in run.stderr + run.stdout


# Resident memory that tangents and solvers on two processes add [bytes a node of this process].
KEPT = """
import numpy as np
import truespring as ts
from pathlib import Path
from truespring.linear import choice, processes_of
from truespring.piecewise import Piecewise

def resident():
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * int(next(line for line in lines if line.startswith("VmRSS")).split()[1])

mesh = ts.box((4, 1, 1), (24, 8, 8))
problem = ts.Problem(mesh, ts.Material(1e4, 0.3), None, [ts.Fixed("left")], [ts.Force("right", (0, 0, 1))])
potential = Piecewise(ts.Springs("isotropic"), problem, processes_of("petsc"))
nodes, held, layout = mesh.nodes, problem.loading.held, potential.layout
matrix, right = potential.hessian(nodes), np.where(held, 0.0, np.sin(nodes))

def added(work, n):
    work()
    before = resident()
    for _ in range(n):
        work()
    return (resident() - before) / len(layout.owned)

def tangent():
    solver.ready(matrix, nodes).solve(right, 1e-2)

def model():
    global solver
    solver = None
    solver = choice.choose("petsc", nodes, held, layout=layout)
    tangent()

model()
kept = added(tangent, 50), added(model, 4)
if layout.ranks.rank == 0:
    print(*kept)
"""


@needs_mpiexec
@pytest.mark.verification
def test_tangents_and_solvers_are_freed_on_two_processes() -> None:
    run = two(program=("-c", KEPT))
    assert run.returncode == 0, run.stderr
    of_tangents, of_solvers = map(float, run.stdout.split())
    assert of_tangents < 1600, "two vectors a tangent are 2,400"
    assert of_solvers < 2000, "a matrix and its coarse levels are some thousands each"


@needs_mpiexec
@pytest.mark.verification
def test_a_time_limit_ends_all(tmp_path: Path) -> None:
    study = written(tmp_path, STUDY.replace("multigrid", "petsc"))
    run = two("solve", study, "--out", str(tmp_path / "out"), "--threads", "1", "--timeout", "1e-6")
    assert run.returncode == 1 and "time limit" in run.stderr + run.stdout, run.stderr
