"""Draw docs/performance.svg: time over number of nodes, one line for each program."""

from collections.abc import Iterable
from pathlib import Path

from benchmarks.cases import SIZES
from benchmarks.runs import PROGRAMS, SPRINGS, Measured

# Color and dash: truespring's springs in blue, its finite elements in grey, peers in other colors.
_STYLES = {
    "gaussian": ("#0b3c75", "-"),
    "isotropic": ("#6ba3dc", "-"),
    "lloyd": ("#6ba3dc", "-"),
    "biquadratic": ("#6ba3dc", ":"),
    "fem-nh": ("#222222", "-"),
    "fem-svk": ("#888888", "-"),
    "calculix": ("#c0392b", "-"),
    "calculix-c3d8i": ("#c0392b", "--"),
    "calculix-c3d20r": ("#c0392b", "-."),
    "calculix-c3d20r-half": ("#c0392b", ":"),
    "felupe-nh": ("#2e8b57", "-"),
    "felupe-svk": ("#2e8b57", ":"),
    "skfem": ("#d98e04", "-"),
}


def draw(runs: Iterable[Measured], file: Path) -> None:
    """Draw times in bending, 2D and 3D side by side, to an SVG file."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    bent = [run for run in runs if run.load == "bending" and run.seconds and run.depth in SIZES[run.dim]]
    figure = Figure(figsize=(12, 4.8), layout="constrained")
    labelled = {}
    for ax, dim in zip(figure.subplots(1, 2, sharey=True), (2, 3), strict=True):
        for name, program in PROGRAMS.items():
            points = sorted((run.n_nodes, run.median) for run in bent if (run.program, run.dim) == (name, dim))
            if points and dim in program.dims:
                color, dash = _STYLES[name]
                width = 2.4 if name == SPRINGS else 1.4
                (line,) = ax.loglog(*zip(*points, strict=True), dash, marker="o", ms=4, color=color, lw=width)
                labelled[program.label] = line
        ax.set(xlabel="nodes", title=f"{dim}D")
        ax.grid(which="major", color="#e5e5e5", lw=0.8)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
    figure.legend(labelled.values(), labelled.keys(), loc="outside right center", frameon=False, fontsize=9)
    figure.axes[0].set_ylabel("seconds from the mesh to equilibrium")
    figure.suptitle("Bending by a force that moves the end of Gaussian springs by half the length", fontsize=11)
    with matplotlib.rc_context({"svg.hashsalt": "performance", "svg.fonttype": "path"}):
        FigureCanvasSVG(figure).print_svg(file, metadata={"Date": None})
