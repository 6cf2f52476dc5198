"""Compare two solutions: the errors of a model against a reference at each load level."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.carrying import carried, matching_points
from truespring.errors import ProblemError
from truespring.mesh import CELL_SHAPES, Gap, SurfaceDistance, gap, named_point, nearest_node, surface_distance
from truespring.mesh.facets import triangles_of
from truespring.problem import Problem
from truespring.solution import Solution, State
from truespring.support_errors import (
    Decisive,
    SupportError,
    decisive,
    of_the_way,
    over_the_way,
    support_errors,
    touch_errors,
)

#: Default tolerance: two solutions agree if their error is below 5 %.
TOLERANCE = 0.05


def _rms(values: Floats) -> float:
    """Return the root mean square of values, in their unit."""
    return float(np.sqrt((values**2).mean()))


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Errors of a solution against a reference, relative to the size of the reference's quantity.

    Attributes:
        model, reference: the two solutions on the mesh on which they are compared.
        known_on: the two solutions on their original meshes.
        outside: true for nodes outside of the other body, excluded from all errors, shape (n_nodes,).
        compared: true for nodes that enter the rms and largest errors: within both bodies, and not prescribed in all
            directions by supports (there both agree whatever the model), shape (n_nodes,).
        node_by_node: whether both had the same nodes, so that nothing was interpolated.
        probe: number of the probe node.
        tolerance: the error below which the two agree [-].
        load_factors: levels above zero that both solutions have, ascending, shape (n,).
        rms_errors: root-mean-square nodal distance over root-mean-square displacement [-], shape (n,).
        max_errors: largest nodal distance over largest displacement [-], shape (n,).
        probe_errors: distance over displacement at the probe [-], shape (n,).
        rms_distances, max_distances: root-mean-square and largest nodal distance [m], shape (n,).
        support_errors: for each level, the errors of the moved supports, tools and grasps whose forces both solutions
            have, length n.
        surface: distances of outlines and nearest nodes, for a reference read as a surface.
        over_the_way: whether the errors are those over all levels, as of a motion or a load that returns to zero. The
            errors at a level are then over the root-mean-square, or the largest, quantity of all levels; the rms, probe
            and force errors are their root mean square, the largest error is the worst.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> finite = ts.solve(problem, ts.Fem("neo-hookean"))
        >>> found = ts.compare(ts.solve(problem, ts.Springs("lloyd")), finite, probe="right-middle")
        >>> f"{found.rms_error:.1%} rms, {found.probe_error:.1%} at the probe"
        '2.6% rms, 1.8% at the probe'
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
    over_the_way: bool = False

    def __repr__(self) -> str:
        return f"Comparison({self})"

    def _repr_html_(self) -> str:
        """Return the comparison as HTML for a notebook: a table and a picture."""
        from truespring.showing.values import html_of

        return html_of(self)

    def last(self, errors: Floats, worst: bool = False) -> float:
        """Return the last of the errors at the levels, or their root mean square over the way; NaN without any.

        Over the way, `worst` takes the largest.
        """
        if not self.load_factors.size:
            return np.nan
        if self.over_the_way:
            return float(errors.max()) if worst else _rms(errors)
        return float(errors[-1])

    def _at_full_load(self, error: float) -> float | None:
        """Return an error, or None if a solution does not reach full load or the error is NaN."""
        return error if self._complete and np.isfinite(error) else None

    @property
    def _complete(self) -> bool:
        return bool(self.load_factors.size and self.load_factors[-1] == 1.0)

    @property
    def probe_error(self) -> float | None:
        """The probe's error at full load; None if a solution does not reach it."""
        return self._at_full_load(self.last(self.probe_errors))

    @property
    def rms_error(self) -> float | None:
        """The rms error at full load; None if a solution does not reach it."""
        return self._at_full_load(self.last(self.rms_errors))

    @property
    def max_error(self) -> float | None:
        """The largest error at full load; None if a solution does not reach it."""
        return self._at_full_load(self.last(self.max_errors, worst=True))

    @cached_property
    def decisive(self) -> tuple[Decisive, ...]:
        """The error that decides at each level: the larger of rms error and force error; length n."""
        return tuple(map(decisive, self.rms_errors.tolist(), self.support_errors))

    @cached_property
    def errors(self) -> Floats:
        """The error that decides at each level [-], shape (n,); NaN where none is known."""
        return np.array([one.error for one in self.decisive])

    @cached_property
    def force_errors(self) -> Floats:
        """The largest error of a support's force or torque at each level [-], shape (n,); NaN where none is known."""
        return np.array([decisive(np.nan, several).error for several in self.support_errors])

    @cached_property
    def last_supports(self) -> tuple[SupportError, ...]:
        """The errors of supports, tools and grasps at the last level, or over the way."""
        if self.over_the_way:
            return of_the_way(self.support_errors)
        return self.support_errors[-1] if self.support_errors else ()

    @property
    def supports(self) -> tuple[SupportError, ...]:
        """The errors of supports, tools and grasps at full load; empty if a solution does not reach it."""
        return self.last_supports if self._complete else ()

    @cached_property
    def last_decisive(self) -> Decisive:
        """The error that decides at the last level, or over the way."""
        return decisive(self.last(self.rms_errors), self.last_supports)

    @property
    def error(self) -> float | None:
        """The error that decides at full load; None if a solution does not reach it."""
        return self._at_full_load(self.last_decisive.error)

    @property
    def decided_by(self) -> str | None:
        """The quantity whose error decides at full load: "displacement", "force" or "torque"; None if none is known."""
        return None if self.error is None else self.last_decisive.quantity

    @property
    def force_error(self) -> float | None:
        """The largest error of a force or torque at full load; None if none is known."""
        return self._at_full_load(decisive(np.nan, self.last_supports).error)

    @property
    def n_outside(self) -> int:
        """The number of nodes outside of the other body."""
        return int(self.outside.sum())

    @cached_property
    def n_reference_outside(self) -> int | None:
        """The number of nodes of the reference's mesh outside of the model's body; None if that encloses no volume."""
        model, reference = self.known_on
        nodes = reference.problem.mesh.nodes
        if not reference.states or not model.states or not model.whole.fills or nodes.shape[1] != model.whole.dim:
            return None
        return int(model.whole.locate(nodes).outside.sum())

    @cached_property
    def hausdorff(self) -> Gap | None:
        """The Hausdorff distance of the deformed surfaces at the last level that both have [m].

        Corners of elements span the surfaces. None if one has no surface, or if one is plane and the other in space.
        """
        shared = float(self.load_factors[-1]) if self.load_factors.size else None
        # A solution read as a surface has one level and no states.
        alone = next((path.load_factor for path in self.known_on if not path.states), None)
        level = shared if alone is None else alone
        if level is None:
            return None
        mine, theirs = (_facets(path, level) for path in self.known_on)
        if mine is None or theirs is None or mine.shape[1:] != theirs.shape[1:]:
            return None
        return gap(mine, theirs)

    @property
    def energy_error(self) -> float | None:
        """Relative difference of the stored energy at full load; None if one of the two is not known."""
        mine, theirs = self.model.at(1.0), self.reference.at(1.0)
        if mine is None or theirs is None or not np.isfinite(mine.energy) or not theirs.energy:
            return None
        error = abs(mine.energy - theirs.energy) / abs(theirs.energy)
        return float(error) if np.isfinite(error) else None

    @property
    def agrees_up_to_load_factor(self) -> float | None:
        """The last of the levels, from the first on, at which the error that decides is below the tolerance.

        Zero if the error of the first level is not; None if the reference has no unloaded state (as one read from a
        file) or no error is known.
        """
        if not self.load_factors.size or self.reference.states[0].load_factor != 0.0 or np.isnan(self.errors).all():
            return None
        beyond = np.flatnonzero(~(self.errors < self.tolerance))
        if not beyond.size:
            return float(self.load_factors[-1])
        return float(self.load_factors[beyond[0] - 1]) if beyond[0] else 0.0

    def __str__(self) -> str:
        """Return the errors at full load, or over the way, in a sentence."""
        if self.error is None:
            return f"{self.model.label} against {self.reference.label}: no error at full load is known"
        up_to = self.agrees_up_to_load_factor
        within = "" if up_to is None else f", within {self.tolerance:.0%} up to load factor {up_to:g}"
        where = "over the whole way" if self.over_the_way else "at full load"
        found = [] if self.rms_error is None else [f"{self.rms_error:.1%} rms"]
        found += [] if self.force_error is None else [f"{self.force_error:.1%} in the supports' force or torque"]
        return f"{self.model.label} against {self.reference.label}: {', '.join(found)} {where}{within}"


