"""The page docs/performance.md from results.json: `python -m benchmarks.page` rebuilds it without measuring."""

import json
import math
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from benchmarks import aims, errors
from benchmarks.cases import LENGTH, LOADS, MOVED, REFERENCE, SIZES, SPRINGS, n_nodes
from benchmarks.figure import draw
from benchmarks.limits import Moved
from benchmarks.runs import HERE, PROGRAMS, ROOT, Measured

# The solver of each program; the rest of its row comes from the runs.
_SOLVERS = {
    "truespring": "one load step, residual to 1e-8 of the load",
    "calculix": "NLGEOM, one increment, SPOOLES, all threads; residual and correction to 1e-7 in the norms of CalculiX",
    "felupe": "plain Newton, MKL Pardiso, threads; residual to 1e-8 of the reactions",
    "skfem": "plain Newton, MKL Pardiso; residual to 1e-8 of the load",
}

# Kernels below this share of the time of a solve are summed into one row.
_LEAST_SHARE = 0.03


def build(results_file: Path, folder: Path) -> str:
    """Write performance.md and performance.svg to `folder`; return the text."""
    results = json.loads(results_file.read_text())
    runs = [Measured(**run | {"seconds": tuple(run["seconds"])}) for run in results["runs"]]
    recorded = json.loads((HERE / "recorded.json").read_text())
    text = "\n".join(_page(results, runs, recorded)) + "\n"
    (folder / "performance.md").write_text(text, encoding="utf-8")
    draw(runs, folder / "performance.svg")
    return text


def _page(results: dict, runs: list[Measured], recorded: dict) -> Iterator[str]:
    machine, versions = results["machine"], results["versions"]
    yield "# Performance\n"
    yield (
        "`make bench` measures the numbers on this page and rebuilds it: all on one machine, each run in a separate "
        f"process. {results['date']}, commit {results['commit']}; "
        f"{machine['processor']}, {machine['cores']} cores, {machine['memory_bytes'] / 2**30:.0f} GiB, "
        f"{machine['system']}; "
        f"{', '.join(f'{name} {number}' for name, number in versions.items())}.\n"
    )
    yield from _compared(runs)
    yield "## Time\n"
    yield "![Time over nodes](performance.svg)\n"
    for dim, load in LOADS:
        yield from _times(runs, dim, load, results["limit_seconds"])
    yield from _agreement(runs)
    yield from _ratios(runs)
    yield from _details(runs)
    yield from _memory(runs)
    yield from _limit(results)
    yield from _accuracy(runs)
    yield from _aims(results, runs)
    yield from _gaussian(json.loads((HERE / "gaussian.json").read_text()))
    yield from _recorded(recorded)


def table(head: Iterable[str], rows: Iterable[Iterable[str]], words: tuple[int, ...] = (0,)) -> Iterator[str]:
    """Yield the lines of a table; the columns `words` are aligned left, numbers right."""
    head = list(head)
    yield f"| {' | '.join(head)} |"
    yield f"|{'|'.join('---' if column in words else '---:' for column in range(len(head)))}|"
    for row in rows:
        yield f"| {' | '.join(row)} |"
    yield ""


def _seconds(value: float) -> str:
    return f"{value:#.2g}" if value < 10 else f"{value:.0f}"


def _sizes(runs: list[Measured], dim: int, load: str) -> list[int]:
    """Return the entries of SIZES that were run, as elements over the height."""
    return sorted({run.depth for run in runs if (run.dim, run.load) == (dim, load)} & set(SIZES[dim]))


def _compared(runs: list[Measured]) -> Iterator[str]:
    bent, pulled = (f"{MOVED[load]:.0%}" for load in ("bending", "stretching"))
    yield "## What is compared\n"
    yield (
        "**Springs are a cheaper model than finite elements.** A spring depends on two nodes; an element integrates a "
        "constitutive law over its volume. Springs have a fixed Poisson's ratio and a model error, see "
        "[below](#time-to-the-same-error). The times compare springs with finite elements of the same nodes, supports "
        "and force; they do not compare two ways to solve the same equations. For that, compare the other programs "
        "with "
        "truespring's finite elements, or with biquadratic springs, which converge to the St. Venant-Kirchhoff law.\n"
    )
    yield (
        f"Two bodies are fixed on the left and loaded on the right by a dead force: a rectangle {LENGTH:g} by 1 of "
        f"squares in plane stress (Poisson's ratio 1/3) and a box {LENGTH:g} by 1 by 1 of cubes (1/4). In bending the "
        f"force moves the end of the springs down by {bent} of the length, in stretching it extends them by {pulled}. "
        "(An aspect ratio of 4 was too difficult: on fine meshes the one-step iteration of truespring failed at the "
        "corners of the clamp, and CalculiX and FElupe failed there as well.)\n"
    )
    yield (
        "Seconds are wall time from the built mesh to equilibrium: sparsity pattern, assembly, factorisation or "
        "multigrid setup, and all iterations, without reading, writing and compiling (compiled code comes from a "
        "cache; each process first solves a small mesh, untimed). Times are the median of three runs, or of one run "
        "if it takes 20 s. The other programs use the smallest number of equal load steps that converges; failed "
        "attempts are not timed.\n"
    )
    rows = []
    for name, program in PROGRAMS.items():
        version = next((run.version for run in runs if run.program == name and run.version), "not run")
        rows.append((program.label, version, program.law, _SOLVERS[program.module]))
    yield from table(("program", "version", "law", "solver"), rows, words=(0, 1, 2, 3))


