"""The table of element kinds: local node numbers only, no coordinates."""

from dataclasses import dataclass
from types import MappingProxyType

Links = tuple[tuple[int, int], ...]
Groups = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class ElementKind:
    """The table entry of an element.

    Attributes:
        dim: the dimensions that it fills.
        n_nodes: the number of its nodes.
        edges, diagonals, body_diagonals: the pairs that may carry a spring: edges, diagonals of a
            quadrilateral or of a face, diagonals through the body.
        facets: what bounds the element, seen from outside anticlockwise; beside quadrilaterals a triangle names its
            last corner twice: a quadrilateral whose last two corners are one is the same, area and shape functions.
        corners: neighbours that span a Jacobian at a node, the node first, in right-handed order; the
            element is inverted where one is not positive. Simplices have the same one at every node. A pyramid has
            none at its tip, where it vanishes by nature: along a line to there it is that at the base, shrinking.
        simplices: triangles or tetrahedra, each counted by `simplex_weight`, whose measures add up to
            the element's own: of a hexahedron both divisions into five, of a wedge or a pyramid two that divide each
            face of four corners both ways, whose mean is exact.
        vtk: the name of the cell in CELL_SHAPES.
        sharing: for each pair (edges first) how many elements of an unbounded regular mesh share it;
            empty where that depends on the mesh.
        merged: its nodes as the corners of a quadrilateral or hexahedron, of which some are one; so a mesh of several
            kinds holds it.
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
        """All pairs that may carry a spring: edges, then diagonals, then body diagonals."""
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

#: What `Mesh.element` says of a mesh of several kinds.
MIXED = "mixed"

_PLURALS = {"vertex": "vertices", "tetrahedron": "tetrahedra", "hexahedron": "hexahedra", "polyhedron": "polyhedra"}


def plural(kind: str) -> str:
    """Return the plural of a kind of cell: "wedges", "hexahedra"."""
    return _PLURALS.get(kind, f"{kind}s")


def counted(count: int, kind: str) -> str:
    """Say how many cells of a kind there are: "1 wedge", "8 hexahedra"."""
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
