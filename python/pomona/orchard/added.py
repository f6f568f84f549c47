"""What became of a session that was brought to a map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.orchard.fruit_ids import Change

if TYPE_CHECKING:
    from pomona.matching import Match

__all__ = ["Added"]

SAME_SHARE, SAME_M = 0.5, 0.025
"""Share of the fruits of two seasons that hang at one place, and how near along each axis, from which on it is one
season: where wood bears again it does 5 to 10 cm beside, four times in five, and a fruit is 1 to 2 cm off."""


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
    n_beyond : int
        Fruits of its part of the map that hang, for all that the last visit to look there knew, where it did not look.
    match : Match, optional
        How the session was found in the map, or not; None for the first session.
    is_added : bool
        Whether the map holds the session now.
    known : FruitCloud, optional
        The fruits that `match` is with: those of the map that may still hang, before the session came; of a large map
        those where the session lies.
    changes : tuple of Change
        Observations of other sessions that now are of another fruit.
    torn_near : tuple of str
        Fruits of the map beside which it and the session are torn against each other, as a camera lost its way.
    torn_like : str, optional
        A session of the map that showed the same tear before: then it is the map that is torn.
    season_before : str, optional
        Of the first visit of a season to a part of the map, the date of the last one before that winter: it was found
        by the fruits of that season, and none of its own can be one of these.
    length_in_map : float, optional
        How long the row is in the map for each metre in the session, where metres of one of the two are wrong; None
        where it is as long, as far as its bends let tell.
    copy_of : str, optional
        A session of the map, in the same frame, that it is as like as hardly any visit is: rounded, perhaps, or moved
        by millimetres.
    was_there : bool
        Whether the map held the very session before, and stays as it was.
    """

    fruit_ids: NDArray[np.int64]
    n_matched: int
    n_new: int
    n_missed: int
    match: Match | None
    is_added: bool = False
    known: FruitCloud | None = None
    changes: tuple[Change, ...] = ()
    torn_near: tuple[str, ...] = ()
    torn_like: str | None = None
    was_there: bool = False
    season_before: str | None = None
    length_in_map: float | None = None
    n_beyond: int = 0
    copy_of: str | None = None

    @property
    def is_year_doubted(self) -> bool:
        """Whether most fruits hang where those of another season did: then the date of one of the visits is wrong."""
        match = self.match
        if match is None or not self.is_added or self.n_matched or match.status.value != "Found":
            return False
        return len(match.pairs) > SAME_SHARE * match.n_query and match.noise_m < SAME_M