def _times(runs: list[Measured], dim: int, load: str, longest: float) -> Iterator[str]:
    depths = _sizes(runs, dim, load)
    if not depths:
        return
    at = {(run.program, run.depth): run for run in runs if (run.dim, run.load) == (dim, load)}
    nodes = [n_nodes(dim, depth) for depth in depths]
    yield f"### {dim}D, {load}: seconds\n"
    left_out = {}

    def cell(program: str, depth: int) -> str:
        run = at.get((program, depth))
        if run is None:
            return ""
        if not run.seconds:
            left_out.setdefault(PROGRAMS[program].label, run.failure)
            return "-"
        steps = f" ({run.notes.split()[0]} steps)" if run.notes.endswith("load steps") else ""
        return _seconds(run.median) + steps

    rows = [
        (program.label, *(cell(name, depth) for depth in depths))
        for name, program in PROGRAMS.items()
        if dim in program.dims
    ]
    yield from table(("nodes", *(f"{count:,}" for count in nodes)), rows)
    if left_out:
        yield f"Sizes left out, since the time of a solve is limited to {longest:g} s:\n"
        yield from (f"* {label}: {why}" for label, why in left_out.items())
        yield ""


def _agreement(runs: list[Measured]) -> Iterator[str]:
    """Yield the largest difference of tip displacements among programs with the same law and mesh."""
    apart: dict[tuple[str, int], float] = {}
    for law in ("St. Venant-Kirchhoff", "neo-Hookean"):
        for dim in (2, 3):
            tips: dict[tuple[str, int], list[float]] = {}
            for run in runs:
                if PROGRAMS[run.program].law == law and run.dim == dim and run.seconds:
                    tips.setdefault((run.load, run.depth), []).append(run.tip)
            spreads = [max(values) / min(values) - 1 for values in tips.values() if len(values) > 1]
            apart[law, dim] = max(spreads, default=0.0)
    listed = "; ".join(f"{law}, {dim}D: {value:.1e}" for (law, dim), value in apart.items())
    yield (
        "Programs with the same law agree. Largest relative difference between two tip displacements on the same "
        f"mesh, over all sizes and both loads: {listed}. (CalculiX prints seven digits.)\n"
    )


def _ratios(runs: list[Measured]) -> Iterator[str]:
    yield "## Speed-up of springs\n"
    yield "Time of each program over that of the springs, at the size of each column:\n"
    columns = [(dim, load) for dim, load in LOADS if _at_reference(runs, SPRINGS[dim], dim, load)]
    rows = []
    for name, program in PROGRAMS.items():
        cells = []
        for dim, load in columns:
            theirs, ours = _at_reference(runs, name, dim, load), _at_reference(runs, SPRINGS[dim], dim, load)
            cells.append(f"{theirs.median / ours.median:.1f}" if theirs and name != SPRINGS[dim] else "")
        rows.append((program.label, *cells))
    nodes = [f"{dim}D, {load}, {_at_reference(runs, SPRINGS[dim], dim, load).n_nodes:,} nodes" for dim, load in columns]
    yield from table(("", *nodes), (row for row in rows if any(row[1:])))


def _at_reference(runs: list[Measured], program: str, dim: int, load: str) -> Measured | None:
    key = (program, dim, load, REFERENCE[dim])
    return next((run for run in runs if (run.program, run.dim, run.load, run.depth) == key and run.seconds), None)


