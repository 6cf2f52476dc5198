"""Regular meshes on which stiffness rules state their effective moduli."""

from collections.abc import Callable
from types import MappingProxyType

import numpy as np

from truespring.mesh import Mesh, box, rectangle


def _equilateral() -> Mesh:
    """Return a mesh of equilateral triangles."""
    halved = rectangle((4.0, 3.0), (4, 3), "triangle", "left")
    return Mesh(halved.nodes @ np.array([[1.0, 0.0], [0.5, np.sqrt(3) / 2]]), halved.elements, "triangle")


#: Small meshes by the name of their lattice, the values of `LatticeModuli.lattice`.
LATTICES: MappingProxyType[str, Callable[[], Mesh]] = MappingProxyType(
    {
        "squares": lambda: rectangle((4.0, 3.0), (4, 3)),
        "rectangles": lambda: rectangle((5.0, 3.0), (4, 3)),
        "equilateral triangles": _equilateral,
        "halved squares": lambda: rectangle((4.0, 3.0), (4, 3), "triangle"),
        "cubes": lambda: box((3.0, 3.0, 3.0), (3, 3, 3)),
        "bricks": lambda: box((3.3, 3.0, 2.7), (3, 3, 3)),
        "body-centred-cubic tetrahedra": lambda: box((3.0, 3.0, 3.0), (3, 3, 3), "bcc-tetrahedron"),
        "six tetrahedra a cube": lambda: box((3.0, 3.0, 3.0), (3, 3, 3), "tetrahedron"),
        "wedges": lambda: box((3.0, 3.0, 3.0), (3, 3, 3), "wedge"),
        "pyramids": lambda: box((3.0, 3.0, 3.0), (3, 3, 3), "pyramid"),
    }
)
