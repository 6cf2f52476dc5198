"""The scheme of the reference's motion: leapfrog or BDF2, whichever takes less time for a frame."""

import time

from truespring.live.session import Live


def choose_scheme(live: Live) -> list[str]:
    """Let a session take BDF2 instead of leapfrog if that is quicker; return notes.

    Both are measured on a frame from the present state, BDF2 only if leapfrog takes longer than the frame lasts. The
    session is then where it was.
    """
    if not live.scheme.startswith("leapfrog"):
        return []
    settings = live.settings
    _seconds(live)  # what is compiled or built once
    explicit = _seconds(live)
    if explicit <= live.settings.frame:
        return []
    live.choose("bdf2", "auto", settings.iterations)
    implicit = _seconds(live)
    if implicit < explicit:
        share = f"{implicit:.2g} s a frame, leapfrog {explicit:.2g} s"
        return [f"the reference moves by BDF2, {live.step_length:.3g} s a step ({share}): its error of time is its own"]
    live.choose("leapfrog", settings.step, settings.iterations)
    return []


def _seconds(live: Live) -> float:
    """Return the time that a frame takes [s]; the session is then where it was."""
    state, begun = live.state, time.perf_counter()
    live.step()
    taken = time.perf_counter() - begun
    live.go_on(state)
    return taken
