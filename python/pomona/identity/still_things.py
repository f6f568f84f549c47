"""Which tracks are no fruits but things that stay as they are: knots, clips, tags, drippers, seen on every visit.

Things show by how much a visit's camera errs, as they are as large on each. But slow fruits are things that stay, too,
for a camera that measures a little more from visit to visit. So things have to prove themselves to cameras that do not
err, and the cameras' errors are learned of those that did.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pomona.identity.size_fates import GROWS, ODD, SLOW, STANDS, THING, Growing, fate_densities, own_growth

__all__ = ["still_chances"]

Numbers = NDArray[np.float64]

FEWEST_TRACKS, FEWEST_DAYS = 20, 3
"""Fewer say nothing: of two days a fruitlet that will drop stands as still as a thing."""

BELIEVED = np.array([0.89, 0.04, 0.03, 0.02, 0.02])
"""Shares of tracks that grow, are slow, are things, stand still from the first visit on, and have stopped later, before
the season says its own."""

SHARE_OF_THINGS = 2
"""Place of theirs."""

ARE_ODD = 0.05
"""Of those that grow, the share that is much smaller or larger than the others."""

BELIEF = 12.0
"""Tracks that this belief is worth: one detector has no clips, another takes every dripper for a fruit."""

DROPS_AFTER_DAYS, HANG_ON = 12.0, 0.05
"""Fruitlets slow down some twelve days before they drop (the growth-rate rule of thinning): so long all that stand
still hang, then half of them drop in as many days each, and a few hang on for good."""

PROOF = 12.0
"""Nats by which things that stay have to explain all sizes better than slow and stopped fruits alone: fates are no
exact model of either, so a few nats are no proof."""

FEWEST_THINGS = 2.0
"""Fewer are no proof, nor worth the search for another reason."""

SCALE_SPREAD = 0.05
"""Of the logarithm of a visit's scale: of a camera that was set up anew."""

LEAST_NOISE, LEAST_SPREAD = 0.01, 0.03
"""No camera is better, and no fruits are more alike."""

USUAL_NOISE, NOISE_BELIEF = 0.05, 6.0
"""Of a size, and tracks that this is worth."""

MOST_CELLS, LEAST_TRACKS = 50_000, 100
"""Tracks times fates times visits by which it is learnt: of 300 tracks of eight visits, and of more of fewer."""

AT_ONCE = 500
"""Tracks that are weighed together."""

ROUNDS, CLOSE = 40, 0.5
"""Of expectation-maximisation at most, and nats that the last of them gained."""

AROUND = 24
"""Tracks next to one that say whether it hangs among fruits that grow."""

OF_ANOTHER_SORT, OTHERS, MOST_LAG = 0.05, 0.9, 0.5
"""Share of places where nothing grows, as fruits of another sort, which are ripe while these grow, or thirsty ones; of
what hangs there, those that do not grow; and of what hangs among fruits, those at most: no tree bears nothing but knots
and clips."""

PLACE_ROUNDS = 10
"""Of expectation-maximisation of the share of things."""

LEAST_HANGING = 1e-6
"""Chance that a track still hangs, where nothing of it was seen for long."""


@dataclass(frozen=True, eq=False)
class _Tracks:
    """N tracks that two days measured.

    Attributes
    ----------
    log_sizes : (N, V) float64
        NaN where unknown.
    days : (V,) float64
    stays : (N,) float64
        Logarithm of the chance that what visits saw and missed is that of a thing, which does not go.
    drops : (N,) float64
        Nats against a fruit that stands still to hang for as long as it was seen.
    """

    log_sizes: Numbers
    days: Numbers
    stays: Numbers
    drops: Numbers

    def __len__(self) -> int:
        return len(self.log_sizes)

    def chosen(self, rows: NDArray[np.int64]) -> _Tracks:
        return _Tracks(self.log_sizes[rows], self.days, self.stays[rows], self.drops[rows])


@dataclass(frozen=True, eq=False)
class _Season:
    """What is learnt: the growth, and shares as `BELIEVED`, (5,)."""

    growing: Growing
    shares: Numbers


