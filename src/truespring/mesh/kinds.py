"""The table of element kinds, by local node numbers."""

from dataclasses import dataclass
from types import MappingProxyType

Links = tuple[tuple[int, int], ...]
Groups = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class ElementKind:
    """An element kind: its connectivity, in local node numbers.

    Attributes:
        dim: dimension of the element.
        n_nodes: number of nodes.
        edges, diagonals, body_diagonals: the pairs that may carry a spring: edges, diagonals of a
            quadrilateral or of a face, diagonals through the body.
        facets: faces of a solid, edges of a plane element, anticlockwise seen from outside. If the element also has
            quadrilateral faces, a triangle repeats its last corner: a quadrilateral with two equal corners has the
            same area and shape functions.
        corners: a node and the neighbours that span the Jacobian there, in right-handed order; the element is
            inverted if one Jacobian is not positive. Simplices have one for all nodes. A pyramid has none at its apex,
            where the Jacobian is 0: along a line to the apex it is that at the base, scaled.
        simplices: triangles or tetrahedra whose measures, times `simplex_weight`, sum to the measure of the element:
            both divisions of a hexahedron into five, two divisions of a wedge or pyramid that split each quadrilateral
            face along both diagonals. Their mean is exact.
        vtk: the name of the cell in CELL_SHAPES.
        sharing: for each pair (edges first), the number of elements of an unbounded regular mesh that share it;
            empty if that depends on the mesh.
        merged: its nodes as the corners of a quadrilateral or hexahedron with repeated corners, as a mesh of several
            kinds stores it.
    """

    dim: int
    n_nodes: int
    vtk: str
    edges: Links
    diagonals: Links = ()
    body_diagonals: Links = ()
    facets: Groups = ()
    corners: Groups = ()
    simplices: Groups = ()
    simplex_weight: float = 1.0
    sharing: tuple[int, ...] = ()
    merged: tuple[int, ...] = ()

    @property
    def links(self) -> Links:
        """Pairs that may carry a spring: edges, then diagonals, then body diagonals."""
        return self.edges + self.diagonals + self.body_diagonals


