"""A session into the map: its fruits are recognised there, and get the identities that only the map gives out."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import NoLinksError, new_file
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.identity import VisitPair
from pomona.orchard.evidence import Evidence, new_visit, read_evidence
from pomona.orchard.fruit_ids import Change
from pomona.orchard.growth_of_fruits import write_growth
from pomona.orchard.recognising import matches_with_visits
from pomona.orchard.session import Session
from pomona.orchard.settling import Settlement, settle, settlement_of, write_changes
from pomona.orchard.tree_tables import follow_trees
from pomona.orchard.writing import Placement, insert_matches, insert_observations, insert_session, update_layers
from pomona.settings import Settings
from pomona.store import schema
from pomona.store.failures import WrongContentError
from pomona.store.numbering import last_ids
from pomona.store.opening import TIMEOUT_S, Waiting, blank, writing
from pomona.store.rows import columns_of
from pomona.store.stored_fruits import fruits_in_map

if TYPE_CHECKING:
    from pomona.matching import Match

__all__ = ["Added", "add_session", "add_sessions"]


@dataclass(frozen=True, eq=False)
class Added:
    """What became of a session.

    Attributes
    ----------
    fruit_ids : (N,) int64
        Identity of each fruit of the session; 0 for all when the session was not added.
    n_matched, n_new, n_missed : int
        Fruits known before, fruits of which the session is the first sight, fruits of the map that hang where the
        session looked and were not seen.
    match : Match, optional
        How the session was found in the map; None for the first session.
    known : FruitCloud, optional
        The fruits that `match` is with: those of the map that may still hang, before the session came.
    changes : tuple of Change
        Observations of other sessions that now are of another fruit.
    """

    fruit_ids: NDArray[np.int64]
    n_matched: int
    n_new: int
    n_missed: int
    match: Match | None
    known: FruitCloud | None = None
    changes: tuple[Change, ...] = ()

    @property
    def is_added(self) -> bool:
        """Whether the map holds the session now."""
        return self.match is None or self.match.status.value == "Found"


def add_session(
    path: str | Path,
    session: Session,
    *,
    settings: Settings | None = None,
    timeout_s: float = TIMEOUT_S,
    waiting: Waiting | None = None,
) -> Added:
    """Recognise a session's fruits in the map and add it; the first session starts the map.

    All of it happens in one transaction: a crash, a full disk or a kill leaves the map as it was. When the session is
    not found in the map, nothing is written. A new map appears whole; when two programs start it at once, the second
    finds its session in the map of the first.

    Parameters
    ----------
    path : str or Path
        The map (.gpkg); it is made when it is not there.
    session : Session
        The visit to add.
    settings : Settings, optional
        How to match; the defaults of `pomona.match` otherwise.
    timeout_s : float
        How long to wait for another program that is writing to the map.
    waiting : callable, optional
        Called once when it has to wait.

    Raises
    ------
    PomonaError
        When the file is not a map of ours, holds the session already or cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".gpkg":
        raise PomonaError(f"{path}: found suffix {path.suffix!r}, expected .gpkg for a map")
    if not len(session.cloud):
        raise PomonaError(f"session {session.name}: has no fruits, expected at least one")
    if not path.exists():
        try:
            with new_file(path) as partial, blank(partial, path) as connection:
                return _start(connection, session)
        except FileExistsError:
            pass
        except NoLinksError:
            return _start_in_place(path, session, settings, timeout_s, waiting)
    return _add(path, session, settings, timeout_s, waiting)