def still_chances(log_sizes: Numbers, days: Numbers, hanging: Numbers, places: Numbers) -> Numbers:
    """Return the probability of each track, (K,), that it is a thing that stays; 0 where sizes do not tell.

    Parameters
    ----------
    log_sizes : (K, V) float64
        Logarithms of diameters in one unit, NaN where unknown; visits in the order of days.
    days : (V,) float64
        Of the visits.
    hanging : (K,) float64
        Probability that it still hangs, by what visits missed: things do not go.
    places : (K, 3) float64
        Of the tracks in one frame: where nothing grows it is fruits of another sort that do not.
    """
    chances = np.zeros(len(log_sizes))
    measured = ~np.isnan(log_sizes).all(axis=0)
    told, tracks = _told_tracks(log_sizes[:, measured], np.floor(days[measured]), hanging)
    if len(told) < FEWEST_TRACKS or len(np.unique(tracks.days)) < FEWEST_DAYS:
        return chances
    most = max(LEAST_TRACKS, MOST_CELLS // (len(tracks.days) + STANDS) ** 2)
    some = tracks.chosen(np.linspace(0, len(told) - 1, min(len(told), most)).astype(np.int64))
    with_things, gained = _learnt(some, _start(tracks.log_sizes), rescales=False)
    if with_things.shares[SHARE_OF_THINGS] * len(some) < FEWEST_THINGS:
        return chances
    none = np.where(np.arange(len(BELIEVED)) == SHARE_OF_THINGS, 0.0, with_things.shares)
    _, without = _learnt(some, replace(with_things, shares=none / none.sum()), rescales=False)
    if gained - without > PROOF:
        with_things, _ = _learnt(some, with_things, rescales=True)
        lags = np.zeros(len(told))
        for start in range(0, len(told), AT_ONCE):
            part = np.arange(start, min(start + AT_ONCE, len(told)))
            of_fates = _weighed(tracks.chosen(part), with_things)[0].sum(axis=2)
            chances[told[part]], lags[part] = of_fates[:, THING], of_fates[:, SLOW:].sum(axis=1)
        chances[told] *= _are_among_fruits(lags, places[told])
    return chances


def _are_among_fruits(lags: Numbers, places: Numbers) -> Numbers:
    """Return the probability that tracks are among fruits that grow, (N,), and not where nothing does.

    There fruits of another sort hang, that are ripe while these grow, or fruits that have stopped, as in a drought.

    Parameters
    ----------
    lags : (N,) float64
        Probability that a track grows less than the others, or not: as a thing, or as a fruit.
    places : (N, 3) float64
    """
    from scipy.spatial import cKDTree

    n = min(AROUND, len(places) - 1)
    near = np.asarray(cKDTree(places).query(places, k=1 + n)[1])
    lagging = lags[near[:, 1:]].sum(axis=1)

    def log_chance(share: float) -> Numbers:
        return np.asarray(lagging * np.log(share) + (n - lagging) * np.log1p(-share))

    are_among = np.ones(len(places))
    for _ in range(PLACE_ROUNDS):
        # Where nothing grows says nothing of the share among fruits.
        among = np.clip(are_among @ lags / max(are_among.sum(), 1.0), 1.0 / n, MOST_LAG)
        odds = np.log(OF_ANOTHER_SORT / (1.0 - OF_ANOTHER_SORT)) + log_chance(OTHERS) - log_chance(among)
        are_among = 1.0 / (1.0 + np.exp(np.minimum(odds, 700.0)))
    return np.asarray(are_among)


def _told_tracks(log_sizes: Numbers, days: Numbers, hanging: Numbers) -> tuple[NDArray[np.int64], _Tracks]:
    """Return the rows of the tracks of which two days have sizes, and what is known of these."""
    seen = ~np.isnan(log_sizes)
    spans = np.where(seen, days, -np.inf).max(axis=1, initial=-np.inf)
    spans = spans - np.where(seen, days, np.inf).min(axis=1, initial=np.inf)
    told = np.flatnonzero(spans > 0.0)
    stays = np.log(np.maximum(hanging[told], LEAST_HANGING))
    halved = np.maximum(spans[told] / DROPS_AFTER_DAYS - 1.0, 0.0)
    drops = -np.log(HANG_ON + (1.0 - HANG_ON) * 0.5**halved)
    return told, _Tracks(log_sizes[told], days, stays, drops)


def _start(log_sizes: Numbers) -> _Season:
    """Return the growth from visit to visit of the tracks that two of them saw, and what is believed."""
    n = log_sizes.shape[1]
    growth = np.zeros(n)
    for visit in range(1, n):
        both = np.isfinite(log_sizes[:, visit]) & np.isfinite(log_sizes[:, :visit]).any(axis=1)
        grown = log_sizes[both, visit, None] - log_sizes[both, :visit] + growth[:visit]
        growth[visit] = np.nanmedian(grown) if both.any() else growth[visit - 1]
    growth += np.nanmedian(log_sizes - growth)
    spread = 1.4826 * np.nanmedian(np.abs(log_sizes - growth))
    return _Season(Growing(growth, np.zeros(n), np.full(n, USUAL_NOISE), max(spread, LEAST_SPREAD), 0.1), BELIEVED)


def _learnt(tracks: _Tracks, season: _Season, *, rescales: bool) -> tuple[_Season, float]:
    """Return what explains the sizes best, from a start on, and how well it does: nats."""
    before = -np.inf
    for _ in range(ROUNDS):
        of_fates, gained = _weighed(tracks, season)
        gained -= 0.5 * float(((season.growing.scales / SCALE_SPREAD) ** 2).sum())
        if gained < before + CLOSE:
            break
        before, season = gained, _better(tracks.log_sizes, season, of_fates, rescales=rescales)
    return season, gained


def _weighed(tracks: _Tracks, season: _Season) -> tuple[Numbers, float]:
    """Return the probabilities of the fates of each track, (N, M, 1 + V), and the log-likelihood of all."""
    logs = fate_densities(tracks.log_sizes, tracks.drops, season.growing)
    logs += _log_priors(tracks.days, season.shares)[:, None]
    logs[:, THING] += tracks.stays[:, None]
    most = logs.max(axis=(1, 2), keepdims=True)
    weights = np.exp(logs - most)
    total = weights.sum(axis=(1, 2), keepdims=True)
    return weights / total, float((most + np.log(total)).sum())


def _log_priors(days: Numbers, shares: Numbers) -> Numbers:
    """Return the logarithm of the probability of each fate, (M,)."""
    between = np.diff(days)
    grows = shares[0] * np.array([1.0 - ARE_ODD, ARE_ODD])
    with np.errstate(divide="ignore"):  # none stops between two visits of one day
        return np.asarray(np.log(np.concatenate([grows, shares[1:-1], shares[-1] * between / between.sum()])))


def _better(log_sizes: Numbers, season: _Season, of_fates: Numbers, *, rescales: bool) -> _Season:
    """Return what explains the sizes better, given the probabilities of the fates, (N, M, 1 + V)."""
    counts = of_fates.sum(axis=(0, 2))
    counts = np.concatenate([[counts[: ODD + 1].sum()], counts[SLOW : STANDS + 1], [counts[STANDS + 1 :].sum()]])
    # A share of nothing stays so.
    shares = (counts + BELIEF * BELIEVED) * (season.shares > 0.0)
    return _Season(_regrown(log_sizes, season.growing, of_fates, rescales=rescales), shares / shares.sum())


def _regrown(log_sizes: Numbers, growing: Growing, of_fates: Numbers, *, rescales: bool) -> Growing:
    seen, grows = ~np.isnan(log_sizes), of_fates[:, GROWS]
    own = own_growth(log_sizes, growing)
    # A size that is off says nothing.
    counted = grows[:, :, None] * seen[:, None, :] * ~np.eye(seen.shape[1] + 1, seen.shape[1], -1, dtype=bool)
    n = counted.sum(axis=(0, 1))
    moved = (counted * own.off).sum(axis=(0, 1)) / np.maximum(n, 1.0)
    squares = (counted * ((own.off - moved) ** 2 + own.variances)).sum(axis=(0, 1))
    noises = np.sqrt((squares + NOISE_BELIEF * USUAL_NOISE**2) / (n + NOISE_BELIEF))
    spreads = np.sqrt((grows * own.squares).sum(axis=(1, 2)) / grows.sum())
    scales = _rescaled(log_sizes, growing, of_fates) if rescales else growing.scales
    return Growing(
        growth=growing.growth + moved + growing.scales - scales,
        scales=scales,
        noises=np.maximum(noises, LEAST_NOISE),
        level_spread=max(float(spreads[0]), LEAST_SPREAD),
        rate_spread=max(float(spreads[1]), LEAST_SPREAD),
    )


def _rescaled(log_sizes: Numbers, growing: Growing, of_fates: Numbers) -> Numbers:
    """Return the scales of the visits, (V,), as those say that do not grow."""
    seen = ~np.isnan(log_sizes)
    stands = of_fates[:, [THING, STANDS]].sum(axis=1)
    weights = np.where(seen, stands.sum(axis=1)[:, None] - stands[:, 1:], 0.0) / growing.noises**2
    sizes = np.where(seen, log_sizes, 0.0)
    off = np.where(seen, sizes - growing.scales, 0.0)
    level = (weights * off).sum(axis=1) / np.maximum(weights.sum(axis=1), np.finfo(float).tiny)
    return np.asarray((weights * (sizes - level[:, None])).sum(axis=0) / (weights.sum(axis=0) + SCALE_SPREAD**-2))
