"""The page docs/performance.md from results.json: `python -m benchmarks.page` rebuilds it without measuring."""

import json
import statistics
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from benchmarks import aims, errors
from benchmarks.cases import BODIES, REFERENCE, SIZES, n_nodes
from benchmarks.figure import draw
from benchmarks.limits import Moved
from benchmarks.runs import HERE, PROGRAMS, ROOT, SPRINGS, Measured

# The solver of each program; the rest of its row comes from the runs.
_SOLVERS = {
    "truespring": "residual to 1e-8 of the load",
    "calculix": "NLGEOM, SPOOLES, all threads; residual and correction to 1e-7 in the norms of CalculiX",
    "felupe": "plain Newton, MKL Pardiso, threads; residual to 1e-8 of the reactions",
    "skfem": "plain Newton, MKL Pardiso; residual to 1e-8 of the load",
}

# Kernels below this share of the time of a solve are summed into one row.
_LEAST_SHARE = 0.03

# Loads of the tables of times.
_LOADS = ((2, "bending"), (3, "bending"), (2, "stretching"), (3, "stretching"))


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
    yield from _aims(results, runs)
    yield from _compared(runs, results["repeats"])
    yield "## Time\n"
    yield "![Time over nodes](performance.svg)\n"
    for dim, load in _LOADS:
        yield from _times(runs, dim, load, results["limit_seconds"])
    yield from _agreement(runs)
    yield from _ratios(runs)
    yield from _accuracy(runs)
    yield from _older(results)
    yield from _organ(results["organ"])
    yield from _details(runs)
    yield from _memory(runs)
    yield from _parts(results["kernels"])
    yield from _limit(results)
    yield from _commands(results["command_line"])
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


def _compared(runs: list[Measured], repeats: int) -> Iterator[str]:
    bent, pulled = (BODIES[2, load].moved for load in ("bending", "stretching"))
    plane, space, soft = (BODIES[key] for key in ((2, "bending"), (3, "bending"), (3, "soft block")))
    yield "## What is compared\n"
    yield (
        "**[Gaussian springs](models.md) are compared with finite elements of the same nodes, supports and force.** "
        "They converge to the neo-Hookean law; each spring depends on two nodes and each pressure on one element, "
        "where a finite element integrates a law over Gauss points. The springs of the paper (lloyd, isotropic) have a "
        "fixed Poisson's ratio and a model error; biquadratic springs converge to the St. Venant-Kirchhoff law. "
        "truespring's own finite elements are the same equations as those of FElupe and scikit-fem, and as C3D8 of "
        "CalculiX. C3D8I and C3D20R of CalculiX need fewer elements in bending: compare them at "
        "[the same error](#time-to-the-same-error).\n"
    )
    yield (
        f"Bodies are fixed on the left and loaded on the right by a dead force: a rectangle {plane.length} by 1 of "
        f"squares in plane stress (Poisson's ratio 1/3), a box {space.length} by 1 by 1 of cubes (1/4), and a block "
        f"{soft.length} by 1 by 1 of cubes (0.45). In bending the force moves the end of Gaussian springs down by "
        f"{bent:.0%} of the length, in stretching it extends them by {pulled:.0%}.\n"
    )
    yield (
        "Seconds are wall time from the built mesh to equilibrium: sparsity pattern, assembly, factorisation or "
        "multigrid setup, and all iterations, without reading, writing and compiling (compiled code comes from a "
        "cache; each process first solves a small mesh, untimed). A process repeats a solution until it has taken 2 s, "
        f"at most five times, and reports the median; a time is the median of at most {repeats} processes: of one if a "
        "solution takes 20 s and for meshes of the time to the same error. All programs use the smallest number of "
        "equal load steps (1, 2, 4, 8 or 16) that converges; failed attempts are not timed.\n"
    )
    rows = []
    for name, program in PROGRAMS.items():
        version = next((run.version for run in runs if run.program == name and run.version), "not run")
        rows.append((program.label, version, program.law, program.element, _SOLVERS[program.module]))
    yield from table(("program", "version", "law", "elements", "solver"), rows, words=(0, 1, 2, 3, 4))


def _times(runs: list[Measured], dim: int, load: str, longest: float) -> Iterator[str]:
    depths = _sizes(runs, dim, load)
    if not depths:
        return
    at = {(run.program, run.depth): run for run in runs if (run.dim, run.load) == (dim, load)}
    nodes = [n_nodes(dim, load, depth) for depth in depths]
    yield f"### {dim}D, {load}: seconds\n"
    left_out = {}

    def cell(program: str, depth: int) -> str:
        run = at.get((program, depth))
        if run is None:
            return ""
        if not run.seconds:
            left_out.setdefault(PROGRAMS[program].label, run.failure)
            return "-"
        return _seconds(run.median) + _steps(run)

    rows = [
        (program.label, *(cell(name, depth) for depth in depths))
        for name, program in PROGRAMS.items()
        if dim in program.dims
    ]
    yield from table(("nodes", *(f"{count:,}" for count in nodes)), rows)
    if left_out:
        yield f"Sizes left out (the time of a solve is limited to {longest:g} s):\n"
        yield from (f"* {label}: {why}" for label, why in left_out.items())
        yield ""


