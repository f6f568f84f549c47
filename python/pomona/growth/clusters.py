"""Clusters: fruits that hang so close that they share a spur."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["clusters_of"]

APART_M = 0.10
"""Centres of neighbours in a cluster: fruits of 7 cm that touch are 7 apart, with their stalks up to 10."""


def clusters_of(positions_m: NDArray[np.float64]) -> NDArray[np.int64]:
    """Give each fruit, (N, 3), the number of its cluster, (N,), in the order of first fruits; one alone is one too."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    n = len(positions_m)
    pairs = KDTree(positions_m).query_pairs(APART_M, output_type="ndarray") if n else np.empty((0, 2), np.int64)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    found = connected_components(graph, directed=False)[1]
    first = np.unique(found, return_index=True)[1]
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.asarray(rank[found])
