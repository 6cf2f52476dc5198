"""The command "cut": what a cut leaves takes the place of the body."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from truespring.arrays import Floats
from truespring.live.commands import Command, checked
from truespring.live.core import Core
from truespring.live.cut import Prepared, built, cut_words, kept_grips, kept_moment, kept_rows, loose_parts


def cut(core: Core, command: Command) -> Command:
    """Cut the body; return the command with the elements that it removed."""
    command = _known(core, command)
    if command.elements:
        ready = core.aside.made(command, core.problem, core.model)
        _take(core, ready or _prepared(core, command), command)
    else:
        core.note("the blade of a cut passes no element")
    return command


def begin_aside(core: Core, place: Sequence[float]) -> None:
    """Begin to build what a cut leaves in another thread; raise LiveError if the command is wrong."""
    command = Command(core.log.frames, "cut", place=tuple(float(one) for one in place))
    command = _known(core, checked(command, core.problem.mesh.dim))
    core.aside.begin(command, core.problem, core.model, partial(_prepared, core))


def _known(core: Core, command: Command) -> Command:
    """Return a cut with the elements that it removes."""
    positions: Floats = core.moment.positions[: core.problem.mesh.n_nodes]
    return replace(command, elements=tuple(core.left.numbers_of(command, positions).tolist()))


def _prepared(core: Core, command: Command) -> Prepared:
    """Return the body that a cut leaves, ready to move; the session is not changed."""
    left, of = core.left.without(command, core.model)
    problem = core.changed(left.problem)
    return Prepared(left, of, problem, built(problem, left.model))


def _take(core: Core, cut: Prepared, command: Command) -> None:
    """Go on with what a cut leaves, its nodes where they are, with their velocities."""
    before, held = core.body.potential, core.held
    rows = kept_rows(cut.of, before, cut.built.body.potential)
    core.left, core.problem, core.model = cut.left, cut.problem, cut.left.model
    core.moment = kept_moment(core.moment, rows)
    grips = kept_grips(held.grips, rows, len(before.nodes))
    gone = [*cut.left.lost, *(held.grips.keys() - grips.keys())]
    held.keep(grips)
    core.build(cut.built)
    mesh = core.problem.mesh
    supported = [np.flatnonzero(core.body.held[: mesh.n_nodes].any(axis=1))]
    supported += [one.nodes for one in grips.values()]
    parts = loose_parts(mesh, np.concatenate(supported))
    core.note(cut_words(len(command.elements or ()), *parts, gone))