def _details(runs: list[Measured]) -> Iterator[str]:
    yield "## Springs by size\n"
    for dim, load in LOADS:
        springs = [run for run in aims.of_springs(runs, dim, load) if run.depth in SIZES[dim]]
        if not springs:
            continue
        power = aims.growth(springs)
        grown = f": time ~ n^{power:.2f} above {aims.LARGE:,} nodes" if power is not None else ""
        yield f"{dim}D, {load}{grown}\n"
        yield from table(
            (
                "nodes",
                "seconds",
                "Newton",
                "CG",
                "Lanczos",
                "KiB per node",
                "tip displacement / length",
                "method",
            ),
            (
                (
                    f"{run.n_nodes:,}",
                    _seconds(run.median),
                    f"{run.iterations}",
                    f"{run.linear_iterations or '-'}",
                    f"{run.lanczos_iterations or '-'}",
                    f"{run.peak_bytes / run.n_nodes / 1024:.3g}",
                    f"{run.tip / LENGTH:.4f}",
                    run.notes,
                )
                for run in springs
            ),
            words=(0, 7),
        )


def _memory(runs: list[Measured]) -> Iterator[str]:
    yield "## Memory\n"
    yield (
        "Peak resident memory in bending, in MiB, minus that of a Python interpreter without imports. Libraries are "
        "included.\n"
    )
    for dim in (2, 3):
        depths = _sizes(runs, dim, "bending")
        at = {(run.program, run.depth): run for run in runs if (run.dim, run.load) == (dim, "bending") and run.seconds}
        head = [f"{n_nodes(dim, depth):,}" for depth in depths]
        rows = (
            (program.label, *(_mebibytes(at.get((name, depth))) for depth in depths))
            for name, program in PROGRAMS.items()
            if dim in program.dims
        )
        yield from table((f"{dim}D, nodes", *head), rows)


def _mebibytes(run: Measured | None) -> str:
    return f"{run.peak_bytes / 2**20:.0f}" if run else "-"


def _limit(results: dict) -> Iterator[str]:
    limit = max(results["bandwidth"].values())
    reading = max(value for name, value in results["bandwidth"].items() if name.startswith("read"))
    yield "## Memory bandwidth\n"
    listed = "; ".join(f"{name}: {value / 1e9:.1f} GB/s" for name, value in results["bandwidth"].items())
    yield f"Memory bandwidth of this machine in the same run, arrays of 512 MiB: {listed}.\n"
    yield (
        "The last column of the table is the time of a spring kernel over its limit, the time needed to read and "
        "write its "
        "data once at the largest of these bandwidths. It can be below 1 if the data fit into a cache. Relative to "
        "the bandwidth of reading alone, "
        f"{reading / 1e9:.1f} GB/s, the last column would be {reading / limit:.2f} times as large.\n"
    )
    rows = []
    for one in results["kernels"]:
        for row in one["rows"]:
            moved = Moved(row["name"], row["seconds"], row["bytes_moved"])
            least = 1e3 * moved.bytes_moved / limit
            numbers = f"{moved.bytes_moved / 1e6:.1f}", f"{1e3 * moved.seconds:.3g}", f"{least:.3g}"
            rows.append((f"{_where(one)}: {moved.name}", *numbers, f"{moved.over(limit):.1f}"))
    yield from table(("", "MB", "ms", "limit, ms", "time over limit"), rows)
    yield "Fractions of the time of a whole solve, including the distribution of work to threads:\n"
    shares = [
        {name: value / sum(one["shares"].values()) for name, value in one["shares"].items()}
        for one in results["kernels"]
    ]
    names = sorted({name for one in shares for name in one}, key=lambda name: -sum(one.get(name, 0) for one in shares))
    large = [name for name in names if max(one.get(name, 0) for one in shares) >= _LEAST_SHARE]
    rows = [(name, *(f"{one.get(name, 0):.0%}" for one in shares)) for name in large]
    rest = (f"{1 - sum(one.get(name, 0) for name in large):.0%}" for one in shares)
    yield from table(
        ("", *map(_where, results["kernels"])), [*rows, (f"{len(names) - len(large)} smaller shares", *rest)]
    )


def _where(one: dict) -> str:
    return f"{one['dim']}D, {one['n_nodes']:,} nodes"


def _accuracy(runs: list[Measured]) -> Iterator[str]:
    yield "## Time to the same error\n"
    yield (
        "The bodies in bending on meshes with one or more elements over the height. The reference is the St. "
        "Venant-Kirchhoff law in the limit of infinitely fine meshes (Richardson extrapolation from the three finest "
        "meshes of truespring's finite elements). CalculiX solves this law, and biquadratic springs converge to it. "
        "The model error is the error that remains in the limit of infinitely fine meshes: positive if the model is "
        "too "
        "soft, negative if it is too stiff. For neo-Hookean programs it is the difference between the two laws. Errors "
        "are those of the tip displacement; a target is reached if every finer mesh reaches it too; times are "
        "interpolated between meshes, one run each.\n"
    )
    for dim in (2, 3):
        truth = errors.limit(errors.solved(runs, errors.TRUTH, dim))
        if math.isnan(truth):
            continue
        rows = []
        for name, program in PROGRAMS.items():
            solved = errors.solved(runs, name, dim)
            if not solved or dim not in program.ladder:
                continue
            found = errors.accuracy(solved, truth)
            rows.append((program.label, f"{round(found.floor, 4) + 0.0:+.2%}", *_reached(found)))
        yield from table((f"{dim}D", "model error", *(f"to {target:.0%}" for target in errors.TARGETS)), rows)
    yield (
        "Each cell has the time in seconds and, in parentheses, the approximate number of nodes; `<=` marks the "
        "coarsest "
        "mesh. Simple bodies need "
        "few nodes for such errors, and every program is fast: springs save time where the geometry needs a fine "
        "mesh.\n"
    )


