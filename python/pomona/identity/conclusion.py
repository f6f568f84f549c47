"""The story: from what all visits saw to who is who, where everybody hangs, and who is gone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.identity.common_frame import frames_of_visits
from pomona.identity.histories import histories_of
from pomona.identity.links import Links, links_of
from pomona.identity.lives import Lives, lives_of, states_of
from pomona.identity.looks import Looks, looks_of
from pomona.identity.sides import sided
from pomona.identity.still_things import still_chances
from pomona.identity.stretches import LIKELY
from pomona.identity.visits import SeenVisit, Sights, VisitPair, all_sights
from pomona.identity.winters import seasons_of

__all__ = ["Conclusion", "conclude"]


@dataclass(frozen=True, eq=False)
class Conclusion:
    """What follows from all visits together; S sights in the order of the visits, V visits, K fruits.

    Attributes
    ----------
    sights : Sights
    labels : (S,) int64
        Fruit of each sight, from 0.
    frames : (V, 4, 4) float64
        `map_from_visit`.
    positions : (S, 3) float64
        In the map.
    probabilities : (S,) float64
        That the sight is of its fruit, by its best link; NaN for the first sight of each fruit.
    distances_m : (S,) float64
        From the fruit's sight before, NaN for the first.
    looks : Looks
    lives : Lives
    states : list of str
        Of each fruit: new, seen, missed or gone.
    state_probabilities : (K,) float64
    """

    sights: Sights
    labels: NDArray[np.int64]
    frames: NDArray[np.float64]
    positions: NDArray[np.float64]
    probabilities: NDArray[np.float64]
    distances_m: NDArray[np.float64]
    looks: Looks
    lives: Lives
    states: list[str]
    state_probabilities: NDArray[np.float64]


def conclude(
    visits: Sequence[SeenVisit], pairs: Sequence[VisitPair], known: NDArray[np.float64], keepers: Sequence[int]
) -> Conclusion:
    """Say who is who, from all visits of a part of the orchard at once.

    Nothing here depends on the order in which the visits came; only the frame of the map does. Visits of another season
    say where a visit lies, and nothing of its fruits (`seasons_of`).

    Parameters
    ----------
    visits
        In the order of their keys.
    pairs
        Matches of two visits, found in one another.
    known, keepers
        As for `frames_of_visits`.
    """
    sights = all_sights(visits)
    seasons = seasons_of(sights.days)
    season_of = np.repeat(np.arange(len(seasons)), [one.stop - one.start for one in seasons])
    links = links_of(sights, [pair for pair in pairs if season_of[pair.first] == season_of[pair.second]])
    labels = _core.contracted(sights.visits, len(visits), links.sights, links.log_odds, links.matched, links.against)
    frames = frames_of_visits(visits, pairs, known, keepers)
    positions = np.concatenate(
        [visit.positions @ frame[:3, :3].T + frame[:3, 3] for visit, frame in zip(visits, frames, strict=True)]
    )
    fates: list[_Fates] = []
    for season in seasons:
        rows, n_before = sights.rows_of(season), sum(len(each.states) for each in fates)
        own = np.unique(labels[rows], return_inverse=True)[1]
        fates.append(_fates(visits[season], sights.of(season), own, positions[rows], frames[season]))
        labels[rows] = own + n_before
    looks, lives, states, state_probabilities = _of_all(fates)
    before = _sights_before(labels)
    return Conclusion(
        sights=sights,
        labels=labels,
        frames=frames,
        positions=positions,
        probabilities=np.where(before < 0, np.nan, _best_links(links, labels)),
        distances_m=np.where(before < 0, np.nan, np.linalg.norm(positions - positions[before], axis=1)),
        looks=looks,
        lives=lives,
        states=states,
        state_probabilities=state_probabilities,
    )


class _Fates(NamedTuple):
    """What became of the fruits of a season."""

    looks: Looks
    lives: Lives
    states: list[str]
    state_probabilities: NDArray[np.float64]


def _fates(
    visits: Sequence[SeenVisit],
    sights: Sights,
    labels: NDArray[np.int64],
    positions: NDArray[np.float64],
    frames: NDArray[np.float64],
) -> _Fates:
    """Say what became of the fruits of a season by its last visit."""
    looks = sided(looks_of(visits, sights, labels, positions, frames), sights.days)
    # Histories tell of fruits that go one by one. A stretch that was emptied has a fate of its own, and none of it
    # says how much leaves hide, or how many go elsewhere.
    lives = lives_of(histories_of(looks, sights.days)).with_emptied(looks.emptied)
    places = _middles(labels, positions)
    still = still_chances(_log_sizes(sights, labels, frames), sights.days, 1.0 - lives.gone, places)
    lives = lives.with_still(still)
    looks = replace(looks, in_view=looks.in_view | (looks.emptied > LIKELY))
    return _Fates(looks, lives, *states_of(looks.seen, looks.in_view, lives))


def _of_all(seasons: Sequence[_Fates]) -> _Fates:
    """Put the fruits of all seasons together: those of the seasons before the last are gone."""
    *past, last = seasons
    if not past:
        return last
    gone = [np.ones(len(each.states)) for each in past]
    lives = Lives(np.concatenate([*gone, last.lives.gone]), np.concatenate([each.lives.false for each in seasons]))
    states = ["gone" for each in past for _ in each.states] + last.states
    looks = Looks.of_seasons([each.looks for each in seasons])
    return _Fates(looks, lives, states, np.concatenate([*gone, last.state_probabilities]))


def _log_sizes(sights: Sights, labels: NDArray[np.int64], frames: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the logarithms of the diameters of each fruit, (K, V), in the unit of the map; NaN where unknown."""
    log_sizes = np.full((labels.max(initial=-1) + 1, len(frames)), np.nan)
    log_sizes[labels, sights.visits] = np.where(np.isfinite(sights.log_sizes), sights.log_sizes, np.nan)
    return np.asarray(log_sizes + np.log(np.linalg.det(frames[:, :3, :3])) / 3.0)


def _middles(labels: NDArray[np.int64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the middle of the sights of each fruit, (K, 3)."""
    sums = np.zeros((labels.max(initial=-1) + 1, 3))
    np.add.at(sums, labels, positions)
    return np.asarray(sums / np.bincount(labels, minlength=len(sums))[:, None])


def _sights_before(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the sight of the same fruit before each, -1 where there is none."""
    order = np.argsort(labels, kind="stable")
    before = np.full(len(labels), -1)
    same = labels[order][1:] == labels[order][:-1]
    before[order[1:][same]] = order[:-1][same]
    return before


def _best_links(links: Links, labels: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the probability of the surest link of each sight with its fruit, (S,)."""
    best = np.full(len(labels), -np.inf)
    inside = labels[links.sights[:, 0]] == labels[links.sights[:, 1]]
    for side in (0, 1):
        np.maximum.at(best, links.sights[inside, side], links.log_odds[inside])
    return np.asarray(1.0 / (1.0 + np.exp(-best)))