def compare(
    model: Solution,
    reference: Solution,
    probe: int | str | Sequence[float] | None = None,
    tolerance: float = TOLERANCE,
) -> Comparison:
    """Return the errors of `model` against `reference` at the levels above zero that both have.

    If both have the same nodes, they are compared node by node. Else the displacement of the reference is interpolated
    at the nodes of the model by its elements; or that of the model at the nodes of the reference, if the reference is
    known at points only (markers, a surface in space) or is plane and the model a solid. Nodes outside of the other
    body are excluded and counted.

    Args:
        model: solution to judge.
        reference: solution to compare with.
        probe: node number of the model, named point such as "right-middle", or position [m]; by default the node of
            the model that moves most.
        tolerance: relative error below which the two agree.

    Raises ProblemError if neither solution can be interpolated at the nodes of the other, MeshError if the probe does
    not exist.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> finite = ts.solve(problem, ts.Fem("neo-hookean"))
        >>> print(ts.compare(ts.solve(problem, ts.Springs("gaussian")), finite))
        springs (gaussian) against neo-Hookean FEM: 0.6% rms at full load, within 5% up to load factor 1
    """
    problem = _common_problem(model, reference)
    mine, theirs = carried(model, problem), carried(reference, problem)
    outside = mine.outside | theirs.outside
    inside = np.flatnonzero(~outside)
    if not inside.size:
        raise ProblemError(
            f"no node of {model.label} lies within {reference.label}: check unit, axes and origin of the two"
        )
    watched = _watched(mine.path, inside, model, probe)
    pairs = [(state, theirs.path.at(state.level)) for state in mine.path.states if state.loaded]
    both = [(one, other) for one, other in pairs if other is not None]
    compared = ~outside & ~_prescribed(mine.path, theirs.path)
    found = [_Distances.between(one, other, compared) for one, other in both]
    probed = [_at_probe(one, other, watched) for one, other in both]
    called = [[one.name for one in path.problem.touching] for path in (model, reference)]
    forces = [(*support_errors(mine.path, theirs.path, *pair), *touch_errors(called, *pair)) for pair in both]
    over = mine.path.problem.returns
    if over:
        found, probed, forces = _over_the_way(found), _over_the_way(probed), over_the_way(forces)
    return Comparison(
        model=mine.path,
        reference=theirs.path,
        probe=watched,
        tolerance=tolerance,
        load_factors=np.array([one.level for one, _ in both]),
        rms_errors=np.array([one.rms / one.rms_size if one.rms_size else np.nan for one in found]),
        max_errors=np.array([one.max / one.max_size if one.max_size else np.nan for one in found]),
        probe_errors=np.array([one.rms / one.rms_size if one.rms_size else np.nan for one in probed]),
        rms_distances=np.array([one.rms for one in found]),
        max_distances=np.array([one.max for one in found]),
        known_on=(model, reference),
        outside=outside,
        compared=compared,
        support_errors=tuple(forces),
        node_by_node=mine.node_by_node and theirs.node_by_node,
        surface=_surface_distance(mine.path, theirs.path),
        over_the_way=over,
    )


