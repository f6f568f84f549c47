"""The ceiling: what geometry allows when the pose is known.

Fruits of a cluster hang 7-10 cm apart, so that even the true pose leaves doubt about who is who. The oracle takes the
true pose and the true noise and lets the last stage of the verified method pair the fruits.

The gated assignment is a second oracle that shares no code with it: maximum likelihood. A pair at distance r costs
r^2 / (2 sigma^2); leaving a fruit of each side alone costs as much as a pair at the gate, which 99 % of the true pairs
pass: r_gate^2 = sigma^2 chi2_3(0.99), 3.37 sigma. A size is one more number, and the gate that of four.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.stats import chi2

import pomona
from pomona.synth.clouds import ScenePair

PASSED = 0.99
"""Share of the true pairs that pass the gate."""


def oracle_pairs(pair: ScenePair) -> NDArray[np.int64]:
    """Return the oracle's pairs of rows, (M, 2) query, map; the cell must have a pose without a mirror."""
    index = pomona.Index(pair.map, scale=pair.cell.scale, threads=1)
    return index.pairs_under(pair.query, pair.map_from_query, noise_m=pair.noise_m).pairs


def gated_pairs(
    pair: ScenePair, sizes: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
) -> NDArray[np.int64]:
    """Return the pairs of rows of the gated assignment, (M, 2) query, map.

    `sizes` are a number of each fruit of the query and of the map; where they are of one fruit they differ by 1 in the
    root mean square. They are a fourth coordinate, in units of the noise.
    """
    in_map = pair.query.positions @ pair.map_from_query[:3, :3].T + pair.map_from_query[:3, 3]
    sigma_m = _true_sigma_m(pair, in_map)
    clouds = [in_map, pair.map.positions]
    if sizes is not None:
        clouds = [np.column_stack([xyz, sigma_m * size]) for xyz, size in zip(clouds, sizes, strict=True)]
    return assign_in_gate(clouds[0], clouds[1], sigma_m)


def _true_sigma_m(pair: ScenePair, in_map: NDArray[np.float64]) -> float:
    """Root mean square residual per axis of the true pairs; with sag it exceeds the noise."""
    rows = {name: row for row, name in enumerate(pair.map.ids or ())}
    common = [(row, rows[name]) for row, name in enumerate(pair.query.ids or ()) if name in rows]
    if not common:
        return pair.noise_m
    query, map_ = np.array(common).T
    return float(np.sqrt(np.mean((in_map[query] - pair.map.positions[map_]) ** 2)))


def assign_in_gate(query: NDArray[np.float64], map_: NDArray[np.float64], sigma_m: float) -> NDArray[np.int64]:
    """Assign (N, D) to (M, D) positions of one frame by maximum likelihood; (K, 2) rows, sorted."""
    gate_chi2 = float(chi2.ppf(PASSED, df=query.shape[1]))
    near = cKDTree(query).sparse_distance_matrix(cKDTree(map_), sigma_m * np.sqrt(gate_chi2), output_type="coo_matrix")
    n = len(query)
    graph = coo_array((np.ones(near.nnz), (near.row, near.col + n)), shape=(n + len(map_),) * 2)
    group = connected_components(graph, directed=False)[1]
    gain = (gate_chi2 - (near.data / sigma_m) ** 2) / 2.0
    order = np.argsort(group[near.row], kind="stable")
    edges = np.split(order, np.flatnonzero(np.diff(group[near.row][order])) + 1) if len(order) else []
    chosen: list[tuple[int, int]] = []
    for block in edges:
        rows, at_row = np.unique(near.row[block], return_inverse=True)
        columns, at_column = np.unique(near.col[block], return_inverse=True)
        gains = np.zeros((len(rows), len(columns)))
        gains[at_row, at_column] = gain[block]
        for row, column in zip(*linear_sum_assignment(gains, maximize=True), strict=True):
            if gains[row, column] > 0.0:
                chosen.append((int(rows[row]), int(columns[column])))
    return np.array(sorted(chosen), np.int64).reshape(-1, 2)
