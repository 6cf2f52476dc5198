"""Time of a solution by what the solver calls: forces, tangents, the linear solver."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import wraps
from typing import Any
from unittest.mock import patch

from truespring.linear import iterative, pressure

#: Modules that call conjugate gradients.
ITERATIVE = (iterative, pressure)

# Methods of a potential, of the iterative solvers and functions of their modules, by phase.
_POTENTIAL = {
    "gradient": "forces",
    "energy": "energy",
    "stress": "stress",
    "extrapolated_stress": "stress",
    "hessian": "tangents",
    "projected_hessian": "projected tangents",
}
_FUNCTIONS = {"conjugate_gradients": "conjugate gradients", "lowest_eigenvalue": "stability (Lanczos)"}


@contextmanager
def phases(potential: type) -> Iterator[Counter[str]]:
    """Yield a counter of the time of each phase [s], without that of phases within it.

    `potential` is the class of the potential.
    """
    taken: Counter[str] = Counter()
    inner = [0.0]

    def timed(function: Callable[..., Any], phase: str) -> Callable[..., Any]:
        @wraps(function)
        def run(*arguments: Any, **options: Any) -> Any:
            inner.append(0.0)
            started = time.perf_counter()
            try:
                return function(*arguments, **options)
            finally:
                whole = time.perf_counter() - started
                taken[phase] += whole - inner.pop()
                inner[-1] += whole

        return run

    with ExitStack() as stack:

        def replaced(owner: Any, name: str, phase: str) -> None:
            if hasattr(owner, name):
                stack.enter_context(patch.object(owner, name, timed(getattr(owner, name), phase)))

        for name, phase in _POTENTIAL.items():
            replaced(potential, name, phase)
        for module in ITERATIVE:
            for name, phase in _FUNCTIONS.items():
                replaced(module, name, phase)
        for solver in (iterative.Multigrid, pressure.PressureMultigrid):
            replaced(solver, "ready", "set-up of the linear solver")
        yield taken
