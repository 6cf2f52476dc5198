"""Elements of several kinds in one table: each as a quadrilateral or hexahedron, some of whose corners are one."""

import itertools
from collections.abc import Mapping

import numpy as np

from truespring.arrays import Bools, Ints
from truespring.errors import MeshError
from truespring.mesh.kinds import ELEMENT_KINDS, MIRRORED, MIXED, ElementKind

#: The kind whose corners each element has, by the dimensions that it fills.
_WHOLE = {2: "quadrilateral", 3: "hexahedron"}


def width(dim: int) -> int:
    """Return the number of corners that the table has for each element; raise MeshError where there is no such."""
    if dim not in _WHOLE:
        raise MeshError(f"elements of several kinds fill 2 or 3 dimensions, the nodes have {dim}")
    return ELEMENT_KINDS[_WHOLE[dim]].n_nodes


def mixed_table(cells: Mapping[str, Ints]) -> Ints:
    """Return elements of several kinds in one table, shape (n_elements, 4 or 8), kind after kind."""
    tables = []
    for kind, elements in cells.items():
        own = ELEMENT_KINDS.get(kind)
        if own is None or not own.merged:
            allowed = ", ".join(name for name, other in ELEMENT_KINDS.items() if other.merged)
            raise MeshError(f"'{kind}' elements cannot be mixed with others; allowed: {allowed}")
        given = np.asarray(elements)
        if given.ndim != 2 or given.shape[1] != own.n_nodes:
            raise MeshError(f"elements of kind {kind} have {own.n_nodes} nodes each, not shape {given.shape}")
        tables.append(given[:, own.merged])
    if len({table.shape[1] for table in tables}) != 1:
        raise MeshError(f"{', '.join(cells)}: the elements of a mesh are all plane or all solid")
    return np.concatenate(tables)


def unmerged(elements: Ints) -> dict[str, tuple[Ints, Ints]]:
    """Find the kinds in a table: of each the numbers of its elements, ascending, and their own nodes.

    Raises MeshError where corners are one that are not in any kind.
    """
    found, known = {}, np.zeros(len(elements), dtype=bool)
    for name, kind in ELEMENT_KINDS.items():
        if len(kind.merged) == elements.shape[1]:
            is_own = _are(elements, kind) & ~known
            known |= is_own
            numbers = np.flatnonzero(is_own)
            if numbers.size:
                found[name] = (numbers, elements[numbers][:, [kind.merged.index(node) for node in range(kind.n_nodes)]])
    if not known.all():
        first = int(known.argmin())
        raise MeshError(
            f"{int((~known).sum())} of {len(known)} elements are degenerate: their coinciding corners match no kind of "
            f"element; the first is element {first}, of nodes {', '.join(map(str, elements[first].tolist()))}"
        )
    return found


def kinds_in(elements: Ints, kind: str) -> list[tuple[str, Ints, Ints]]:
    """Return the kinds in a table of elements of a kind or "mixed": of each its name, numbers and nodes of elements."""
    if kind != MIXED:
        return [(kind, np.arange(len(elements)), elements)]
    return [(name, numbers, own) for name, (numbers, own) in unmerged(elements).items()]


def mirrored(elements: Ints, kind: str, which: Bools) -> Ints:
    """Return a table of elements of a kind or "mixed", some of them in the order of their mirror images."""
    found = elements.copy()
    for name, numbers, own in kinds_in(elements, kind):
        here = which[numbers]
        turned = own[here][:, MIRRORED[name]]
        found[numbers[here]] = turned if kind != MIXED else turned[:, ELEMENT_KINDS[name].merged]
    return found


def repeats(elements: Ints) -> Bools:
    """Tell which elements name a node twice, shape (n_elements,)."""
    ordered = np.sort(elements, axis=1)
    return np.asarray((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))


def turned(elements: Ints) -> Ints:
    """Return a table whose elements are turned so that corners that are one stand as `ElementKind.merged` has them.

    Programs write wedges and pyramids as bricks with corners that are one, whichever these are. What is of no kind
    stays as it is.
    """
    found = elements.copy()
    left = np.flatnonzero(repeats(elements))
    kinds = [kind for kind in ELEMENT_KINDS.values() if len(kind.merged) == elements.shape[1]]
    for turn in _turns(elements.shape[1]):
        rows = elements[left][:, turn]
        fits = np.any([_are(rows, kind) for kind in kinds], axis=0)
        found[left[fits]] = rows[fits]
        left = left[~fits]
    return found


def _turns(corners: int) -> list[list[int]]:
    """The rotations of a square or a cube, each as the order that it brings their corners into."""
    dim = int(corners).bit_length() - 1
    places = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    places = 2 * places[:corners, :dim] - 1
    found = []
    for axes in itertools.permutations(range(dim)):
        for signs in itertools.product((1, -1), repeat=dim):
            matrix = np.eye(dim, dtype=np.int64)[list(axes)] * signs
            if round(float(np.linalg.det(matrix))) == 1:
                after = (places @ matrix.T).tolist()
                found.append([places.tolist().index(place) for place in after])
    return found


def _are(elements: Ints, kind: ElementKind) -> Bools:
    """Tell which elements have just those corners as one that the kind has."""
    own = np.ones(len(elements), dtype=bool)
    for one in range(elements.shape[1]):
        for other in range(one):
            same = elements[:, one] == elements[:, other]
            own &= same == (kind.merged[one] == kind.merged[other])
    return own
