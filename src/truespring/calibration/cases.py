"""Load cases of a calibration: a problem with measured or computed displacements and forces."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from truespring.arrays import Floats, Ints
from truespring.calibration.curve import Curve
from truespring.carrying import carried
from truespring.equilibrium import Solution
from truespring.errors import ProblemError
from truespring.mesh import Grid
from truespring.problem import Problem
from truespring.reactions import SupportForce, leading_support, resultant_rows
from truespring.solvers import Newton, Solver

Rows = sparse.csr_array[Any, tuple[int, int]]


@dataclass(frozen=True, eq=False)
class Observation:
    """Data of one load level: `rows` times the displacement, or times the reactions, should equal `data`.

    Attributes:
        level: load factor.
        quantity: "displacement" [m], "force" [N] or "torque" [N m] of a support.
        rows: sparse, shape (m, n_dof).
        data: shape (m,).
        scale: by which the objective divides errors: the norm of data of this quantity at the last known level, so that
            small values at first levels have little weight; for forces at least the total load.
        whole: whether the displacement of all nodes is known, so that equilibrium can be evaluated.
        support: number of the support of a force or torque.
    """

    level: float
    quantity: str
    rows: Rows
    data: Floats
    whole: bool = False
    scale: float = 1.0
    support: int | None = None

    @property
    def size(self) -> float:
        """The norm of the data."""
        return float(np.linalg.norm(self.data))


@dataclass(frozen=True, eq=False)
class LoadCase:
    """A problem, and the reference that its springs are fitted to.

    Attributes:
        name: name in tables.
        problem: mesh, material, supports, loads; all cases of a calibration have the same mesh.
        reference: a path solved on any mesh or read from a file: a full field if it has elements, else markers.
        curve: a measured force-displacement curve.
        solver: solver of the equilibria; data are compared at its load steps.
        against: the reference in words; by default its label.
        own_error: relative error of the reference; None if unknown.
        field: the reference as full field on the nodes of the problem; None if it is not one.

    Raises ProblemError if there are no data at any load step of the solver.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> reference = ts.solve(problem, ts.Fem("neo-hookean"))
        >>> case = ts.LoadCase("pulled", problem, reference)
        >>> case.name
        'pulled'
    """

    name: str
    problem: Problem
    reference: Solution | None = None
    curve: Curve | None = None
    solver: Solver = field(default_factory=Newton)
    against: str = ""
    own_error: float | None = None

    def __post_init__(self) -> None:
        if not self.against:
            known = "the measured data" if self.reference is None else self.reference.label
            object.__setattr__(self, "against", known)
        if not self.solver.follows_load:
            raise ProblemError(f'{self.name}: calibration needs load control: set control = "load"')
        if self.problem.dynamics is not None:
            raise ProblemError(f"{self.name}: calibration is for equilibria: leave dynamics out")
        if not self.observations:
            steps = self.solver.load_steps
            raise ProblemError(
                f"{self.name}: there are no data at the load levels k/{steps} of the solver: give a reference with "
                "such levels, or a curve that reaches the first of them"
            )

    @cached_property
    def levels(self) -> Floats:
        """Load factors of the solver's steps [-], shape (n,)."""
        return np.arange(1, self.solver.load_steps + 1) / self.solver.load_steps

    @cached_property
    def field(self) -> "tuple[Solution, Ints] | None":
        """The reference on the nodes of the problem, and the nodes that it covers, shape (n,).

        None if not a full field.
        """
        if self.reference is None or not self.reference.states:
            return None
        if self.reference.problem.mesh.element == "line" or not self.reference.whole.fills:
            return None
        found = carried(self.reference, self.problem)
        return found.path, np.flatnonzero(~found.outside)

    @cached_property
    def observations(self) -> tuple[Observation, ...]:
        """All data, by load level."""
        known: list[Observation] = []
        for source in (self._of_field, self._of_markers, self._of_curve):
            found = [one for level in self.levels for one in source(level)]
            for kind in dict.fromkeys((one.quantity, one.support) for one in found):
                like = [one for one in found if (one.quantity, one.support) == kind and one.size]
                least = self._load if kind[0] == "force" else 0.0
                known += [replace(one, scale=max(like[-1].size, least)) for one in like]
        return tuple(sorted(known, key=lambda one: one.level))

    @property
    def _load(self) -> float:
        """Norm of the total force at full load [N]."""
        return float(np.linalg.norm(self.problem.loading.force(self.problem.mesh.nodes).sum(axis=0)))

    @cached_property
    def free(self) -> Ints:
        """Numbers of the free degrees of freedom, shape (n_free,)."""
        return np.flatnonzero(~self.problem.loading.held.ravel())

    def _of_field(self, level: float) -> Iterator[Observation]:
        if self.field is None:
            return
        path, nodes = self.field
        state = path.at(level)
        if state is None:
            return
        dim = self.problem.mesh.dim
        free = nodes[~self.problem.loading.held[nodes].all(axis=1)]  # others have a prescribed displacement
        dofs = (free[:, None] * dim + np.arange(dim)).ravel()
        if dofs.size:
            whole = len(nodes) == self.problem.mesh.n_nodes
            yield Observation(level, "displacement", self._picked(dofs), state.displacement.ravel()[dofs], whole)
        yield from self._of_supports(path.support_forces(state), state.positions, level)

    def _of_supports(self, forces: Sequence[SupportForce], positions: Floats, level: float) -> Iterator[Observation]:
        """Yield forces of moved supports, and torques of those that hold their nodes in all directions.

        The lever arms of such torques are prescribed; those of sliding nodes depend on the unknowns.
        """
        for one in forces:
            force, torque = resultant_rows(self.problem, one.support, positions, level)
            if one.has_force:
                yield Observation(level, "force", force, one.force, support=one.support)
            if one.has_torque and len(self.problem.held[one.support].directions) == self.problem.mesh.dim:
                yield Observation(level, "torque", torque, one.torque, support=one.support)

    def _of_markers(self, level: float) -> Iterator[Observation]:
        reference = self.reference
        if reference is None or self.field is not None or not reference.states:
            return
        state = reference.at(level)
        if state is None:
            return
        rows, inside = self._marker_rows
        moved = state.all_positions - reference.whole.points
        yield Observation(level, "displacement", rows, moved[inside, : self.problem.mesh.dim].ravel())

    @cached_property
    def _marker_rows(self) -> tuple[Rows, Ints]:
        """The interpolation from nodes to the markers in the body, and the numbers of those markers."""
        assert self.reference is not None
        mesh, points = self.problem.mesh, self.reference.whole.points
        if points.shape[1] < mesh.dim:
            raise ProblemError(f"{self.name}: markers have 2 coordinates, the body has 3")
        found = Grid(mesh.nodes, mesh.cells).locate(points[:, : mesh.dim])
        inside = np.flatnonzero(~found.outside)
        if not inside.size:
            raise ProblemError(f"{self.name}: no marker lies in the body: check unit, axes and origin")
        rows = sparse.csr_array(sparse.kron(found.weights[inside], sparse.eye_array(mesh.dim)))
        return rows, inside

    def _of_curve(self, level: float) -> Iterator[Observation]:
        if self.curve is None:
            return
        for quantity, axes, data in self.curve.at(level):
            whole = self._pull(level) if quantity == "force" else self._probe(self.curve.probe)
            yield Observation(level, quantity, sparse.csr_array(whole[axes]), data)

    def _pull(self, level: float) -> Rows:
        """Return the rows that sum the reactions of the support that moves most, shape (dim, n_dof)."""
        support = leading_support(self.problem)
        assert support is not None  # a motion drives the body
        force, _ = resultant_rows(self.problem, support, self.problem.mesh.nodes, level)
        return force

    def _probe(self, node: int) -> Rows:
        dim = self.problem.mesh.dim
        return self._picked(node * dim + np.arange(dim))

    def _picked(self, dofs: Ints) -> Rows:
        size = self.problem.mesh.nodes.size
        return sparse.csr_array((np.ones(len(dofs)), (np.arange(len(dofs)), dofs)), shape=(len(dofs), size))


def require_one_body(cases: Iterable[tuple[str, Problem]], problem: Problem) -> None:
    """Raise ProblemError if a case, given by name and problem, differs from the calibrated body."""
    for case, own in cases:
        what = next(
            (
                name
                for name, same in (
                    ("mesh", _same_mesh(own, problem)),
                    ("material", own.materials == problem.materials),
                    ("material of some elements", np.array_equal(own.material_numbers, problem.material_numbers)),
                    ("section", own.section == problem.section),
                )
                if not same
            ),
            None,
        )
        if what is not None:
            raise ProblemError(
                f"{case}: its {what} differs from that of the calibrated body: load cases may differ in supports and "
                "loads only"
            )


def _same_mesh(one: Problem, other: Problem) -> bool:
    mine, theirs = one.mesh, other.mesh
    return (
        mine.element == theirs.element
        and np.array_equal(mine.nodes, theirs.nodes)
        and np.array_equal(mine.elements, theirs.elements)
    )
