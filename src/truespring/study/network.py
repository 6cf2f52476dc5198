"""Read a spring network from two CSV files, one of nodes and one of springs."""

from pathlib import Path

import numpy as np

from truespring.columns import Columns
from truespring.errors import MeshError, TruespringError
from truespring.models import SpringNetwork
from truespring.units import Dimension

# Dimension of each allowed column; None for texts and numbers without a unit.
_NODE_COLUMNS: dict[str, Dimension | None] = {
    "node": None,
    "x": "length",
    "y": "length",
    "z": "length",
    "mass": "mass",
}
_SPRING_COLUMNS: dict[str, Dimension | None] = {
    "a": None,
    "b": None,
    "stiffness": "stiffness",
    "rest_length": "length",
}


def read_network(nodes: str | Path, springs: str | Path) -> SpringNetwork:
    """Read a network from two CSV files, each with a header line.

    Args:
        nodes: columns x, y and, in 3D, z; optionally `node`, the name of each node, and `mass`, which a motion needs.
        springs: columns a and b, the two nodes of each spring, by name or, without names, by number from 0; stiffness;
            and optionally rest_length, by default the distance of the nodes.

    Numbers are in SI units unless the header has a unit: "x [mm]", "stiffness [N/mm]". Raises MeshError with file and
    line if a file is damaged or a spring refers to an unknown node.

    Example:
        >>> import truespring as ts
        >>> files = {
        ...     "nodes.csv": ["x [m],y [m]", "0,0", "1,0.25", "2,0"],
        ...     "springs.csv": ["a,b,stiffness [N/m]", "0,1,1", "1,2,1"],
        ... }
        >>> for name, lines in files.items():
        ...     with open(name, "w") as file:
        ...         for line in lines:
        ...             print(line, file=file)
        >>> ts.read_network("nodes.csv", "springs.csv").springs.tolist()
        [[0, 1], [1, 2]]
    """
    data = Columns(Path(nodes), _NODE_COLUMNS, ("x", "y"))
    axes = [axis for axis in "xyz" if axis in data.columns]
    places = np.stack([data.numbers(axis) for axis in axes], axis=1)
    names = data.texts("node") if "node" in data.columns else [str(number) for number in range(len(places))]
    number = {name: place for place, name in enumerate(names)}
    if len(number) < len(names):
        twice = next(name for place, name in enumerate(names) if number[name] != place)
        raise MeshError(f"{nodes}: node {twice} is listed twice")
    joined = Columns(Path(springs), _SPRING_COLUMNS, ("a", "b", "stiffness"))
    ends = np.array([[joined.known(column, row, number) for column in "ab"] for row in range(joined.n_rows)])
    rest = joined.numbers("rest_length") if "rest_length" in joined.columns else np.zeros(0)
    mass = data.numbers("mass") if "mass" in data.columns else np.zeros(0)
    light = np.flatnonzero(mass <= 0)
    if light.size:
        raise MeshError(f"{nodes}:{data.line(int(light[0]))}: mass = {mass[light[0]]:g} kg: must be positive")
    try:
        return SpringNetwork(places, ends, joined.numbers("stiffness"), rest, mass=mass)
    except TruespringError as error:
        raise MeshError(f"{springs}: {error}") from None
