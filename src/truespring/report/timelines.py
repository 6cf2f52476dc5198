"""Plots over time, or over the way at rest: energies of a motion, forces on tools."""

import numpy as np

from truespring.arrays import Floats
from truespring.equilibrium import Solution
from truespring.report.axis import axis_of
from truespring.report.frame import draw_frame
from truespring.report.legend import ROW, Entry, draw_legend, legend_columns
from truespring.report.parts import by_scheme
from truespring.report.plots import Curve, plot
from truespring.report.quantity import natural_scale, percent
from truespring.report.result import Result
from truespring.report.sheet import Area, Sheet
from truespring.report.style import BLUE, INK, RED, is_strong, label_and_name, path_styles
from truespring.report.verdict import display_name
from truespring.report.words import draw_words

# Energies in the order of the stack, with their colours; `numerical` is an error.
_BANDS = {"kinetic": BLUE, "elastic": "#7fc0e8", "contact": "#00795a", "damped": "#e0a030", "numerical": RED}
# Energies below this share of the largest are left out of the legend.
_NONE = 1e-3
_WIDTH, _HEIGHT, _LEFT, _BOTTOM = 5.9, 2.7, 0.62, 0.5
_DASHES = ("-", (0, (4, 2)), (0, (1.2, 1.5)), (0, (6, 1.5, 1, 1.5)))


def energies_figure(result: Result, name: str) -> Sheet:
    """Return the energies of a path stacked over time, and the work done on the body, which is their sum."""
    from matplotlib.lines import Line2D

    axis, path = axis_of(result), result.solutions[name]
    at, values, work = _energies(path)
    x = axis.value(at)
    low, high = _limits(result)
    scale = natural_scale(max(abs(low), high), "J")
    shown = [band for band, one in values.items() if np.abs(one).max() > _NONE * (high or 1.0)]
    legend = [Entry(band, _BANDS[band]) for band in shown] + [Entry(_work_words(work), INK)]
    columns, _ = legend_columns(legend, _WIDTH - _LEFT)
    top = 0.4 + ROW * len(columns[0])
    sheet = Sheet(_WIDTH, _BOTTOM + _HEIGHT + top, _energy_title(result, name))
    span = 0.05 * (high - low) or 0.05
    limits = (low - span if low < 0 else 0.0, high + span)
    y = limits[0] / scale.size, limits[1] / scale.size
    area = Area(sheet, _LEFT, _BOTTOM, _WIDTH - _LEFT - 0.15, _HEIGHT, (0.0, axis.span), y)
    draw_frame(area, axis.label, f"energy [{scale.unit}]")
    for band, below, above in _stacked(values):
        _fill(area, x, below / scale.size, above / scale.size, _BANDS[band], band)
    area.add(Line2D(x, work / scale.size, color=INK, lw=1.3, zorder=4, gid="work", label="work"))
    draw_words(sheet, _LEFT, sheet.height - 0.19, sheet.title, 9, bold=True)
    draw_legend(sheet, columns, _LEFT, sheet.height - 0.34)
    return sheet


def _work_words(work: Floats) -> str:
    """Return what the line of work is; at the begin the body may have energy."""
    begins = abs(float(work[0])) > _NONE * float(np.abs(work).max())
    return "energy at the begin and work done" if begins else "work done on the body"


def moving(result: Result) -> list[str]:
    """Return the names of the paths whose energies are known over time."""
    return [name for name, path in result.solutions.items() if sum(one.moving is not None for one in path.states) > 1]


def _energies(path: Solution) -> tuple[Floats, dict[str, Floats], Floats]:
    """Return levels, energies by band [J] and the work done with the energy at the begin [J], shape (n,) each."""
    states = [(state.load_factor, state.moving.energies) for state in path.states if state.moving is not None]
    values = {band: np.array([getattr(one, band) for _, one in states]) for band in _BANDS}
    begin = sum(float(one[0]) for one in values.values())
    return np.array([at for at, _ in states]), values, begin - np.array([one.loads for _, one in states])


def _limits(result: Result) -> tuple[float, float]:
    """Return the lowest and highest value of the stacks and of the work of all paths [J]."""
    found = [0.0]
    for name in moving(result):
        _, values, work = _energies(result.solutions[name])
        found += [float(work.min()), float(work.max())]
        for _, below, above in _stacked(values):
            found += [float(below.min()), float(above.max())]
    return min(found), max(found)


def _stacked(values: dict[str, Floats]) -> list[tuple[str, Floats, Floats]]:
    """Return name, lower and upper side of each band; negative values are stacked below zero, as bands of their own."""
    up, down = (np.zeros(len(next(iter(values.values())))) for _ in range(2))
    found = []
    for band, one in values.items():
        above, below = up + one.clip(min=0), down + one.clip(max=0)
        found += [(band, up, above)] if (one > 0).any() else []
        found += [(band, below, down)] if (one < 0).any() else []
        up, down = above, below
    return found


def _fill(area: Area, x: Floats, below: Floats, above: Floats, color: str, name: str) -> None:
    from matplotlib.patches import Polygon

    corners = np.concatenate([np.column_stack([x, below]), np.column_stack([x, above])[::-1]])
    area.add(Polygon(corners, closed=True, fc=color, ec="white", lw=0.3, zorder=3, gid=name))


def _energy_title(result: Result, name: str) -> str:
    title = f"Energies of {display_name(result, name)}"
    taken = by_scheme(result.solutions[name])
    if taken is None or abs(taken) < 1e-4:
        return title
    verb = "dissipated" if taken > 0 else "added"
    return f"{title}; the scheme {verb} {percent(abs(taken))} of the work"


def has_touches(result: Result) -> bool:
    """Return whether the forces on tools or grasps are known along the way."""
    return any(len(path.states) > 1 and path.states[-1].touches for path in result.solutions.values())


def tools_figure(result: Result) -> Sheet:
    """Return the size of the force on each tool and grasp, over time or over the way."""
    axis, styles = axis_of(result), path_styles(result)
    names = [one.name for one in result.problem.touching]
    found = []
    for name, path in result.solutions.items():
        states = [state for state in path.states if len(state.touches) == len(names)]
        for number, tool in enumerate(names if states else ()):
            size = np.array([float(np.linalg.norm(state.touches[number].force)) for state in states])
            found.append((name, number, tool, np.array([state.load_factor for state in states]), size))
    scale = natural_scale(max(float(size.max()) for *_, size in found), "N")
    several = len(names) > 1
    curves = []
    for name, number, tool, at, size in found:
        color, dashes, marker = styles[name]
        label = "\n".join([*label_and_name(result, name)][:1] + ([f"on {tool}"] if several else []))
        dashes = _DASHES[number % len(_DASHES)] if several else dashes
        curves.append(
            Curve(axis.value(at), size / scale.size, color, dashes, marker, label, strong=is_strong(result, name))
        )
    what = "each tool" if several else names[0]
    return plot(f"Force on {what} over {axis.name}", axis.label, f"force [{scale.unit}]", curves).sheet
