"""Another map as a whole, read to be merged."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Container, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np

from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.orchard.besides import Besides, read_besides
from pomona.orchard.evidence import Evidence, KnownVisit, read_evidence
from pomona.orchard.recognising import Sight, sights_of_fruits, worth_recognising
from pomona.orchard.session import Session
from pomona.orchard.stored_sessions import session_in_map
from pomona.store.opening import snapshot
from pomona.store.rows import columns_of
from pomona.store.stored_fruits import fruits_in_map

__all__ = ["OtherMap", "read_other"]


@dataclass(frozen=True, eq=False)
class OtherMap:
    """All that a map holds of its sessions.

    Attributes
    ----------
    name : str
        Of the file.
    evidence : Evidence
        In the frame of that map.
    sessions : list of Session
        Each in its own frame, in the order of the evidence's visits.
    fruits : FruitCloud
        Those that may still hang.
    besides : Besides
        What it knows besides its sessions.
    """

    name: str
    evidence: Evidence
    sessions: list[Session]
    fruits: FruitCloud
    besides: Besides

    @property
    def contents(self) -> list[str]:
        """Hashes of what each session saw."""
        return [visit.seen.key[1] for visit in self.evidence.visits]

    def all_but(self, left_out: Container[int]) -> list[int]:
        """Return the numbers of the other sessions."""
        return [number for number in range(len(self.sessions)) if number not in left_out]

    def with_free_names(self, numbers: Sequence[int], taken: Collection[str]) -> tuple[OtherMap, dict[str, str]]:
        """Return it with other names for those of its sessions whose name is taken, and which have which now."""
        names = {*taken, *(session.name for session in self.sessions)}
        renamed: dict[str, str] = {}
        for name in (self.sessions[number].name for number in numbers):
            if name in taken:
                renamed[name] = next(one for one in self._names_for(name) if one not in names)
                names.add(renamed[name])
        sessions = [
            replace(session, name=renamed.get(session.name, session.name)) if number in numbers else session
            for number, session in enumerate(self.sessions)
        ]
        return replace(self, sessions=sessions, besides=self.besides.renamed(renamed)), renamed

    def _names_for(self, name: str) -> Iterator[str]:
        yield f"{name} ({self.name})"
        yield from (f"{name} ({self.name}, {number})" for number in count(2))

    def sights(self) -> list[Sequence[Sight]]:
        """Return for each of `fruits` the visits that saw it, with its rows there."""
        seen = sights_of_fruits(self.evidence)
        return [seen[int(name)] for name in self.fruits.ids or ()]


def read_other(path: Path) -> OtherMap:
    """Read a map.

    Raises
    ------
    PomonaError
        When it is not a map of ours.
    """
    with snapshot(path) as (connection, kind):
        if kind != "map":
            raise PomonaError(f"{path}: is the file of one session, expected a map; `map add` takes sessions")
        (session_ids,) = columns_of(connection, "sessions", ("id",))
        evidence = read_evidence(connection, session_ids)
        sessions = [_session(connection, visit) for visit in evidence.visits]
        fruits = worth_recognising(fruits_in_map(connection, FruitCloud))
        return OtherMap(path.stem, evidence, sessions, fruits, read_besides(connection))


def _session(connection: sqlite3.Connection, visit: KnownVisit) -> Session:
    return session_in_map(connection, visit.session_id, np.asarray(np.linalg.inv(visit.map_from_session)))