def _prescribed(mine: Solution, theirs: Solution) -> Bools:
    """Return which nodes are prescribed in all directions, in both solutions if known in both, shape (n_nodes,)."""
    known = [one for one in (mine.prescribed, theirs.prescribed) if one is not None]
    return np.logical_and.reduce(known) if known else np.zeros(mine.problem.mesh.n_nodes, dtype=bool)


def _common_problem(model: Solution, reference: Solution) -> Problem:
    """Return the problem on whose nodes two solutions are compared: the model's, or the reference's; see `compare`."""
    mine, theirs = model.problem, reference.problem
    if mine.mesh.dim != theirs.mesh.dim:
        return mine if mine.mesh.dim == 2 else theirs
    if mine.mesh.n_nodes == theirs.mesh.n_nodes and matching_points(model.whole, theirs.mesh.nodes) is not None:
        # The same nodes: prefer elements to a network, and a problem with supports and loads to one without.
        return max((mine, theirs), key=lambda one: (one.mesh.element != "line", one.stated))
    if not reference.whole.fills and model.whole.fills:  # markers, networks, surfaces in space
        return theirs
    return mine


def _watched(on: Solution, inside: Ints, model: Solution, probe: int | str | Sequence[float] | None) -> int:
    """Return the number of the probe node on the mesh on which the solutions are compared."""
    mesh = on.problem.mesh
    if isinstance(probe, str):
        return named_point(mesh, probe)
    if isinstance(probe, int | np.integer):
        given = model.problem.mesh
        return int(probe) if given is mesh else nearest_node(mesh, given.nodes[probe, : mesh.dim].tolist())
    return most_moved(on, inside) if probe is None else nearest_node(mesh, list(probe))


