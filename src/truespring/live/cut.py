"""Cuts: what is left of a body after blades passed through it, and the state of its remaining nodes."""

import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Refined
from truespring.equilibrium import moving_body
from truespring.errors import LiveError
from truespring.live.actions import Grip
from truespring.live.blade import Blade
from truespring.live.commands import Command
from truespring.live.remaining import Left, remaining
from truespring.mesh import Mesh, Remainder
from truespring.models import Model
from truespring.motion.explicit import stable_step
from truespring.motion.moving import Body
from truespring.motion.stages import Moment
from truespring.potential import Potential
from truespring.problem import Problem
from truespring.solvers import Geometry


@dataclass(frozen=True, eq=False)
class Built:
    """What a session needs of a problem and a model to move, whose building takes long for a large body.

    Attributes:
        body: what moves.
        geometry: functions of the mesh.
        stable: the largest stable step of leapfrog [s].
    """

    body: Body
    geometry: Geometry
    stable: float


def built(problem: Problem, model: Model) -> Built:
    """Build what moves; raises ModelError and ProblemError as `moving_body`."""
    body, geometry = moving_body(problem, model)
    return Built(body, geometry, stable_step(body))


@dataclass(frozen=True, eq=False)
class Whole:
    """A body as stated, or what cuts left of it.

    Attributes:
        problem: the problem as stated, without the changes of a session.
        model: its model.
        models: models to which a session can change, by name.
        nodes: numbers of its nodes in the uncut body, ascending, shape (n_nodes,).
        elements: numbers of its elements in the uncut body, ascending, shape (n_elements,).
        uncut: number of elements of the uncut body.
        lost: names of grasps of the problem that the last cut left without a node.
    """

    problem: Problem
    model: Model
    models: Mapping[str, Model]
    nodes: Ints
    elements: Ints
    uncut: int
    lost: tuple[str, ...] = ()

    @classmethod
    def of(cls, problem: Problem, model: Model, models: Mapping[str, Model]) -> Self:
        """Return an uncut body."""
        mesh = problem.mesh
        return cls(problem, model, models, np.arange(mesh.n_nodes), np.arange(len(mesh.elements)), len(mesh.elements))

    def numbers_of(self, command: Command, positions: Floats) -> Ints:
        """Return the elements that a cut removes, numbers in the uncut body, ascending, shape (n,).

        `positions` are those of the nodes now [m]. Raises LiveError if no element would remain, for a blade without
        length or area, and for elements that the body does not have.
        """
        mesh = self.problem.mesh
        if command.elements is None:
            passed = self.elements[Blade.of(command.place, mesh.dim).passed(mesh, positions)]
        else:
            beyond = max(command.elements, default=0)
            if beyond >= self.uncut:
                raise LiveError(
                    f"cut: element {beyond} does not exist, the body has 0 to {self.uncut - 1}: cut a body with "
                    "another mesh by the blade alone, without elements"
                )
            passed = np.intersect1d(np.array(command.elements, dtype=np.int64), self.elements)
        if len(passed) == len(self.elements):
            raise LiveError(f"cut: the blade passes all {len(passed)} elements, and nothing would remain: move it")
        return passed

    def without(self, command: Command, model: Model) -> "tuple[Whole, Remainder]":
        """Return what a cut with known elements leaves, and how it lies in this body.

        `model` is the present one. Raises ModelError if a model cannot be cut.
        """
        keep = np.flatnonzero(~np.isin(self.elements, np.array(command.elements, dtype=np.int64)))
        left: Left = remaining(self.problem, keep)
        of = left.of
        models = {name: one.on_remainder(of) for name, one in self.models.items()}
        kept = self.nodes[of.nodes], self.elements[of.elements], self.uncut
        return Whole(left.problem, model.on_remainder(of), models, *kept, left.lost), of


