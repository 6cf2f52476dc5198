"""Bars and aims of the benchmark, and the measured values."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.cases import OLDER, REFERENCE, SIZES, n_nodes
from benchmarks.commands import COLD
from benchmarks.errors import TARGETS, Reached, to_the_same_error
from benchmarks.older import RULES
from benchmarks.runs import PROGRAMS, SPRINGS, Measured

#: Cost over size is fitted from so many nodes on.
LARGE = 30_000

#: The body and the error of the figure of the time to the same error.
SAME_ERROR = (3, "soft block")


@dataclass(frozen=True)
class Aim:
    """A figure to reach.

    Attributes:
        what: the figure.
        before: its value at commit 8b0afef, in words.
        bar, aim: at least or at most these numbers; no aim if None.
        measured: the value, None where it was not measured.
        at_least: whether larger is better.
        why: what the time or memory is spent on.
    """

    what: str
    before: str
    bar: float
    aim: float | None
    measured: float | None
    at_least: bool = False
    why: str = ""

    @property
    def verdict(self) -> str:
        """Aim met, bar met, or by how much the bar is missed."""
        if self.measured is None or math.isnan(self.measured):
            return "not measured"
        if self.aim is not None and self._reaches(self.aim):
            return "aim met"
        if self._reaches(self.bar):
            return "met" if self.aim is None else "bar met"
        ratio = self.bar / self.measured if self.at_least else self.measured / self.bar
        return f"missed by a factor of {ratio:.2f}"

    def _reaches(self, target: float) -> bool:
        assert self.measured is not None
        return self.measured >= target if self.at_least else self.measured <= target


def of_springs(runs: Sequence[Measured], dim: int, load: str = "bending") -> list[Measured]:
    """Return the runs of Gaussian springs that gave a result, from small to large."""
    found = (run for run in runs if (run.program, run.dim, run.load) == (SPRINGS, dim, load) and run.seconds)
    return sorted(found, key=lambda run: run.n_nodes)


def growth(runs: Sequence[Measured]) -> float | None:
    """Return p of time ~ n^p by least squares over the runs from LARGE on; None for fewer than two."""
    large = [run for run in runs if run.n_nodes >= LARGE]
    if len(large) < 2:
        return None
    return float(np.polyfit(*np.log([[run.n_nodes for run in large], [run.median for run in large]]), 1)[0])


def faster(runs: Sequence[Measured], dim: int, ours: str, theirs: str, load: str = "bending") -> float | None:
    """Return how many times faster a program is than another on the mesh of `cases.REFERENCE`."""
    at = {run.program: run for run in runs if (run.dim, run.load, run.depth) == (dim, load, REFERENCE[dim])}
    if not all(name in at and at[name].seconds for name in (ours, theirs)):
        return None
    return at[theirs].median / at[ours].median


def best_peer(found: dict[str, tuple[Measured, float, list[Reached | None]]], place: int) -> tuple[str, Reached] | None:
    """Return the program of others that reaches the error TARGETS[place] first, of `errors.to_the_same_error`."""
    reached = [
        (cost[place].seconds, name)
        for name, (_, _, cost) in found.items()
        if PROGRAMS[name].peer and cost[place] is not None
    ]
    if not reached:
        return None
    name = min(reached)[1]
    cost = found[name][2][place]
    assert cost is not None
    return name, cost


def older(results: dict, dim: int, side: str = "now") -> float | None:
    """Return how many times faster springs are than at the older commit, by the medians of runs in alternation."""
    for row in results["older"]:
        if row["dim"] == dim and row["seconds"]["then"] and row["seconds"][side]:
            return float(np.median(row["seconds"]["then"]) / np.median(row["seconds"][side]))
    return None


def _shares(results: dict, dim: int, program: str) -> str:
    """Return the largest parts of the time of a solve, in words; empty if not measured."""
    for one in results["kernels"]:
        if (one["dim"], one["program"]) == (dim, program) and one["phases"]:
            total = sum(one["phases"].values())
            largest = sorted(one["phases"].items(), key=lambda item: -item[1])[:5]
            listed = "; ".join(f"{name} {value / total:.0%}" for name, value in largest)
            spent = f"{one['iterations']} Newton, {one['cg']} CG and {one['lanczos']} Lanczos iterations"
            return f"of a solve with {one['n_nodes']:,} nodes ({spent}): {listed}"
    return ""


def aims(results: dict, runs: Sequence[Measured]) -> Iterator[Aim]:
    """Yield the figures to reach with the measured values."""
    yield from _faster(results, runs)
    yield _same_error(runs)
    yield from _than_before(results)
    yield from _on_the_organ(results)
    yield from _of_size(results, runs)
    commands = results["command_line"]
    for name, bar, before in (
        (f"{COLD}, compiling", 4.0, "7.1"),
        (COLD, 1.5, "2.1"),
        ("truespring --help", 0.1, "0.06"),
    ):
        solving = commands.get(f"{name}, solving")
        why = f"{solving:.2f} s of it are spent in solving" if solving else ""
        yield Aim(f"`{name}`, seconds", before, bar, None, commands.get(name), why=why)


def _faster(results: dict, runs: Sequence[Measured]) -> Iterator[Aim]:
    for dim, before, bar, aim in ((3, "37 (isotropic)", 60, 100), (2, "19 (lloyd)", 30, 50)):
        what = f"Gaussian springs, {dim}D, {_nodes(dim, REFERENCE)} nodes, bending: times faster than CalculiX"
        measured = faster(runs, dim, SPRINGS, "calculix")
        yield Aim(what, before, bar, aim, measured, at_least=True, why=_shares(results, dim, SPRINGS))
    what = f"neo-Hookean FEM, 3D, {_nodes(3, REFERENCE)} nodes, bending: times faster than FElupe's"
    measured = faster(runs, 3, "fem-nh", "felupe-nh")
    yield Aim(what, "6", 20, 40, measured, at_least=True, why=_shares(results, 3, "fem-nh"))


def _nodes(dim: int, depths: dict[int, int]) -> str:
    return f"{n_nodes(dim, 'bending', depths[dim]):,}"


def _same_error(runs: Sequence[Measured]) -> Aim:
    found, place = to_the_same_error(runs, *SAME_ERROR), len(TARGETS) - 1
    what = (
        f"bent block, Poisson's ratio 0.45, {TARGETS[place]:.0%} error: Gaussian springs times faster than the best "
        "element of CalculiX and FElupe"
    )
    ours, theirs = found[SPRINGS][2][place] if SPRINGS in found else None, best_peer(found, place)
    if ours is None or theirs is None:
        return Aim(what, "-", 20, 100, None, at_least=True)
    name, cost = theirs
    why = (
        f"{ours.seconds:.2g} s ({ours.unknowns:.0f} unknowns{_marks(ours)}) against {cost.seconds:.2g} s of "
        f"{PROGRAMS[name].label} ({cost.unknowns:.0f} unknowns{_marks(cost)})"
    )
    return Aim(what, "-", 20, 100, cost.seconds / ours.seconds, at_least=True, why=why)


def _marks(cost: Reached) -> str:
    return ", its coarsest mesh" * cost.bound + ", extrapolated" * cost.extrapolated


def _than_before(results: dict) -> Iterator[Aim]:
    for dim, before, bar, aim in ((3, "1 (13 s)", 2.6, 4.3), (2, "1 (7.5 s)", 1.9, 2.5)):
        row = next((row for row in results["older"] if row["dim"] == dim), None)
        nodes = f"{row['n_nodes']:,}" if row else _nodes(dim, OLDER)
        program = RULES[dim]
        what = f"springs ({program}), {dim}D, {nodes} nodes: times faster than commit {results['older_commit']}"
        why = _shares(results, dim, program)
        yield Aim(what, before, bar, aim, older(results, dim), at_least=True, why=why)


def _on_the_organ(results: dict) -> Iterator[Aim]:
    for model, poisson, before, bar, aim in (
        ("gaussian", 0.49, "2 to 9", 2.0, 1.0),
        ("gaussian", 0.499, "-", 4.0, 2.0),
        ("neo-hookean", 0.49, "65", 15.0, 5.0),
    ):
        one = next((row for row in results["organ"] if (row["key"], row["poisson"]) == (model, poisson)), {})
        label = {"gaussian": "Gaussian springs", "neo-hookean": "neo-Hookean FEM"}[model]
        what = f"organ, Poisson's ratio {poisson:g}, {label}: seconds"
        why = ""
        if "solve" in one:
            tangents = one["iterations"] * (one["tangent"] + one["force"])
            why = (
                f"{one['iterations']} Newton and {one['cg']} CG iterations ({one['linear']}); a force and a tangent of "
                f"each Newton iteration together take {tangents / one['solve']:.0%} of the time"
            )
        yield Aim(what, before, bar, aim, one.get("solve"), why=why or one.get("failure", ""))


def _of_size(results: dict, runs: Sequence[Measured]) -> Iterator[Aim]:
    for dim in (2, 3):
        springs = of_springs(runs, dim)
        whole = springs and springs[-1].depth == SIZES[dim][-1]
        largest = f"{n_nodes(dim, 'bending', SIZES[dim][-1]):,}"
        what = f"Gaussian springs, {dim}D: p of time ~ n^p from 30,000 to {largest} nodes"
        spent = ", ".join(
            f"{run.iterations} Newton and {run.linear_iterations or 0} CG at {run.n_nodes:,}" for run in springs[-3:]
        )
        why = f"iterations: {spent}" if whole else f"measured to {springs[-1].n_nodes:,} nodes only" if springs else ""
        yield Aim(what, "1.0", 1.05, None, growth(springs) if whole else None, why=why)
    taken = [run for run in of_springs(runs, 3) if run.n_nodes >= LARGE]
    value = taken[-1].peak_bytes / taken[-1].n_nodes / 1024 if taken else None
    what = f"Gaussian springs, 3D, {taken[-1].n_nodes:,} nodes: " if taken else "Gaussian springs, 3D: "
    counted = [one for one in results["kernels"] if (one["dim"], one["program"]) == (3, SPRINGS) and one["parts"]]
    largest_parts = max(counted, key=lambda one: one["n_nodes"], default=None)
    why = ""
    if largest_parts:
        each = {name: size / largest_parts["n_nodes"] for name, size in largest_parts["parts"].items()}
        why = f"bytes a node of what a solve keeps: {', '.join(f'{name} {size:.0f}' for name, size in each.items())}"
    yield Aim(what + "memory above an empty process, KiB a node", "7", 4, 1.5, value, why=why)
