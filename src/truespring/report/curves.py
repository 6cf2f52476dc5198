"""curves.csv: displacement of the probe and force; reactions.csv: forces and torques of moved supports."""

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from truespring.mesh.selections import AXES
from truespring.reactions import torque_axes
from truespring.report.result import Result


def write_curves(result: Result, file: Path) -> None:
    """Write columns model, load_factor, ux, uy[, uz], fx, fy[, fz], one row per model and level, in m and N.

    If a path has unstable states, a last column `state` is stable, unstable or the kind of critical point.
    """
    axes = AXES[: result.problem.mesh.dim]
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        past = any(
            state.critical or state.negative_eigenvalues for path in result.solutions.values() for state in path.states
        )
        columns = ["model", "load_factor", *(f"u{axis}" for axis in axes), *(f"f{axis}" for axis in axes)]
        table.writerow([*columns, *(["state"] if past else [])])
        for name, path in result.solutions.items():
            for state in path.states:  # + 0.0 turns a negative zero into zero; unknown values stay empty
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


def heads(letter: str, names: Iterable[str], unit: str) -> list[str]:
    """Return columns of a letter and each of the names, with their unit, such as "ux [m]"."""
    return [f"{letter}{name} [{unit}]" for name in names]


def write_reactions(result: Result, file: Path) -> None:
    """Write columns model, load_factor, support, on, ux, uy[, uz] [m], fx, fy[, fz] [N], [mx, my,] mz [N m], compared.

    One row per model, level and moved support; supports are numbered from 1, `on` is their selection. u is the mean
    displacement of the support's nodes, f and m are its force and torque on the body, see SupportForce. `compared`
    names which of the two are compared with a reference: those that do not vanish. The header line states the units.
    """
    axes = AXES[: result.problem.mesh.dim]
    torques = torque_axes(len(axes))
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        columns = [*heads("u", axes, "m"), *heads("f", axes, "N"), *heads("m", torques, "N m")]
        table.writerow(["model", "load_factor", "support", "on", *columns, "compared"])
        for name, path in result.solutions.items():
            for state in path.states:
                for one in path.support_forces(state):
                    moved = state.displacement[path.problem.held[one.support].nodes].mean(axis=0)
                    values = (repr(float(value) + 0.0) for value in (*moved, *one.force, *one.torque))
                    compared = " ".join(
                        what for what, there in (("force", one.has_force), ("torque", one.has_torque)) if there
                    )
                    table.writerow([name, repr(float(state.load_factor)), one.support + 1, one.name, *values, compared])