def _steps(run: Measured) -> str:
    """Return the number of load steps of a run in parentheses, empty for one."""
    first = run.notes.split(", ")[0]
    return f" ({first.split()[0]} steps)" if first.endswith("load steps") else ""


def _agreement(runs: list[Measured]) -> Iterator[str]:
    """Yield the largest difference of tip displacements among programs with the same law, elements and mesh."""
    apart = {}
    for law in ("St. Venant-Kirchhoff", "neo-Hookean"):
        for dim in (2, 3):
            tips: dict[tuple[str, int], list[float]] = {}
            for run in runs:
                program = PROGRAMS[run.program]
                linear = program.element.startswith("linear") and run.load != "soft block"
                if program.law == law and run.dim == dim and run.seconds and linear:
                    tips.setdefault((run.load, run.depth), []).append(run.tip)
            spreads = [max(values) / min(values) - 1 for values in tips.values() if len(values) > 1]
            apart[law, dim] = max(spreads, default=0.0)
    listed = "; ".join(f"{law}, {dim}D: {value:.1e}" for (law, dim), value in apart.items())
    yield (
        "Programs with the same law and linear elements agree. Largest relative difference between two tip "
        f"displacements on the same mesh, over all sizes and both loads: {listed}. (CalculiX prints seven digits.)\n"
    )


def _ratios(runs: list[Measured]) -> Iterator[str]:
    yield "## Speed-up\n"
    for ours, words in ((SPRINGS, "Gaussian springs"), ("fem-nh", "truespring's neo-Hookean finite elements")):
        columns = [(dim, load) for dim, load in _LOADS if _at_reference(runs, ours, dim, load)]
        if not columns:
            continue
        yield f"Time of each program over that of {words}, at the size of each column:\n"
        rows = []
        for name, program in PROGRAMS.items():
            cells = []
            for dim, load in columns:
                theirs, own = (_at_reference(runs, one, dim, load) for one in (name, ours))
                cells.append(f"{theirs.median / own.median:.2g}" if theirs and own and name != ours else "")
            rows.append((program.label, *cells))
        nodes = [f"{dim}D, {load}, {n_nodes(dim, load, REFERENCE[dim]):,} nodes" for dim, load in columns]
        yield from table(("", *nodes), (row for row in rows if any(row[1:])))


def _at_reference(runs: list[Measured], program: str, dim: int, load: str) -> Measured | None:
    key = (program, dim, load, REFERENCE[dim])
    return next((run for run in runs if (run.program, run.dim, run.load, run.depth) == key and run.seconds), None)


def _older(results: dict) -> Iterator[str]:
    """Yield the times of springs then and now."""
    yield f"## Against commit {results['older_commit']}\n"
    if not results["older"]:
        yield f"Not measured: this clone does not have commit {results['older_commit']}.\n"
        return
    yield (
        f"Springs in bending by the code of commit {results['older_commit']} and of this one, in alternation, in the "
        "same environment; median seconds, and the ratio of the medians.\n"
    )
    rows = []
    for row in results["older"]:
        where = f"{row['dim']}D, {row['n_nodes']:,} nodes"
        then = row["seconds"]["then"]
        rule = row["rule"].removeprefix("truespring, ")
        for side, label in (("now", rule), (SPRINGS, f"Gaussian springs now, {rule} then")):
            now = row["seconds"][side]
            if then and now:
                taken = statistics.median(then), statistics.median(now)
                cells = (*map(_seconds, taken), f"{taken[0] / taken[1]:.2f}")
            else:
                cells = ("-", "-", row["failure"])
            rows.append((f"{where}: {label}", *cells))
    yield from table(("", "then", "now", "times faster"), rows)


