"""Solve a study on finer meshes until the watched quantities settle."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from truespring.comparison import most_moved
from truespring.converging.result import StudyRefinement, refined_study
from truespring.converging.settling import Attempt, refinement
from truespring.deprecation import renamed_argument
from truespring.equilibrium import Solution
from truespring.errors import StudyError
from truespring.mesh import nearest_node
from truespring.mesh.selections import AXES
from truespring.study.last_level import require_last_level
from truespring.study.read import Study, read_study
from truespring.study.run import follow


@renamed_argument("report", "progress")
def converge(
    study: Study | str | Path,
    tolerance: float = 0.01,
    most: int = 5,
    progress: Callable[[Study, str], None] | None = None,
) -> Iterator[StudyRefinement]:
    """Solve a study on a sequence of meshes, each with elements of half the size; yield the refinement after each.

    It ends when every watched quantity has settled, when a model does not reach full load, or after `most` meshes.
    Watched are the probe's displacement along each axis, the stored energy, force and torque of each moved support,
    and the force on each tool and grasp. Nothing settles on a mesh on which a model is inverted, unstable or not
    converged.

    Args:
        study: a study or its file.
        tolerance: relative error up to which a quantity has settled.
        most: largest number of meshes.
        progress: called with the refined study and the name of a model before it is solved.

    Raises StudyError if the mesh cannot be refined, or the study is a motion or returns before its end.

    Example:
        >>> import truespring as ts
        >>> study = ts.read_study(ts.new("strip", "strip.toml"), **{"mesh.elements": [4, 1], "solver.load_steps": 2})
        >>> *_, last = ts.converge(study, most=2)
        >>> last.n_nodes
        (10, 27)
    """
    original = study if isinstance(study, Study) else read_study(study)
    require_last_level(original, "converge")
    attempts: list[Attempt] = []
    values: dict[tuple[str, str, str], list[tuple[int, float]]] = {}
    place = None
    for halvings in range(most):
        study = original.finer(halvings) if halvings else original
        models = {name: entry for name, entry in study.entries.items() if entry.solves}
        if not models:
            raise StudyError(
                f"{study.file}: models: all models are read from files, which have one mesh: add a model to solve"
            )
        mesh = study.problem.mesh
        for name, model in models.items():
            if progress:
                progress(study, name)
            path = follow(study, model)
            attempts.append(_attempt(name, path))
            if not path.complete:
                continue
            if place is None:
                place = mesh.nodes[most_moved(path) if study.probe is None else study.probe]
            for quantity, unit, value in _watched(path, nearest_node(mesh, place.tolist())):
                values.setdefault((name, quantity, unit), []).append((mesh.n_nodes, value))
        found = refined_study(original.title, original.file, refinement(attempts, values, tolerance))
        yield found
        if found.ended:
            return


def _attempt(name: str, path: Solution) -> Attempt:
    n_nodes = path.problem.mesh.n_nodes
    return Attempt(name, n_nodes, str(path.status), path.load_factor, path.status.advice, path.complete)


def _watched(path: Solution, probe: int) -> Iterator[tuple[str, str, float]]:
    state = path.states[-1]
    for direction, value in zip(AXES, state.displacement[probe], strict=False):
        yield f"u{direction} of the probe", "m", float(value)
    if np.isfinite(state.energy):  # unknown for some other programs
        yield "energy", "J", state.energy
    for tool, touch in zip(path.problem.touching, state.touches, strict=False):  # not known of some other programs
        yield f"force of {tool.name}", "N", float(np.linalg.norm(touch.force))
    for one in path.support_forces(state):  # a resultant that vanishes is zero on every mesh
        yield f"force of {one.name}", "N", float(np.linalg.norm(one.force)) if one.has_force else 0.0
        yield f"torque of {one.name}", "N m", float(np.linalg.norm(one.torque)) if one.has_torque else 0.0
