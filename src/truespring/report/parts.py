"""The separate errors of a motion: of the model, of the time step, of the solver."""

from collections.abc import Iterator
from dataclasses import dataclass

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
    most = largest(parts)
    return [
        PartRow(one.name, part_words(one), one.against, one is most, (one.value or 0.0) >= result.tolerance)
        for one in parts
    ]


def part_words(one: Part) -> str:
    """Return the value of an error as text."""
    return "not known" if one.value is None else "0 %" if one.value == 0 else percent(one.value)


def largest(parts: list[Part]) -> Part | None:
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
        reference = several + result.paths[name].label
        yield Part(
            "model",
            result.comparisons[name].rms_error,
            f"{result.paths[result.model].label} against {reference}, same scheme and step",
            "a shorter step and more iterations do not reduce it",
        )
    if splits is None:
        return
    # The automatic step of an explicit scheme is that of its stability, of an implicit one that of `accuracy`.
    shorter = "take a smaller accuracy" if dynamics.step == "auto" else "take a shorter step"
    other = ", or bdf2 instead of euler" if dynamics.scheme == "euler" else ""
    # Of order 1, steps half as long are as far from the exact motion as from the whole ones, of order 2 a third of it.
    half = "against steps half as long"
    half += ", which are themselves about as far from the exact motion" if dynamics.scheme == "euler" else ""
    yield Part("time step", splits.step, half, f"{shorter}{other}")
    few = dynamics.iterations
    counted = f"{few} iteration{'s' * (few != 1)} a step" if few else "steps are solved"
    yield Part(
        "solver",
        splits.solver,
        f"{counted}, against solved steps" if few else counted,
        f"take more than {few}, or iterations = 0, which solves each step",
    )
