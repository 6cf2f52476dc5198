"""truespring: springs by a rule, or finite elements by a law; `model` is the name of either."""

import sys
from functools import partial
from importlib.metadata import version

import truespring as ts
from benchmarks.cases import WARM_UP, Case
from benchmarks.programs.common import TOLERANCE, Run, main, peak_bytes


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
    """Solve in one load step."""
    chosen = ts.Fem(model) if model in ts.LAWS else ts.Springs(model)
    path = ts.solve(problem_of(case), chosen, ts.Newton(load_steps=1, tolerance=TOLERANCE))
    if path.status is not ts.Status.CONVERGED:
        raise SystemExit(f"{path.status}: {path.status.advice}")
    cost = path.cost
    notes = [cost.newton, cost.linear, *cost.notes] if cost else []
    return Run(
        version=version("truespring"),
        seconds=path.seconds,
        tip=case.tip(path.states[-1].displacement),
        iterations=path.newton_iterations,
        peak_bytes=peak_bytes(),
        linear_iterations=(cost.cg_iterations or None) if cost else None,
        lanczos_iterations=(cost.lanczos_iterations or None) if cost else None,
        notes=", ".join(notes),
    )


if __name__ == "__main__":
    main(partial(solve, model=sys.argv[2]), WARM_UP)
