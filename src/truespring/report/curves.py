"""curves.csv: displacement of the probe against force, for every model and load level."""

import csv
from pathlib import Path as FilePath

import numpy as np

from truespring.mesh.selections import AXES
from truespring.report.result import Result


def write_curves(result: Result, file: FilePath) -> None:
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