def kept_rows(of: Remainder, before: Potential, now: Potential) -> Ints:
    """Return where the nodes of a potential were in that before the cut, shape (n,), also those between nodes."""
    if not isinstance(before, Refined) or not isinstance(now, Refined):
        return of.nodes
    n_before, old = of.whole.n_nodes, np.sort(before.parents, axis=1)
    keys = old[:, 0] * n_before + old[:, 1]
    order = np.argsort(keys)
    new = np.sort(of.nodes[now.parents], axis=1)
    there = order[np.searchsorted(keys, new[:, 0] * n_before + new[:, 1], sorter=order)]
    return np.concatenate([of.nodes, n_before + there])


def kept_moment(moment: Moment, rows: Ints) -> Moment:
    """Return the state of the nodes that remain: their positions and velocities as before."""
    return Moment(moment.time, moment.positions[rows], moment.velocity[rows])


def kept_grips(grips: Mapping[str, Grip], rows: Ints, n_before: int) -> dict[str, Grip]:
    """Return grasps with the nodes that remain, those without any left out; `rows` as `kept_rows`."""
    numbers = np.full(n_before, -1, dtype=np.int64)
    numbers[rows] = np.arange(len(rows))
    found = {}
    for name, one in grips.items():
        there = numbers[one.nodes] >= 0
        if there.any():
            nodes = numbers[one.nodes[there]]
            found[name] = replace(one, nodes=nodes, stiffness=one.stiffness[there], rest=one.rest[there])
    return found


def loose_parts(mesh: Mesh, supported: Ints) -> tuple[int, int]:
    """Return the number of parts of a body, and of those without a node that is `supported`, shape (n,)."""
    n_parts = int(mesh.parts.max()) + 1
    return n_parts, n_parts - len(np.unique(mesh.parts[supported]))


def cut_words(n_removed: int, n_parts: int, n_loose: int, gone: Sequence[str]) -> str:
    """Return what a cut did, as a sentence without a full stop."""
    words = f"{n_removed} element{'s' * (n_removed != 1)} removed by a cut"
    if n_parts > 1:
        words += f"; the body is in {n_parts} parts"
    if n_loose:
        words += f", {n_loose} of them without a support: {'they fall' if n_loose > 1 else 'it falls'} free"
    if gone:
        words += f"; released, as none of their nodes remains: {', '.join(gone)}"
    return words


@dataclass(frozen=True, eq=False)
class Prepared:
    """A cut body, ready to move.

    Attributes:
        left: what is left, as stated.
        of: how its mesh lies in that before.
        problem: the problem with the changes of the session.
        built: what moves.
    """

    left: Whole
    of: Remainder
    problem: Problem
    built: Built


class Aside:
    """A cut body that is built in another thread while the body moves on: one at a time.

    Attributes:
        command: the cut, with the elements that it removes; None without one.
    """

    def __init__(self) -> None:
        self.command: Command | None = None
        self._of: tuple[Problem, Model] | None = None
        self._made: list[Prepared] = []
        self._thread: threading.Thread | None = None

    def begin(self, command: Command, problem: Problem, model: Model, prepare: Callable[[Command], Prepared]) -> None:
        """Begin to build what a cut leaves of a problem; raise LiveError while another cut is built."""
        if self.command is not None:
            raise LiveError("cut: another cut is being built: cut again when it is done, or without aside")
        made: list[Prepared] = []
        self.command, self._of, self._made = command, (problem, model), made

        def work() -> None:
            with suppress(Exception):  # it is raised when the session itself builds the cut body
                made.append(prepare(command))

        self._thread = threading.Thread(target=work, name="truespring cut", daemon=True)
        self._thread.start()

    def ready(self) -> Command | None:
        """Return the cut that was built, None without one or while it is built."""
        return None if self._thread is None or self._thread.is_alive() else self.command

    def made(self, command: Command, problem: Problem, model: Model) -> Prepared | None:
        """Return what was built of a cut and forget it; None unless it is that cut of the same problem and model."""
        if self.ready() is None or self.command is None or command.elements != self.command.elements:
            return None
        same = self._of is not None and self._of[0] is problem and self._of[1] is model
        found = self._made[0] if same and self._made else None
        self.forget()
        return found

    def forget(self) -> None:
        """Forget the cut."""
        self.command, self._of, self._made, self._thread = None, None, [], None
