"""Solution against path: how far a model may be trusted, level by level and in a sentence."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.carrying import carried, matching_points
from truespring.equilibrium import Solution, State
from truespring.errors import ProblemError
from truespring.mesh import CELL_SHAPES, Gap, SurfaceDistance, gap, named_point, nearest_node, surface_distance
from truespring.mesh.facets import triangles_of
from truespring.problem import Problem
from truespring.reactions import SupportForce

#: What "agrees" means where nothing else is said: an error of 5 %.
TOLERANCE = 0.05


@dataclass(frozen=True, eq=False)
class SupportError:
    """How force and torque of a moved support differ from those of the reference.

    Attributes:
        mine, theirs: of the model and of the reference.
        load: length of the total load there [N], None where no load acts beside the motion, or loads have no total.
    """

    mine: SupportForce
    theirs: SupportForce
    load: float | None = None

    @property
    def force_apart(self) -> Floats | None:
        """Difference of the forces over the length of the reference's, shape (dim,); None where that vanishes."""
        return _apart(self.mine.force, self.theirs.force) if self.theirs.has_force else None

    @property
    def torque_apart(self) -> Floats | None:
        """Difference of the torques over the length of the reference's, shape (1 or 3,); None where that vanishes."""
        return _apart(self.mine.torque, self.theirs.torque) if self.theirs.has_torque else None

    @property
    def force_error(self) -> float | None:
        """Length of the difference of the forces over that of the reference's; None where that vanishes."""
        return _length(self.force_apart)

    @property
    def torque_error(self) -> float | None:
        """Length of the difference of the torques over that of the reference's; None where that vanishes."""
        return _length(self.torque_apart)

    @property
    def share_of_load(self) -> float | None:
        """The reference's force over the total load; None where no load acts."""
        return float(np.linalg.norm(self.theirs.force)) / self.load if self.load else None


class Decisive(NamedTuple):
    """The error that decides: `error`, not a number where none is known, and of what.

    `quantity` is "displacement", "force" or "torque", empty where none is known; `support` the name of the support.
    """

    error: float
    quantity: str
    support: str = ""


def decisive(displacement: float, supports: Sequence[SupportError]) -> Decisive:
    """Return the larger of the rms error of displacement and the largest error of a support's force or torque.

    The one rule by which verdicts, maps, comparisons and calibrations judge; of equal errors the first counts.
    """
    errors = [Decisive(displacement, "displacement")]
    for one in supports:
        errors.append(Decisive(_or_nan(one.force_error), "force", one.mine.name))
        errors.append(Decisive(_or_nan(one.torque_error), "torque", one.mine.name))
    return largest(errors)


