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
    """A measured force-displacement curve: under loads the displacement of a probe, under a motion its force.

    Attributes:
        load_factors: ascending from 0, shape (n,).
        quantity: "displacement" of the probe [m], or "force" of the moved supports [N].
        axes: numbers of the measured axes, shape (m,).
        values: shape (n, m).
        probe: node number of the probe.
    """

    load_factors: Floats
    quantity: str
    axes: Ints
    values: Floats
    probe: int = 0

    def at(self, load_factor: float) -> Iterator[tuple[str, Ints, Floats]]:
        """Yield quantity, axes and values at a level [m or N], shape (m,) each, interpolated between measured ones."""
        if load_factor <= self.load_factors[-1] * (1 + 1e-9):
            columns = [np.interp(load_factor, self.load_factors, column) for column in self.values.T]
            yield self.quantity, self.axes, np.array(columns)


def read_curve(file: str | Path, problem: Problem, probe: int) -> Curve:
    """Read a force-displacement curve from a CSV file with a line of column names.

    Columns are the measured ones of fx, fy, fz (force) and ux, uy, uz (displacement), and optionally `load_factor`.
    Without it, the load factor is the measured force over that of the study, or under a prescribed motion the measured
    displacement over that of the support, along the axis in which these are largest. Under loads the displacement of
    the probe is fitted, under a motion alone the force. Numbers are in SI, or in the unit after the column name:
    "fy [mN]". The undeformed state, with zeros, is added.

    Raises ReferenceFileError, with file and line, if the file is damaged, a column is missing, or load factors do not
    ascend.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> with open("test.csv", "w") as file:
        ...     for line in ("ux [mm],fx [N]", "0,0", "2,0.05", "5,0.1"):
        ...         print(line, file=file)
        >>> curve = ts.read_curve("test.csv", problem, probe=ts.named_point(problem.mesh, "right-middle"))
        >>> curve.load_factors.tolist(), curve.values.ravel().tolist()
        ([0.0, 0.5, 1.0], [0.0, 0.002, 0.005])
    """
    place = Path(file)
    data = Columns(place, _COLUMNS, (), ReferenceFileError)
    loading, dim = problem.loading, problem.mesh.dim
    driven = loading.driven_by_motion
    fitted, driving = ("f", "u") if driven else ("u", "f")
    for axis in AXES[dim:]:
        for column in (f"u{axis}", f"f{axis}"):
            if column in data.columns:
                raise ReferenceFileError(f"{place}:1: column {column}: the body has {dim} directions")
    axes = [axis for axis in AXES[:dim] if f"{fitted}{axis}" in data.columns]
    if not axes:
        needed = ", ".join(f"{fitted}{axis}" for axis in AXES[:dim])
        what = "the force of the moved support" if driven else "the displacement of the probe"
        raise ReferenceFileError(f"{place}:1: {what} is fitted: give at least one of the columns {needed}")
    values = np.stack([data.numbers(f"{fitted}{axis}") for axis in axes], axis=1)
    if "load_factor" in data.columns:
        factors = data.numbers("load_factor")
    else:
        factors = _factors(data, place, driving, _largest(problem), axes_of=AXES[:dim])
    at_rest = factors == 0
    if values[at_rest].any():
        raise ReferenceFileError(
            f"{place}:{data.line(int(at_rest.argmax()))}: the {'force' if driven else 'displacement'} must be 0 at "
            "load factor 0"
        )
    factors, values = factors[~at_rest], values[~at_rest]
    later = np.flatnonzero(np.diff(np.append(0.0, factors)) <= 0)
    if later.size:
        raise ReferenceFileError(
            f"{place}:{data.line(int(np.flatnonzero(~at_rest)[later[0]]))}: the load factor decreases to "
            f"{factors[later[0]]:g}: give one loading with ascending load factors"
        )
    if not factors.size:
        raise ReferenceFileError(f"{place}: no row has a load factor above 0")
    numbers = np.array([AXES.index(axis) for axis in axes])
    return Curve(
        np.append(0.0, factors),
        "force" if driven else "displacement",
        numbers,
        np.concatenate([np.zeros((1, len(axes))), values]),
        probe,
    )


def _largest(problem: Problem) -> Floats:
    """Return the total force of the study [N], without loads the largest motion of a support [m], shape (dim,)."""
    loading = problem.loading
    if not loading.driven_by_motion:
        return np.asarray(loading.force(problem.mesh.nodes).sum(axis=0))
    motion = loading.full.motion()
    return np.asarray(motion[np.linalg.norm(motion, axis=1).argmax()])


def _factors(data: Columns, file: Path, driving: str, largest: Floats, axes_of: str) -> Floats:
    """Return the load factor of each row, shape (n,), from column f or u along the largest axis of the study's."""
    axis = int(np.abs(largest).argmax())
    column = f"{driving}{axes_of[axis]}"
    if not largest[axis]:
        raise ReferenceFileError(f"{file}:1: the study's loads have no total force: add a column load_factor")
    if column not in data.columns:
        raise ReferenceFileError(f"{file}:1: add a column {column} or load_factor, which give the load level")
    return np.asarray(data.numbers(column) / largest[axis])
