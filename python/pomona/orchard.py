"""The orchard map and its sessions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pomona.cloud import FruitCloud
from pomona.trajectory import Trajectory


def write_session(
    path: str | Path,
    cloud: FruitCloud,
    *,
    name: str,
    date: str,
    recording: str,
    trajectory: Trajectory | None = None,
    configuration: Mapping[str, object] | None = None,
    input_hashes: Mapping[str, str] | None = None,
) -> None:
    """Write one visit as a map with one session (GeoPackage); the file appears whole or not at all.

    Parameters
    ----------
    path : str or Path
        The .gpkg file; an existing one is replaced.
    cloud : FruitCloud
        Fruits in the session's frame, metres; ids are the session's own names of the fruits.
    name : str
        Name of the session, unique in a map.
    date : str
        ISO 8601 date or date and time, for example ``2021-09-27`` or ``2021-09-27T11:40:12``.
    recording : str
        Where the session came from.
    trajectory : Trajectory, optional
        Camera poses in the session's frame.
    configuration : mapping, optional
        Effective settings of the program that made the cloud, JSON values.
    input_hashes : mapping, optional
        File name to SHA-256 of the inputs.
    """
    raise NotImplementedError  # the store follows within the hour