def largest(errors: Sequence[Decisive]) -> Decisive:
    """Return the largest error that is known, of equal ones the first."""
    known = [one for one in errors if not np.isnan(one.error)]
    # Errors that differ by rounding are equal.
    return max(known, key=lambda one: float(f"{one.error:.6g}")) if known else Decisive(float("nan"), "")


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """How a path differs from a reference. All errors are relative to the reference's own size.

    Attributes:
        model, reference: the two paths, on the nodes of one mesh: that on which they are compared.
        known_on: the two paths as they were given, each on its own mesh.
        outside: nodes that lie outside of the other body, which are left out of all errors, shape (n_nodes,).
        compared: nodes that rms and largest errors are over: within both bodies, and not moved (or held) in all
            directions by supports, which tells nothing of a model, shape (n_nodes,).
        node_by_node: whether both had the same nodes, so that nothing was interpolated.
        probe: number of the node that is watched.
        tolerance: the error up to which the two agree.
        load_factors: the loaded levels that both paths have, ascending, shape (n,).
        rms_errors: root-mean-square nodal distance over root-mean-square displacement, shape (n,).
        max_errors: largest nodal distance over largest displacement, shape (n,).
        probe_errors: distance over displacement at the probe, shape (n,).
        rms_distances, max_distances: root-mean-square and largest nodal distance [m], shape (n,).
        support_errors: at each level those of the moved supports whose forces both paths know, of length n.
        surface: distances of outlines and nearest nodes, for a reference read as a surface.
    """

    model: Solution
    reference: Solution
    probe: int
    tolerance: float
    load_factors: Floats
    rms_errors: Floats
    max_errors: Floats
    probe_errors: Floats
    rms_distances: Floats
    max_distances: Floats
    known_on: tuple[Solution, Solution]
    outside: Bools
    compared: Bools
    support_errors: tuple[tuple[SupportError, ...], ...] = ()
    node_by_node: bool = True
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

    @cached_property
    def decisive(self) -> tuple[Decisive, ...]:
        """At each level the error that decides: the larger of rms error and force error, of length n."""
        return tuple(map(decisive, self.rms_errors.tolist(), self.support_errors))

    @cached_property
    def errors(self) -> Floats:
        """The error that decides at each level, shape (n,); not a number where none is known."""
        return np.array([one.error for one in self.decisive])

    @cached_property
    def force_errors(self) -> Floats:
        """The largest error of a support's force or torque at each level, shape (n,); not a number where none is."""
        return np.array([decisive(np.nan, several).error for several in self.support_errors])

    @property
    def supports(self) -> tuple[SupportError, ...]:
        """The errors of the moved supports at full load; empty where one path did not get there."""
        reached = self.load_factors.size and self.load_factors[-1] == 1.0
        return self.support_errors[-1] if reached else ()

    @property
    def error(self) -> float | None:
        """The error that decides at full load; None where one path did not get there."""
        return self._at_full_load(self.errors)

    @property
    def decided_by(self) -> str | None:
        """What decides at full load: "displacement", "force" or "torque"; None where nothing is known there."""
        return None if self.error is None else self.decisive[-1].quantity

    @property
    def force_error(self) -> float | None:
        """The largest error of a moved support's force or torque at full load; None where there is none to tell."""
        return self._at_full_load(self.force_errors)

    @property
    def n_outside(self) -> int:
        """The number of nodes that lie outside of the other body."""
        return int(self.outside.sum())

    @cached_property
    def n_reference_outside(self) -> int | None:
        """The number of the reference's own nodes outside of the model's body; None where the model has no inside."""
        model, reference = self.known_on
        nodes = reference.problem.mesh.nodes
        if not reference.states or not model.states or not model.whole.fills or nodes.shape[1] != model.whole.dim:
            return None
        return int(model.whole.locate(nodes).outside.sum())

    @cached_property
    def hausdorff(self) -> Gap | None:
        """How far the deformed surfaces of both are apart at the last level that both have [m].

        Corners of elements span the surfaces. None where one of both has no surface, or one lies in the plane and the
        other in space.
        """
        met = float(self.load_factors[-1]) if self.load_factors.size else None
        # One that is a surface only has no levels to meet at, but its own.
        alone = next((path.load_factor for path in self.known_on if not path.states), None)
        level = met if alone is None else alone
        if level is None:
            return None
        mine, theirs = (_facets(path, level) for path in self.known_on)
        if mine is None or theirs is None or mine.shape[1:] != theirs.shape[1:]:
            return None
        return gap(mine, theirs)

    @property
    def energy_error(self) -> float | None:
        """Difference over size of the stored energy at full load; None where one of both does not tell it."""
        mine, theirs = self.model.at(1.0), self.reference.at(1.0)
        if mine is None or theirs is None or not np.isfinite(mine.energy) or not theirs.energy:
            return None
        error = abs(mine.energy - theirs.energy) / abs(theirs.energy)
        return float(error) if np.isfinite(error) else None

    @property
    def agrees_up_to_load_factor(self) -> float | None:
        """The largest level up to which, without a gap from zero, the error that decides is under the tolerance.

        Zero where the first level already differs; None for a reference of one level, read from a file, and where
        there is nothing to compare.
        """
        if not self.load_factors.size or self.reference.states[0].load_factor != 0.0 or np.isnan(self.errors).all():
            return None
        beyond = np.flatnonzero(~(self.errors < self.tolerance))
        if not beyond.size:
            return float(self.load_factors[-1])
        return float(self.load_factors[beyond[0] - 1]) if beyond[0] else 0.0

    def __str__(self) -> str:
        """Return the comparison in a sentence."""
        if self.error is None:
            return f"{self.model.label} and {self.reference.label} do not meet at full load"
        up_to = self.agrees_up_to_load_factor
        within = "" if up_to is None else f", within {self.tolerance:.0%} up to load factor {up_to:g}"
        found = [] if self.rms_error is None else [f"{self.rms_error:.1%} rms"]
        found += [] if self.force_error is None else [f"{self.force_error:.1%} in the supports' force or torque"]
        return f"{self.model.label} against {self.reference.label}: {', '.join(found)} at full load{within}"


