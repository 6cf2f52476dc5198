"""Path against path: how far a model may be trusted, level by level and in a sentence."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.equilibrium import Path, State
from truespring.errors import ProblemError
from truespring.mesh import SurfaceDistance, named_point, surface_distance

#: What "agrees" means where nothing else is said: an rms error of 5 %.
TOLERANCE = 0.05


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """How a path differs from a reference. All errors are relative to the reference's displacement.

    Attributes:
        model, reference: the two paths.
        probe: number of the node that is watched.
        tolerance: the rms error up to which the two agree.
        load_factors: the loaded levels that both paths have, ascending, shape (n,).
        rms_errors: root-mean-square nodal distance over root-mean-square displacement, shape (n,).
        max_errors: largest nodal distance over largest displacement, shape (n,).
        probe_errors: distance over displacement at the probe, shape (n,).
        surface: distances of outlines and nearest nodes, for a reference read as a surface.
    """

    model: Path
    reference: Path
    probe: int
    tolerance: float
    load_factors: Floats
    rms_errors: Floats
    max_errors: Floats
    probe_errors: Floats
    surface: SurfaceDistance | None = None

    def __repr__(self) -> str:
        return f"Comparison({self})"

    def _at_full_load(self, errors: Floats) -> float | None:
        reached = self.load_factors.size and self.load_factors[-1] == 1.0
        return float(errors[-1]) if reached and np.isfinite(errors[-1]) else None

    @property
    def probe_error(self) -> float | None:
        """The probe's error at full load; None where one path did not get there."""
        return self._at_full_load(self.probe_errors)

    @property
    def rms_error(self) -> float | None:
        """The rms error at full load; None where one path did not get there."""
        return self._at_full_load(self.rms_errors)

    @property
    def max_error(self) -> float | None:
        """The largest error at full load; None where one path did not get there."""
        return self._at_full_load(self.max_errors)

    @property
    def force_error(self) -> float | None:
        """Difference over size of the reactions to a prescribed motion at full load; None where loads are given."""
        mine, theirs = self.model.at(1.0), self.reference.at(1.0)
        if (
            not self.model.problem.loading.driven_by_motion
            or mine is None
            or theirs is None
            or self.reference.potential is None
        ):
            return None
        wanted = self.reference.applied_force(theirs)
        size = float(np.linalg.norm(wanted))
        return float(np.linalg.norm(self.model.applied_force(mine) - wanted)) / size if size else None

    @property
    def agrees_up_to_load_factor(self) -> float | None:
        """The largest level up to which, without a gap from zero, the rms error is under the tolerance.

        Zero where the first level already differs; None for a reference of one level, read from a file.
        """
        if not self.load_factors.size or self.reference.states[0].load_factor != 0.0:
            return None
        beyond = np.flatnonzero(~(self.rms_errors < self.tolerance))
        if not beyond.size:
            return float(self.load_factors[-1])
        return float(self.load_factors[beyond[0] - 1]) if beyond[0] else 0.0

    def __str__(self) -> str:
        """Return the comparison in a sentence."""
        if self.rms_error is None:
            return f"{self.model.label} and {self.reference.label} do not meet at full load"
        up_to = self.agrees_up_to_load_factor
        within = "" if up_to is None else f", within {self.tolerance:.0%} up to load factor {up_to:g}"
        return f"{self.model.label} against {self.reference.label}: {self.rms_error:.1%} rms at full load{within}"


def compare(
    model: Path,
    reference: Path,
    probe: int | str | None = None,
    tolerance: float = TOLERANCE,
) -> Comparison:
    """Compare two paths of one problem at the loaded levels that both have.

    `probe` is a node number or a named point such as "right-middle", by default the node of `model`
    that moves most. Raises ProblemError where the paths are not of the same mesh, MeshError where
    there is no such point.
    """
    nodes = model.problem.mesh.nodes
    if nodes.shape != reference.problem.mesh.nodes.shape or not np.allclose(
        nodes, reference.problem.mesh.nodes, rtol=0, atol=1e-9 * model.problem.mesh.diameter
    ):
        raise ProblemError("only paths on the same nodes can be compared")
    if isinstance(probe, str):
        probe = named_point(model.problem.mesh, probe)
    watched = most_moved(model) if probe is None else probe
    pairs = [(state, reference.at(state.level)) for state in model.states if state.level > 0]
    both = [(mine, theirs) for mine, theirs in pairs if theirs is not None]
    errors = np.array([_errors(mine, theirs, watched) for mine, theirs in both]).reshape(-1, 3)
    return Comparison(
        model=model,
        reference=reference,
        probe=watched,
        tolerance=tolerance,
        load_factors=np.array([mine.level for mine, _ in both]),
        rms_errors=errors[:, 0],
        max_errors=errors[:, 1],
        probe_errors=errors[:, 2],
        surface=_surface_distance(model, reference),
    )


def closest(comparisons: Mapping[str, Comparison]) -> str | None:
    """Return the name of the reference with the smallest rms error at full load, None where there is none."""
    errors = {name: one.rms_error for name, one in comparisons.items()}
    known = {name: error for name, error in errors.items() if error is not None}
    # Errors that differ by rounding are equal; finite elements come first among equals.
    order = {name: (float(f"{error:.9g}"), comparisons[name].reference.kind != "fem") for name, error in known.items()}
    return min(order, key=lambda name: order[name]) if order else None


def most_moved(path: Path) -> int:
    """Return the node that moves most at the last level; of several, the one with smaller coordinates."""
    if not path.states:
        return 0
    # A node whose motion is prescribed in full tells nothing of the model.
    told = path.problem.loading.held.all(axis=1)
    moved = np.linalg.norm(path.states[-1].displacement, axis=1) * (told.all() | ~told)
    ties = np.flatnonzero(moved >= moved.max() * (1 - 1e-9))
    return int(min(ties, key=lambda node: tuple(path.problem.mesh.nodes[node])))


def _errors(mine: State, theirs: State, probe: int) -> tuple[float, float, float]:
    distance = np.linalg.norm(mine.displacement - theirs.displacement, axis=1)
    size = np.linalg.norm(theirs.displacement, axis=1)
    return (
        _ratio(float(np.sqrt((distance**2).mean())), float(np.sqrt((size**2).mean()))),
        _ratio(float(distance.max()), float(size.max())),
        _ratio(float(distance[probe]), float(size[probe])),
    )


def _ratio(distance: float, size: float) -> float:
    """The relative error; not a number where the reference does not move."""
    return distance / size if size else float("nan")


def _surface_distance(model: Path, reference: Path) -> SurfaceDistance | None:
    if reference.surface is None:
        return None
    state = model.at(reference.surface.load_factor)
    if state is None:
        return None
    mesh = model.problem.mesh
    return surface_distance(state.positions, mesh.boundary, reference.surface)
