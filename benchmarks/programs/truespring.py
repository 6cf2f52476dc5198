"""truespring: springs by a rule, or finite elements by a law; `model` is the name of either."""

import sys
from dataclasses import replace
from functools import partial
from importlib.metadata import version

import truespring as ts
from benchmarks.cases import WARM_UP, Case
from benchmarks.programs.common import TOLERANCE, Attempt, Run, in_few_increments, main


def problem_of(case: Case) -> ts.Problem:
    """Return the case as a problem: the same nodes, the same elements, the same shares of the force."""
    mesh = ts.Mesh(case.nodes, case.elements, "quadrilateral" if case.dim == 2 else "hexahedron")
    return ts.Problem(
        mesh=mesh,
        material=ts.Material(case.young, case.poisson),
        section=ts.PlaneStress(1.0) if case.dim == 2 else None,
        supports=[ts.Fixed("left")],
        loads=[ts.Force("right", case.force.sum(axis=0).tolist())],
    )


def solve(case: Case, model: str) -> Run:
    """Solve in one load step, or in as few more as it takes."""
    problem = problem_of(case)
    chosen = ts.Fem(model) if model in ts.LAWS else ts.Springs(model)
    costs = []

    def attempt(increments: int) -> Attempt | None:
        path = ts.solve(problem, chosen, ts.Newton(load_steps=increments, tolerance=TOLERANCE))
        if path.status is not ts.Status.CONVERGED:
            return None
        costs.append(path.cost)
        return path.states[-1].displacement, path.newton_iterations, path.seconds

    run = in_few_increments(case, version("truespring"), attempt)
    if (cost := costs[-1]) is None:
        return run
    return replace(
        run,
        linear_iterations=cost.cg_iterations or None,
        lanczos_iterations=cost.lanczos_iterations or None,
        notes=", ".join(filter(None, [run.notes, cost.newton, cost.linear, *cost.notes])),
    )


if __name__ == "__main__":
    main(partial(solve, model=sys.argv[2]), WARM_UP)
