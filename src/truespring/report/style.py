"""The style of all figures: colours, line styles and names of paths."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.report.result import Result

#: Colours that colour-blind readers and grey prints distinguish (blue, vermillion, green: Okabe and Ito).
INK, BLUE, RED, LOAD, MOTION, FAINT = "#16191d", "#0072b2", "#d3222a", "#b84a00", "#00795a", "#a9b0b7"

# The part of matplotlib's magma for distances, from 0 (light) to the largest (dark).
_ERROR_RANGE = (0.97, 0.27)

SPRING_STYLES = ((BLUE, "-", "o"), ("#3a9bdc", "--", "s"), ("#00476f", "-.", "^"), ("#5c7fb8", ":", "D"))
#: Colour, dashes and marker of lines that are all alike, such as values of many models.
EQUAL_STYLES: tuple[tuple[str, Any, str], ...] = (
    (BLUE, "-", "o"),
    ("#000000", (0, (6, 2)), "s"),
    (LOAD, (0, (3, 1.5, 1, 1.5)), "^"),
    (MOTION, (0, (1.2, 1.6)), "D"),
    ("#7a4f9c", "-", "v"),
    ("#3a9bdc", (0, (6, 2)), "P"),
    ("#70777e", (0, (3, 1.5, 1, 1.5)), "X"),
    ("#8a5a00", (0, (1.2, 1.6)), "<"),
)
_REFERENCE_STYLES = (
    ("#000000", (0, ()), "s"),
    ("#3d4248", (0, (6, 2)), "^"),
    ("#5b6168", (0, (3, 1.5, 1, 1.5)), "D"),
    ("#70777e", (0, (1.2, 1.6)), "v"),
    ("#3d4248", (0, (8, 2, 1, 2, 1, 2)), "P"),
    ("#5b6168", (0, (2, 2)), "X"),
)

_RC: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.5,
    "text.color": INK,
    "svg.fonttype": "path",
    "svg.hashsalt": "truespring",
    "savefig.facecolor": "white",
}
#: A typographical point [inch].
POINT = 1 / 72


@contextmanager
def figure_style() -> Iterator[None]:
    """Apply the common settings of matplotlib, and restore the former ones at the end."""
    import matplotlib

    with matplotlib.rc_context(_RC):
        yield


def error_colors(shares: Floats) -> Floats:
    """Return the colours of distances, shares 0 ... 1 of the largest: red, green, blue [-], shape (..., 3)."""
    import matplotlib

    light, dark = _ERROR_RANGE
    return np.asarray(matplotlib.colormaps["magma"](light + (dark - light) * shares)[..., :3])


def path_styles(result: Result) -> dict[str, tuple[str, Any, str]]:
    """Return colour, dashes and marker of each path: blues for springs and the compared model, black and greys else."""
    springs = [name for name in result.solutions if is_strong(result, name)]
    others = [name for name in result.solutions if name not in springs]
    return {
        **{name: SPRING_STYLES[place % len(SPRING_STYLES)] for place, name in enumerate(springs)},
        **{name: _REFERENCE_STYLES[place % len(_REFERENCE_STYLES)] for place, name in enumerate(others)},
    }


def is_strong(result: Result, name: str) -> bool:
    """Return whether a path is drawn in blue: springs and the compared model."""
    return name == result.model or result.solutions[name].has_springs


def full_name(result: Result, name: str) -> str:
    """Return the label of a path, with its name in the study if the label does not identify it."""
    return " · ".join(label_and_name(result, name))


def label_and_name(result: Result, name: str) -> tuple[str, ...]:
    """Return the label of a path, and its name in the study if the label does not contain it or is not unique."""
    label = result.solutions[name].label
    alone = sum(path.label == label for path in result.solutions.values()) == 1
    return (label,) if alone and name.casefold() in label.casefold() else (label, name)
