"""`map georeference`: where on Earth a map lies, by known points or by fixes along the way of a camera."""

from __future__ import annotations

import json
import sqlite3
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona import geopackage
from pomona.earth import Anchor, anchored
from pomona.errors import PomonaError
from pomona.orchard.control_points import ControlTable
from pomona.orchard.stored_sessions import cameras_in_map
from pomona.orchard.writing import nullable, update_layers
from pomona.store.opening import TIMEOUT_S, Waiting, writing
from pomona.store.rows import columns_of

__all__ = ["WITHIN_M", "Georeferenced", "georeference"]

WITHIN_M = 1.0
"""Known points lie no farther from where the fit puts them: more is a wrong point, or no RTK."""

DOWN_IN_CAMERA = 1
"""Cameras have y down."""

LONGEST_GAP_S = 1.0
"""Between two poses the camera's place is known for so long."""


@dataclass(frozen=True, eq=False)
class Georeferenced:
    """What was found.

    Attributes
    ----------
    anchor : Anchor
    names : tuple of N str
    off_m : (N, 3) float64
        East, north, up of where each known point should be; up is NaN where no height is known.
    scale : float
        The Earth's metres in one of the map's.
    """

    anchor: Anchor
    names: tuple[str, ...]
    off_m: NDArray[np.float64]
    scale: float

    @property
    def rms_m(self) -> float:
        """Root mean square distance from the known points, in plan where no heights are known."""
        return float(np.sqrt(np.nansum(self.off_m**2, axis=1).mean()))


def georeference(
    path: str | Path,
    table: ControlTable,
    *,
    session: str | None = None,
    up_in_map: NDArray[np.float64] | None = None,
    within_m: float = WITHIN_M,
    free_scale: bool = False,
    timeout_s: float = TIMEOUT_S,
    waiting: Waiting | None = None,
) -> Georeferenced:
    """Anchor a map to known points and write it down, in one transaction; what it had before is replaced.

    Parameters
    ----------
    path : str or Path
        The map (.gpkg).
    table : ControlTable
    session : str, optional
        Whose frames or times the table tells; not needed where only one session has poses.
    up_in_map : (3,) float64, optional
        The vertical; that of the cameras on average otherwise, where the map has some.
    within_m : float
        A known point that is farther off is refused.
    free_scale : bool
        Whether the map's metres may be longer or shorter than the Earth's.
    timeout_s, waiting
        As for `add_session`.

    Raises
    ------
    PomonaError
        When the file is not a map of ours, or the points are too few, too near each other, or contradict each other.
    """
    if not within_m > 0:  # NaN is not
        raise PomonaError(f"--within: found {within_m:g}, expected metres above 0")
    with writing(Path(path), "map", timeout_s=timeout_s, waiting=waiting) as (connection, _):
        named, frames, positions = _in_map(connection, table, session)
        up = _up(connection) if up_in_map is None else np.asarray(up_in_map, np.float64)
        anchor = _anchored(table, positions, up, free_scale=free_scale)
        off_m = anchor.off_m(positions, table.geodetic)
        _require_near(table, positions, anchor, up, off_m, within_m)
        scale = float(np.cbrt(np.linalg.det(anchor.enu_from_map[:3, :3])))
        found = Georeferenced(anchor, table.names, off_m, scale)
        _write(connection, found, table, positions, named, frames)
        update_layers(connection)
        return found


def _in_map(
    connection: sqlite3.Connection, table: ControlTable, session: str | None
) -> tuple[str | None, list[int | None], NDArray[np.float64]]:
    """Return the session, the frames and the places of the known points."""
    if table.place == "x":
        return None, [None] * len(table.places), table.places
    name, (frames, times_s, poses) = _way(connection, session)
    asked = table.places[:, 0]
    cameras = poses[:, :3, 3]
    known = frames.astype(np.float64) if table.place == "frame" else times_s
    order = np.argsort(known, kind="stable")
    known, cameras, frames = known[order], cameras[order], frames[order]
    after = np.clip(np.searchsorted(known, asked), 1, len(known) - 1) if len(known) > 1 else np.zeros(len(asked), int)
    nearest = np.where(np.abs(known[after - 1] - asked) < np.abs(known[after] - asked), after - 1, after)
    gap = 0.0 if table.place == "frame" else LONGEST_GAP_S
    wrong = np.abs(known[nearest] - asked) > gap
    if wrong.any():
        row = int(np.argmax(wrong))
        raise PomonaError(
            f"{table.where[row]}: {table.place}: found {asked[row]:g}, expected one of session {name}, "
            f"{known[0]:g} to {known[-1]:g}"
        )
    positions = np.stack([np.interp(asked, known, column) for column in cameras.T], axis=1)
    return name, [int(frame) for frame in frames[nearest]], positions