def add_sessions(
    path: str | Path,
    sessions: Sequence[Session],
    *,
    settings: Settings | None = None,
    timeout_s: float = TIMEOUT_S,
    waiting: Waiting | None = None,
) -> list[Added]:
    """Add several sessions, each in a transaction of its own; return what became of each, in their order.

    One that is not found in the map is tried again after the others, which may have seen what lies between.

    Parameters
    ----------
    path, settings, timeout_s, waiting
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
    while waiting_for_others:
        for number in waiting_for_others:
            answers[number] = add_session(
                path, sessions[number], settings=settings, timeout_s=timeout_s, waiting=waiting
            )
        refused = [number for number in waiting_for_others if not answers[number].is_added]
        if len(refused) == len(waiting_for_others):
            break
        waiting_for_others = refused
    return [answers[number] for number in range(len(sessions))]


def _start_in_place(
    path: Path, session: Session, settings: Settings | None, timeout_s: float, waiting: Waiting | None
) -> Added:
    """Start a map where it cannot appear whole: readers are told that it is empty until it is not."""
    try:
        return _add(path, session, settings, timeout_s, waiting, create=True)
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
    create: bool = False,
) -> Added:
    # A file of no bytes is what a killed start leaves where a map cannot appear whole.
    create = create or path.stat().st_size == 0
    with writing(path, "map", create=create, timeout_s=timeout_s, waiting=waiting) as (connection, is_blank):
        if is_blank:
            return _start(connection, session)
        last_ids(connection)
        _require_new(connection, session)
        settings = settings or Settings.load(None, {})
        known = _worth_recognising(fruits_in_map(connection, FruitCloud))
        if not len(known):
            raise WrongContentError("has sessions and no fruits, expected at least one")
        found = settings.match(session.cloud, known)
        if found.status.value != "Found":
            return Added(np.zeros(len(session.cloud), np.int64), 0, 0, 0, found, known)
        evidence = read_evidence(connection)
        ids = np.array(known.ids, np.int64)
        matches = matches_with_visits(evidence, new_visit(session), found, ids, settings)
        placement = Placement(settings, found.log_odds, found.noise_m)
        return replace(_join(connection, session, evidence, matches, placement), match=found, known=known)


def _start(connection: sqlite3.Connection, session: Session) -> Added:
    """Make the session's frame the map's, and each of its fruits a new one."""
    schema.create(connection, "map")
    return _join(connection, session, Evidence((), ()), {})


def _join(
    connection: sqlite3.Connection,
    session: Session,
    evidence: Evidence,
    matches: Mapping[int, VisitPair],
    placement: Placement | None = None,
) -> Added:
    """Write the session and all that follows from it with the others."""
    visit = new_visit(session)
    together = evidence.with_visit(visit, matches)
    settlement = settlement_of(connection, together)
    own = together.number_of(0)
    frame = settlement.conclusion.frames[own]
    fruit_ids = settlement.fruit_ids[settlement.conclusion.sights.visits == own]
    # Fruits come after their observations: where they hang, the last observation says.
    connection.execute("PRAGMA defer_foreign_keys = ON")
    session_id = insert_session(connection, session, frame, placement)
    observation_ids = insert_observations(connection, session_id, fruit_ids, session.cloud.transformed(frame))
    added = replace(
        visit,
        session_id=session_id,
        map_from_session=frame,
        observation_ids=observation_ids,
        fruit_ids=fruit_ids,
    )
    together = together.with_known(added)
    for pair in together.pairs:
        if own in (pair.first, pair.second):
            one, other = together.visits[pair.first], together.visits[pair.second]
            ids = (one.session_id, other.session_id), (one.observation_ids, other.observation_ids)
            insert_matches(connection, pair, *ids)
    settle(connection, together, settlement)
    write_changes(connection, "added", session.name, settlement.changes)
    write_growth(connection, fruit_ids.tolist(), settlement.changes)
    follow_trees(connection)
    update_layers(connection)
    return _told(settlement, own)


def _worth_recognising(fruits: FruitCloud) -> FruitCloud:
    """Return the fruits that may still hang: those gone, and what never was a fruit, only look like others."""
    judged = zip(fruits.extras["state"], fruits.extras["fruit_probability"], strict=True)
    may_hang = np.array([state != "gone" and (state != "missed" or float(p or 1) > 0.5) for state, p in judged], bool)
    return fruits.select(may_hang) if may_hang.any() else fruits


def _told(settlement: Settlement, own: int) -> Added:
    """Say what became of a session that is there now."""
    conclusion = settlement.conclusion
    looks = conclusion.looks
    is_elsewhere = looks.seen.sum(axis=1) > looks.seen[:, own]
    n_matched = int((looks.seen[:, own] & is_elsewhere).sum())
    n_seen = int(looks.seen[:, own].sum())
    return Added(
        fruit_ids=settlement.fruit_ids[conclusion.sights.visits == own],
        n_matched=n_matched,
        n_new=n_seen - n_matched,
        n_missed=int((looks.in_view[:, own] & ~looks.seen[:, own]).sum()),
        match=None,
        changes=tuple(settlement.changes),
    )


def _require_new(connection: sqlite3.Connection, session: Session) -> None:
    """Refuse a session that is in the map: by its name, by what it saw or by what it was made from."""
    columns = columns_of(connection, "sessions", ("name", "content_sha256", "input_hashes"))
    if not columns[0]:
        raise WrongContentError("has no session, expected at least one")
    for name, content_sha256, input_hashes in zip(*columns, strict=True):
        if name == session.name:
            raise WrongContentError(f"session {name} is in the map already")
        if content_sha256 == session.content_sha256:
            raise WrongContentError(f"session {session.name} is in the map already, as {name}: the same fruits")
        if session.input_hashes and input_hashes == session.input_hashes_json:
            raise WrongContentError(f"session {session.name} is in the map already, as {name}: the same input files")
