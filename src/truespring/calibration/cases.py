"""Load cases of a calibration: a problem, and what is known of how its body answers."""

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
    """What is known of an equilibrium at one level: `rows` times displacement, or times the reactions.

    Attributes:
        level: the load factor.
        quantity: "displacement" [m], "force" [N] or "torque" [N m] of a support.
        rows: sparse, shape (m, n_dof).
        data: shape (m,).
        scale: by which the objective divides errors: the norm of the like data at the last level that is known, so that
            what is small at first counts little; of forces no less than the total load.
        whole: whether the displacement of all nodes is known, of which equilibrium itself may be asked.
        support: the number of the support whose force or torque it is.
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
    """A problem, and references that its springs are to follow.

    Attributes:
        name: how tables call it.
        problem: mesh, material, supports, loads; of all cases of a calibration the mesh is the same.
        reference: a path solved on any mesh, or read from a file: of a body of cells full fields, else markers.
        curve: a measured force-displacement curve.
        solver: how equilibrium is found; the levels that are compared are among its load steps.
        against: what the reference is, in words; by default its label.
        own_error: how far the reference is itself off, relative, None where that is not known.
        field: full displacement fields on the nodes of the problem, None where the reference holds none.

    Raises ProblemError where nothing is known at any level of the solver.
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
            known = "what was measured" if self.reference is None else self.reference.label
            object.__setattr__(self, "against", known)
        if not self.solver.follows_load:
            raise ProblemError(
                f'{self.name}: springs are calibrated under load control, with Newton: take control = "load"'
            )
        if not self.observations:
            steps = self.solver.load_steps
            raise ProblemError(
                f"{self.name}: nothing is known at the load levels k/{steps} that are solved: give a reference with "
                "such levels, or a curve that reaches the first of them"
            )

    @cached_property
    def levels(self) -> Floats:
        """The load factors that are solved, shape (n,)."""
        return np.arange(1, self.solver.load_steps + 1) / self.solver.load_steps

    @cached_property
    def field(self) -> "tuple[Solution, Ints] | None":
        """The reference on the nodes of the problem, and the nodes that it covers; None where it is no full field."""
        if self.reference is None or not self.reference.states:
            return None
        if self.reference.problem.mesh.element == "line" or not self.reference.whole.fills:
            return None
        found = carried(self.reference, self.problem)
        return found.path, np.flatnonzero(~found.outside)

    @cached_property
    def observations(self) -> tuple[Observation, ...]:
        """All that is known, level by level."""
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
        """The total of the loads at full load [N]."""
        return float(np.linalg.norm(self.problem.loading.force(self.problem.mesh.nodes).sum(axis=0)))

    @cached_property
    def free(self) -> Ints:
        """The numbers of the directions that are free."""
        return np.flatnonzero(~self.problem.loading.held.ravel())

    def _of_field(self, level: float) -> Iterator[Observation]:
        if self.field is None:
            return
        path, nodes = self.field
        state = path.at(level)
        if state is None:
            return
        dim = self.problem.mesh.dim
        told = nodes[~self.problem.loading.held[nodes].all(axis=1)]  # of others the displacement is prescribed
        dofs = (told[:, None] * dim + np.arange(dim)).ravel()
        if dofs.size:
            whole = len(nodes) == self.problem.mesh.n_nodes
            yield Observation(level, "displacement", self._picked(dofs), state.displacement.ravel()[dofs], whole)
        yield from self._of_supports(path.support_forces(state), state.positions, level)

    def _of_supports(self, forces: Sequence[SupportForce], positions: Floats, level: float) -> Iterator[Observation]:
        """What moved supports take: forces, and torques where the support holds its nodes in all directions.

        The arms of a torque are then prescribed; where nodes slide they change with what is sought.
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
        """What interpolates the displacement at the markers within the body, and their numbers."""
        assert self.reference is not None
        mesh, points = self.problem.mesh, self.reference.whole.points
        if points.shape[1] < mesh.dim:
            raise ProblemError(f"{self.name}: markers in a plane say nothing of a body in space")
        found = Grid(mesh.nodes, mesh.cells).locate(points[:, : mesh.dim])
        inside = np.flatnonzero(~found.outside)
        if not inside.size:
            raise ProblemError(f"{self.name}: no marker lies within the body: are unit, axes and origin the same?")
        rows = sparse.csr_array(sparse.kron(found.weights[inside], sparse.eye_array(mesh.dim)))
        return rows, inside

    def _of_curve(self, level: float) -> Iterator[Observation]:
        if self.curve is None:
            return
        for quantity, axes, data in self.curve.at(level):
            whole = self._pull(level) if quantity == "force" else self._probe(self.curve.probe)
            yield Observation(level, quantity, sparse.csr_array(whole[axes]), data)

    def _pull(self, level: float) -> Rows:
        """What sums the reactions of the support that moves most, whose force a curve tells, shape (dim, n_dof)."""
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
    """Raise ProblemError where a case, by name and problem, has another body than the one that is calibrated."""
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
                f"{case}: its {what} is another than that of the body that is calibrated; load cases differ in "
                "supports and loads only"
            )


def _same_mesh(one: Problem, other: Problem) -> bool:
    mine, theirs = one.mesh, other.mesh
    return (
        mine.element == theirs.element
        and np.array_equal(mine.nodes, theirs.nodes)
        and np.array_equal(mine.elements, theirs.elements)
    )