def compare(
    model: Solution,
    reference: Solution,
    probe: int | str | Sequence[float] | None = None,
    tolerance: float = TOLERANCE,
) -> Comparison:
    """Compare two paths at the loaded levels that both have: node by node where their nodes are the same.

    Else the reference is carried to the nodes of the model by the own interpolation of its elements; and the model to
    those of the reference where only they will do: a reference of markers or surfaces in space, a plane one beside a
    solid. What lies outside of the other body is left out and counted.

    `probe` is a node number of the model, a named point such as "right-middle" or a place [m], by default the node of
    the model that moves most. Raises ProblemError where neither path can be carried, MeshError where there is no such
    point.
    """
    problem = _common_problem(model, reference)
    mine, theirs = carried(model, problem), carried(reference, problem)
    outside = mine.outside | theirs.outside
    inside = np.flatnonzero(~outside)
    if not inside.size:
        raise ProblemError(
            f"no node of {model.label} lies within {reference.label}: are unit, axes and origin the same?"
        )
    watched = _watched(mine.path, inside, model, probe)
    pairs = [(state, theirs.path.at(state.level)) for state in mine.path.states if state.loaded]
    both = [(one, other) for one, other in pairs if other is not None]
    compared = ~outside & ~_dictated(mine.path, theirs.path)
    found = [_Distances.between(one, other, compared) for one, other in both]
    return Comparison(
        model=mine.path,
        reference=theirs.path,
        probe=watched,
        tolerance=tolerance,
        load_factors=np.array([one.level for one, _ in both]),
        rms_errors=np.array([one.rms / one.rms_size if one.rms_size else np.nan for one in found]),
        max_errors=np.array([one.max / one.max_size if one.max_size else np.nan for one in found]),
        probe_errors=np.array([_probe_error(one, other, watched) for one, other in both]),
        rms_distances=np.array([one.rms for one in found]),
        max_distances=np.array([one.max for one in found]),
        known_on=(model, reference),
        outside=outside,
        compared=compared,
        support_errors=tuple(tuple(_support_errors(mine.path, theirs.path, *pair)) for pair in both),
        node_by_node=mine.node_by_node and theirs.node_by_node,
        surface=_surface_distance(mine.path, theirs.path),
    )


def _dictated(mine: Solution, theirs: Solution) -> Bools:
    """The nodes that supports move or hold in all directions, in both paths where both tell, shape (n_nodes,)."""
    told = [one for one in (mine.dictated, theirs.dictated) if one is not None]
    return np.logical_and.reduce(told) if told else np.zeros(mine.problem.mesh.n_nodes, dtype=bool)


def _support_errors(mine: Solution, theirs: Solution, one: State, other: State) -> Iterator[SupportError]:
    """Yield the errors of the supports that both paths know, by their numbers."""
    wanted = {found.support: found for found in theirs.support_forces(other)}
    load = _total_load(mine, one)
    for found in mine.support_forces(one):
        if found.support in wanted and found.force.shape == wanted[found.support].force.shape:
            yield SupportError(found, wanted[found.support], load)


def _total_load(path: Solution, state: State) -> float | None:
    """The length of the total load at a state [N]; None where none acts beside the motion, or it has no total."""
    if not path.problem.stated or path.problem.loading.driven_by_motion:
        return None
    loads = path.problem.loading.force(state.positions, state.load_factor)
    total = float(np.linalg.norm(state.applied_force))
    return total if total > _NO_TOTAL * float(np.linalg.norm(loads, axis=1).sum()) else None


# Loads that balance but for this share have no total.
_NO_TOTAL = 1e-9


def _common_problem(model: Solution, reference: Solution) -> Problem:
    """The problem on whose nodes two paths are compared: the model's but where those of the reference tell more."""
    mine, theirs = model.problem, reference.problem
    if mine.mesh.dim != theirs.mesh.dim:
        return mine if mine.mesh.dim == 2 else theirs
    if mine.mesh.n_nodes == theirs.mesh.n_nodes and matching_points(model.whole, theirs.mesh.nodes) is not None:
        # One body: by its elements rather than as a network, with its supports and loads rather than without.
        return max((mine, theirs), key=lambda one: (one.mesh.element != "line", one.stated))
    if not reference.whole.fills and model.whole.fills:  # markers, networks, surfaces in space
        return theirs
    return mine