def _reached(found: errors.Accuracy) -> Iterator[str]:
    for seconds, nodes, bound in zip(found.seconds, found.nodes, found.bounds, strict=True):
        if seconds is None or nodes is None:
            yield "never"
        else:
            yield f"{'<= ' * bound}{_seconds(seconds)} ({nodes:.0f})"


def _aims(results: dict, runs: list[Measured]) -> Iterator[str]:
    yield "## Targets\n"
    rows = []
    reasons = {}
    for aim in aims.aims(results, runs):
        if aim.verdict.startswith("missed") and aim.why:
            reasons[aim.what] = aim.why
        measured = "" if aim.measured is None else f"{aim.measured:.3g}"
        rows.append((aim.what, f"{'at least' if aim.at_least else 'at most'} {aim.target:g}", measured, aim.verdict))
    yield from table(("springs, bent by half the length", "target", "measured", ""), rows, words=(0, 3))
    if reasons:
        yield "Why:\n"
        yield from (f"* {what}: {why}" for what, why in reasons.items())
        yield ""


def _gaussian(results: dict) -> Iterator[str]:
    """Yield the section on Gaussian springs beside finite elements, from benchmarks/gaussian.json."""
    yield "## Gaussian springs\n"
    yield (
        "`python -m benchmarks.gaussian` measures Gaussian springs beside neo-Hookean finite elements in one run: "
        f"{results['date']}, commit {results['commit']}, {results['machine']['cores']} cores. Finite elements have "
        "mean dilatation, the default above a Poisson's ratio of 0.4. A tangent includes its assembly.\n"
    )
    head = ("body", "model", "elements", "force, ms", "tangent, ms", "solve, s", "iterations", "linear solver", "error")
    rows = [(f"organ, nu {poisson}", one) for poisson, pair in results["organ"].items() for one in pair]
    rows += [("block, nu 0.45", one) for one in results["block"]]
    yield from table(head, (_timed(body, one) for body, one in rows), words=(0, 1, 7))
    ratios = []
    for poisson, (springs, fem) in results["organ"].items():
        parts = [f"{what} {springs[what] / fem[what]:.3f}" for what in ("force", "tangent", "solve")]
        ratios.append(f"on the organ at nu {poisson}, {', '.join(parts)}")
    first, last = results["block"][0], results["block"][-1]
    yield (
        f"Springs over finite elements: {'; '.join(ratios)}. The block is bent by half its length; its error is the "
        "rms distance at the nodes of the coarsest mesh from finite elements on two fine meshes, extrapolated. At no "
        f"larger error, finite elements take {last['solve'] / first['solve']:.0f} times as long as springs.\n"
    )


def _timed(body: str, one: dict) -> tuple[str, ...]:
    """Return a row of the table of Gaussian springs."""
    cells = one["cells"]
    return (
        body,
        one["model"],
        f"{cells:,}" if isinstance(cells, int) else " x ".join(map(str, cells)),
        f"{1e3 * one['force']:.2g}",
        f"{1e3 * one['tangent']:.2g}",
        f"{one['solve']:.2g}",
        str(one["iterations"]),
        one["linear"],
        "" if one["error"] is None else f"{one['error']:.2%}",
    )


def _recorded(recorded: dict) -> Iterator[str]:
    yield "## Other programs\n"
    yield (
        f"Measured once, not by `make bench`: {recorded['date']}, {recorded['processor']}, {recorded['cores']} cores, "
        "one run each, in bending on the same meshes with the same forces.\n"
    )
    rows = (
        (run["program"], run["version"], f"{run['dim']}D, {run['n_nodes']:,}", _seconds(run["seconds"]), run["notes"])
        for run in recorded["runs"]
    )
    yield from table(("program", "version", "nodes", "seconds", "notes"), rows, words=(0, 1, 4))


if __name__ == "__main__":
    sys.stdout.write(build(HERE / "results.json", ROOT / "docs"))
