"""Targets of the benchmark and the measured values."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.cases import REFERENCE, SIZES, SPRINGS
from benchmarks.limits import Moved
from benchmarks.runs import Measured

#: Cost over size is fitted from so many nodes on.
LARGE = 30_000


@dataclass(frozen=True)
class Aim:
    """A target: at least or at most a number; `measured` is None where it was not measured.

    `why` is the reason if it is missed.
    """

    what: str
    target: float
    measured: float | None
    at_least: bool = False
    why: str = ""

    @property
    def verdict(self) -> str:
        """Met, or by how much it is missed."""
        if self.measured is None or math.isnan(self.measured):
            return "not measured"
        if self.measured >= self.target if self.at_least else self.measured <= self.target:
            return "met"
        return f"missed by {abs(self.measured / self.target - 1):.0%}"


def of_springs(runs: list[Measured], dim: int, load: str = "bending") -> list[Measured]:
    """Return the runs of the springs of `cases.SPRINGS` that gave a result, from small to large."""
    found = (run for run in runs if (run.program, run.dim, run.load) == (SPRINGS[dim], dim, load) and run.seconds)
    return sorted(found, key=lambda run: run.n_nodes)


def growth(runs: list[Measured]) -> float | None:
    """Return p of time ~ n^p by least squares over the runs from LARGE on; None for fewer than two."""
    large = [run for run in runs if run.n_nodes >= LARGE]
    if len(large) < 2:
        return None
    return float(np.polyfit(*np.log([[run.n_nodes for run in large], [run.median for run in large]]), 1)[0])


def faster(runs: list[Measured], dim: int, programs: tuple[str, ...], load: str = "bending") -> float | None:
    """Return how many times faster springs are than the fastest of `programs` at the size of `cases.REFERENCE`."""
    at = [run for run in runs if (run.dim, run.load, run.depth) == (dim, load, REFERENCE[dim]) and run.seconds]
    ours = [run.median for run in at if run.program == SPRINGS[dim]]
    theirs = [run.median for run in at if run.program in programs]
    return min(theirs) / ours[0] if ours and theirs else None


FELUPE = ("felupe-svk", "felupe-nh")

_WHY = {
    "2D": "at this size, a loop takes about as long as the start of the second thread (0.1 to 0.2 ms), and a solve has "
    "about 750 such loops (both measured separately). The table of fractions above lists each loop. For larger bodies "
    "the time grows more slowly than the number of nodes.",
    "3D": "half of the time is spent in the sweeps and transfers of multigrid (see the tables above), the rest in "
    "the construction of coarse levels and in assembly.",
    "command": "most of the time is not spent in the solver. A separate run of 5.1 s under a profiler spent 0.9 s in "
    "imports, 0.9 s in numba and compiled code, 1.4 s in figures, 0.7 s in files and the page, and 1.2 s in solving "
    "five models at ten levels.",
    "assembly": "to prevent two threads from writing to the same row, the block of a spring is computed once for each "
    "of its two nodes, and its data come from several arrays. Arithmetic and latency limit the speed, not bandwidth.",
    "matrix product": "a block is stored once for two rows, which halves the data of a plain product. Each byte "
    "therefore needs more arithmetic, in scalar double precision, and different blocks write to the same rows.",
}


def aims(results: dict, runs: list[Measured]) -> Iterator[Aim]:
    """Yield the targets of the benchmark with the measured values."""
    for dim, size, target in ((2, "51,000", ((12, 25), (8, 15))), (3, "31,000", ((35, 80), (15, 30)))):
        for name, programs, (least, best) in zip(("CalculiX", "FElupe"), (("calculix",), FELUPE), target, strict=True):
            measured = faster(runs, dim, programs)
            what, why = f"{dim}D, {size} nodes: times faster than {name}", _WHY[f"{dim}D"]
            yield Aim(what, least, measured, at_least=True, why=why)
            yield Aim(f"{what}, stretch target", best, measured, at_least=True, why=why)
    for dim, upper, memory in ((2, "one million", 2.5), (3, "300,000", 10.0)):
        springs = of_springs(runs, dim)
        largest = springs[-1] if springs and springs[-1].depth == SIZES[dim][-1] else None
        power = growth(springs) if largest else None
        yield Aim(f"{dim}D: p of time ~ n^p from 30,000 to {upper} nodes", 1.1, power)
        taken = largest.peak_bytes / largest.n_nodes / 1024 if largest else None
        yield Aim(f"{dim}D, largest size: memory above an empty process, KiB per node", memory, taken)
        newton = max((run.iterations for run in springs), default=None)
        yield Aim(f"{dim}D: largest number of Newton iterations", 8, newton)
        per_newton = [run.linear_iterations / run.iterations for run in springs if run.linear_iterations]
        gradients = max(per_newton, default=None)
        yield Aim(f"{dim}D: largest number of CG iterations per Newton iteration", 15, gradients)
    limit = max(results["bandwidth"].values())
    for name, least_nodes, target in (
        ("assembly", 50_000, 3.0),
        ("assembly", 1_000_000, 6.0),
        ("matrix product", 50_000, 1.5),
        ("matrix product", 1_000_000, 1.5),
    ):
        sized = [one for one in results["kernels"] if least_nodes <= one["n_nodes"] < 1.1 * least_nodes]
        at = [row for one in sized if one["dim"] == 2 for row in one["rows"] if row["name"] == name]
        measured = Moved(name, at[0]["seconds"], at[0]["bytes_moved"]).over(limit) if at else None
        what = f"2D, {least_nodes:,} nodes: {name}, times the memory limit"
        yield Aim(what, target, measured, why=_WHY[name])
    for command, target in (("truespring verify examples/bending.toml", 4.0), ("truespring --help", 0.3)):
        yield Aim(f"`{command}`, seconds", target, results["command_line"].get(command), why=_WHY["command"])
