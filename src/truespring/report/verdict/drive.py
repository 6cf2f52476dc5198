"""The direction that drives a body: of its loads, or of its prescribed motion."""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.mesh.selections import AXES
from truespring.reactions import leading_support
from truespring.report.axis import driven_by_motion
from truespring.report.result import Result


@dataclass(frozen=True, slots=True)
class Drive:
    """The main direction of loads or motion: `axis` (0 is x), `sign` 1 or -1 along it."""

    axis: int
    sign: float

    def along(self, vector: Floats) -> float:
        """Return the component of a vector, shape (dim,), positive along the drive."""
        return self.sign * float(vector[self.axis])

    @property
    def name(self) -> str:
        """The direction in writing: x, −y."""
        return f"{'−' if self.sign < 0 else ''}{AXES[self.axis]}"


def drive(result: Result) -> Drive:
    """Return the main direction of the total force; without loads, that of the prescribed motion.

    Of results from files, whose loads are unknown, with tools, and without loads and moved supports, return the
    direction in which the probe moves furthest.
    """
    if not result.problem.stated:
        return _of_probe(result)
    loading = result.problem.loading.full
    leading = leading_support(result.problem)
    if driven_by_motion(result) and leading is not None:
        held = result.problem.held[leading]
        return _largest(held.motion[None] if held.motion.any() else loading.motion()[held.nodes])
    force = loading.force(result.problem.mesh.nodes)
    if result.problem.touching or not force.any():  # or a velocity at the begin
        return _of_probe(result)
    total = force.sum(axis=0)
    # Balanced loads have no total: take the largest nodal force.
    return _largest(force if np.abs(total).max() <= 1e-9 * np.abs(force).max() else total[None])


def axis_name(vector: Floats) -> str:
    """Return a direction in writing: x, −y; of several components "its direction of motion"."""
    if np.count_nonzero(vector) > 1:
        return "its direction of motion"
    axis = int(np.abs(vector).argmax())
    return Drive(axis, float(np.sign(vector[axis]))).name


def _of_probe(result: Result) -> Drive:
    path = next((path for path in result.solutions.values() if path.states), None)
    moved = np.zeros((1, 1)) if path is None else np.array([one.displacement[result.probe] for one in path.states])
    return _largest(moved) if moved.any() else Drive(0, 1.0)


def _largest(vectors: Floats) -> Drive:
    """Return the direction of the largest component of vectors, shape (n, dim)."""
    place = int(np.abs(vectors).argmax())
    return Drive(place % vectors.shape[1], float(np.sign(vectors.ravel()[place])))
