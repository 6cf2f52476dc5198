"""Rebuild docs/images/springs_over_fem.png, the picture of docs/accuracy/studies.md: the shipped studies at full load.

Run from the root of the repository: python docs/build_picture.py (or make verification).
"""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from truespring.arrays import Floats, Ints
from truespring.report.bodies import path_lines
from truespring.report.figures import render_figures
from truespring.report.style import BLUE, FAINT, INK, RED, figure_style
from truespring.study import read_study, run

ROOT = Path(__file__).parent.parent


def picture() -> Figure:
    """Bending on top, stretching below; linear FEM on the left, St. Venant-Kirchhoff FEM on the right."""
    figure = Figure(figsize=(10, 6.0))
    axes = figure.subplots(2, 2, gridspec_kw={"height_ratios": (2.15, 1)})
    figure.subplots_adjust(left=0.01, right=0.99, top=0.89, bottom=0.01, wspace=0.03, hspace=0.12)
    for row, name in zip(axes, ("bending", "stretching"), strict=True):
        result = run(read_study(ROOT / "examples" / f"{name}.toml"))
        springs = result.solutions["springs"]
        everything = []
        for ax, reference in zip(row, ("linear", "nonlinear"), strict=True):
            comparison = result.comparisons[reference]
            fem, mine = comparison.reference.states[-1].positions, springs.states[-1].positions
            rest = result.problem.mesh.nodes
            for points, lines, color, width in (
                (rest, result.problem.mesh.boundary, FAINT, 0.8),
                (fem, path_lines(comparison.reference), INK, 1.5),
                (mine, path_lines(springs), BLUE, 0.8),
            ):
                draw(ax, points, lines, color, width)
            ax.plot(*mine[result.probe], "o", color=RED, ms=5, mec="white", mew=0.6)
            label = comparison.reference.label
            ax.set_title(f"{name}, over {label}: {comparison.rms_error:.1%} apart", fontsize=11, loc="left", x=0.03)
            everything.append(np.concatenate([rest, fem, mine]))
        lower, upper = np.concatenate(everything).min(axis=0), np.concatenate(everything).max(axis=0)
        for ax in row:
            margin = 0.02 * (upper - lower).max()
            ax.set(xlim=(lower[0] - margin, upper[0] + margin), ylim=(lower[1] - margin, upper[1] + margin))
            ax.set_aspect("equal")
            ax.set_axis_off()
    handles = [Line2D([], [], color=color, lw=1.8) for color in (BLUE, INK, FAINT)]
    labels = ["springs (Lloyd's rule)", "finite elements", "at rest"]
    figure.legend(handles, labels, loc="upper left", ncols=3, bbox_to_anchor=(0.015, 1.0), fontsize=11, frameon=False)
    return figure


def draw(ax: object, points: Floats, lines: Ints, color: str, width: float) -> None:
    ax.add_collection(LineCollection(points[lines], colors=color, linewidths=width))


if __name__ == "__main__":
    with figure_style():
        drawn = picture()
        FigureCanvasAgg(drawn)
        drawn.savefig(ROOT / "docs" / "images" / "springs_over_fem.png", dpi=130)
    block = render_figures(run(read_study(ROOT / "examples" / "soft_block.toml")))
    (ROOT / "docs" / "images" / "soft_block.png").write_bytes(block["gaussian_error_neo-hookean"].png)