def _organ(rows: list[dict]) -> Iterator[str]:
    """Yield the times on the shipped organ."""
    yield "## A body of voxels, nearly incompressible\n"
    n_elements = next((row["n_elements"] for row in rows if "n_elements" in row), 0)
    yield (
        f"The frog's liver of `examples/organ.toml`, {n_elements:,} cubes of voxels in five load steps, by Gaussian "
        "springs and by neo-Hookean finite elements with mean dilatation; median of three solutions, or one if it "
        "takes 15 s. A tangent includes its assembly.\n"
    )
    found = []
    for row in rows:
        label = {"gaussian": "Gaussian springs", "neo-hookean": "neo-Hookean FEM"}[row["key"]]
        if "failure" in row:
            cells = ("-", "-", "-", "", "", row["failure"])
        else:
            times = f"{1e3 * row['force']:.2g}", f"{1e3 * row['tangent']:.2g}", _seconds(row["solve"])
            cells = (*times, f"{row['iterations']}", f"{row['cg'] or '-'}", row["linear"])
        found.append((f"{row['poisson']:g}", label, *cells))
    head = ("Poisson's ratio", "model", "force, ms", "tangent, ms", "solve, s", "Newton", "CG", "linear solver")
    yield from table(head, found, words=(1, 7))


def _commands(found: dict[str, float]) -> Iterator[str]:
    yield "## Command line\n"
    yield (
        "Median wall times of whole commands. Compiling: with an empty cache of compiled code, as the first command "
        "after installation. Solving: the part of it that the summaries report.\n"
    )
    names = [name for name in found if not name.endswith(", solving")]
    rows = (
        (f"`{name}`", f"{found[name]:.2f}", f"{found[f'{name}, solving']:.2f}" if f"{name}, solving" in found else "")
        for name in names
    )
    yield from table(("command", "seconds", "solving"), rows)


def _details(runs: list[Measured]) -> Iterator[str]:
    yield "## Gaussian springs by size\n"
    for dim, load in _LOADS:
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
                    f"{run.tip / BODIES[dim, load].length:.4f}",
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
        head = [f"{n_nodes(dim, 'bending', depth):,}" for depth in depths]
        rows = (
            (program.label, *(_mebibytes(at.get((name, depth))) for depth in depths))
            for name, program in PROGRAMS.items()
            if dim in program.dims
        )
        yield from table((f"{dim}D, nodes", *head), rows)


def _mebibytes(run: Measured | None) -> str:
    return f"{run.peak_bytes / 2**20:.0f}" if run else "-"


def _parts(kernels: list[dict]) -> Iterator[str]:
    """Yield the bytes of what a solve keeps."""
    counted = [one for one in kernels if one["parts"]]
    if not counted:
        return
    yield (
        "Bytes a node of the arrays that are kept at the end of a solve; temporary ones and libraries are not "
        "counted. The tangent is the assembled matrix, the linear solver what it makes of it.\n"
    )
    rows = []
    for one in counted:
        parts = {name: size / one["n_nodes"] for name, size in one["parts"].items()}
        rows.append((_where(one), *(f"{size:.0f}" for size in parts.values()), f"{sum(parts.values()):.0f}"))
    yield from table(("", *counted[0]["parts"], "sum"), rows)


def _limit(results: dict) -> Iterator[str]:
    limit = max(results["bandwidth"].values())
    reading = max(value for name, value in results["bandwidth"].items() if name.startswith("read"))
    yield "## Memory bandwidth\n"
    listed = "; ".join(f"{name}: {value / 1e9:.1f} GB/s" for name, value in results["bandwidth"].items())
    yield f"Memory bandwidth of this machine in the same run, arrays of 512 MiB: {listed}.\n"
    yield (
        "The last column of the table is the time of a loop over its limit, the time to move its data once at the "
        "largest of these bandwidths: of a force, positions, elements and forces; of a tangent, positions, elements "
        "and the matrix in double precision; of a matrix product, half of the symmetric matrix in single precision and "
        "two vectors; of a V-cycle, each level twice; of a solve, the tangents, products and V-cycles of its "
        "iterations. It can be below 1 if the data fit into a cache, or if a loop needs less than that. Relative to "
        f"the bandwidth of reading alone, {reading / 1e9:.1f} GB/s, it would be {reading / limit:.2f} times as "
        "large.\n"
    )
    rows = []
    for one in results["kernels"]:
        for row in one["rows"]:
            moved = Moved(row["name"], row["seconds"], row["bytes_moved"])
            least = 1e3 * moved.bytes_moved / limit
            numbers = f"{moved.bytes_moved / 1e6:.1f}", f"{1e3 * moved.seconds:.3g}", f"{least:.3g}"
            rows.append((f"{_where(one)}: {moved.name}", *numbers, f"{moved.over(limit):.1f}"))
    yield from table(("", "MB", "ms", "limit, ms", "time over limit"), rows)
    yield "Fractions of the time of a whole solve, by what the solver calls:\n"
    yield from _fractions(results["kernels"], "phases")
    yield "The same by compiled loop, including the distribution of work to threads:\n"
    yield from _fractions(results["kernels"], "shares")