def _watched(on: Solution, inside: Ints, model: Solution, probe: int | str | Sequence[float] | None) -> int:
    """The node to watch, by its number where the paths are compared."""
    mesh = on.problem.mesh
    if isinstance(probe, str):
        return named_point(mesh, probe)
    if isinstance(probe, int | np.integer):
        given = model.problem.mesh
        return int(probe) if given is mesh else nearest_node(mesh, given.nodes[probe, : mesh.dim].tolist())
    return most_moved(on, inside) if probe is None else nearest_node(mesh, list(probe))


def closest(comparisons: Mapping[str, Comparison]) -> str | None:
    """Return the name of the reference with the smallest rms error at full load, None where there is none."""
    errors = {name: one.rms_error for name, one in comparisons.items()}
    known = {name: error for name, error in errors.items() if error is not None}
    # Errors that differ by rounding are equal; finite elements come first among equals.
    is_fem = {name: comparisons[name].reference.element is not None for name in known}
    order = {name: (float(f"{error:.9g}"), not is_fem[name]) for name, error in known.items()}
    return min(order, key=lambda name: order[name]) if order else None


def most_moved(path: Solution, among: Ints | None = None) -> int:
    """Return the node that moves most at the last level, of all or `among` some; of several, by smaller coordinates."""
    if not path.states:
        return 0
    # A node whose motion is prescribed in full tells nothing of the model.
    told = path.problem.loading.held.all(axis=1)
    moved = np.linalg.norm(path.states[-1].displacement, axis=1) * (told.all() | ~told)
    if among is not None:
        apart = np.ones(len(moved), dtype=bool)
        apart[among] = False
        moved[apart] = -1.0
    ties = np.flatnonzero(moved >= moved.max() * (1 - 1e-9))
    return int(min(ties, key=lambda node: tuple(path.problem.mesh.nodes[node])))


@dataclass(frozen=True, slots=True)
class _Distances:
    """Root-mean-square and largest nodal distance of two states, and size of the reference's displacement [m]."""

    rms: float
    max: float
    rms_size: float
    max_size: float

    @staticmethod
    def between(mine: State, theirs: State, compared: Bools) -> "_Distances":
        """Distances over some nodes; not a number where there are none."""
        distance = np.linalg.norm(mine.displacement[compared] - theirs.displacement[compared], axis=1)
        size = np.linalg.norm(theirs.displacement[compared], axis=1)
        if not distance.size:
            return _Distances(*[np.nan] * 4)
        means = (float(np.sqrt((one**2).mean())) for one in (distance, size))
        rms, rms_size = means
        return _Distances(rms, float(distance.max()), rms_size, float(size.max()))


def _probe_error(mine: State, theirs: State, probe: int) -> float:
    """The relative error at the probe; not a number where the reference does not move there."""
    size = float(np.linalg.norm(theirs.displacement[probe]))
    return float(np.linalg.norm(mine.displacement[probe] - theirs.displacement[probe])) / size if size else np.nan


def _apart(mine: Floats, theirs: Floats) -> Floats:
    return np.asarray((mine - theirs) / np.linalg.norm(theirs))


def _length(apart: Floats | None) -> float | None:
    return None if apart is None else float(np.linalg.norm(apart))


def _or_nan(error: float | None) -> float:
    return np.nan if error is None else error


def _facets(path: Solution, level: float) -> Floats | None:
    """The deformed surface by its segments or triangles [m], shape (n, 2, 2) or (n, 3, 3); None where there is none."""
    if not path.states:
        known = path.surface or path.shell
        return None if known is None else known.facets
    state, grid, mesh = path.at(level), path.whole, path.problem.mesh
    if state is None:
        return None
    if grid.fills:
        return np.asarray(state.positions[triangles_of(mesh.boundary)])
    if grid.cell_dim < 2:
        return None
    corners = [triangles_of(cells[:, : len(CELL_SHAPES[kind].corners)]) for kind, cells in grid.cells.items()]
    return np.asarray(state.all_positions[np.concatenate(corners)])


def _surface_distance(model: Solution, reference: Solution) -> SurfaceDistance | None:
    if reference.surface is None or model.problem.mesh.dim != 2:
        return None
    state = model.at(reference.surface.load_factor)
    if state is None:
        return None
    mesh = model.problem.mesh
    return surface_distance(state.positions, mesh.boundary, reference.surface)
