"""Where the cameras of a map's sessions went: along its rows."""

from __future__ import annotations

import sqlite3
from collections import defaultdict
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.store.rows import columns_of

__all__ = ["camera_ways"]


def camera_ways(connection: sqlite3.Connection, part_of: Mapping[int, int]) -> dict[int, list[NDArray[np.float64]]]:
    """Return the places of the cameras in the map's frame by part, one array (F, 3) a session that knows them.

    `part_of` tells the part of each session, as `part_numbers` does.
    """
    sessions, places = columns_of(connection, "poses", ("session_id", "geom"))
    cameras, of_session = geopackage.points_of(places), np.array(sessions, np.int64)
    ways: dict[int, list[NDArray[np.float64]]] = defaultdict(list)
    for session in np.unique(of_session).tolist():
        ways[part_of.get(session, 0)].append(cameras[of_session == session])
    return dict(ways)
