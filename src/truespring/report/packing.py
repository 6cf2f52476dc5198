"""Arrays as base64, for a page."""

import base64

import numpy as np

from truespring.arrays import Floats, Ints


class Packing:
    """Pack positions in 65536 steps of a box, far below a pixel, and node numbers of the nodes that are kept.

    Positions beyond the box are packed as single precision numbers of the same steps.
    """

    def __init__(self, lower: Floats, extent: float, nodes: Ints, n_nodes: int) -> None:
        """Take the box's lower corner [m], its longest edge [m], and which of `n_nodes` nodes are kept."""
        self.lower, self.extent, self.nodes = lower, extent or 1.0, nodes
        self._number = np.full(n_nodes, -1)
        self._number[nodes] = np.arange(len(nodes))

    def steps(self, length: float) -> float:
        """Return a length [m] in steps."""
        return 65535 * length / self.extent

    def number(self, node: int) -> int:
        """Return the index of a node among those that are kept."""
        return int(self._number[node])

    def places(self, positions: Floats, beyond: bool = False) -> str:
        """Pack the positions of the nodes that are kept, from those of all nodes [m], shape (n_nodes, dim)."""
        return self.points(positions[self.nodes], beyond)

    def points(self, points: Floats, beyond: bool = False) -> str:
        """Pack any points [m], shape (n, dim)."""
        steps = 65535 * (points - self.lower) / self.extent
        return _base64(steps.astype("<f4") if beyond else np.rint(steps).astype("<u2"))

    def pairs(self, lines: Ints) -> str:
        """Pack node numbers, shape (n, k), as indices among the nodes that are kept."""
        return self.numbers(self._number[lines])

    def cells(self, cells: Ints) -> str:
        """Pack node numbers as `pairs` does, in two bytes each if there are few nodes."""
        return _base64(self._number[cells].astype("<u2" if len(self.nodes) < 65536 else "<u4"))

    def shares(self, values: Floats, low: float, high: float, steps: int) -> str:
        """Pack values of all nodes, shape (n_nodes,), those of the nodes that are kept, in `steps` of a range.

        They take one byte each with up to 255 steps, else two.
        """
        found = np.rint(np.nan_to_num(steps * (values[self.nodes] - low) / (high - low)))
        return _base64(found.astype("u1" if steps < 256 else "<u2"))

    def numbers(self, values: Ints) -> str:
        """Pack integers unchanged."""
        return _base64(values.astype("<u4"))


def _base64(array: np.ndarray) -> str:
    return base64.b64encode(array.tobytes()).decode()
