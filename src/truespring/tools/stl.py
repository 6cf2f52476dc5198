"""A tool whose surface is an STL file."""

from dataclasses import dataclass, field
from pathlib import Path as File

from truespring.arrays import Floats
from truespring.errors import MeshError, ToolError
from truespring.mesh.files.stl import parse_stl
from truespring.opening import read_file
from truespring.tools.path import Path
from truespring.tools.skins import Skin, triangulated
from truespring.tools.solid import Solid
from truespring.tools.tool import Tool
from truespring.units import unit_of

# Number of vertices that are checked at the start.
_POINTS = 100


@dataclass(frozen=True)
class StlTool(Tool):
    """A solid bounded by the triangles of an STL file; its path is that of the origin of the file.

    Attributes:
        name, path: as those of Tool; further ones as those of Touching.
        file: path of the file, ASCII or binary.
        unit: length unit of the file, such as "mm", which STL files do not state.
        solid: the solid, read from the file. A file that cannot be read, or whose surface is not closed, raises
            MeshError.

    Example:
        >>> import truespring as ts
        >>> import numpy as np
        >>> corners = 0.01 * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
        >>> lines = []
        >>> for face in ([0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]):
        ...     vertices = [f"vertex {x} {y} {z}" for x, y, z in corners[face]]
        ...     lines += ["facet normal 0 0 0", "outer loop", *vertices, "endloop", "endfacet"]
        >>> with open("tip.stl", "w") as file:
        ...     for line in ["solid tip", *lines, "endsolid"]:
        ...         print(line, file=file)
        >>> ts.StlTool("tip", "tip.stl", path=[(0, 0.0, 0.02, 0.0), (1, 0.0, 0.01, 0.0)]).words()
        "'tip': solid of 4 triangles from tip.stl, from (0, 0.02, 0) m to (0, 0.01, 0) m"
    """

    name: str
    file: str | File
    path: Path
    unit: str = "m"
    solid: Solid = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        size = unit_of(self.unit, "length", "unit", MeshError)
        try:
            solid = Solid.of(size * parse_stl(read_file(File(self.file), MeshError)))
        except MeshError as error:
            raise MeshError(f"{self.file}: {str(error).removeprefix(f'{self.file}: ')}") from None
        object.__setattr__(self, "solid", solid)

    def form(self) -> str:
        """Return shape and dimensions."""
        return f"solid of {len(self.solid.triangles)} triangles from {self.file}"

    def skin(self, centre: Floats, size: float) -> Skin:
        """Return the triangles."""
        return triangulated(self.solid.corners, self.solid.triangles)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Smallest and largest coordinates relative to the place [m]."""
        return self.solid.bounds

    def points(self, dim: int) -> Floats:
        """Return some of the vertices."""
        corners = self.solid.corners
        return corners[:: 1 + len(corners) // _POINTS]

    def check(self, dim: int) -> None:
        """Raise ToolError in the plane."""
        if dim != len("xyz"):
            raise ToolError(self.name, "a solid needs a body in 3D: in the plane use another shape")

    def gaps(self, places: Floats) -> tuple[Floats, Floats]:
        """Return the signed distance from the surface [m], and the normals."""
        return self.solid.gaps(places)

    def bends(self, places: Floats) -> Floats:
        """Return the second derivatives of the distance [1/m]."""
        return self.solid.bends(places)
