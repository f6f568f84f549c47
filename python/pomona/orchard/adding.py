"""A session into the map: its fruits are recognised there, and get the identities that only the map gives out."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import NoLinksError, new_file
from pomona.errors import PomonaError
from pomona.identity import VisitPair, seasons_of
from pomona.orchard.added import Added
from pomona.orchard.evidence import Evidence, new_visit
from pomona.orchard.joining import Newcomer, join
from pomona.orchard.mending import mended
from pomona.orchard.near_copies import doubted_copy
from pomona.orchard.recognising import recognised
from pomona.orchard.removing import take_out
from pomona.orchard.replacing import NotFoundError, holds, there_already
from pomona.orchard.seen_parts import SeenPart, matches_with_parts, seen_parts
from pomona.orchard.session import Session
from pomona.orchard.settling import SettledPart, Settlement, write_changes
from pomona.orchard.tears import beside_tears, torn_alike
from pomona.orchard.visit_days import require_visit_day
from pomona.orchard.writing import Placement
from pomona.row_length import length_in_map
from pomona.settings import Settings
from pomona.store import schema
from pomona.store.failures import WrongContentError
from pomona.store.numbering import last_ids
from pomona.store.opening import TIMEOUT_S, Waiting, blank, writing
from pomona.store.rows import columns_of

__all__ = ["Added", "add_session", "add_sessions", "require_unseen"]

BETWEEN_PARTS_M = 10.0
"""From one part of a map to the next, where nobody knows how they lie to each other."""

KEPT = 0.95
"""Of the fruits that a torn session is recognised by, part by part, those that it has to keep in one piece."""


def add_session(
    path: str | Path,
    session: Session,
    *,
    settings: Settings | None = None,
    new_part: bool = False,
    replacing: bool = False,
    timeout_s: float = TIMEOUT_S,
    waiting: Waiting | None = None,
) -> Added:
    """Recognise a session's fruits in the map and add it; the first session starts the map.

    All of it happens in one transaction: a crash, a full disk or a kill leaves the map as it was. When the session is
    not found in the map, nothing is written, unless it shall start a part of its own. A new map appears whole; when two
    programs start it at once, the second finds its session in the map of the first.

    Parameters
    ----------
    path : str or Path
        The map (.gpkg); it is made when it is not there.
    session : Session
        The visit to add.
    settings : Settings, optional
        How to match; the defaults of `pomona.match` otherwise.
    new_part : bool
        Whether a session that is not found in the map starts a part of its own, as another row of the orchard does.
    replacing : bool
        Whether the session takes the place of one of its name that saw something else; the very same session is left
        as it is. Both in one transaction: where the new one is not found, the old one stays.
    timeout_s : float
        How long to wait for another program that is writing to the map.
    waiting : callable, optional
        Called once when it has to wait.

    Raises
    ------
    PomonaError
        When the file is not a map of ours, holds the session already or cannot be written, or the session's date is
        still to come.
    """
    path = Path(path)
    if path.suffix.lower() != ".gpkg":
        raise PomonaError(f"{path}: found suffix {path.suffix!r}, expected .gpkg for a map")
    if not len(session.cloud):
        raise PomonaError(f"session {session.name}: has no fruits, expected at least one")
    require_visit_day(session.date, f"session {session.name}")
    if session.is_scale_free:
        found = "was triangulated without a scale, and a map is in metres"
        raise PomonaError(f"session {session.name}: {found}: triangulate it again with --map")
    if not path.exists():
        try:
            with new_file(path) as partial, blank(partial, path) as connection:
                return _start(connection, session)
        except FileExistsError:
            pass
        except NoLinksError:
            return _start_in_place(path, session, settings, timeout_s, waiting)
    try:
        return _add(path, session, settings, timeout_s, waiting, new_part=new_part, replacing=replacing)
    except NotFoundError as refused:
        return refused.added


def add_sessions(
    path: str | Path,
    sessions: Sequence[Session],
    *,
    settings: Settings | None = None,
    new_part: bool = False,
    replacing: bool = False,
    timeout_s: float = TIMEOUT_S,
    waiting: Waiting | None = None,
) -> list[Added]:
    """Add several sessions, each in a transaction of its own; return what became of each, in their order.

    One that is not found in the map is tried again after the others, which may have seen what lies between. When all
    that are left are not found, the first of them starts a part of its own if it may, and the others are tried again.

    Parameters
    ----------
    path, settings, new_part, replacing, timeout_s, waiting
        As for `add_session`.
    sessions : sequence of Session
        The visits to add.

    Raises
    ------
    PomonaError
        As `add_session`; the sessions before that one are in the map.
    """
    answers: dict[int, Added] = {}
    waiting_for_others = list(range(len(sessions)))
    starts_part = False
    while waiting_for_others:
        for place, number in enumerate(waiting_for_others):
            answers[number] = add_session(
                path,
                sessions[number],
                settings=settings,
                new_part=starts_part and place == 0,
                replacing=replacing,
                timeout_s=timeout_s,
                waiting=waiting,
            )
        refused = [number for number in waiting_for_others if not answers[number].is_added]
        is_stuck = len(refused) == len(waiting_for_others)
        if is_stuck and not new_part:
            break
        starts_part, waiting_for_others = is_stuck, refused
    return [answers[number] for number in range(len(sessions))]


def _start_in_place(
    path: Path, session: Session, settings: Settings | None, timeout_s: float, waiting: Waiting | None
) -> Added:
    """Start a map where it cannot appear whole: readers are told that it is empty until it is not."""
    try:
        return _add(path, session, settings, timeout_s, waiting, new_part=False, create=True)
    except BaseException:
        # SQLite makes the file before the first commit; a map that never was shall leave none.
        if path.exists() and path.stat().st_size == 0:
            path.unlink()
        raise


def _add(
    path: Path,
    session: Session,
    settings: Settings | None,
    timeout_s: float,
    waiting: Waiting | None,
    *,
    new_part: bool,
    replacing: bool = False,
    create: bool = False,
) -> Added:
    # A file of no bytes is what a killed start leaves where a map cannot appear whole.
    create = create or path.stat().st_size == 0
    with writing(path, "map", create=create, timeout_s=timeout_s, waiting=waiting) as (connection, is_blank):
        if is_blank:
            return _start(connection, session)
        last_ids(connection)
        if replacing:
            if holds(connection, session):
                return there_already(connection, session)
            if not take_out(connection, session.name):
                return _join(connection, session, Evidence((), ()), {})
        require_new(connection, session, session.content_sha256)
        settings = settings or Settings.load(None, {})
        found = recognised(connection, session.cloud, settings)
        parts = seen_parts(connection, session.cloud, found, settings)
        torn_like = torn_alike(connection, found.match, found.known)
        if parts:
            added = _add_where_found(connection, session, parts, settings)
        elif new_part:
            added = _join(connection, session, Evidence((), ()), {}, map_from_session=_beside(connection, session))
        else:
            added = Added(np.zeros(len(session.cloud), np.int64), 0, 0, 0, None)
        found = parts[0].found if parts else found
        length = length_in_map(found.match, session.cloud, found.known)
        added = replace(added, match=found.match, known=found.known, length_in_map=length)
        if found.match.n_parts > 1:
            near = tuple(beside_tears(found.match, session.cloud, found.known))
            added = replace(added, torn_near=near, torn_like=torn_like)
        if replacing and not added.is_added:
            raise NotFoundError(added)
        return added


def _start(connection: sqlite3.Connection, session: Session) -> Added:
    """Make the session's frame the map's, and each of its fruits a new one."""
    schema.create(connection, "map")
    return _join(connection, session, Evidence((), ()), {})


def _add_where_found(
    connection: sqlite3.Connection, session: Session, parts: Sequence[SeenPart], settings: Settings
) -> Added:
    """Add the session to the parts of the map that have fruits which it saw."""
    content = session.content_sha256
    if len(parts) == 1:
        session, parts = _in_one_piece(connection, session, parts[0], settings)
    visit = new_visit(session, content)
    evidence, matches = matches_with_parts(parts, visit, settings)
    doubted = doubted_copy(connection, session.name, visit, evidence, matches)
    first = parts[0].found.match
    placement = Placement(settings, first.log_odds, first.noise_m)
    return replace(_join(connection, session, evidence, matches, placement, content), copy_of=doubted)


def _in_one_piece(
    connection: sqlite3.Connection, session: Session, part: SeenPart, settings: Settings
) -> tuple[Session, Sequence[SeenPart]]:
    """Return a session, mended where it is torn apart, and the parts of the map that it saw.

    One pose lays a session in the map, and visits to come are compared with it as a whole. It is left as it came where
    it would be recognised worse in one piece.
    """
    if part.found.match.n_parts < 2:
        return session, [part]
    whole = mended(session, part.found.match)
    found = recognised(connection, whole.cloud, settings)
    parts = seen_parts(connection, whole.cloud, found, settings)
    before, after = (match.probabilities.sum() for match in (part.found.match, found.match))
    return (whole, parts) if parts and after >= KEPT * before else (session, [part])


def _beside(connection: sqlite3.Connection, session: Session) -> NDArray[np.float64]:
    """Return where a part begins of which nobody knows where it lies: beside all others, in the axes of its session."""
    (most_x,) = connection.execute("SELECT max(maxx) FROM rtree_observations_geom").fetchone()
    frame = np.eye(4)
    frame[0, 3] = np.ceil(most_x + BETWEEN_PARTS_M - session.cloud.positions[:, 0].min())
    return frame


def _join(
    connection: sqlite3.Connection,
    session: Session,
    evidence: Evidence,
    matches: Mapping[int, VisitPair],
    placement: Placement | None = None,
    content: str = "",
    *,
    map_from_session: NDArray[np.float64] | None = None,
) -> Added:
    """Write the session and all that follows from it with the others; `content` is its hash, where it was mended."""
    visit = new_visit(session, content)
    if map_from_session is not None:
        visit = replace(visit, map_from_session=map_from_session)
    newcomer = Newcomer(session, placement, visit.seen.key[1])
    settlement = join(connection, evidence.with_visit(visit, matches), {visit.session_id: newcomer})
    write_changes(connection, "added", session.name, settlement.changes)
    (session_id,) = connection.execute("SELECT max(id) FROM sessions").fetchone()
    return _told(settlement, session_id)


def _told(settlement: Settlement, session_id: int) -> Added:
    """Say what became of a session that is there now."""
    part, own = settlement.part_with(session_id)
    looks = part.conclusion.looks
    is_elsewhere = looks.seen.sum(axis=1) > looks.seen[:, own]
    n_matched = int((looks.seen[:, own] & is_elsewhere).sum())
    n_seen = int(looks.seen[:, own].sum())
    is_beyond = np.isin(part.conclusion.states, ("seen", "new")) & ~looks.in_view[:, own] & ~looks.seen[:, own]
    return Added(
        fruit_ids=part.fruit_ids_of(own),
        n_matched=n_matched,
        n_new=n_seen - n_matched,
        n_missed=int((looks.in_view[:, own] & ~looks.seen[:, own]).sum()),
        match=None,
        is_added=True,
        changes=tuple(settlement.changes),
        season_before=_season_before(part, own),
        n_beyond=int(is_beyond.sum()),
    )


def _season_before(part: SettledPart, own: int) -> str | None:
    """Return when the season before ended for the part, where a visit is the first one after it."""
    begins = [season.start for season in seasons_of(part.conclusion.sights.days)]
    return part.evidence.visits[own - 1].date if own and own in begins else None


def require_new(connection: sqlite3.Connection, session: Session, content: str) -> None:
    """Refuse a session that is in the map: by its name, by the hash of what it saw or by what it was made from."""
    for name, content_sha256 in zip(*columns_of(connection, "sessions", ("name", "content_sha256")), strict=True):
        if name == session.name and content_sha256 != content:
            raise WrongContentError(
                f"another session is called {name}, with other fruits, expected a name that the map does not have: "
                "`map add --name` gives one, --replace takes the other's place"
            )
        if name == session.name:
            raise WrongContentError(f"session {name} is in the map already")
    require_unseen(connection, session, content)


def require_unseen(connection: sqlite3.Connection, session: Session, content: str) -> None:
    """Refuse a session that is in the map, whatever it is called there."""
    columns = columns_of(connection, "sessions", ("name", "content_sha256", "input_hashes"))
    if not columns[0]:
        raise WrongContentError("has no session, expected at least one")
    for name, content_sha256, input_hashes in zip(*columns, strict=True):
        if content_sha256 == content:
            raise WrongContentError(f"session {session.name} is in the map already, as {name}: the same fruits")
        if session.input_hashes and input_hashes == session.input_hashes_json:
            raise WrongContentError(f"session {session.name} is in the map already, as {name}: the same input files")
