"""The error of steps that are not solved to the end: one frame of a state, with steps as taken and with solved ones."""

from truespring.live.ghost import Ghost
from truespring.live.session import Live
from truespring.live.state import State


def solved(live: Live, state: State, step: float) -> Ghost:
    """Return the frame after a state, with steps solved to the tolerance, and as `own` with those of the session.

    `live` is a session of the same model and settings, but for the step [s]; it is then where it was.
    """
    kept, settings = live.state, live.settings
    found = []
    for iterations in (settings.iterations, 0):
        live.choose(settings.scheme, step, iterations)
        live.go_on(state)
        live.step()
        found.append((live.time, live.positions))
    live.choose(settings.scheme, settings.step, settings.iterations)
    live.go_on(kept)
    (_, taken), (time, right) = found
    says = f"of a frame with {settings.iterations} iteration{'s' * (settings.iterations != 1)} a step"
    return Ghost(time, "solved", right, own=taken, says=says)