def closest(comparisons: Mapping[str, Comparison]) -> str | None:
    """Return the name of the comparison with the smallest rms error at full load, None if no such error is known."""
    errors = {name: one.rms_error for name, one in comparisons.items()}
    known = {name: error for name, error in errors.items() if error is not None}
    # Errors that differ by rounding are equal; of equal ones, finite elements come first.
    is_fem = {name: comparisons[name].reference.element is not None for name in known}
    order = {name: (float(f"{error:.9g}"), not is_fem[name]) for name, error in known.items()}
    return min(order, key=lambda name: order[name]) if order else None


def most_moved(path: Solution, among: Ints | None = None) -> int:
    """Return the number of the node that moves most at the last level, of all nodes or of those in `among`.

    If displacements may return to zero, as in a motion, it is the node that moves most at any level.

    Of nodes that move equally, the one with the smallest coordinates (x first). Nodes prescribed in all directions
    count only if there are no others.
    """
    if not path.states:
        return 0
    prescribed = path.problem.loading.held.all(axis=1)
    states = path.states if path.problem.returns else path.states[-1:]
    moved = np.max([np.linalg.norm(state.displacement, axis=1) for state in states], axis=0)
    moved *= prescribed.all() | ~prescribed
    if among is not None:
        others = np.ones(len(moved), dtype=bool)
        others[among] = False
        moved[others] = -1.0
    ties = np.flatnonzero(moved >= moved.max() * (1 - 1e-9))
    return int(min(ties, key=lambda node: tuple(path.problem.mesh.nodes[node])))


@dataclass(frozen=True, slots=True)
class _Distances:
    """Root-mean-square and largest nodal distance of two states [m], and the same of the reference's displacement."""

    rms: float
    max: float
    rms_size: float
    max_size: float

    @staticmethod
    def between(mine: State, theirs: State, compared: Bools) -> "_Distances":
        """Return the distances over the nodes of a mask, NaN if it is empty."""
        distance = np.linalg.norm(mine.displacement[compared] - theirs.displacement[compared], axis=1)
        size = np.linalg.norm(theirs.displacement[compared], axis=1)
        if not distance.size:
            return _Distances(*[np.nan] * 4)
        means = (float(np.sqrt((one**2).mean())) for one in (distance, size))
        rms, rms_size = means
        return _Distances(rms, float(distance.max()), rms_size, float(size.max()))


def _at_probe(mine: State, theirs: State, probe: int) -> _Distances:
    """Return the distance at the probe, and the size of the reference's displacement."""
    size = float(np.linalg.norm(theirs.displacement[probe]))
    distance = float(np.linalg.norm(mine.displacement[probe] - theirs.displacement[probe]))
    return _Distances(distance, distance, size, size)


def _over_the_way(found: Sequence[_Distances]) -> list[_Distances]:
    """Return distances with the displacement of all levels: its root mean square, and the largest."""
    if not found:
        return []
    rms, largest = _rms(np.array([one.rms_size for one in found])), max(one.max_size for one in found)
    return [replace(one, rms_size=rms, max_size=largest) for one in found]


def _facets(path: Solution, level: float) -> Floats | None:
    """Return segments or triangles of the deformed surface [m], shape (n, 2, 2) or (n, 3, 3); None without one."""
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
    """Return the distances between the outline of a plane model and a reference read as a surface, None for others."""
    if reference.surface is None or model.problem.mesh.dim != 2:
        return None
    state = model.at(reference.surface.load_factor)
    if state is None:
        return None
    mesh = model.problem.mesh
    return surface_distance(state.positions, mesh.boundary, reference.surface)
