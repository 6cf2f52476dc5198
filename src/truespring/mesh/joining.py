"""Merge points with equal coordinates, as in files that store the nodes of each cell separately."""

import numpy as np

from truespring.arrays import Floats, Ints


def distinct_points(places: Floats, near: float) -> tuple[Ints, Ints]:
    """Number the distinct places; places within a distance of `near`, and chains of such places, count as one.

    Args:
        places: coordinates, shape (n, dim).
        near: distance, in the unit of `places`.

    Returns the first row of each distinct place, shape (n_distinct,), and the number of each row's place, shape (n,).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    distinct, row, inverse = np.unique(places, axis=0, return_index=True, return_inverse=True)
    pairs = KDTree(distinct).query_pairs(near, output_type="ndarray")
    joined = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(distinct), len(distinct)))
    number = connected_components(joined, directed=False)[1]
    _, first = np.unique(number, return_index=True)
    return np.asarray(row[first]), np.asarray(number[inverse.ravel()], dtype=np.int64)
