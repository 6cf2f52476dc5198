"""curves.csv: displacement of the probe against force; reactions.csv: what supports that move need."""

import csv
from pathlib import Path

import numpy as np

from truespring.mesh.selections import AXES
from truespring.reactions import torque_axes
from truespring.report.result import Result


def write_curves(result: Result, file: Path) -> None:
    """Write columns model, load_factor, ux, uy[, uz] [m], fx, fy[, fz] [N], a row per model and level.

    Where a path goes through unstable states a last column, state, tells them: stable, unstable, or the kind of
    critical point.
    """
    axes = AXES[: result.problem.mesh.dim]
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        past = any(
            state.critical or state.negative_eigenvalues for path in result.paths.values() for state in path.states
        )
        columns = ["model", "load_factor", *(f"u{axis}" for axis in axes), *(f"f{axis}" for axis in axes)]
        table.writerow([*columns, *(["state"] if past else [])])
        for name, path in result.paths.items():
            for state in path.states:  # + 0.0 writes no negative zero; what is not known stays empty
                moved, force = state.displacement[result.probe], path.applied_force(state)
                table.writerow(
                    [
                        name,
                        *(
                            "" if np.isnan(value) else repr(float(value) + 0.0)
                            for value in (state.load_factor, *moved, *force)
                        ),
                        *([state.critical or ("unstable" if state.negative_eigenvalues else "stable")] if past else []),
                    ]
                )


def write_reactions(result: Result, file: Path) -> None:
    """Write columns model, load_factor, support, on, ux, uy[, uz] [m], fx, fy[, fz] [N], [mx, my,] mz [N m], compared.

    A row per model, level and support that is moved or turned, supports counted from 1 and called by what they are on:
    the mean displacement of its nodes, its force on the body and its torque, see SupportForce. `compared` tells which
    of both is compared with a reference: what does not vanish.
    """
    axes = AXES[: result.problem.mesh.dim]
    letters = (("u", axes), ("f", axes), ("m", torque_axes(len(axes))))
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        columns = [f"{letter}{axis}" for letter, several in letters for axis in several]
        table.writerow(["model", "load_factor", "support", "on", *columns, "compared"])
        for name, path in result.paths.items():
            for state in path.states:
                for one in path.support_forces(state):
                    moved = state.displacement[path.problem.held[one.support].nodes].mean(axis=0)
                    told = (repr(float(value) + 0.0) for value in (*moved, *one.force, *one.torque))
                    compared = " ".join(
                        what for what, there in (("force", one.has_force), ("torque", one.has_torque)) if there
                    )
                    table.writerow([name, repr(float(state.load_factor)), one.support + 1, one.name, *told, compared])
