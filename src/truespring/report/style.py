"""How figures look: colours, line styles and the names of paths, shared by all of them."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.report.result import Result

#: Colours that stay apart for colour-blind eyes and on grey paper (blue, vermillion, green: Okabe and Ito).
INK, BLUE, RED, LOAD, MOTION, FAINT = "#16191d", "#0072b2", "#d3222a", "#b84a00", "#00795a", "#a9b0b7"

#: How far two paths are apart, from nothing to the largest distance: matplotlib's magma from its light end on.
_ERROR_RANGE = (0.97, 0.27)

SPRING_STYLES = ((BLUE, "-", "o"), ("#3a9bdc", "--", "s"), ("#00476f", "-.", "^"), ("#5c7fb8", ":", "D"))
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
#: A point of type [inch].
POINT = 1 / 72


@contextmanager
def figure_style() -> Iterator[None]:
    """Draw within this: matplotlib's settings, and its former ones afterwards."""
    import matplotlib

    with matplotlib.rc_context(_RC):
        yield


def error_colors(shares: Floats) -> Floats:
    """Return the colours of distances, each a share 0 ... 1 of the largest: red, green, blue, shape (..., 3)."""
    import matplotlib

    light, dark = _ERROR_RANGE
    return np.asarray(matplotlib.colormaps["magma"](light + (dark - light) * shares)[..., :3])


def path_styles(result: Result) -> dict[str, tuple[str, Any, str]]:
    """Return colour, dashes and marker of each path: springs and what is compared in blues, others in black, greys."""
    springs = [name for name in result.paths if is_strong(result, name)]
    others = [name for name in result.paths if name not in springs]
    return {
        **{name: SPRING_STYLES[place % len(SPRING_STYLES)] for place, name in enumerate(springs)},
        **{name: _REFERENCE_STYLES[place % len(_REFERENCE_STYLES)] for place, name in enumerate(others)},
    }


def is_strong(result: Result, name: str) -> bool:
    """Tell whether a path is drawn in blue: springs, and what is compared."""
    return name == result.model or result.paths[name].has_springs


def full_name(result: Result, name: str) -> str:
    """The label of a path, and its name in the study where that is needed to know it by."""
    return " · ".join(label_and_name(result, name))


def label_and_name(result: Result, name: str) -> tuple[str, ...]:
    """Return the label of a path and its name in the study, where the label does not hold it or is not its own."""
    label = result.paths[name].label
    alone = sum(path.label == label for path in result.paths.values()) == 1
    return (label,) if alone and name.casefold() in label.casefold() else (label, name)