def _way(
    connection: sqlite3.Connection, session: str | None
) -> tuple[str, tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]]:
    ids, names = columns_of(connection, "sessions", ("id", "name"))
    if session is not None and session not in names:
        raise PomonaError(f"--session: found {session!r}, expected one of the map's: {', '.join(names)[:200]}")
    ways = {
        name: way
        for session_id, name in zip(ids, names, strict=True)
        if session in (None, name) and (way := cameras_in_map(connection, session_id)) is not None
    }
    if len(ways) != 1:
        found = f"{len(ways) or 'no'} sessions with poses"
        raise PomonaError(f"--session: found {found}, expected the one whose frames or times the table tells")
    return next(iter(ways.items()))


def _up(connection: sqlite3.Connection) -> NDArray[np.float64] | None:
    """Return the vertical that the cameras have on average; without cameras nobody tells."""
    (ids,) = columns_of(connection, "sessions", ("id",))
    ways = [way[2] for session_id in ids if (way := cameras_in_map(connection, session_id)) is not None]
    if not ways:
        return None
    return np.asarray(-np.concatenate(ways)[:, :3, DOWN_IN_CAMERA].mean(axis=0))


def _anchored(
    table: ControlTable, positions: NDArray[np.float64], up_in_map: NDArray[np.float64] | None, *, free_scale: bool
) -> Anchor:
    try:
        return anchored(positions, table.geodetic, up_in_map, free_scale=free_scale)
    except PomonaError as error:
        raise PomonaError(f"{table.path}: {error}") from None


def _require_near(
    table: ControlTable,
    positions: NDArray[np.float64],
    anchor: Anchor,
    up_in_map: NDArray[np.float64] | None,
    off_m: NDArray[np.float64],
    within_m: float,
) -> None:
    """Refuse points that contradict each other, by the one that does most."""
    far = np.sqrt(np.nansum(off_m**2, axis=1))
    if far.max() <= within_m:
        return
    row = _worst(table, positions, up_in_map, far)
    if len(far) == 2:
        enu = anchor.east_north_up(np.nan_to_num(table.geodetic))
        in_map, on_earth = (float(np.linalg.norm(points[0] - points[1])) for points in (positions, enu))
        raise PomonaError(
            f"{table.where[1]}: {table.names[0]} and {table.names[1]} are {in_map:.2f} m apart in the map and "
            f"{on_earth:.2f} m on Earth, expected the same to {within_m:g} m each"
        )
    raise PomonaError(
        f"{table.where[row]}: {table.names[row]} is {far[row]:.2f} m from where the other points put it, expected "
        f"at most {within_m:g} m: a wrong point? --within METRES allows more"
    )


def _worst(
    table: ControlTable,
    positions: NDArray[np.float64],
    up_in_map: NDArray[np.float64] | None,
    far: NDArray[np.float64],
) -> int:
    """Return the point without which the others agree best; of many, the farthest."""
    if not 3 <= len(far) <= 50:
        return int(np.argmax(far))
    left = []
    for row in range(len(far)):
        rest = np.arange(len(far)) != row
        try:
            anchor = anchored(positions[rest], table.geodetic[rest], up_in_map)
        except PomonaError:
            left.append(np.inf)
            continue
        off = anchor.off_m(positions[rest], table.geodetic[rest])
        left.append(float(np.nansum(off**2)))
    return int(np.argmin(left))


def _write(
    connection: sqlite3.Connection,
    found: Georeferenced,
    table: ControlTable,
    positions: NDArray[np.float64],
    session: str | None,
    frames: list[int | None],
) -> None:
    anchor = found.anchor
    connection.execute("DELETE FROM georeference")
    connection.execute("DELETE FROM control_points")
    connection.execute(
        """INSERT INTO georeference (enu_from_map, longitude_deg, latitude_deg, height_m, source, n_points, rms_m)
        VALUES (?, ?, ?, ?, ?, ?, ?)""",
        (
            json.dumps(anchor.enu_from_map.tolist()), anchor.longitude_deg, anchor.latitude_deg, anchor.height_m,
            "points" if session is None else "trajectory", len(table.names), found.rms_m,
        ),
    )  # fmt: skip
    connection.executemany(
        """INSERT INTO control_points (geom, name, longitude_deg, latitude_deg, height_m, session, frame, east_off_m,
        north_off_m, up_off_m) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)""",
        zip(
            geopackage.points(positions),
            table.names,
            *(nullable(column) for column in table.geodetic.T),
            [session] * len(frames),
            frames,
            *(nullable(column) for column in found.off_m.T),
            strict=True,
        ),
    )
