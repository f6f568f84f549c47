"""What a cell of each column may hold: the border between a file, which anyone may have edited, and the program."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import NoneType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.errors import PomonaError
from pomona.store.values import FARTHEST_M, iso_date

__all__ = ["COLUMNS", "CellKind", "finite_json", "places_of", "similarity"]

RIGID_TOLERANCE = 1e-6
"""How far the axes of a transform may be from right angles and one length; rounding is at 1e-15."""

MOST_PICTURE_BYTES = 1 << 20
"""Of one fruit on one date; those that Pomona keeps have a few thousand bytes."""


@dataclass(frozen=True)
class CellKind:
    """What a column holds.

    Attributes
    ----------
    expected : str
        In words, for people.
    type : type
        As sqlite3 gives it.
    hold : callable
        Whether all of these cells, of that type, are right.
    may_be_null : bool
        Whether nothing is right too.
    parse : callable, optional
        What the text of a cell says, None where it is not right; of columns of JSON.
    """

    expected: str
    type: type
    hold: Callable[[Sequence[Any]], bool]
    may_be_null: bool = False
    parse: Callable[[str], Any] | None = None

    def are_right(self, cells: Sequence[object]) -> bool:
        """Tell whether all cells are of this kind."""
        types = set(map(type, cells))
        if self.may_be_null and NoneType in types:
            types.remove(NoneType)
            cells = [cell for cell in cells if cell is not None]
        return types <= {self.type} and (not cells or self.hold(cells))

    def wrong_rows(self, cells: Sequence[object]) -> list[int]:
        """Return the rows of the cells that are not of this kind."""
        if self.are_right(cells):
            return []
        return [row for row, cell in enumerate(cells) if not self.are_right((cell,))]


def _or_null(kind: CellKind) -> CellKind:
    return CellKind(f"{kind.expected}, or null", kind.type, kind.hold, may_be_null=True)


def _whole(expected: str, least: int) -> CellKind:
    return CellKind(expected, int, lambda cells: min(cells) >= least)


def _number(expected: str, least: float, most: float) -> CellKind:
    return CellKind(expected, float, lambda cells: bool(least <= min(cells) and max(cells) <= most))


def _text(expected: str, is_right: Callable[[str], bool] = bool) -> CellKind:
    return CellKind(expected, str, lambda cells: _are_unicode(cells) and all(map(is_right, set(cells))))


def _one_of(*words: str) -> CellKind:
    *before, last = (f"'{word}'" for word in words)
    return _text(f"{', '.join(before)} or {last}", words.__contains__)


def _json(expected: str, is_right: Callable[[Any], bool]) -> CellKind:
    return _text(expected, lambda text: is_right(finite_json(text)))


def _parsed(expected: str, read: Callable[[Any], Any]) -> CellKind:
    """Return a kind of JSON of which `read` makes what is asked for, or None where it is wrong."""

    def parse(text: str) -> Any:
        return read(finite_json(text)) if _are_unicode((text,)) else None

    return CellKind(expected, str, lambda cells: all(parse(text) is not None for text in set(cells)), parse=parse)


def _are_unicode(texts: Sequence[str]) -> bool:
    try:
        "".join(texts).encode()
    except UnicodeEncodeError:
        return False
    return True


def _is_date(text: str) -> bool:
    """Tell whether it is a date as `Session` writes it: such dates are in order of time as texts."""
    try:
        return iso_date(text) == text
    except PomonaError:
        return False


def finite_json(text: str) -> Any:
    """Parse JSON; None where it is none, is nested without end or has numbers that are none."""

    def refuse(name: str) -> None:
        raise ValueError(name)

    try:
        return json.loads(text, parse_constant=refuse)
    except (ValueError, RecursionError):
        return None


def similarity(rows: Any) -> NDArray[np.float64] | None:
    """Return a (4, 4) transform that turns, moves and scales, and no more; None where it is something else."""
    is_grid = isinstance(rows, list) and len(rows) == 4 and all(isinstance(row, list) and len(row) == 4 for row in rows)
    if not is_grid or not all(type(cell) in (int, float) for row in rows for cell in row):
        return None
    try:
        transform = np.array(rows, dtype=np.float64)
    except OverflowError:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        axes = transform[:3, :3]
        scale = np.cbrt(np.linalg.det(axes)) if np.isfinite(transform).all() else np.nan
        is_similarity = scale > 0 and np.abs(axes @ axes.T / scale**2 - np.eye(3)).max() < RIGID_TOLERANCE
    is_similarity = bool(is_similarity and np.abs(transform).max() <= FARTHEST_M)
    return transform if is_similarity and (transform[3] == (0, 0, 0, 1)).all() else None


def places_of(points: bytes) -> NDArray[np.float64] | None:
    """Return the places, (N, 3), of points that lie one after the other; None where one of them is no cell of ours."""
    places = geopackage.joined_points(points)
    return places if places is not None and np.abs(places).max(initial=0.0) <= FARTHEST_M else None


def _are_places(blobs: Sequence[bytes]) -> bool:
    return set(map(len, blobs)) <= {geopackage.POINT_Z.itemsize} and places_of(b"".join(blobs)) is not None


def _are_pictures(blobs: Sequence[bytes]) -> bool:
    return all(
        len(blob) <= MOST_PICTURE_BYTES
        and (blob.startswith(b"\xff\xd8\xff") or (blob.startswith(b"RIFF") and blob[8:12] == b"WEBP"))
        for blob in blobs
    )


def _pairs(value: object) -> NDArray[np.float64] | None:
    """Return rows of two ids and a probability, (M, 3); None where these are none.

    A map has millions of them, so a column at a time.
    """
    if not isinstance(value, list) or set(map(type, value)) - {list} or set(map(len, value)) - {3}:
        return None
    if not value:
        return np.empty((0, 3))
    *ids, probabilities = zip(*value, strict=True)
    are_ids = all(set(map(type, column)) == {int} for column in ids)
    if not are_ids or set(map(type, probabilities)) != {float}:
        return None
    if not 0.0 <= min(probabilities) <= max(probabilities) <= 1.0:
        return None
    try:
        return np.array([*ids, probabilities], np.float64).T
    except OverflowError:
        return None


def _texts_by_name(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(text, str) for text in value.values())


ID = _whole("a whole number from 1", 1)
COUNT = _whole("a whole number from 0", 0)
WHOLE = _whole("a whole number", -(2**63))
NAME = _text("a text that is not blank", lambda text: bool(text.strip()))
TEXT = _text("a text in UTF-8", lambda _: True)
DATE = _text("ISO 8601 local time as 2021-09-27 or 2021-09-27T11:40:12", _is_date)
OBJECT = _json("a JSON object", lambda value: isinstance(value, dict))
HASHES = _json("a JSON object of texts", _texts_by_name)
TRANSFORM = _parsed("a 4x4 rigid or similarity transform as JSON", similarity)
PAIRS = _parsed("a JSON list of [observation id, observation id, probability]", _pairs)
POINT = CellKind("a little-endian POINT Z with coordinates in metres", bytes, _are_places)
GEOMETRY = CellKind("a geometry", bytes, lambda _: True)
PICTURE = CellKind("a WebP or JPEG picture of at most 1 MiB", bytes, _are_pictures)
LONGITUDE = _number("degrees from -180 to 180", -180.0, 180.0)
LATITUDE = _number("degrees from -90 to 90", -90.0, 90.0)
HEIGHT = _number("metres above the ellipsoid", -12_000.0, 9_000.0)
FINITE = _number("a finite number", -np.finfo(float).max, np.finfo(float).max)
SQUARE = _number("square metres", -(FARTHEST_M**2), FARTHEST_M**2)
NUMBER = _number("a number", -np.inf, np.inf)
LENGTH = _number("metres from 0", 0.0, FARTHEST_M)
DIAMETER = _number("metres above 0", np.finfo(float).tiny, FARTHEST_M)
SHARE = _number("a number from 0 to 1", 0.0, 1.0)
UNIT = _number("a number from -1 to 1", -1.0 - RIGID_TOLERANCE, 1.0 + RIGID_TOLERANCE)

COLUMNS: Mapping[str, Mapping[str, CellKind]] = {
    "pomona_format": {"id": ID, "format_version": WHOLE, "kind": TEXT, "program_version": TEXT},
    "sessions": {
        "id": ID,
        "name": NAME,
        "date": DATE,
        "recording": TEXT,
        "content_sha256": TEXT,
        "map_from_session": TRANSFORM,
        "program_version": TEXT,
        "configuration": OBJECT,
        "input_hashes": HASHES,
        "method": _or_null(TEXT),
        "settings": _or_null(OBJECT),
        "log_odds": _or_null(NUMBER),
        "noise_m": _or_null(LENGTH),
    },
    "fruits": {
        "id": ID,
        "geom": POINT,
        "state": _one_of("new", "seen", "missed", "gone"),
        "last_seen": DATE,
        "last_session_id": ID,
        "n_sessions": ID,
        "n_missed": COUNT,
        "diameter_m": _or_null(DIAMETER),
        "state_probability": _or_null(SHARE),
        "fruit_probability": _or_null(SHARE),
        "tree_id": _or_null(ID),
        "tree_probability": _or_null(SHARE),
        "growth_mm_per_day": _or_null(FINITE),
    },
    "trees": {
        "id": ID,
        "geom": _or_null(POINT),
        "name": _or_null(TEXT),
        "row_id": _or_null(ID),
        "number": _or_null(WHOLE),
        "along_m": _or_null(FINITE),
        "kind": _or_null(TEXT),
        "source": _or_null(TEXT),
        "n_fruits": _or_null(COUNT),
    },
    "rows": {
        "id": ID,
        "geom": _or_null(GEOMETRY),
        "name": _or_null(TEXT),
        "number": _or_null(WHOLE),
        "source": _or_null(TEXT),
        "spacing_m": _or_null(LENGTH),
        "spacing_log_odds": _or_null(NUMBER),
    },
    "observations": {
        "id": ID,
        "geom": POINT,
        "session_id": ID,
        "fruit_id": ID,
        "label": _or_null(TEXT),
        "diameter_m": _or_null(DIAMETER),
        **dict.fromkeys(("cxx", "cxy", "cxz", "cyy", "cyz", "czz"), _or_null(SQUARE)),
        "n_views": _or_null(COUNT),
        "match_probability": _or_null(SHARE),
        "match_distance_m": _or_null(LENGTH),
        "other_columns": _or_null(HASHES),
    },
    "sightings": {"id": ID, "observation_id": ID, "frame": WHOLE},
    "poses": {
        "id": ID,
        "geom": POINT,
        "session_id": ID,
        "frame": WHOLE,
        "time_s": FINITE,
        **dict.fromkeys(("qx", "qy", "qz", "qw"), UNIT),
    },
    "matches": {
        "id": ID,
        "first_session_id": ID,
        "second_session_id": ID,
        "first_from_second": TRANSFORM,
        "log_odds": NUMBER,
        "pairs": PAIRS,
    },
    "changes": {
        "id": ID,
        "cause": _one_of("added", "removed", "merged"),
        "session": NAME,
        "event": _one_of("joined", "split", "moved"),
        "from_fruit_id": ID,
        "to_fruit_id": ID,
        "n_observations": ID,
    },
    "crops": {"id": ID, "session_id": ID, "observation_id": ID, "frame": WHOLE, "picture": PICTURE},
    "georeference": {
        "id": ID,
        "enu_from_map": TRANSFORM,
        "longitude_deg": LONGITUDE,
        "latitude_deg": LATITUDE,
        "height_m": _or_null(HEIGHT),
        "source": _one_of("points", "trajectory"),
        "n_points": ID,
        "rms_m": LENGTH,
    },
    "control_points": {
        "id": ID,
        "geom": POINT,
        "name": NAME,
        "longitude_deg": LONGITUDE,
        "latitude_deg": LATITUDE,
        "height_m": _or_null(HEIGHT),
        "session": _or_null(NAME),
        "frame": _or_null(WHOLE),
        "east_off_m": FINITE,
        "north_off_m": FINITE,
        "up_off_m": _or_null(FINITE),
    },
}
"""The columns that Pomona reads, and what they may hold."""
