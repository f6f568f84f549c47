"""Two maps into one: the sessions of the other come with their matches, and are matched with those that are there."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.errors import PomonaError
from pomona.identity import VisitPair
from pomona.orchard.adding import require_unseen
from pomona.orchard.carrying import carry_anchor, carry_history, carry_trees
from pomona.orchard.evidence import Evidence, KnownVisit, read_evidence
from pomona.orchard.fruit_ids import Change
from pomona.orchard.joining import Newcomer, join
from pomona.orchard.other_map import OtherMap, read_other
from pomona.orchard.parts import parts_with
from pomona.orchard.recognising import (
    Recognised,
    matches_between,
    matches_through_fruits,
    recognised,
    seen_last_by,
)
from pomona.orchard.settling import Settlement, write_changes
from pomona.orchard.tree_tables import follow_trees
from pomona.orchard.writing import Placement, update_layers
from pomona.settings import Settings
from pomona.store.numbering import last_ids
from pomona.store.opening import TIMEOUT_S, Waiting, snapshot, writing
from pomona.store.rows import columns_of

if TYPE_CHECKING:
    from pomona.matching import Match

__all__ = ["Merged", "merge_maps"]


@dataclass(frozen=True, eq=False)
class Merged:
    """What became of the other map.

    Attributes
    ----------
    match : Match, optional
        How its fruits were found; None where a session that is in both says how the maps lie.
    is_merged : bool
        Whether the map holds its sessions now.
    sessions, shared : tuple of str
        Names of the sessions that came, and of those that were in both.
    renamed : mapping of str to str
        Names that another session of the map had, and what the sessions that came are called instead.
    fruit_ids : mapping of int to int
        Fruit of the other map to the fruit that has most of its sights now.
    n_known : int
        Fruits of the other map that this one had.
    changes : tuple of Change
        Observations that were in the map and now are of another fruit.
    left_out : tuple of str
        What the other map knew of trees and its place on Earth, and this one keeps as it had it.
    """

    match: Match | None
    is_merged: bool
    sessions: tuple[str, ...] = ()
    shared: tuple[str, ...] = ()
    renamed: Mapping[str, str] = field(default_factory=dict)
    fruit_ids: Mapping[int, int] = field(default_factory=dict)
    n_known: int = 0
    changes: tuple[Change, ...] = ()
    left_out: tuple[str, ...] = ()


def merge_maps(
    path: str | Path,
    other: str | Path,
    *,
    output: str | Path | None = None,
    settings: Settings | None = None,
    timeout_s: float = TIMEOUT_S,
    waiting: Waiting | None = None,
) -> Merged:
    """Add all sessions of another map to a map, as if each had been added to it.

    The other map is only read. Fruits of the map keep their ids; those of the other get ids of the map, and the layer
    `changes` keeps which. Trees, the place on Earth and the history of the other come too, where the map does not have
    its own. A session that is in both comes once; one whose name another session of the map has gets the name of its
    file behind its own. When the two do not overlap nothing is written. All of it happens in one transaction.

    Parameters
    ----------
    path, other : str or Path
        The maps (.gpkg).
    output : str or Path, optional
        Where to write the merged map; into `path` otherwise, which else stays as it is.
    settings : Settings, optional
        How to match; the defaults of `pomona.match` otherwise.
    timeout_s : float
        How long to wait for another program that is writing to the map.
    waiting : callable, optional
        Called once when it has to wait.

    Raises
    ------
    PomonaError
        When a file is not a map of ours, both are the same file, a session was made from the input files of another
        one of the map, or the map cannot be written.
    """
    path, other = Path(path), Path(other)
    if other.exists() and path.exists() and path.samefile(other):
        raise PomonaError(f"{other}: is the map itself, expected another one to merge with {path}")
    settings = settings or Settings.load(None, {})
    theirs = read_other(other)
    if output is None:
        with writing(path, "map", timeout_s=timeout_s, waiting=waiting) as (connection, _):
            return _merge(connection, theirs, settings)
    with tempfile.TemporaryDirectory(prefix="pomona-") as folder:
        copy = Path(folder) / "merged.gpkg"
        _copy(path, copy)
        with writing(copy, "map", shown=path) as (connection, _):  # what is wrong in a copy is wrong in the map
            merged = _merge(connection, theirs, settings)
        if merged.is_merged:
            with whole_file(output) as partial:
                shutil.copyfile(copy, partial)
    return merged


def _copy(path: Path, copy: Path) -> None:
    with snapshot(path) as (connection, kind), closing(sqlite3.connect(copy)) as target:
        if kind != "map":
            raise PomonaError(f"{path}: is the file of one session, expected a map")
        connection.backup(target)


def _merge(connection: sqlite3.Connection, theirs: OtherMap, settings: Settings) -> Merged:
    last_ids(connection)
    ours = dict(zip(*columns_of(connection, "sessions", ("content_sha256", "id")), strict=True))
    shared = {number: ours[content] for number, content in enumerate(theirs.contents) if content in ours}
    for number in theirs.all_but(shared):
        require_unseen(connection, theirs.sessions[number], theirs.contents[number])
    (taken,) = columns_of(connection, "sessions", ("name",))
    theirs, renamed = theirs.with_free_names(theirs.all_but(shared), taken)
    found = None if shared else recognised(connection, theirs.fruits, settings)
    if found is not None and not found.is_found:
        return Merged(found.match, is_merged=False)
    touched = shared.values() if found is None else seen_last_by(connection, found)
    evidence = read_evidence(connection, parts_with(connection, touched))
    map_from_other = _pose(evidence, theirs, shared, found)
    together = _together(evidence, theirs, shared, found, map_from_other, settings)
    placement = None if found is None else Placement(settings, found.match.log_odds, found.match.noise_m)
    newcomers = {
        -number: Newcomer(theirs.sessions[number], placement, theirs.contents[number])
        for number in theirs.all_but(shared)
    }
    settlement = join(connection, together, newcomers)
    before = set(evidence.fruit_ids.tolist())
    became = _became(settlement, theirs, before)
    merged = _told(None if found is None else found.match, theirs, shared, before, became)
    carry_history(connection, theirs.besides, merged.fruit_ids, merged.shared)
    write_changes(connection, "added", theirs.name, settlement.changes)
    write_changes(connection, "merged", theirs.name, became)
    left_out = _carried(connection, theirs, map_from_other, merged.fruit_ids)
    return replace(merged, renamed=renamed, changes=tuple(settlement.changes), left_out=left_out)


def _carried(
    connection: sqlite3.Connection, theirs: OtherMap, map_from_other: NDArray[np.float64], fruit_ids: Mapping[int, int]
) -> tuple[str, ...]:
    """Write what the other map knows of trees and its place on Earth, and what follows; return what was left out."""
    left_out = (
        *carry_trees(connection, theirs.besides, map_from_other, fruit_ids),
        *carry_anchor(connection, theirs.besides, map_from_other),
    )
    (all_fruits,) = columns_of(connection, "fruits", ("id",))
    follow_trees(connection, all_fruits, ())
    update_layers(connection)
    return left_out


def _together(
    evidence: Evidence,
    theirs: OtherMap,
    shared: Mapping[int, int],
    found: Recognised | None,
    map_from_other: NDArray[np.float64],
    settings: Settings,
) -> Evidence:
    """Return what all sessions of both maps say: of ours, of theirs, and of one of each."""
    coming = {
        number: _laid(theirs.evidence.visits[number], -number, map_from_other) for number in theirs.all_but(shared)
    }
    between = {
        number: matches_between(evidence, visit, visit.map_from_session, settings, but=set(shared.values()))
        for number, visit in coming.items()
    }
    if found is not None and not any(between.values()):
        between = matches_through_fruits(evidence, found, theirs.evidence.visits, theirs.sights())
    visits = sorted([*evidence.visits, *coming.values()], key=lambda visit: visit.seen.key)
    numbers = {visit.session_id: number for number, visit in enumerate(visits)}
    ours = [numbers[visit.session_id] for visit in evidence.visits]
    others = [numbers[shared.get(number, -number)] for number in range(len(theirs.contents))]
    # Of two that are in both, this map says it itself.
    of_theirs = [pair for pair in theirs.evidence.pairs if not {pair.first, pair.second} <= shared.keys()]
    across = [
        replace(pair, first=min(ours[our], others[their]), second=max(ours[our], others[their]))
        for their, matches in between.items()
        for our, pair in matches.items()
    ]
    return Evidence(visits, [*_renumbered(evidence.pairs, ours), *_renumbered(of_theirs, others), *across])


def _renumbered(pairs: Sequence[VisitPair], numbers: Sequence[int]) -> Iterator[VisitPair]:
    return (replace(pair, first=numbers[pair.first], second=numbers[pair.second]) for pair in pairs)


def _pose(
    evidence: Evidence, theirs: OtherMap, shared: Mapping[int, int], found: Recognised | None
) -> NDArray[np.float64]:
    """Return `map_from_other`: as a session that is in both says, or as the fruits were found."""
    if found is not None:
        assert found.match.map_from_query is not None
        return found.match.map_from_query
    number, session_id = min(shared.items(), key=lambda pair: pair[1])
    in_map = evidence.visits[evidence.number_of(session_id)].map_from_session
    return np.asarray(in_map @ np.linalg.inv(theirs.evidence.visits[number].map_from_session))


def _laid(visit: KnownVisit, number: int, map_from_other: NDArray[np.float64]) -> KnownVisit:
    """Return a visit of the other map as a new one of this map."""
    return replace(
        visit,
        session_id=number,
        map_from_session=map_from_other @ visit.map_from_session,
        observation_ids=np.zeros(len(visit.cloud), np.int64),
        fruit_ids=np.zeros(len(visit.cloud), np.int64),
    )


def _became(settlement: Settlement, theirs: OtherMap, before: set[int]) -> list[Change]:
    """Return which fruit of this map each fruit of the other has become, by their sights."""
    now = {
        visit.seen.key: part.fruit_ids_of(own)
        for part in settlement.parts
        for own, visit in enumerate(part.evidence.visits)
    }
    sights: Counter[tuple[int, int]] = Counter()
    for visit in theirs.evidence.visits:
        sights.update(zip(visit.fruit_ids.tolist(), now[visit.seen.key].tolist(), strict=True))
    n_pieces = Counter(theirs_id for theirs_id, _ in sights)
    return [
        Change("split" if n_pieces[one] > 1 else "joined" if other in before else "moved", one, other, count)
        for (one, other), count in sorted(sights.items())
    ]


def _told(
    match: Match | None, theirs: OtherMap, shared: Mapping[int, int], before: set[int], became: list[Change]
) -> Merged:
    most_last = sorted(became, key=lambda change: change.n_observations)
    fruit_ids = {change.from_fruit_id: change.to_fruit_id for change in most_last}
    return Merged(
        match=match,
        is_merged=True,
        sessions=tuple(theirs.sessions[number].name for number in theirs.all_but(shared)),
        shared=tuple(theirs.sessions[number].name for number in shared),
        fruit_ids=dict(sorted(fruit_ids.items())),
        n_known=sum(fruit_id in before for fruit_id in fruit_ids.values()),
    )
