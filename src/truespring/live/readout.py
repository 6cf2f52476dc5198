"""Figures, notes and warnings of a session for a page, renewed some times a second."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.live.orders import Order
from truespring.live.session import Live
from truespring.live.snapshot import Mark, Overlay
from truespring.report.quantity import quantity

# Time between readouts [s].
_EVERY = 0.2
# Number of notes and messages that are shown.
_SHOWN = 8
#: The errors of a motion, in the order of the page.
ERRORS = ("model", "time", "solver")


@dataclass(frozen=True, slots=True)
class Facts:
    """What the loop knows of a session besides its state.

    Attributes:
        running: whether it advances.
        speed: simulated time per real time that is asked for.
        rates: frames a second and simulated per real time of the last second; None if not known.
        still: whether the body is held still.
        marks: what acts on the body.
        overlay: the last reference; None without one.
        errors: as text, by name.
        messages: of the loop.
        saves: whether the session can be written to a folder.
    """

    running: bool
    speed: float
    rates: tuple[float, float] | None
    still: bool
    marks: Sequence[Mark]
    overlay: Overlay | None
    errors: Mapping[str, str]
    messages: Sequence[str]
    saves: bool


class Readout:
    """What is known of a session, as JSON values."""

    def __init__(self, model: str) -> None:
        """Take the name of the model."""
        self._model = model
        self._known: dict[str, Any] = {}
        self._next = float("-inf")
        self._set: dict[str, float] = {}

    def changed(self, order: Order) -> None:
        """Remember what an order has set."""
        if order.kind == "model":
            self._model = order.name
        elif order.value is not None and not order.name:
            self._set[order.kind] = order.value

    def values(self, now: float, live: Live, facts: Callable[[], Facts], fresh: bool) -> Mapping[str, Any]:
        """Return the values of this moment if `fresh` or if they are old at time `now` [s], else those of before."""
        if fresh or now >= self._next:
            self._next = now + _EVERY
            self._known = self._renewed(live, facts())
        return self._known

    def _renewed(self, live: Live, facts: Facts) -> dict[str, Any]:
        rates = facts.rates
        return {
            "kind": "readout",
            "running": facts.running,
            "speed": facts.speed,
            "frame": live.settings.frame,
            "rate": None if rates is None else round(rates[0], 1),
            "factor": None if rates is None else round(rates[1], 3),
            "scheme": f"{live.scheme}, {live.steps_a_frame} steps of {quantity(live.step_length, 's')} a frame",
            "model": self._model,
            "models": list(live.models),
            "settings": {**_begin(live), **self._set},
            "marks": [_mark(one, live.forces) for one in facts.marks],
            "errors": {name: facts.errors.get(name) for name in ERRORS},
            "ghost": None if facts.overlay is None else _ghost(facts.overlay, live.time),
            "still": facts.still,
            "saves": facts.saves,
            "warnings": list(live.warnings),
            "notes": [*live.notes[-_SHOWN:], *list(facts.messages)[-_SHOWN:]],
        }


def _begin(live: Live) -> dict[str, float | None]:
    """Return the settings before any change."""
    materials, dynamics = live.problem.materials, live.problem.dynamics
    return {
        "gravity": live.gravity_share,
        "young": 1.0,
        "poisson": next((one.poisson for one in materials), None),
        "damping": 0.0 if dynamics is None else dynamics.damping.mass,
    }


def _mark(mark: Mark, forces: Mapping[str, Floats]) -> dict[str, str | None]:
    """Return what acts on the body as text; its force is None before the first frame with it."""
    force = quantity(float(np.linalg.norm(forces[mark.name])), "N", 2) if mark.name in forces else None
    return {"name": mark.name, "what": mark.what, "force": force}


def _ghost(overlay: Overlay, time: float) -> dict[str, Any]:
    """Return kind of a reference, how far it is behind a time [s], and its largest distance, as text."""
    farthest = quantity(float(overlay.distances.max()), "m", 2)
    return {"kind": overlay.kind, "behind": round(max(0.0, time - overlay.time), 2), "farthest": farthest}
