"""How likely all is that the visits saw of fruits and did not see: what they may miss, what goes, what never was."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.identity.looks import Looks, visibility_classes

__all__ = ["CHANCES_OF_SEEING", "SHARE_GONE", "Histories", "HistoryOdds", "histories_of"]

CHANCES_OF_SEEING = np.concatenate(
    [
        (0.80, 0.42, 0.27, 0.22, 0.18, 0.13),
        (0.17, 0.23, 0.30, 0.35, 0.43, 0.56, 0.66, 0.80, 0.88, 0.93, 0.98, 0.99, 0.993),
    ]
)
"""Of a fruit that hangs where a visit looks, by its `visibility_classes`: what the looks before tell of the next one in
the drawn orchards, where leaves hide the same fruits on every date."""

MOST_SEEING = 0.985
"""A detector misses fruits that hang free, too."""

LEVEL, LEVEL_SPREAD = 0.85, 1.2
"""Logit of the chance of a first look, of `MOST_SEEING`. Wide: detectors and trees see from a third to nearly all."""

SLOPE, SLOPE_SPREAD = 0.6, 0.5
"""How much the looks before tell: 0, nothing, where every visit misses others; 1, as in the drawn orchards."""

OWN_SPREAD = 0.4
"""Of the logit of each class about what level and slope say of it."""

LATENESS, LATENESS_SPREAD = 3.0, 3.0
"""By how much fruits that were missed at first are seen worse than others: the rate of their first sights in ranks."""

SHARE_GONE = 0.02
"""Of the fruits that go between two visits a week apart or more, before the season says its own."""

WEEK = 7.0
"""Days; between visits that are nearer in time as much fewer go, and none between two of one date."""

BELIEF_GONE = 25.0
"""Fruits that this belief is worth: few against the hundreds of a row, so that thinning shows."""

FARTHEST = 6.0
"""Of a setting from what is believed beforehand, standard deviations."""

FARTHEST_LEAVING = (-9.0, 4.0)
"""The same of the logit of the share that goes."""

RANK_DIGITS = 2


@dataclass(frozen=True, eq=False)
class Histories:
    """What the visits saw of each of K fruits.

    Attributes
    ----------
    seen, in_view : (K, V) bool
        As in `Looks`.
    classes : (K, V) int64
        `visibility_classes`.
    unseen : (K, V) int64
        The same for a fruit at that place that no visit has seen.
    days : (V,) float64
    late_ranks : (K,) float64
        How well its first sight saw a fruit that looks before had missed, as `Looks.views`; NaN of all others, and
        where nobody counted.
    """

    seen: NDArray[np.bool_]
    in_view: NDArray[np.bool_]
    classes: NDArray[np.int64]
    unseen: NDArray[np.int64]
    days: NDArray[np.float64]
    late_ranks: NDArray[np.float64]


def histories_of(looks: Looks, days: NDArray[np.float64]) -> Histories:
    """Return what the looks say of each fruit; `days`, (V,), of the visits."""
    classes, unseen = visibility_classes(looks)
    rows, first = np.arange(len(looks.seen)), looks.seen.argmax(axis=1)
    is_late = looks.is_counted[first] & (unseen[rows, first] > 0)
    ranks = np.where(is_late, looks.views[rows, first].round(RANK_DIGITS), np.nan)
    return Histories(looks.seen, looks.in_view, classes, unseen, days, ranks)


class HistoryOdds:
    r"""The posterior of all that histories follow from, but for the share of false points, which is given.

    A fruit that hangs is seen with the chance $c_j$ of its class $j$, by what the looks before saw of it:
    $\mathrm{logit}\, c_j = a + b\, x_j + e_j$, with $x_j$ as in the drawn orchards, the level $a$, the slope $b$ and
    what is the class's own, $e_j$; before visit $v$ the share $h_v$ goes. So a history has the probability $P$, and
    some visit sees a fruit there with $S$. Beside each that hangs a visit has $\rho = c_0 f / (1 - f)$ false points,
    which no other visit sees: $f$ is their share of what a first look sees. Of what was seen at a place,

    $$L = \prod \frac{P + \rho\, [\mathrm{one\ visit\ alone\ saw\ it}]}{S + \rho\, n}, \qquad n\ \mathrm{looks}$$

    is the likelihood. How many fruits hang that nobody saw is not asked: places are given.
    """

    def __init__(self, histories: Histories) -> None:
        one = histories
        self.n_visits = one.seen.shape[1]
        last = self.n_visits - 1 - one.seen[:, ::-1].argmax(axis=1)
        is_single = one.seen.sum(axis=1) == 1
        # Of what was seen twice and by the last visit nothing is open: its looks are counted once and for all.
        self.is_open = is_single | (last < self.n_visits - 1)
        own = np.nonzero(self.is_open)[0]
        self.seen, self.in_view, self.classes = one.seen[own], one.in_view[own], one.classes[own]
        self.last, self.is_single, self.late_ranks = last[own], is_single[own], one.late_ranks[own]
        closed = ~self.is_open
        self.n_closed = np.count_nonzero(closed)
        self.closed_hits = _counts(one.classes[closed], one.seen[closed])
        self.closed_misses = _counts(one.classes[closed], one.in_view[closed] & ~one.seen[closed])
        ranks = one.late_ranks[closed]
        self.closed_late = np.array([np.count_nonzero(~np.isnan(ranks)), np.nansum(ranks)])
        places, self.n_at = np.unique(np.concatenate([one.in_view, one.unseen], axis=1), axis=0, return_counts=True)
        self.place_in_view, self.place_classes = places[:, : self.n_visits] > 0, places[:, self.n_visits :]
        self.n_looks = self.place_in_view.sum(axis=1)
        self.goes = np.diff(np.floor(one.days)) > 0
        self.share_gone = np.where(self.goes, SHARE_GONE * np.minimum(np.diff(one.days) / WEEK, 1.0), 0.0)
        logits = np.log(CHANCES_OF_SEEING / (1.0 - CHANCES_OF_SEEING))
        self.told = logits - logits[0]

    def start(self) -> NDArray[np.float64]:
        """Return what is believed beforehand: level, slope, lateness, the classes' own, logits of what goes."""
        believed = np.where(self.goes, self.share_gone, SHARE_GONE)
        return np.concatenate([np.zeros(3 + len(self.told)), np.log(believed / (1.0 - believed))])

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """How far from that each of it may be."""
        return [(-FARTHEST, FARTHEST)] * (3 + len(self.told)) + [FARTHEST_LEAVING] * (self.n_visits - 1)

    def __call__(self, told: NDArray[np.float64], share_false: float) -> tuple[float, NDArray[np.float64]]:
        """Return minus the log posterior and its gradient."""
        from scipy.special import xlogy

        n_own = 3 + len(self.told)
        chances, leaving = self._chances(told), self._leaving(told)
        density = 1.0 - chances / MOST_SEEING
        rate = share_false / (1.0 - share_false) * chances[0]
        ends, log_real, false = self._weighed(told, chances, leaving, rate)
        unseen_ends, log_unseen = _endings(leaving, np.full(len(self.n_at), -1), self._misses_at(chances))
        met = -np.expm1(log_unseen) + rate * self.n_looks
        real, missing = 1.0 - false, self.n_at * np.exp(log_unseen) / met
        log_single = np.log(np.exp(log_real) + rate)
        value = np.where(self.is_single, log_single, log_real).sum() - self.n_at @ np.log(met)
        value += self.closed_hits @ np.log(chances) + self.closed_misses @ np.log1p(-chances)
        value += self.n_closed * np.log1p(-leaving).sum()
        # Expected counts: of looks that saw and that missed, of fruits that went and that stayed.
        hits = self.closed_hits + _counts(self.classes, self.seen * real[:, None])
        misses = self.closed_misses + _counts(
            self.classes, (self.in_view & ~self.seen) * _hanging(ends) * real[:, None]
        )
        misses += _counts(self.place_classes, self.place_in_view * _hanging(unseen_ends) * missing[:, None])
        went = real @ ends[:, :-1] + missing @ unseen_ends[:, :-1]
        stayed = self.n_closed + real @ _hanging(ends) + missing @ _hanging(unseen_ends)
        of_chance = hits - misses * chances / (1.0 - chances)
        of_chance[0] += false.sum() - rate * (self.n_at * self.n_looks / met).sum()
        of_logit = of_chance * density
        late, lateness = ~np.isnan(self.late_ranks), self._lateness(told)
        n_late = self.closed_late[0] + real[late].sum()
        ranks = self.closed_late[1] + real[late] @ self.late_ranks[late]
        value += self.closed_late[0] * _log_rate(lateness) - lateness * self.closed_late[1]
        of_lateness = n_late * (1.0 / lateness - 1.0 / np.expm1(lateness)) - ranks
        slopes = [LEVEL_SPREAD * of_logit.sum(), SLOPE_SPREAD * of_logit @ self.told, LATENESS_SPREAD * of_lateness]
        went_before, stayed_before = BELIEF_GONE * self.share_gone, BELIEF_GONE * (1.0 - self.share_gone)
        went, stayed, goes = went[1:] + went_before, stayed[1:] + stayed_before, leaving[1:]
        value += (xlogy(went_before, goes) + stayed_before * np.log1p(-goes)).sum()
        value -= 0.5 * told[:n_own] @ told[:n_own]
        gradient = np.concatenate([slopes, OWN_SPREAD * of_logit, self.goes * (went * (1.0 - goes) - stayed * goes)])
        gradient[:n_own] -= told[:n_own]
        return -value, -gradient

    def lives(self, told: NDArray[np.float64], share_false: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return for each fruit, (K,), that it has gone, if it is one, and that it never was one."""
        chances = self._chances(told)
        rate = share_false / (1.0 - share_false) * chances[0]
        ends, _, false = self._weighed(told, chances, self._leaving(told), rate)
        gone, never = np.zeros(len(self.is_open)), np.zeros(len(self.is_open))
        gone[self.is_open], never[self.is_open] = 1.0 - ends[:, -1], false
        return gone, never

    def _weighed(
        self, told: NDArray[np.float64], chances: NDArray[np.float64], leaving: NDArray[np.float64], rate: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return when each open fruit goes, as `_endings`; the log of what speaks for a real one; that it is none."""
        looks = np.where(self.seen, np.log(chances)[self.classes], np.log1p(-chances)[self.classes])
        ends, log_real = _endings(leaving, self.last, np.where(self.in_view, looks, 0.0))
        lateness = self._lateness(told)
        log_real = log_real + np.nan_to_num(_log_rate(lateness) - lateness * self.late_ranks)
        return ends, log_real, np.where(self.is_single, rate / (rate + np.exp(log_real)), 0.0)

    def _misses_at(self, chances: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(self.place_in_view, np.log1p(-chances)[self.place_classes], 0.0)

    def _chances(self, told: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the chance of seeing a fruit of each class, (C,)."""
        common = LEVEL + LEVEL_SPREAD * told[0] + (SLOPE + SLOPE_SPREAD * told[1]) * self.told
        return np.asarray(MOST_SEEING / (1.0 + np.exp(-common - OWN_SPREAD * told[3 : 3 + len(self.told)])))

    def _leaving(self, told: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the share that goes before each visit, (V,); none before the first, nor between two of one date."""
        return np.concatenate([[0.0], self.goes / (1.0 + np.exp(-told[3 + len(self.told) :]))])

    @staticmethod
    def _lateness(told: NDArray[np.float64]) -> float:
        lateness = LATENESS + LATENESS_SPREAD * float(told[2])
        return lateness if abs(lateness) > 1e-3 else 1e-3


def _log_rate(lateness: float) -> float:
    """Return the log of what makes exp(-lateness * rank) a density over ranks of 0 to 1."""
    return float(np.log(lateness / -np.expm1(-lateness)))


def _counts(classes: NDArray[np.int64], weights: NDArray[np.generic]) -> NDArray[np.float64]:
    counted = np.bincount(classes.ravel(), weights.ravel().astype(np.float64), len(CHANCES_OF_SEEING))
    return counted.astype(np.float64)


def _endings(
    leaving: NDArray[np.float64], last: NDArray[np.int64], logs: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return probabilities of going before each visit, the last column for never, (K, V + 1); and their log sum.

    `logs`, (K, V), are of what each look saw or missed; up to the visit `last` the fruit hangs for sure.
    """
    stayed = np.concatenate([[0.0], np.cumsum(np.log1p(-leaving))])
    with np.errstate(divide="ignore"):
        going = np.concatenate([np.log(leaving), [0.0]]) + stayed
    weights = np.concatenate([np.zeros((len(logs), 1)), np.cumsum(logs, axis=1)], axis=1) + going
    weights = np.where(np.arange(logs.shape[1] + 1) > last[:, None], weights, -np.inf)
    most = weights.max(axis=1, keepdims=True, initial=-np.inf)
    weights = np.exp(weights - most)
    total = weights.sum(axis=1, keepdims=True)
    return weights / total, (most + np.log(total))[:, 0]


def _hanging(ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the probability that each fruit hangs on each visit, (K, V)."""
    return np.asarray(1.0 - np.cumsum(ends, axis=1)[:, :-1])
