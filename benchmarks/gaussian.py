"""Time Gaussian springs beside neo-Hookean finite elements, on the shipped organ and on a bent block at equal error.

python -m benchmarks.gaussian prints the ratios and writes benchmarks/gaussian.json; run nothing else meanwhile.
"""

import json
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

import truespring as ts
from benchmarks import machine
from benchmarks.runs import HERE, ROOT
from truespring.models.model import Model
from truespring.study import read_study

REPEATS = 5
#: Poisson's ratio from which a body is solved once only, since finite elements take a minute.
LARGE_POISSON = 0.49
#: Elements along the sides of the block, for springs and, from coarse to fine, for finite elements.
SPRINGS_CELLS, FEM_CELLS = (8, 2, 2), ((16, 4, 4), (24, 6, 6), (32, 8, 8), (40, 10, 10))
#: The two meshes of finite elements that the truth is extrapolated from, with second order.
TRUTH_CELLS = ((24, 6, 6), (48, 12, 12))


@dataclass(frozen=True)
class Timed:
    """Times of a model on one mesh [s]: a force, a tangent, a solution; and what the solution took."""

    model: str
    cells: tuple[int, ...] | int
    force: float
    tangent: float
    solve: float
    iterations: int
    linear: str
    error: float | None = None


def best(action: Callable[[], object], repeats: int = REPEATS) -> float:
    """Return the shortest time of an action [s], after one that is not counted."""
    action()
    found = []
    for _ in range(repeats):
        started = time.perf_counter()
        action()
        found.append(time.perf_counter() - started)
    return min(found)


def timed(
    problem: ts.Problem, model: Model, newton: ts.Newton, cells: tuple[int, ...] | int, solves: int = 3
) -> tuple[Timed, np.ndarray]:
    """Return times of a model and the displacement of the nodes at full load [m]."""
    solutions = [ts.solve(problem, model, newton) for _ in range(solves)]
    path = min(solutions, key=lambda one: one.seconds)
    if not path.complete:
        raise RuntimeError(f"{model}: {path.status}")
    positions, potential = path.states[-1].positions, model.potential(problem)
    stress = potential.stress(positions)
    found = Timed(
        path.label,
        cells,
        best(lambda: potential.gradient(positions)),
        best(lambda: potential.hessian(positions, stress)),
        path.seconds,
        path.newton_iterations,
        path.cost.linear if path.cost else "",
    )
    return found, path.states[-1].displacement


def organ(poisson: float) -> list[Timed]:
    """Return the times of both models on the shipped organ."""
    study = read_study(ROOT / "examples" / "organ.toml")
    problem = study.problem
    material = ts.Material(problem.material.young, poisson, problem.material.density)
    problem = ts.Problem(problem.mesh, material, None, problem.supports, problem.loads)
    models = (ts.Springs("gaussian"), ts.Fem("neo-hookean"))
    n_elements, solves = len(problem.mesh.elements), 3 if poisson < LARGE_POISSON else 1
    return [timed(problem, model, study.solver, n_elements, solves)[0] for model in models]


def block(cells: tuple[int, ...]) -> ts.Problem:
    """Return a block at Poisson's ratio 0.45 that is bent by half its length."""
    return ts.Problem(
        ts.box((0.16, 0.04, 0.04), cells),
        ts.Material(10e3, 0.45),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, -0.2, 0.0))],
    )


def at_equal_error() -> list[Timed]:
    """Return Gaussian springs on a coarse mesh, and finite elements on the coarsest with at most their error."""
    newton = ts.Newton(load_steps=2, tolerance=1e-8)
    coarse, fine = (
        _on_the_coarsest(cells, timed(block(cells), ts.Fem("neo-hookean"), newton, cells)[1]) for cells in TRUTH_CELLS
    )
    truth = fine + (fine - coarse) / 3
    size = np.sqrt((truth**2).sum(axis=1).mean())

    def judged(cells: tuple[int, ...], model: Model) -> Timed:
        found, moved = timed(block(cells), model, newton, cells)
        error = np.sqrt(((_on_the_coarsest(cells, moved) - truth) ** 2).sum(axis=1).mean()) / size
        return Timed(**asdict(found) | {"error": float(error)})

    springs = judged(SPRINGS_CELLS, ts.Springs("gaussian"))
    found = [springs]
    for cells in FEM_CELLS:
        found.append(judged(cells, ts.Fem("neo-hookean")))
        if found[-1].error <= springs.error:
            break
    return found


def _on_the_coarsest(cells: tuple[int, ...], moved: np.ndarray) -> np.ndarray:
    """Return the displacement at the nodes of SPRINGS_CELLS, which finer meshes contain [m]."""
    grid = moved.reshape(*(count + 1 for count in reversed(cells)), 3)
    steps = [count // own for count, own in zip(reversed(cells), reversed(SPRINGS_CELLS), strict=True)]
    return grid[:: steps[0], :: steps[1], :: steps[2]].reshape(-1, 3)


def main() -> None:
    """Measure, print the ratios and write the results."""
    results = {
        "date": machine.today(),
        "commit": machine.commit(),
        "machine": machine.hardware(),
        "versions": machine.versions(),
        "organ": {f"{poisson:g}": [asdict(one) for one in organ(poisson)] for poisson in (0.45, 0.49)},
        "block": [asdict(one) for one in at_equal_error()],
    }
    (HERE / "gaussian.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    for poisson, (springs, fem) in results["organ"].items():
        ratios = ", ".join(f"{what} {springs[what] / fem[what]:.3f}" for what in ("force", "tangent", "solve"))
        sys.stdout.write(f"organ, nu {poisson}: Gaussian springs over FEM: {ratios}\n")
    first, last = results["block"][0], results["block"][-1]
    sys.stdout.write(
        f"block: {first['error']:.2%} in {first['solve']:.3f} s, FEM {last['cells']} {last['error']:.2%} in "
        f"{last['solve']:.3f} s: {first['solve'] / last['solve']:.4f}\n"
    )


if __name__ == "__main__":
    main()
