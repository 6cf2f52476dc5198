"""curves.csv: displacement of the probe against force; reactions.csv: the forces that move supports need."""

import csv
from pathlib import Path as FilePath

import numpy as np

from truespring.arrays import Floats
from truespring.equilibrium import Path, State
from truespring.mesh.selections import AXES
from truespring.problem import Problem
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


def moved_supports(problem: Problem) -> list[int]:
    """Return the numbers of the supports that are moved or turned."""
    return [number for number, held in enumerate(problem.held) if held.motion.any() or held.turn is not None]


def reaction_of(path: Path, state: State, support: int) -> tuple[Floats, Floats]:
    """Return the force of a support on the body [N], shape (dim,), and its moment [N m] about the support's middle.

    The moment is (m_z,) in the plane and of shape (3,) in space. Nodes that two supports hold count for both.
    """
    nodes = path.problem.held[support].nodes
    force, places = state.reaction[nodes], state.positions[nodes]
    arms = places - places.mean(axis=0)
    if force.shape[1] == 2:
        return force.sum(axis=0), np.array([(arms[:, 0] * force[:, 1] - arms[:, 1] * force[:, 0]).sum()])
    return force.sum(axis=0), np.cross(arms, force).sum(axis=0)


def write_reactions(result: Result, file: FilePath) -> None:
    """Write columns model, load_factor, support, ux, uy[, uz] [m], fx, fy[, fz] [N], [mx, my,] mz [N m].

    A row per model, level and support that is moved or turned, supports counted from 1: the mean displacement of its
    nodes, its force on the body, and its moment about their middle.
    """
    axes = AXES[: result.problem.mesh.dim]
    turns = AXES if len(axes) == 3 else "z"
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        columns = [
            f"{letter}{axis}" for letter, several in (("u", axes), ("f", axes), ("m", turns)) for axis in several
        ]
        table.writerow(["model", "load_factor", "support", *columns])
        for name, path in result.paths.items():
            for state in path.states if path.has_reactions else ():
                for support in moved_supports(path.problem):
                    moved = state.displacement[path.problem.held[support].nodes].mean(axis=0)
                    values = (*moved, *np.concatenate(reaction_of(path, state, support)))
                    told = (repr(float(value) + 0.0) for value in values)
                    table.writerow([name, repr(float(state.load_factor)), support + 1, *told])
