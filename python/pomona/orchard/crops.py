"""Small pictures of fruits out of a session or a map, for whoever shows them."""

from __future__ import annotations

import sqlite3

from pomona.fruit_crop import FruitCrop
from pomona.store.rows import columns_of

__all__ = ["best_crops", "crops_of", "crops_of_session"]

OF_BEST_DATE = """
WHERE crops.id IN (
    SELECT id FROM (
        SELECT crops.id AS id, row_number() OVER (
            PARTITION BY observations.fruit_id
            ORDER BY coalesce(observations.n_views, 0) DESC, sessions.date DESC, crops.id
        ) AS place
        FROM crops JOIN observations ON observations.id = crops.observation_id
        JOIN sessions ON sessions.id = observations.session_id
    ) WHERE place = 1
) ORDER BY crops.id
"""
"""The date that saw the fruit in most frames shows it best; the later of two."""

OF_FRUIT = """
WHERE crops.observation_id IN (SELECT id FROM observations WHERE fruit_id = {:d}) ORDER BY crops.session_id
"""

OF_SESSION = "WHERE crops.session_id = {:d} ORDER BY crops.observation_id"


def best_crops(connection: sqlite3.Connection) -> dict[int, FruitCrop]:
    """Give one crop a fruit, of its best date, by the fruit's id; fruits without a crop are left out.

    Raises
    ------
    WrongContentError
        With the first cell that is none of ours.
    """
    observation_ids, crops = _crops(connection, OF_BEST_DATE)
    which = "WHERE observations.id IN (SELECT observation_id FROM crops)"
    fruit_of = dict(zip(*columns_of(connection, "observations", ("id", "fruit_id"), which), strict=True))
    return dict(sorted((fruit_of[seen], crop) for seen, crop in zip(observation_ids, crops, strict=True)))


def crops_of(connection: sqlite3.Connection, fruit_id: int) -> dict[int, FruitCrop]:
    """Give the crops of one fruit, by the number of the session."""
    session_ids, crops = _crops(connection, OF_FRUIT.format(fruit_id), "session_id")
    return dict(zip(session_ids, crops, strict=True))


def crops_of_session(connection: sqlite3.Connection, session_id: int) -> dict[int, FruitCrop]:
    """Give the crops of one session, by the id of the observation."""
    observation_ids, crops = _crops(connection, OF_SESSION.format(session_id))
    return dict(zip(observation_ids, crops, strict=True))


def _crops(connection: sqlite3.Connection, which: str, of: str = "observation_id") -> tuple[list[int], list[FruitCrop]]:
    owners, frames, pictures = columns_of(connection, "crops", (of, "frame", "picture"), which)
    return owners, [FruitCrop(frame, picture) for frame, picture in zip(frames, pictures, strict=True)]
