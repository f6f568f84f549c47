"""A map of many rows, drawn and put together by the functions that `map add` calls, a row at a time.

Rows stand 4 m apart. Every visit sees four fifths of a row's fruits, 8 mm off and larger than the time before, among
false points, in a frame of its own. What follows from all visits is concluded once a row instead of once a visit, and a
row is put where it stands instead of being looked for. Every two visits of the rows to which one is added later are
matched as `map add` does it; of the other rows the truth says who is who, which is as many pairs and takes no time.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pomona import FruitCloud
from pomona.identity import VisitPair
from pomona.orchard import Session
from pomona.orchard.evidence import Evidence, KnownVisit, new_visit
from pomona.orchard.joining import Newcomer, join
from pomona.orchard.recognising import matches_between
from pomona.orchard.writing import Placement
from pomona.settings import Settings
from pomona.store import schema
from pomona.store.opening import blank
from pomona.synth.planting import grow_row

BETWEEN_ROWS_M = 4.0
SEEN = 0.8
N_FALSE = 40
OFF_M = 0.008
DAYS = 14


@dataclass(frozen=True, eq=False)
class DrawnRow:
    """A row of trees and who sees it.

    Attributes
    ----------
    number : int
    places : (N, 3) float64
        Of its fruits in the map, metres.
    """

    number: int
    places: NDArray[np.float64]

    def seen(self, visit: int) -> NDArray[np.int64]:
        """Return the fruits that a visit sees, in the order of its cloud; false points come after them."""
        return np.random.default_rng([self.number, visit]).permutation(len(self.places))[: int(SEEN * len(self.places))]

    def session(self, visit: int) -> tuple[Session, NDArray[np.float64]]:
        """Return a visit, and `map_from_session`."""
        rng, seen = np.random.default_rng([self.number, visit, 1]), self.seen(visit)
        strays = rng.uniform(self.places.min(axis=0), self.places.max(axis=0), (N_FALSE, 3))
        sizes = np.random.default_rng(self.number).normal(0, 0.1, len(self.places))[seen]
        cloud = FruitCloud(
            np.vstack([self.places[seen] + rng.normal(0, OFF_M, (len(seen), 3)), strays]),
            diameters_m=np.concatenate([(0.03 + 0.004 * visit) * np.exp(sizes), np.full(N_FALSE, 0.05)]),
            covariances=np.tile(np.diag([1e-4, 1e-4, 3e-4]), (len(seen) + N_FALSE, 1, 1)),
            n_views=rng.integers(1, 30, len(seen) + N_FALSE),
        )
        frame = np.eye(4)
        frame[:3, :3], frame[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.uniform(-5, 5, 3)
        day = date(2024, 5, 1) + timedelta(days=DAYS * visit)
        session = Session(
            f"row {self.number}, {day}", day.isoformat(), "drawn", cloud.transformed(np.linalg.inv(frame))
        )
        return session, frame


def drawn_rows(n_rows: int, n_trees: int) -> Iterator[DrawnRow]:
    """Draw rows side by side."""
    for number in range(n_rows):
        places = grow_row(np.random.default_rng([7, number]), n_trees).positions
        yield DrawnRow(number, places + np.array([0.0, BETWEEN_ROWS_M * number, 0.0]))


def build(path: Path, rows: Iterator[DrawnRow], n_visits: dict[int, int], most_visits: int) -> Iterator[int]:
    """Make the map; gives the number of each row that is in it. `n_visits` are those of rows that have fewer."""
    with blank(path, path) as connection:
        schema.create(connection, "map")
        for row in rows:
            evidence, newcomers = row_evidence(
                row, n_visits.get(row.number, most_visits), is_matched=row.number in n_visits
            )
            join(connection, evidence, newcomers)
            yield row.number


def row_evidence(row: DrawnRow, n_visits: int, *, is_matched: bool) -> tuple[Evidence, dict[int, Newcomer]]:
    """Say who is who between every two visits of a row, by matching them or by the truth."""
    settings = Settings.load(None, {})
    evidence, newcomers = Evidence((), ()), {}
    for number in range(n_visits):
        session, frame = row.session(number)
        visit = replace(new_visit(session), session_id=-number, map_from_session=frame)
        matches = matches_between(evidence, visit, frame, settings) if is_matched else true_pairs(row, evidence, visit)
        evidence = evidence.with_visit(visit, matches)
        placement = Placement(settings, sum(pair.log_odds for pair in matches.values()), OFF_M) if matches else None
        newcomers[-number] = Newcomer(session, placement, visit.seen.key[1])
    return evidence, newcomers


def true_pairs(row: DrawnRow, evidence: Evidence, visit: KnownVisit) -> dict[int, VisitPair]:
    """Return who is who between a visit and those before it, as a match would."""
    later, pairs = row.seen(-visit.session_id), {}
    for number, other in enumerate(evidence.visits):
        _, first, second = np.intersect1d(row.seen(-other.session_id), later, return_indices=True)
        first_from_second = np.linalg.inv(other.map_from_session) @ visit.map_from_session
        rows = np.stack([first, second], axis=1)
        pairs[number] = VisitPair(0, 0, first_from_second, 5.0 * len(rows), rows, np.full(len(rows), 0.999))
    return pairs
