"""The commands, carried out: what each changes of the state of a session."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from truespring.dynamics import Damping
from truespring.errors import LiveError
from truespring.live.actions import Ball, Grip
from truespring.live.commands import Command
from truespring.live.core import Core
from truespring.live.cutting import cut
from truespring.tools import Grasp


def carried_out(core: Core, command: Command) -> Command:
    """Carry out a command that is checked; return it with what another session needs to repeat it."""
    return _CARRIED[command.kind](core, command) or command


def _grasp(core: Core, command: Command) -> Command:
    core.held.require_free(command.name)
    at, radius, body = np.array(command.place), command.radius, core.sizes.acted_on
    assert radius is not None and command.value is not None  # see `checked`
    nodes, stiffness = Grasp(command.name, command.place, radius, command.place, command.value).patch(body, None)
    still = np.zeros(len(at))
    grip = Grip(command.name, at, radius, nodes, stiffness, body.nodes[nodes], still, still, core.moment.time)
    motion = np.array(command.begin) if command.begin else grip.mean_motion(core.moment.positions)
    core.held.hold(replace(grip, begin=motion, end=motion))
    core.note_place(command.name)
    return replace(command, begin=tuple(motion.tolist()))


def _sphere(core: Core, command: Command) -> None:
    core.held.require_free(command.name)
    centre = np.array(command.place)
    assert command.radius is not None and command.value is not None  # see `checked`
    core.held.add(Ball(command.name, command.radius, command.value, centre, centre, core.moment.time))
    core.note_place(command.name)


def _move(core: Core, command: Command) -> None:
    core.held.move(command.name, np.array(command.place))


def _release(core: Core, command: Command) -> None:
    core.held.release(command.name)


def _gravity(core: Core, command: Command) -> None:
    assert command.value is not None  # see `checked`
    core.share = command.value
    core.weight = replace(core.weight, end=core.gravity.weight(core.built.body.mass, command.value).end)


def _material(core: Core, command: Command) -> None:
    assert command.value is not None  # see `checked`
    core.changes[command.kind] = command.value
    core.problem = core.changed(core.left.problem)
    core.build()


def _damping(core: Core, command: Command) -> None:
    assert command.value is not None  # see `checked`
    damping = Damping(core.dynamics.damping.stiffness, command.value)
    core.problem = replace(core.problem, dynamics=replace(core.dynamics, damping=damping))
    core.build()


def _model(core: Core, command: Command) -> None:
    models = core.left.models
    if command.name not in models:
        raise LiveError(f"model '{command.name}' is unknown; allowed: {', '.join(models) or 'none'}")
    core.model, core.decided = models[command.name], None
    core.build()
    if len(core.body.potential.nodes) != len(core.moment.positions):
        core.moment = core.first_moment()


def _restart(core: Core, command: Command) -> None:
    core.aside.forget()
    if core.left is not core.whole:
        core.left, core.model = core.whole, core.whole.model
        core.problem = core.changed(core.whole.problem)
    core.begin()


_CARRIED: Mapping[str, Callable[[Core, Command], Command | None]] = MappingProxyType(
    {
        "grasp": _grasp,
        "sphere": _sphere,
        "move": _move,
        "release": _release,
        "gravity": _gravity,
        "young": _material,
        "poisson": _material,
        "damping": _damping,
        "model": _model,
        "cut": cut,
        "restart": _restart,
    }
)
