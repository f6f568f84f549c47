"""Where the cameras of a map's sessions went: along its rows."""

from __future__ import annotations

import sqlite3

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.store.rows import columns_of

__all__ = ["camera_ways"]


def camera_ways(connection: sqlite3.Connection) -> tuple[NDArray[np.float64], ...]:
    """Return the places of the cameras in the map's frame, one array (F, 3) a session that knows them."""
    sessions, places = columns_of(connection, "poses", ("session_id", "geom"))
    cameras, of_session = geopackage.points_of(places), np.array(sessions, np.int64)
    return tuple(cameras[of_session == session] for session in np.unique(of_session))
