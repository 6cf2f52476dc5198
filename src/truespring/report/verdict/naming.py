"""Names in the sentences of a verdict: models, references, load levels and elements."""

from collections.abc import Sequence

from truespring.equilibrium import Solution
from truespring.report.axis import axis_of
from truespring.report.result import Result

#: First-order elements by the element of the mesh.
ELEMENTS = {
    "quadrilateral": "four-node elements",
    "triangle": "linear triangles",
    "hexahedron": "eight-node elements",
    "tetrahedron": "linear tetrahedra",
}

_CORNERS = {
    "quadrilateral": "four-node ",
    "hexahedron": "eight-node ",
    "wedge": "six-node ",
    "pyramid": "five-node ",
}


def display_name(result: Result, name: str) -> str:
    """Return the label of a path, followed by its name in the study if several paths have that label."""
    label = result.solutions[name].label
    is_unique = sum(path.label == label for path in result.solutions.values()) == 1
    return label if is_unique else f"{label} ({name})"


def subject(result: Result) -> tuple[str, bool]:
    """Return the name of the compared model as the subject of a sentence, and whether it is plural."""
    assert result.model is not None
    path = result.solutions[result.model]
    if not path.has_springs:
        return display_name(result, result.model), False
    several = sum(other.has_springs for other in result.solutions.values()) > 1
    return display_name(result, result.model) if several else "springs", True


def everyone(result: Result, names: Sequence[str]) -> str:
    """Return the name of one reference, or the number of several."""
    if len(names) == 1:
        return display_name(result, names[0])
    return "both references" if len(names) == 2 else f"all {len(names)} references"


def level_name(result: Result, load_factor: float) -> str:
    """Return a level in words, see `Axis`: full load, load factor 0.4, 0.16 s."""
    return axis_of(result).words(load_factor)


def full_level(result: Result) -> str:
    """Return the name of level 1: full load, without loads full motion, the duration of a motion."""
    return axis_of(result).full


def linear_fem(path: Solution) -> str:
    """Return the name of first-order finite elements on the mesh of a path."""
    return f"linear {_CORNERS.get(path.problem.mesh.element, '')}FEM"


def deep(depth: int) -> str:
    """Return a number of elements over the depth in words."""
    return f"{depth} element{'' if depth == 1 else 's'} deep"


def listed(parts: Sequence[str], last: str = " and ") -> str:
    """Return parts joined by commas, the last one by `last`."""
    return last.join([", ".join(parts[:-1]), parts[-1]]) if len(parts) > 1 else parts[0]