ELEMENT_KINDS: MappingProxyType[str, ElementKind] = MappingProxyType(
    {
        "line": ElementKind(dim=1, n_nodes=2, vtk="line", edges=((0, 1),), facets=((0,), (1,)), sharing=(1,)),
        "triangle": ElementKind(
            dim=2,
            n_nodes=3,
            vtk="triangle",
            edges=((0, 1), (1, 2), (2, 0)),
            facets=((0, 1), (1, 2), (2, 0)),
            corners=((0, 1, 2),),
            simplices=((0, 1, 2),),
            sharing=(2, 2, 2),
            merged=(0, 1, 2, 2),
        ),
        "quadrilateral": ElementKind(
            dim=2,
            n_nodes=4,
            vtk="quad",
            edges=((0, 1), (1, 2), (2, 3), (3, 0)),
            diagonals=((0, 2), (1, 3)),
            facets=((0, 1), (1, 2), (2, 3), (3, 0)),
            corners=((0, 1, 3), (1, 2, 0), (2, 3, 1), (3, 0, 2)),
            simplices=((0, 1, 2), (0, 2, 3)),
            sharing=(2, 2, 2, 2, 1, 1),
            merged=(0, 1, 2, 3),
        ),
        "tetrahedron": ElementKind(
            dim=3,
            n_nodes=4,
            vtk="tetra",
            edges=((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
            facets=((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
            corners=((0, 1, 2, 3),),
            simplices=((0, 1, 2, 3),),
            merged=(0, 1, 2, 2, 3, 3, 3, 3),
        ),
        "pyramid": ElementKind(
            dim=3,
            n_nodes=5,
            vtk="pyramid",
            edges=((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
            diagonals=((0, 2), (1, 3)),
            facets=((0, 3, 2, 1), (0, 1, 4, 4), (1, 2, 4, 4), (2, 3, 4, 4), (3, 0, 4, 4)),
            corners=((0, 1, 3, 4), (1, 2, 0, 4), (2, 3, 1, 4), (3, 0, 2, 4)),
            simplices=((0, 1, 2, 4), (0, 2, 3, 4), (0, 1, 3, 4), (1, 2, 3, 4)),
            simplex_weight=0.5,
            merged=(0, 1, 2, 3, 4, 4, 4, 4),
        ),
        "wedge": ElementKind(
            dim=3,
            n_nodes=6,
            vtk="wedge",
            edges=((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
            diagonals=((0, 4), (1, 3), (1, 5), (2, 4), (2, 3), (0, 5)),
            facets=((0, 2, 1, 1), (3, 4, 5, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
            corners=((0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (3, 5, 4, 0), (4, 3, 5, 1), (5, 4, 3, 2)),
            simplices=(
                *((0, 1, 2, 3), (1, 2, 3, 5), (1, 5, 3, 4)),
                *((3, 5, 4, 0), (4, 2, 1, 0), (4, 5, 2, 0)),
            ),
            simplex_weight=0.5,
            merged=(0, 1, 2, 2, 3, 4, 5, 5),
        ),
        "hexahedron": ElementKind(
            dim=3,
            n_nodes=8,
            vtk="hexahedron",
            edges=(
                *((0, 1), (1, 2), (2, 3), (3, 0)),
                *((4, 5), (5, 6), (6, 7), (7, 4)),
                *((0, 4), (1, 5), (2, 6), (3, 7)),
            ),
            diagonals=(
                *((0, 2), (1, 3), (4, 6), (5, 7)),
                *((0, 5), (1, 4), (3, 6), (2, 7)),
                *((0, 7), (3, 4), (1, 6), (2, 5)),
            ),
            body_diagonals=((0, 6), (1, 7), (2, 4), (3, 5)),
            facets=((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
            corners=(
                *((0, 1, 3, 4), (1, 2, 0, 5), (2, 3, 1, 6), (3, 0, 2, 7)),
                *((4, 7, 5, 0), (5, 4, 6, 1), (6, 5, 7, 2), (7, 6, 4, 3)),
            ),
            simplices=(
                *((0, 1, 3, 4), (1, 2, 3, 6), (1, 4, 5, 6), (3, 4, 6, 7), (1, 3, 4, 6)),
                *((0, 1, 2, 5), (0, 2, 3, 7), (0, 4, 5, 7), (2, 5, 6, 7), (0, 2, 7, 5)),
            ),
            simplex_weight=0.5,
            sharing=(4,) * 12 + (2,) * 12 + (1,) * 4,
            merged=(0, 1, 2, 3, 4, 5, 6, 7),
        ),
    }
)

#: `Mesh.element` of a mesh of several kinds.
MIXED = "mixed"

_PLURALS = {"vertex": "vertices", "tetrahedron": "tetrahedra", "hexahedron": "hexahedra", "polyhedron": "polyhedra"}


def plural(kind: str) -> str:
    """Return the plural of a kind of cell: "wedges", "hexahedra"."""
    return _PLURALS.get(kind, f"{kind}s")


def counted(count: int, kind: str) -> str:
    """Return a count with the name of a kind of cell: "1 wedge", "8 hexahedra"."""
    return f"{count} {kind if count == 1 else plural(kind)}"


#: The nodes of an element in the order of its mirror image.
MIRRORED: MappingProxyType[str, tuple[int, ...]] = MappingProxyType(
    {
        "triangle": (0, 2, 1),
        "quadrilateral": (0, 3, 2, 1),
        "tetrahedron": (0, 2, 1, 3),
        "pyramid": (0, 3, 2, 1, 4),
        "wedge": (0, 2, 1, 3, 5, 4),
        "hexahedron": (0, 3, 2, 1, 4, 7, 6, 5),
    }
)
