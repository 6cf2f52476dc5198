"""Networks from two CSV files: nodes, and the springs between them."""

from pathlib import Path

import numpy as np

from truespring.columns import Columns
from truespring.errors import MeshError, TruespringError
from truespring.models import SpringNetwork
from truespring.units import Dimension

# Columns by name, and what they measure; others are refused.
_NODE_COLUMNS: dict[str, Dimension | None] = {"node": None, "x": "length", "y": "length", "z": "length"}
_SPRING_COLUMNS: dict[str, Dimension | None] = {
    "a": None,
    "b": None,
    "stiffness": "stiffness",
    "rest_length": "length",
}


def read_network(nodes: str | Path, springs: str | Path) -> SpringNetwork:
    """Read a network from two CSV files with a line of column names each.

    Args:
        nodes: columns x, y and in space z; `node`, where there is one, names each.
        springs: columns a and b, the nodes that a spring joins, by their names or, where they have none, by their
            numbers from 0; stiffness; and rest_length, where springs do not have the distance of their nodes.

    Numbers are SI; a unit may stand behind a column's name: "x [mm]", "stiffness [N/mm]". Raises MeshError, with file
    and line, where a file is damaged or names what is not there.
    """
    data = Columns(Path(nodes), _NODE_COLUMNS, ("x", "y"))
    axes = [axis for axis in "xyz" if axis in data.columns]
    places = np.stack([data.numbers(axis) for axis in axes], axis=1)
    names = data.texts("node") if "node" in data.columns else [str(number) for number in range(len(places))]
    number = {name: place for place, name in enumerate(names)}
    if len(number) < len(names):
        twice = next(name for place, name in enumerate(names) if number[name] != place)
        raise MeshError(f"{nodes}: node {twice} is there twice")
    joined = Columns(Path(springs), _SPRING_COLUMNS, ("a", "b", "stiffness"))
    ends = np.array([[joined.known(column, row, number) for column in "ab"] for row in range(joined.n_rows)])
    rest = joined.numbers("rest_length") if "rest_length" in joined.columns else np.zeros(0)
    try:
        return SpringNetwork(places, ends, joined.numbers("stiffness"), rest)
    except TruespringError as error:
        raise MeshError(f"{springs}: {error}") from None
