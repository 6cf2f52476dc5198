"""Measured force-displacement curves, from CSV."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.columns import Columns
from truespring.errors import ReferenceFileError
from truespring.mesh.selections import AXES
from truespring.problem import Problem
from truespring.units import Dimension

_COLUMNS: dict[str, Dimension | None] = {"load_factor": None}
_COLUMNS.update(dict.fromkeys([f"u{axis}" for axis in AXES], "length"))
_COLUMNS.update(dict.fromkeys([f"f{axis}" for axis in AXES], "force"))


@dataclass(frozen=True, eq=False)
class Curve:
    """What was measured as the load went up: under loads where a point went, under a motion what that took.

    Attributes:
        load_factors: ascending from rest, shape (n,).
        quantity: "displacement" of the probe [m], or "force" of the supports that move [N].
        axes: the directions that were measured, numbers of axes, shape (m,).
        values: shape (n, m).
        probe: number of the node whose displacement it is.
    """

    load_factors: Floats
    quantity: str
    axes: Ints
    values: Floats
    probe: int = 0

    def at(self, load_factor: float) -> Iterator[tuple[str, Ints, Floats]]:
        """Yield quantity, axes and values at a level, on the straight line between two that were measured."""
        if load_factor <= self.load_factors[-1] * (1 + 1e-9):
            columns = [np.interp(load_factor, self.load_factors, column) for column in self.values.T]
            yield self.quantity, self.axes, np.array(columns)


def read_curve(file: str | Path, problem: Problem, probe: int) -> Curve:
    """Read a force-displacement curve from a CSV file with a line of column names.

    Columns are fx, fy, fz, the force, and ux, uy, uz, the displacement, those that were measured; `load_factor`, where
    there is one, tells the share of the study's load. Without it that is told by the measured force over the study's,
    or where a support moves by the measured displacement over that of the support, along the direction in which these
    are largest. Under loads the displacement of the probe is what is fitted, under a motion alone the force. Numbers
    are SI, or in the unit behind a column's name: "fy [mN]". Rest, where all is zero, is added.

    Raises ReferenceFileError, with file and line, where the file is damaged, what is needed is not there, or load
    factors do not ascend.
    """
    place = Path(file)
    data = Columns(place, _COLUMNS, (), ReferenceFileError)
    loading, dim = problem.loading, problem.mesh.dim
    driven = loading.driven_by_motion
    fitted, told = ("f", "u") if driven else ("u", "f")
    for axis in AXES[dim:]:
        for column in (f"u{axis}", f"f{axis}"):
            if column in data.columns:
                raise ReferenceFileError(f"{place}:1: column {column}: the body has {dim} directions")
    axes = [axis for axis in AXES[:dim] if f"{fitted}{axis}" in data.columns]
    if not axes:
        wanted = ", ".join(f"{fitted}{axis}" for axis in AXES[:dim])
        why = "a support is moved, so that its force is fitted" if driven else "loads are given, so that the probe is"
        raise ReferenceFileError(f"{place}:1: {why}: one of the columns {wanted} is wanted")
    values = np.stack([data.numbers(f"{fitted}{axis}") for axis in axes], axis=1)
    if "load_factor" in data.columns:
        factors = data.numbers("load_factor")
    else:
        factors = _factors(data, place, told, _largest(problem), axes_of=AXES[:dim])
    at_rest = factors == 0
    if values[at_rest].any():
        raise ReferenceFileError(
            f"{place}:{data.line(int(at_rest.argmax()))}: without load there is no {'force' if driven else 'motion'}"
        )
    factors, values = factors[~at_rest], values[~at_rest]
    later = np.flatnonzero(np.diff(np.append(0.0, factors)) <= 0)
    if later.size:
        raise ReferenceFileError(
            f"{place}:{data.line(int(np.flatnonzero(~at_rest)[later[0]]))}: the load goes down, to "
            f"{factors[later[0]]:g} of the study's: a curve of one loading, row after row, is wanted"
        )
    if not factors.size:
        raise ReferenceFileError(f"{place}: there is no row under load")
    numbers = np.array([AXES.index(axis) for axis in axes])
    return Curve(
        np.append(0.0, factors),
        "force" if driven else "displacement",
        numbers,
        np.concatenate([np.zeros((1, len(axes))), values]),
        probe,
    )


def _largest(problem: Problem) -> Floats:
    """The study's total force [N], or without loads the largest motion of a support [m], shape (dim,)."""
    loading = problem.loading
    if not loading.driven_by_motion:
        return np.asarray(loading.force(problem.mesh.nodes).sum(axis=0))
    motion = loading.motion()
    return np.asarray(motion[np.linalg.norm(motion, axis=1).argmax()])


def _factors(data: Columns, file: Path, told: str, largest: Floats, axes_of: str) -> Floats:
    axis = int(np.abs(largest).argmax())
    column = f"{told}{axes_of[axis]}"
    if not largest[axis]:
        raise ReferenceFileError(f"{file}:1: the study's load has no total that tells how far it went: add load_factor")
    if column not in data.columns:
        raise ReferenceFileError(f"{file}:1: column {column} is missing, or load_factor, to tell how far the load went")
    return np.asarray(data.numbers(column) / largest[axis])
