"""Time a model on the shipped organ: python -m benchmarks.organ POISSON MODEL prints JSON.

MODEL is a rule of springs or a law of finite elements.
"""

import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import truespring as ts
from benchmarks.kernels import in_turn
from truespring.study import read_study

#: Poisson's ratios, and the models.
POISSON, MODELS = (0.45, 0.49, 0.499), ("gaussian", "neo-hookean")

_STUDY = Path(__file__).parents[1] / "examples" / "organ.toml"
_REPEATS = 5
# A solution shorter than this [s] is repeated.
_SHORT = 15.0


def timed(action: Callable[[], object]) -> float:
    """Return the median time of an action [s], after one that is not counted."""
    action()
    found = []
    for _ in range(_REPEATS):
        started = time.perf_counter()
        action()
        found.append(time.perf_counter() - started)
    return statistics.median(found)


def measured(poisson: float, name: str) -> dict:
    """Return the times of a force, a tangent and a solution [s], and what the solution took."""
    study = read_study(_STUDY)
    given = study.problem
    assert given.material is not None
    material = ts.Material(given.material.young, poisson, given.material.density)
    problem = ts.Problem(given.mesh, material, None, given.supports, given.loads)
    model = ts.Fem(name) if name in ts.LAWS else ts.Springs(name)
    paths = [ts.solve(problem, model, study.solver)]
    while len(paths) < 3 and paths[0].seconds < _SHORT:
        paths.append(ts.solve(problem, model, study.solver))
    if not paths[0].complete:
        raise SystemExit(f"{paths[0].status}: {paths[0].status.advice}")
    potential, positions = model.potential(problem), paths[0].states[-1].positions
    stress, cost, turns = potential.stress(positions), paths[0].cost, in_turn(positions)
    return {
        "poisson": poisson,
        "model": paths[0].label,
        "n_elements": len(problem.mesh.elements),
        "force": timed(lambda: potential.gradient(next(turns))),
        "tangent": timed(lambda: potential.hessian(next(turns), stress)),
        "solve": statistics.median(path.seconds for path in paths),
        "iterations": paths[0].newton_iterations,
        "cg": cost.cg_iterations if cost else 0,
        "linear": cost.linear if cost else "",
    }


if __name__ == "__main__":
    sys.stdout.write(json.dumps(measured(float(sys.argv[1]), sys.argv[2])) + "\n")
