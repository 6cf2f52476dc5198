"""Time the loops of a solution against the bytes that they must move, and count the bytes of its parts.

python -m benchmarks.kernels CASE.npz MODEL prints them as JSON; without arguments, it prints the memory bandwidth.
"""

import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from itertools import cycle
from typing import Any
from unittest.mock import patch

import numpy as np

import truespring as ts
from benchmarks.cases import Case
from benchmarks.limits import Kernel, Moved, bandwidth, measure
from benchmarks.parts import n_bytes
from benchmarks.phases import ITERATIVE, phases
from benchmarks.programs.common import TOLERANCE
from benchmarks.programs.truespring import problem_of
from truespring.kernels import threads
from truespring.linear import gradients
from truespring.potential import SparseMatrix, Stressed
from truespring.problem import Problem

# Number of vectors that an iteration of conjugate gradients reads and writes besides product and preconditioner: reads
# x, r, p, q, writes x, r, p, and converts to and from single precision.
_VECTORS = 9


def of_potential(problem: Problem, potential: Stressed, positions: np.ndarray) -> Iterator[Kernel]:
    """Yield the internal force and the assembly of the tangent at positions [m].

    They must read positions and elements, and write the force, or the tangent.
    """
    given = positions.nbytes + problem.mesh.elements.size * 4
    turns = in_turn(positions)
    yield Kernel("force", lambda: potential.gradient(next(turns)), given + positions.nbytes)
    stress = potential.stress(positions)
    matrix = potential.hessian(positions, stress)
    yield Kernel("tangent", lambda: potential.hessian(next(turns), stress), given + matrix.data.nbytes)


def in_turn(positions: np.ndarray) -> Iterator[np.ndarray]:
    """Yield two copies of positions in turn: potentials keep what they computed for the last positions."""
    return cycle((positions.copy(), positions * (1 + 1e-12)))


def of_solver(used: "Used", memory: int, matrix: SparseMatrix, positions: np.ndarray) -> Iterator[Kernel]:
    """Yield the matrix product and the V-cycle of conjugate gradients; none if a solution did not use them.

    A product must read half of the symmetric matrix in single precision, with its columns; a V-cycle each level twice.
    `memory` is that of all levels [bytes].
    """
    if used.product is None or used.precondition is None:
        return
    product, precondition = used.product, used.precondition
    n, dim = positions.shape
    x, result = np.ascontiguousarray(positions), np.empty_like(positions)
    lower = (len(matrix.indices) - n) // 2
    read = lower * (4 * dim**2 + 4) + n * 4 * dim**2
    yield Kernel("matrix product", lambda: product(x, result), read + 2 * x.nbytes)
    residual = np.random.default_rng(7).normal(size=positions.shape).astype(np.float32)
    yield Kernel("V-cycle", lambda: precondition(residual), 2 * memory + 2 * residual.nbytes)


@dataclass
class Used:
    """The product and the preconditioner that a solution gave to conjugate gradients last, None without them."""

    product: Callable[..., Any] | None = None
    precondition: Callable[..., Any] | None = None


@contextmanager
def watched() -> Iterator[Used]:
    """Yield what solutions give to conjugate gradients."""
    used, iterate = Used(), gradients.conjugate_gradients

    def spied(product: Callable[..., Any], precondition: Callable[..., Any], *rest: Any, **more: Any) -> Any:
        used.product, used.precondition = product, precondition
        return iterate(product, precondition, *rest, **more)

    with ExitStack() as stack:
        for module in ITERATIVE:
            stack.enter_context(patch.object(module, "conjugate_gradients", spied))
        yield used


@contextmanager
def profile() -> Iterator[Counter[str]]:
    """Yield a counter of the time of each kernel [s], including the overhead of threads."""
    taken: Counter[str] = Counter()
    run_on = threads.run_on

    def timed(ranges: Any, function: Any, *arguments: Any) -> list[Any]:
        """Run a kernel and count its time."""
        started = time.perf_counter()
        found = run_on(ranges, function, *arguments)
        named = hasattr(function, "py_func")
        module = function.__module__.rpartition(".")[2] if named else "pieces"
        name = getattr(function, "__name__", "a call").strip("<>").replace("_", " ")
        taken[f"{module}: {name}"] += time.perf_counter() - started
        return found

    with patch.object(threads, "run_on", timed):
        yield taken


def measured(case: Case, name: str) -> dict[str, Any]:
    """Return times of loops at the equilibrium of a case and of the whole solution, its time by loop, and its bytes."""
    problem = problem_of(case)
    model, newton = ts.Fem(name) if name in ts.LAWS else ts.Springs(name), ts.Newton(load_steps=1, tolerance=TOLERANCE)
    ts.solve(problem, model, newton)
    path = ts.solve(problem, model, newton)
    with phases(type(path.potential)) as spent, watched() as used:
        again = ts.solve(problem, model, newton)
    spent["all else: sparsity, checks, Python"] = again.seconds - spent.total()
    with profile() as shares:
        third = ts.solve(problem, model, newton)
    shares["all else: small loops, NumPy, Python"] = third.seconds - shares.total()
    positions, potential = again.states[-1].positions, again.potential
    matrix = potential.hessian(positions)
    kernels = [
        *of_potential(problem, potential, positions),
        *of_solver(used, again.cost.memory, matrix, positions),
    ]
    found = [measure(kernel) for kernel in kernels]
    moved = Counter({one.name: one.bytes_moved for one in found})
    tangent, product, cycle = (moved[name] for name in ("tangent", "matrix product", "V-cycle"))
    step = product + cycle + _VECTORS * positions.nbytes
    whole = path.newton_iterations * tangent + (path.cost.cg_iterations + path.cost.lanczos_iterations) * step
    found.append(Moved("whole solve", path.seconds, whole))
    parts = {
        "mesh": problem.mesh,
        "potential": potential,
        "tangent": matrix,
        "linear solver": (used.product, used.precondition),
    }
    return {
        "rows": [asdict(row) for row in found],
        "phases": dict(spent.most_common()),
        "shares": dict(shares.most_common()),
        "parts": n_bytes(parts),
        "iterations": path.newton_iterations,
        "cg": path.cost.cg_iterations,
        "lanczos": path.cost.lanczos_iterations,
    }


def main() -> None:
    """Print the measurements of a case as JSON, or without one the bandwidth."""
    found = bandwidth() if len(sys.argv) == 1 else measured(Case.read(sys.argv[1]), sys.argv[2])
    sys.stdout.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    main()
