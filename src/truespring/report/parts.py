"""The separate errors of a motion: of the model, of the time step, of the solver."""

from collections.abc import Iterator
from dataclasses import dataclass

from truespring.dynamics import Dynamics
from truespring.equilibrium import Solution
from truespring.report.axis import Axis, axis_of
from truespring.report.quantity import percent
from truespring.report.result import Result


@dataclass(frozen=True, slots=True)
class Part:
    """One of the errors of a motion.

    Attributes:
        name: "model", "time step" or "solver".
        value: root mean square over nodes and recorded times, over that of the displacement [-]; None if not known.
        against: what it is measured against.
        remedy: what reduces it.
    """

    name: str
    value: float | None
    against: str
    remedy: str


def parts_of(result: Result) -> list[Part]:
    """Return the errors of the compared model in a motion; empty at rest, and if none of them was computed."""
    return list(_parts(result, axis_of(result)))


def by_scheme(path: Solution) -> float | None:
    """Return the energy that the scheme dissipated over the largest energy given to the body [-]; None at rest.

    Negative if the scheme added energy.
    """
    energies = [state.moving.energies for state in path.states if state.moving is not None]
    if not energies:
        return None
    first = energies[0]
    begin = first.total + first.damped + first.numerical - first.loads
    given = max(abs(begin - one.loads) for one in energies)
    return energies[-1].numerical / given if given else None


def _alike(dynamics: Dynamics) -> str:
    """Return what two models have in common in a motion, as the end of a clause: an automatic choice may differ."""
    same = [name for name in ("scheme", "step") if getattr(dynamics, name) != "auto"]
    return f", same {' and '.join(same)}" if same else ""


def _finer(dynamics: Dynamics) -> str:
    """Return what reduces the error of the time step."""
    # The automatic step of leapfrog is that of its stability, of other schemes that of `accuracy`.
    automatic = dynamics.step == "auto"
    ways = ["a smaller accuracy"] if automatic and dynamics.scheme != "leapfrog" else []
    ways += ["a shorter step"] if not automatic or dynamics.scheme in ("auto", "leapfrog") else []
    ways += ["bdf2 instead of euler"] if dynamics.scheme == "euler" else []
    return f"take {', or '.join(ways)}"


@dataclass(frozen=True, slots=True)
class PartRow:
    """A row of a table: the error as text, whether it is the largest, whether it is not below the tolerance."""

    name: str
    error: str
    against: str
    largest: bool
    above: bool


def part_rows(result: Result) -> list[PartRow]:
    """Return the errors of a motion as rows of a table."""
    parts = parts_of(result)
    most = largest_of(parts)
    return [
        PartRow(one.name, part_words(one), one.against, one is most, (one.value or 0.0) >= result.tolerance)
        for one in parts
    ]


def part_words(one: Part) -> str:
    """Return the value of an error as text."""
    return "not known" if one.value is None else "0 %" if one.value == 0 else percent(one.value)


def largest_of(parts: list[Part]) -> Part | None:
    """Return the largest of the errors that are known; None if none is known or all are zero."""
    known = [one for one in parts if one.value]
    return max(known, key=lambda one: one.value or 0.0) if known else None


def _parts(result: Result, axis: Axis) -> Iterator[Part]:
    dynamics, splits = result.problem.dynamics, result.splits
    if dynamics is None or result.model is None or not axis.moves:
        return
    name = result.closest
    if name is not None:
        several = "the nearest reference, " if len(result.comparisons) > 1 else ""
        reference = several + result.solutions[name].label
        yield Part(
            "model",
            result.comparisons[name].rms_error,
            f"{result.solutions[result.model].label} against {reference}{_alike(dynamics)}",
            "a shorter step and more iterations do not reduce it",
        )
    if splits is None:
        return
    # Of order 1, steps half as long are as far from the exact motion as from whole steps; farther where both are long.
    half = "against steps half as long"
    half += ", which are as far or farther from the exact motion" if dynamics.scheme == "euler" else ""
    yield Part("time step", splits.step, half, _finer(dynamics))
    few = dynamics.iterations
    explicit = result.solutions[result.model].newton_iterations == 0
    solved = "explicit steps, which are not iterated" if explicit else "steps are solved"
    yield Part(
        "solver",
        splits.solver,
        f"{few} iteration{'s' * (few != 1)} a step, against solved steps" if few and not explicit else solved,
        f"take more than {few}, or iterations = 0, which solves each step",
    )
