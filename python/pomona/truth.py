"""Which true fruit each fruit is, by its place."""

from __future__ import annotations

import numpy as np

from pomona.cloud import FruitCloud
from pomona.errors import PomonaError

__all__ = ["WITHIN_M", "aligned", "true_fruits"]

WITHIN_M = 0.03
"""Half the diameter of a small apple: nearer to its middle is nothing but the fruit itself."""

LEAST_SHARE = 0.5
"""Of the fruits that must lie near a true one: in another frame hardly any does, of a fair scan most do."""


def true_fruits(cloud: FruitCloud, truth: FruitCloud, *, within_m: float = WITHIN_M) -> tuple[str, ...]:
    """Give the id of the true fruit nearest to each fruit, empty where none is within a radius.

    Parameters
    ----------
    cloud
        What was found, in the frame of the truth.
    truth
        True fruits; without ids they go by their row numbers.
    within_m
        The radius, metres.

    Raises
    ------
    PomonaError
        Most fruits lie near no true one: the frames differ.
    """
    from scipy.spatial import cKDTree

    if not (len(cloud) and len(truth)):
        return ("",) * len(cloud)
    distances_m, nearest = cKDTree(truth.positions).query(cloud.positions)
    near = np.asarray(distances_m) <= within_m
    if near.sum() < LEAST_SHARE * len(cloud):
        found = f"found {near.sum()} of {len(cloud)} fruits within {100 * within_m:g} cm of a true one"
        raise PomonaError(f"{found}, expected most: is the truth in another frame? --align finds it")
    return tuple(
        truth.label(row) if is_near else ""
        for row, is_near in zip(np.asarray(nearest).tolist(), near.tolist(), strict=True)
    )


def aligned(cloud: FruitCloud, truth: FruitCloud) -> FruitCloud:
    """Bring a cloud into the frame of its truth, by matching the two.

    Raises
    ------
    PomonaError
        When it is not found there.
    """
    from pomona.matching import match

    found = match(cloud, truth)
    if found.map_from_query is None:
        raise PomonaError(f"{found.status.value} of {len(cloud)} fruits among {len(truth)} true ones, expected Found")
    return cloud.transformed(found.map_from_query)
