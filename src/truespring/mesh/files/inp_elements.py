"""Element types of Abaqus and CalculiX: cell kinds, node counts and face numbering."""

import re
from types import MappingProxyType
from typing import NamedTuple

from truespring.mesh.files.contents import CELL_KINDS
from truespring.mesh.kinds import ELEMENT_KINDS, Groups

# By family and number of nodes. Trailing letters (reduced integration, hybrid, ...) do not change the geometry.
_PLANE = {3: "triangle", 6: "triangle", 4: "quadrilateral", 8: "quadrilateral", 9: "quadrilateral"}
_SOLID = {
    **{4: "tetrahedron", 10: "tetrahedron", 8: "hexahedron", 20: "hexahedron", 27: "hexahedron"},
    **{6: "wedge", 15: "wedge", 5: "pyramid", 13: "pyramid"},
}
_LINE = {2: "line", 3: "line"}
_FAMILIES = {
    **{"C3D": _SOLID, "SC": _SOLID, "CPS": _PLANE, "CPE": _PLANE, "S": _PLANE, "STRI": _PLANE},
    **{"M3D": _PLANE, "SFM3D": _PLANE, "T2D": _LINE, "T3D": _LINE},
}

# Types whose names do not contain the number of nodes.
_NAMED = {
    **{"SPRINGA": 2, "STRI65": 6, "C3D15V": 18},
    **{f"B{dim}{order}": 3 if order == 2 else 2 for dim in (2, 3) for order in (1, 2, 3)},
}
_NAMED_KINDS = {"STRI65": "triangle", "C3D15V": "wedge"}

#: The supported types, for messages.
READ = "C3D4, C3D5, C3D6, C3D8, C3D10, C3D15, C3D20, CPS3, CPS4, CPE3, CPE4, S3, S4 and their variants"

#: Corners of the faces of each kind in the order of both programs, S1 or P1 the first; of plane kinds the edges.
#: Source: the element library of Abaqus, "Node ordering and face numbering".
FACES: MappingProxyType[str, Groups] = MappingProxyType(
    {
        "triangle": ((0, 1), (1, 2), (2, 0)),
        "quadrilateral": ((0, 1), (1, 2), (2, 3), (3, 0)),
        "tetrahedron": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
        "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
        "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
        "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    }
)


class ElementType(NamedTuple):
    """An element type: its kind of cell (a key of CELL_KINDS) and its number of nodes."""

    kind: str
    n_nodes: int


def element_type(name: str) -> ElementType | None:
    """Return the type of a name in upper case; None for types that define neither the body nor its groups.

    These are left out: masses, connectors, gaps, dashpots, rigid, fluid and user elements.
    """
    found = re.fullmatch(rf"({'|'.join(_NAMED)})(?:[A-Z].*)?", name)
    if found:
        return ElementType(_NAMED_KINDS.get(found[1], "line"), _NAMED[found[1]])
    found = re.fullmatch(rf"({'|'.join(_FAMILIES)})(\d+)(?:[A-Z].*)?", name)
    kind = _FAMILIES[found[1]].get(int(found[2])) if found else None
    return ElementType(kind, int(found[2])) if found and kind else None


def is_of_a_body(name: str) -> bool:
    """Return whether a type is a continuum element, with a known number of nodes or not: it cannot be left out."""
    return re.match(r"(C3D|CPS|CPE|CPEG|CAX|CGAX)\d", name) is not None


def local_facet(kind: str, face: int) -> int | None:
    """Return the index in `facets` of ELEMENT_KINDS of a face, which both programs count from 1; None if unknown."""
    if kind not in ELEMENT_KINDS or not 1 <= face <= len(FACES.get(kind, ())):
        return None
    return [set(facet) for facet in ELEMENT_KINDS[kind].facets].index(set(FACES[kind][face - 1]))


def facets_of_kind(kind: str) -> Groups:
    """Return the corners of the facets of a kind, as in ELEMENT_KINDS; empty for kinds that form no body."""
    return ELEMENT_KINDS[kind].facets if kind in ELEMENT_KINDS else ()


def is_shell(name: str) -> bool:
    """Return whether a type is a shell or a membrane, whose first two faces are its sides."""
    return re.match(r"S\d|STRI|M3D|SFM3D", name) is not None


def dimension(kind: str) -> int:
    """Return the topological dimension of a kind of cell."""
    return CELL_KINDS[kind][0]
