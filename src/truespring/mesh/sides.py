"""Facets of elements as columns of nodes: known by their corners, and which of them lie on each other."""

from collections.abc import Iterable

import numpy as np

from truespring.arrays import Bools, Ints
from truespring.mesh.kinds import ELEMENT_KINDS
from truespring.mesh.rows import ascending, distinct_rows


def facet_columns(elements: Iterable[tuple[str, Ints]]) -> Ints:
    """Return the facets of elements of several kinds as columns, those of all elements of a kind by facet; (k, n).

    Elements by kind, shape (n_elements, nodes of the kind). Triangles beside quadrilaterals name their last corner twice.
    """
    tables = []
    for kind, own in elements:
        local = np.array(ELEMENT_KINDS[kind].facets).T
        tables.append(own.T[local].reshape(len(local), -1))
    most = max((len(table) for table in tables), default=0)
    tables = [np.concatenate([table, *[table[-1:]] * (most - len(table))]) for table in tables]
    return tables[0] if len(tables) == 1 else np.concatenate(tables or [np.zeros((0, 0), dtype=np.int64)], axis=1)


def facet_keys(facets: Ints) -> list[Ints]:
    """Return the nodes of facets ascending, from columns to columns; of a corner named twice the largest twice."""
    ordered = ascending(facets)
    if len(ordered) < len("abcc"):
        return ordered
    first, second, third, last = ordered
    early = first == second
    late = early | (second == third)
    return [first, np.where(early, third, second), np.where(late, last, third), last] if late.any() else ordered


def halved(facets: Ints) -> Bools:
    """Tell which facets in space are quadrilaterals on which two triangles of the others lie, or these triangles.

    Facets of shape (n, 3 or 4), the result (n,).
    """
    inside = np.zeros(len(facets), dtype=bool)
    if facets.shape[1] < len("abcc"):
        return inside
    is_triangle = facets[:, 2] == facets[:, 3]
    triangles, whole = np.flatnonzero(is_triangle), np.flatnonzero(~is_triangle)
    for halves in (((0, 1, 2), (0, 2, 3)), ((0, 1, 3), (1, 2, 3))):
        rows = np.concatenate([facets[triangles, :3], *(facets[whole][:, half] for half in halves)])
        found = distinct_rows(ascending(rows.T))
        place = np.full(len(found.starts), -1)
        place[found.of[: len(triangles)]] = triangles
        one, other = place[found.of[len(triangles) :]].reshape(2, -1)
        both = (one >= 0) & (other >= 0)
        for part in (whole, one, other):
            inside[part[both]] = True
    return inside
