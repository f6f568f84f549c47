"""A session for a map, from a file of either kind; what is doubtful must be said before it goes in."""

from __future__ import annotations

import datetime
import hashlib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from pomona.cloud import FruitCloud, Unit
from pomona.cloud.files import check_places, doubt_of_diameters
from pomona.cloud.near_names import DIAMETER, near_names
from pomona.errors import PomonaError, PomonaWarning
from pomona.file_names import given_path
from pomona.orchard.session import Session
from pomona.orchard.stored_sessions import read_session
from pomona.orchard.visit_days import require_visit_day
from pomona.reading import shown
from pomona.store.values import iso_date

__all__ = ["load_session"]

FEWEST_REPEATED, REPEATED = 5, 0.03
"""Fruits, and their share of all, that have one diameter which is no measurement."""

INSIDE, FEWEST_INSIDE, OFTEN_INSIDE = 0.5, 10, 0.1
"""Of the larger diameter, how near two centres are where one would be inside the other fruit; and how many fruits, and
what share of all, may be so by the errors of their places: 5 % where these are 4 cm."""

ALONE = 1.2
"""Fruits to a diameter, in the mean, where sizes are not rounded: of rounded ones many are alike."""


def load_session(path: str | Path, *, date: str | datetime.date | None = None, unit: Unit | None = None) -> Session:
    """Read a session file, or a bare cloud (.csv, .ply) as a session that is called as its file.

    Parameters
    ----------
    path : str or Path
        A session (.gpkg) or a cloud (.csv, .ply).
    date : str or datetime.date, optional
        Local date, or date and time, of the visit, as text in ISO 8601; needed for a cloud and for a session whose date
        was guessed, instead of the session's own otherwise.
    unit : {"m", "cm", "mm", "free"}, optional
        Unit of the coordinates; metres otherwise, and then they must look like metres.

    Raises
    ------
    PomonaError
        When the file cannot be read, has no date that anybody has noted or one that is still to come, or has no
        distances or diameters of fruits and nobody says that they are right: ``unit="m"``.

    Warns
    -----
    PomonaWarning
        When a column of a cloud is kept as text whose name nearly is one that counts, as `diameter_mm`; and when many
        fruits have one diameter, to the last digit, and the others each its own: that of fruits nobody measured; and
        when many fruits would be inside one another.
    """
    path = given_path(path)
    day = None if date is None else iso_date(date, f"{path}: date")
    read = _session if path.suffix.lower() == ".gpkg" else _cloud
    with _doubts_refused(is_said=unit is not None):
        session = read(path, day, unit)
        require_visit_day(session.date, f"{path}: date")
        if unit is None:
            check_places(path, session.cloud.positions)
            _check_diameters(path, session.cloud)
    if path.suffix.lower() != ".gpkg":
        _tell_near_names(path, session.cloud)
    _tell_repeated_diameter(path, session.cloud)
    _tell_doubled(path, session.cloud)
    return session


def _session(path: Path, date: str | None, unit: Unit | None) -> Session:
    if unit not in (None, "m"):
        raise PomonaError(f"{path}: found the unit {unit}, but a session is in metres; scan again with the right unit")
    session = read_session(path)
    if date is not None:
        return replace(session, date=date)
    if session.is_date_guessed:
        raise PomonaError(
            f"{path}: its date {session.date} was guessed from the age of files, say the day of the visit: "
            "--date YYYY-MM-DD, in Python date="
        )
    return session


def _cloud(path: Path, date: str | None, unit: Unit | None) -> Session:
    cloud = FruitCloud.read(path, unit="m" if unit is None else unit)
    if date is None:
        raise PomonaError(
            f"{path}: a bare cloud has no date, give the day of the visit: --date YYYY-MM-DD, in Python date="
        )
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return Session(path.stem, date, path.name, cloud, input_hashes={path.name: digest})


def _check_diameters(path: Path, cloud: FruitCloud) -> None:
    if (doubt := doubt_of_diameters(cloud)) is not None:
        warnings.warn(f"{path}: {doubt}; check the unit", PomonaWarning, stacklevel=3)


def _tell_near_names(path: Path, cloud: FruitCloud) -> None:
    """Warn, and refuse nothing: what is only text is no damage to a map, as sizes in another unit are."""
    for name, known in near_names(cloud):
        metres = ", in metres," if known == DIAMETER else ""
        found = f"found the column {shown(name)}, which is kept as text"
        warnings.warn(f"{path}: {found}; expected {known}{metres} for it to count", PomonaWarning, stacklevel=3)


def _tell_repeated_diameter(path: Path, cloud: FruitCloud) -> None:
    """Warn where a detector gives one size to what it could not measure: it would be a thing that does not grow."""
    known_m = np.empty(0) if cloud.diameters_m is None else cloud.diameters_m[~np.isnan(cloud.diameters_m)]
    values_m, counts = np.unique(known_m, return_counts=True)
    if len(values_m) < 2:
        return
    most = int(counts.argmax())
    if counts[most] < max(FEWEST_REPEATED, REPEATED * len(known_m)) or np.delete(counts, most).mean() > ALONE:
        return
    found = f"{counts[most]} of {len(known_m)} diameters are {values_m[most]:.6g} m exactly, and the others differ"
    expected = "expected none where nobody measured, for what does not grow is taken for no fruit"
    warnings.warn(f"{path}: {found}; {expected}", PomonaWarning, stacklevel=3)


def _tell_doubled(path: Path, cloud: FruitCloud) -> None:
    """Warn where fruits would be inside one another: found twice they are counted twice."""
    from scipy.spatial import cKDTree

    if cloud.diameters_m is None or np.isnan(cloud.diameters_m).all():
        return
    sizes_m = np.where(np.isnan(cloud.diameters_m), 0.0, cloud.diameters_m)
    near = cKDTree(cloud.positions).query_pairs(INSIDE * float(np.quantile(sizes_m, 0.95)), output_type="ndarray")
    apart_m = np.linalg.norm(np.diff(cloud.positions[near], axis=1)[:, 0], axis=1)
    doubled = np.unique(near[apart_m < INSIDE * sizes_m[near].max(axis=1)])
    if len(doubled) < max(FEWEST_INSIDE, OFTEN_INSIDE * len(cloud)):
        return
    example = cloud.label(int(doubled[0]))
    found = f"{len(doubled)} of {len(cloud)} fruits with the middle of another one inside them, as {example}"
    warnings.warn(
        f"{path}: found {found}; expected each fruit once, for those found twice count twice",
        PomonaWarning,
        stacklevel=3,
    )


@contextmanager
def _doubts_refused(is_said: bool) -> Iterator[None]:
    """Refuse what only draws a warning elsewhere: a map keeps it for good. Unless the unit is said."""
    with warnings.catch_warnings():
        if not is_said:
            warnings.simplefilter("error", PomonaWarning)
        try:
            yield
        except PomonaWarning as doubt:
            raise PomonaError(f"{doubt}; a map takes it as it is with --unit m, in Python unit='m'") from None