def _fractions(kernels: list[dict], key: str) -> Iterator[str]:
    """Yield a table of the fractions of time by name, of profiles under a key."""
    profiled = [one for one in kernels if one[key]]
    parts = [{name: value / sum(one[key].values()) for name, value in one[key].items()} for one in profiled]
    names = sorted({name for one in parts for name in one}, key=lambda name: -sum(one.get(name, 0) for one in parts))
    large = [name for name in names if max(one.get(name, 0) for one in parts) >= _LEAST_SHARE]
    rows = [(name, *(f"{one.get(name, 0):.0%}" for one in parts)) for name in large]
    if rest := len(names) - len(large):
        small = (f"{1 - sum(one.get(name, 0) for name in large):.0%}" for one in parts)
        rows.append((f"{rest} smaller shares", *small))
    yield from table(("", *map(_where, profiled)), rows)


def _where(one: dict) -> str:
    label = PROGRAMS[one["program"]].label.removeprefix("truespring, ")
    return f"{label}, {one['dim']}D, {one['n_nodes']:,} nodes"


def _accuracy(runs: list[Measured]) -> Iterator[str]:
    yield "## Time to the same error\n"
    yield (
        "The bodies in bending on meshes with one or more elements over the height. The error is the rms distance of "
        "the nodes of the coarsest mesh from the limit of fine meshes, over the rms displacement. The limit is that of "
        "the law of each program: neo-Hookean or St. Venant-Kirchhoff (lloyd and isotropic springs, too), extrapolated "
        "from the three finest meshes of truespring's finite elements (Richardson). A target is reached if every "
        "finer mesh reaches it too; times are interpolated between meshes as powers of the error.\n"
    )
    for dim, load in ((3, "soft block"), (2, "bending"), (3, "bending")):
        found = errors.to_the_same_error(runs, dim, load)
        if not found:
            continue
        rows = []
        for name, (finest, error, costs) in found.items():
            rows.append((PROGRAMS[name].label, f"{error:.2%} ({finest.n_unknowns:,})", *map(_reached, costs)))
        title = f"{dim}D, Poisson's ratio {BODIES[dim, load].poisson:.3g}"
        targets = (f"to {target:.0%}" for target in errors.TARGETS)
        yield from table((title, "finest mesh: error (unknowns)", *targets), rows)
    yield (
        "Each cell has the time in seconds and, in parentheses, the approximate number of unknowns; `<=` marks the "
        "coarsest mesh, `~` a time extrapolated beyond the finest mesh by the slope of the last two, `-` an error that "
        "is out of reach of both. Errors near the difference of the finest meshes from the limit are not exact.\n"
    )


def _reached(cost: errors.Reached | None) -> str:
    if cost is None:
        return "-"
    return f"{'<= ' * cost.bound}{'~ ' * cost.extrapolated}{_seconds(cost.seconds)} ({cost.unknowns:,.0f})"


def _aims(results: dict, runs: list[Measured]) -> Iterator[str]:
    yield "## Bars and aims\n"
    yield (
        "Each figure is a ratio or a time of this run. Before: at commit "
        f"{results['older_commit']}, on another machine or at another time.\n"
    )
    rows = []
    reasons = {}
    for aim in aims.aims(results, runs):
        if aim.why:
            reasons[aim.what] = aim.why
        measured = "-" if aim.measured is None else f"{aim.measured:.3g}"
        sign = "at least" if aim.at_least else "at most"
        best = "" if aim.aim is None else f"{aim.aim:g}"
        rows.append((aim.what, aim.before, f"{sign} {aim.bar:g}", best, measured, aim.verdict))
    yield from table(("figure", "before", "bar", "aim", "measured", ""), rows, words=(0, 1, 5))
    if reasons:
        yield "What each of them is spent on, by the profiles of this run:\n"
        yield from (f"* {what}: {why}" for what, why in reasons.items())
        yield ""


def _recorded(recorded: dict) -> Iterator[str]:
    yield "## Other programs\n"
    yield (
        f"Measured once, not by `make bench`: {recorded['date']}, {recorded['processor']}, {recorded['cores']} cores, "
        "one run each, in bending on the same meshes by forces that move springs (lloyd, isotropic) by half the "
        "length.\n"
    )
    rows = (
        (run["program"], run["version"], f"{run['dim']}D, {run['n_nodes']:,}", _seconds(run["seconds"]), run["notes"])
        for run in recorded["runs"]
    )
    yield from table(("program", "version", "nodes", "seconds", "notes"), rows, words=(0, 1, 4))


if __name__ == "__main__":
    sys.stdout.write(build(HERE / "results.json", ROOT / "docs"))
