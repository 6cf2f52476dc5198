"""Measure the memory of a body that processes share: mpiexec -n P python -m benchmarks.processes [--elements N].

Each run adds a line to a file; with two numbers of processes at one size it prints the fit of the peak to a part that
each process has and a part that is distributed.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np

import truespring as ts
from truespring.linear import processes_of


def peak() -> int:
    """Return the largest resident memory of this process so far [bytes], on Linux."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return 1024 * int(next(line for line in lines if line.startswith("VmHWM")).split()[1])


def say(text: str) -> None:
    """Print a line."""
    sys.stdout.write(text + "\n")


def fit(rows: list[list[float]]) -> tuple[float, float]:
    """Return the replicated and the distributed part of the peaks [bytes a node], by least squares.

    Each row has the number of processes and the peak of each of them [bytes a node].
    """
    processes, peaks = np.array(rows).T
    replicated, distributed = np.linalg.lstsq(np.column_stack([np.ones(len(rows)), 1 / processes]), peaks, rcond=None)[
        0
    ]
    return float(replicated), float(distributed)


def main() -> None:
    """Solve a bent box of Gaussian springs, and print the peak a node above that of a small box."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--elements", type=int, default=16, help="elements across the box, four times as many along it")
    parser.add_argument("--file", type=Path, default=Path("benchmarks/.cache/processes.jsonl"), help="file of the runs")
    options = parser.parse_args()
    ranks = processes_of("petsc")
    used = []
    for across in (4, options.elements):
        mesh = ts.box((4.0, 1.0, 1.0), (4 * across, across, across))
        supports, loads = [ts.Fixed("left")], [ts.Force("right", (0.0, -2.0, 0.0))]
        problem = ts.Problem(mesh, ts.Material(1e4, 0.3), None, supports, loads)
        solution = ts.solve(problem, ts.Springs("gaussian"), ts.Newton(load_steps=1, linear="petsc"))
        used.append(ranks.largest(float(peak())))
    a_node = (used[1] - used[0]) / mesh.n_nodes
    if ranks.rank:
        return
    cost = solution.cost
    iterations = f"{cost.newton_iterations} and {cost.cg_iterations} iterations" if cost else ""
    say(f"{ranks.size} processes, {mesh.n_nodes} nodes, {solution.status.value}, {iterations}: {a_node:,.0f} B a node")
    options.file.parent.mkdir(parents=True, exist_ok=True)
    with options.file.open("a", encoding="utf-8") as file:
        file.write(json.dumps([mesh.n_nodes, ranks.size, a_node]) + "\n")
    runs = [json.loads(line) for line in options.file.read_text(encoding="utf-8").splitlines()]
    rows = [run[1:] for run in runs if run[0] == mesh.n_nodes]
    if len({row[0] for row in rows}) > 1:
        replicated, distributed = fit(rows)
        say(f"fit: {replicated:,.0f} B a node on each process + {distributed:,.0f} B a node / processes")


if __name__ == "__main__":
    main()
