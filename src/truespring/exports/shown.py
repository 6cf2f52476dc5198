"""What is shown of an exported body: its surface at each load level, coloured by the displacement at full load."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from truespring.arrays import Floats, Ints, in_space
from truespring.exports.exported import Exported
from truespring.exports.surfaces import Cells, is_surface, surface_of
from truespring.exports.whole import nodes_of_the_mesh

#: Duration of an animation up to the last load level [s].
SECONDS = 2.0

# Colours from no displacement to the largest, in sRGB (the map viridis of matplotlib).
_COLOURS = np.array(
    [[0.267, 0.005, 0.329], [0.230, 0.322, 0.546], [0.128, 0.567, 0.551], [0.369, 0.789, 0.383], [0.993, 0.906, 0.144]]
)


@dataclass(frozen=True, eq=False)
class Shown:
    """A surface of n nodes at the load levels of a solution, in float32; of bodies without elements, lines."""

    exported: Exported

    @cached_property
    def cells(self) -> Cells:
        """The triangles or lines."""
        return surface_of(nodes_of_the_mesh(self.exported))

    @property
    def is_lines(self) -> bool:
        """Whether the cells are lines."""
        return not is_surface(self.cells)

    @property
    def rows(self) -> Ints:
        """The nodes of each cell among those of the surface, shape (n_cells, 2 or 3)."""
        return self.cells.cells

    @cached_property
    def levels(self) -> list[tuple[float, Floats]]:
        """Load factor and positions [m], shape (n, 3), of each load level, at rest first."""
        rest = (0.0, self._of(self.exported.problem.mesh.nodes))
        found = [(state.load_factor, self._of(state.positions)) for state in self.exported.path.states]
        return [rest, *[(factor, places) for factor, places in found if factor > 0]]

    def _of(self, positions: Floats) -> Floats:
        return in_space(positions)[self.cells.nodes].astype(np.float32)

    @cached_property
    def colours(self) -> Floats:
        """Colour of each node in sRGB by the displacement at the last level, shape (n, 3)."""
        moved = np.linalg.norm(self.levels[-1][1] - self.levels[0][1], axis=1)
        share = moved / (moved.max(initial=0.0) or 1.0) * (len(_COLOURS) - 1)
        return np.stack([np.interp(share, np.arange(len(_COLOURS)), column) for column in _COLOURS.T], axis=1)

    @property
    def linear_colours(self) -> Floats:
        """The same in linear RGB, by the transfer function of sRGB (IEC 61966-2-1)."""
        c = self.colours
        return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
