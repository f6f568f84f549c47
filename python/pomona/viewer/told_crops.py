"""Small pictures of fruits for the page: of the best date inside a report, of every date from the server."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pomona.orchard.crops import best_crops, crops_of
from pomona.recording.picture_size import encoded_size
from pomona.store.opening import snapshot
from pomona.store.rows import columns_of
from pomona.viewer.packed_columns import packed
from pomona.viewer.told_fruits import FruitsTold

__all__ = ["CropShelf", "crops_inside"]

MOST_REPORT_BYTES = 2_600_000
"""Of all pictures in a report: with the rest of 5,000 fruits it stays below 5 MB in base64, which mail carries."""

MOST_PIXELS_A_CROP = 1 << 20
SMALLER = ((48, 60), (40, 45), (32, 35), (24, 30))
"""Side in pixels and quality of WebP, tried in turn where a picture has more than its share of the bytes."""


def crops_inside(path: Path, fruits: FruitsTold) -> dict[str, Any] | None:
    """Tell the picture of each fruit's best date itself; None where the map has none."""
    with snapshot(path) as (connection, _):
        best = best_crops(connection)
    share = MOST_REPORT_BYTES // max(1, len(best))
    small = {fruit: small_crop(crop.picture, share) for fruit, crop in best.items()}
    kept = {fruit: picture for fruit, picture in small.items() if picture is not None}
    if not kept:
        return None
    pictures = [base64.b64encode(picture).decode("ascii") for picture in kept.values()]
    return {"best": _rows(kept, fruits), "pictures": pictures, "sights": None}


def small_crop(picture: bytes, most_bytes: int) -> bytes | None:
    """Give a picture that is no larger, made anew where it must be; None where it is none or does not get so small."""
    import cv2

    size = encoded_size(picture)
    if size is None or size[0] * size[1] > MOST_PIXELS_A_CROP:
        return None
    if len(picture) <= most_bytes:
        return picture
    pixels = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    if pixels is None:
        return None
    for side, quality in SMALLER:
        factor = min(1.0, side / max(pixels.shape[:2]))
        smaller = cv2.resize(pixels, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
        made = cv2.imencode(".webp", smaller, [cv2.IMWRITE_WEBP_QUALITY, quality])[1].tobytes()
        if len(made) <= most_bytes:
            return made
    return None


class CropShelf:
    """The pictures of a map, one at a time, for a server.

    Parameters
    ----------
    path : Path
        The map.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with snapshot(path) as (connection, _):
            self._best = best_crops(connection)
            (self._sessions,) = columns_of(connection, "sessions", ("id",), "ORDER BY date, id")
            self._seen = columns_of(connection, "crops", ("session_id", "observation_id"))
            seen, fruits = columns_of(connection, "observations", ("id", "fruit_id"))
        self._fruit_of = dict(zip(seen, fruits, strict=True))

    def told(self, _path: Path, fruits: FruitsTold) -> dict[str, Any] | None:
        """Tell which pictures there are; None where there are none."""
        if not self._best:
            return None
        visit_of = {session: visit for visit, session in enumerate(self._sessions)}
        sessions, observations = self._seen
        rows = fruits.rows_of(np.array([self._fruit_of[one] for one in observations], dtype=np.int64))
        visits = [visit_of[session] for session in sessions]
        sights = {"fruit": packed(rows), "visit": packed(visits)}
        return {"best": _rows(self._best, fruits), "pictures": None, "sights": sights}

    def picture(self, fruit: int, visit: int | None) -> bytes | None:
        """Give the picture of a fruit by a visit, of its best date for None; None where there is none."""
        if visit is None:
            crop = self._best.get(fruit)
        elif 0 <= visit < len(self._sessions) and fruit in self._best:
            with snapshot(self._path) as (connection, _):
                crop = crops_of(connection, fruit).get(self._sessions[visit])
        else:
            crop = None
        return None if crop is None else crop.picture


def _rows(by_fruit: Mapping[int, object], fruits: FruitsTold) -> dict[str, Any]:
    return packed(fruits.rows_of(np.array(list(by_fruit), dtype=np.int64)))
