"""Time the kernels of a spring solution against the bytes that they must move.

python -m benchmarks.kernels CASE.npz RULE prints them as JSON; without arguments, it prints the memory bandwidth.
"""

import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

import numpy as np

import truespring as ts
from benchmarks.cases import Case
from benchmarks.limits import Kernel, Moved, bandwidth, measure
from benchmarks.programs.common import TOLERANCE
from benchmarks.programs.truespring import problem_of
from truespring.kernels import threads
from truespring.linear.iterative import Multigrid, Preconditioned
from truespring.linear.multigrid import Hierarchy, Level

# Number of vectors that an iteration of conjugate gradients reads and writes besides product and preconditioner: reads
# x, r, p, q, writes x, r, p, and converts to and from single precision.
_VECTORS = 9


def kernels(potential: ts.SpringNetwork, positions: np.ndarray, ready: Preconditioned) -> Iterator[Kernel]:
    """Yield assembly, matrix product and V-cycle at positions [m] of a network."""
    stress = potential.stress(positions)
    matrix = potential.hessian(positions, stress)
    springs = potential.springs.size * 4 + potential.stiffness.nbytes + stress.nbytes
    yield Kernel(
        "assembly", lambda: potential.hessian(positions, stress), positions.nbytes + springs + matrix.data.nbytes
    )
    x, result = np.ascontiguousarray(positions), np.empty_like(positions)
    yield Kernel("matrix product", lambda: ready.level.product(x, result), _once(ready.level) + 2 * x.nbytes)
    residual = (x - potential.nodes).astype(np.float32)
    yield Kernel(
        "V-cycle",
        lambda: ready.coarse.cycle(ready.level, ready.turns, residual),
        cycle_bytes(ready.level, ready.coarse) + 2 * residual.nbytes + ready.turns.nbytes,
    )


def _once(level: Level) -> int:
    """Return the bytes of a matrix that a product reads."""
    return level.columns.nbytes + level.lower.nbytes + level.rest.nbytes


def cycle_bytes(finest: Level, coarse: Hierarchy) -> int:
    """Return the bytes that a V-cycle reads: each matrix twice (down and up), each transfer once each way."""
    levels = [finest, *coarse.levels]
    matrices = sum(2 * (level.columns.nbytes + level.lower.nbytes + level.inverse.nbytes) for level in levels)
    return matrices + sum(transfer.n_bytes for transfer in coarse.transfers) + coarse.inverse.nbytes


@contextmanager
def profile() -> Iterator[Counter[str]]:
    """Yield a counter of the time of each kernel [s], including the overhead of threads."""
    taken: Counter[str] = Counter()
    run = threads.run

    def timed(function: Any, *arguments: Any, **options: Any) -> list[Any]:
        """Run a kernel and count its time."""
        started = time.perf_counter()
        found = run(function, *arguments, **options)
        module = function.__module__.rpartition(".")[2] if hasattr(function, "py_func") else "assembly"
        taken[f"{module}: {function.__name__.replace('_', ' ')}"] += time.perf_counter() - started
        return found

    threads.run = timed
    try:
        yield taken
    finally:
        threads.run = run


def measured(case: Case, rule: str) -> tuple[list[Moved], Counter[str]]:
    """Return times of the kernels at the equilibrium of a case and of the whole solution, and its time by kernel."""
    problem = problem_of(case)
    model, newton = ts.Springs(rule), ts.Newton(load_steps=1, tolerance=TOLERANCE, linear="multigrid")
    ts.solve(problem, model, newton)
    path = ts.solve(problem, model, newton)
    with profile() as shares:
        again = ts.solve(problem, model, newton)
    shares["all else: small loops, NumPy, Python"] = again.seconds - shares.total()
    positions = path.states[-1].positions
    solver = Multigrid(path.potential.nodes, problem.loading.held)
    ready = solver.ready(path.potential.hessian(positions), positions)
    found = [measure(kernel) for kernel in kernels(path.potential, positions, ready)]
    assembly, product, cycle = (one.bytes_moved for one in found)
    step = product + cycle + _VECTORS * positions.nbytes
    whole = path.newton_iterations * assembly + (path.cost.cg_iterations + path.cost.lanczos_iterations) * step
    return [*found, Moved("whole solve", path.seconds, whole)], shares


def main() -> None:
    """Print the measurements of a case as JSON, or without one the bandwidth."""
    if len(sys.argv) == 1:
        found = bandwidth()
    else:
        rows, shares = measured(Case.read(sys.argv[1]), sys.argv[2])
        found = {"rows": [asdict(row) for row in rows], "shares": dict(shares.most_common())}
    sys.stdout.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    main()
