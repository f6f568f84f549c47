"""How likely all is that the visits saw of fruits and did not see: what they may miss, what goes, what never was."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.identity.first_views import N_BINS, N_SETTINGS, UNCOUNTED, WIDTHS, ViewDensities
from pomona.identity.local_shares import shares_of_places
from pomona.identity.looks import MISSES, SHARES_OF_VIEWS, USUAL_VIEWS, Looks, visibility_classes

__all__ = ["CHANCES_OF_SEEING", "SHARE_GONE", "Histories", "HistoryOdds", "histories_of"]

_BY_VIEWS = (0.17, 0.23, 0.30, 0.35, 0.43, 0.56, 0.66, 0.80, 0.88, 0.93, 0.98, 0.99, 0.993)
CHANCES_OF_SEEING = np.concatenate([(0.80, 0.42, 0.27, 0.22, 0.18, 0.13), _BY_VIEWS, _BY_VIEWS])
"""Of a fruit that hangs where a visit looks, by its `visibility_classes`: what the looks before tell of the next one in
the drawn orchards, where leaves hide the same fruits on every date."""

MOST_SEEING = 0.985
"""A detector misses fruits that hang free, too."""

LEVEL, LEVEL_SPREAD = 0.85, 1.2
"""Logit of the chance of a first look, of `MOST_SEEING`. Wide: detectors and trees see from a third to nearly all."""

SLOPE, SLOPE_SPREAD = 0.6, 0.5
"""How much the looks before tell: 0, nothing, where every visit misses others; 1, as in the drawn orchards."""

IN_PART_SPREAD = 1.0
"""By how much of two fruits with as many views the one that some looks missed is seen worse, or better."""

OWN_SPREAD = 0.4
"""Of the logit of each class about what level and slope say of it."""

AGAIN_SPREAD = 0.2
"""Of the logit of what a second look at all fruits sees, those that the first missed among them, about that of a first:
a visit that sees three quarters is followed by one that sees as many, where nothing goes. Without it, of two visits of
which the second sees half as many, a quarter of all fruits could be seen at first and two in five of those again."""

LEAVES_SPREAD = 0.15
"""Of the logit of a visit's chances to see what looks before had missed: leaves fall, or have grown. Most visits are
alike, and one may be far off: half width of a Cauchy distribution."""

FALSE_SPREAD = 0.3
"""The same of the logarithm of a visit's false points: light, dust and detectors make them, visit by visit."""

LIGHT_SPREAD = 0.05
"""Of the logit of the last visit's chances to see any fruit, about those of a usual visit, as for leaves. One visit in
sixty sees by 1 and more less: it was dark, the drive was fast, the lens was dirty. Of the visits before it later ones
tell; were they free, too, small errors of the classes would be taken for light, and fruits for gone."""

FARTHEST_OFF = 30.0
"""Of a visit from the others, half widths."""

DARKEST = 100.0
"""The same of its light."""

SHARE_GONE = 0.02
"""Of the fruits that go between two visits a week apart or more, before the season says its own."""

WEEK = 7.0
"""Days; between visits that are nearer in time as much fewer go, and none between two of one date."""

BELIEF_GONE = 25.0
"""Fruits that this belief is worth: few against the hundreds of a row, so that thinning shows."""

CLEARED = 0.1
"""Of the times between visits a week apart or more, those in which any share goes, as likely: people thin and pick,
once or so in a season of ten visits.
By the belief in a usual week alone, two thirds thinned at once were sooner two thirds of false points on the visit
before, of which no other visit has any."""

FARTHEST = 6.0
"""Of a setting from what is believed beforehand, standard deviations."""

FARTHEST_LEAVING = (-9.0, 4.0)
"""The same of the logit of the share that goes."""


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
    is_late : (K,) bool
        Whether looks had missed it before its first sight.
    first_views : (K,) int64
        Bin of how well its first sight saw it, as `Looks.views` among `SHARES_OF_VIEWS`; `UNCOUNTED` where nobody
        counted.
    went_by : (K, V) bool
    about : (K, n) int64
        Both as in `Looks`.
    """

    seen: NDArray[np.bool_]
    in_view: NDArray[np.bool_]
    classes: NDArray[np.int64]
    unseen: NDArray[np.int64]
    days: NDArray[np.float64]
    is_late: NDArray[np.bool_]
    first_views: NDArray[np.int64]
    went_by: NDArray[np.bool_]
    about: NDArray[np.int64]


def histories_of(looks: Looks, days: NDArray[np.float64]) -> Histories:
    """Return what the looks say of each fruit; `days`, (V,), of the visits."""
    classes, unseen = visibility_classes(looks)
    rows, first = np.arange(len(looks.seen)), looks.seen.argmax(axis=1)
    is_late = unseen[rows, first] > 0
    bins = np.searchsorted(SHARES_OF_VIEWS, looks.views[rows, first], side="right")
    first_views = np.where(looks.is_counted[first], bins, UNCOUNTED)
    return Histories(looks.seen, looks.in_view, classes, unseen, days, is_late, first_views, looks.went_by, looks.about)


class HistoryOdds:
    r"""The posterior of all that histories follow from, but for the share of false points, which is given.

    A fruit that hangs is seen with the chance $c_j$ of its class $j$, by what the looks before saw of it:
    $\mathrm{logit}\, c_j = a + b\, x_j + d\, y_j + e_j$, with $x_j$ as in the drawn orchards, $y_j$ 1 where some looks
    missed the fruit and others saw it, the level $a$, the slope $b$ and what is the class's own, $e_j$; before visit
    $v$ the share $h_v$ goes. So a history has the probability $P$, and some visit sees a fruit there with $S$. Beside
    each that hangs a visit has $\rho_v = e^{g_v} c_0 f / (1 - f)$ false points, which no other visit sees: $f$ is their
    share of what a first look sees, and $g_v$ is 0 where visits are alike. What looks before had missed a visit sees
    with $\mathrm{logit}\, c_j + l_v$, and the last visit sees all by $d$ of the logit more surely, 0 unless it is asked
    whether it was dark. Of what was seen at a place by visit $w$, of those that looked there,

    $$L = \prod \frac{q\, P + u\, \rho_w\, [\mathrm{it\ alone\ saw\ it}]}{S + \sum_v \rho_v}$$

    is the likelihood, with the densities $q$ and $u$ of how well first sights see fruits and false points
    (`ViewDensities`). How many fruits hang that nobody saw is not asked: places are given.
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
        self.last, self.is_single = last[own], is_single[own]
        self.is_late, self.first_views = one.is_late[own].astype(np.int64), one.first_views[own]
        self.went_by, self.about = one.went_by, one.about
        closed = ~self.is_open
        self.n_closed = np.count_nonzero(closed)
        self.closed_hits = _counts(one.classes[closed], one.seen[closed])
        self.closed_misses = _counts(one.classes[closed], one.in_view[closed] & ~one.seen[closed])
        late, views = one.is_late[closed], one.first_views[closed]
        self.closed_views = np.stack([_in_bins(views, ~late), _in_bins(views, late), np.zeros(N_BINS)])
        places, self.n_at = np.unique(np.concatenate([one.in_view, one.unseen], axis=1), axis=0, return_counts=True)
        self.place_in_view, self.place_classes = places[:, : self.n_visits] > 0, places[:, self.n_visits :]
        self.goes = np.diff(np.floor(one.days)) > 0
        self.share_gone = np.where(self.goes, SHARE_GONE * np.minimum(np.diff(one.days) / WEEK, 1.0), 0.0)
        logits = np.log(CHANCES_OF_SEEING / (1.0 - CHANCES_OF_SEEING))
        self.told = logits - logits[0]
        self.in_part = np.arange(len(logits)) >= len(logits) - len(_BY_VIEWS)
        first, self.of_light = 3 + len(self.told), 3 + len(self.told) + 2 * self.n_visits
        self.of_leaves = slice(first, first + self.n_visits)
        self.of_false = slice(first + self.n_visits, self.of_light)
        self.of_visits = slice(first, self.of_light + 1)
        counted = one.first_views != UNCOUNTED
        share = np.count_nonzero(counted) / max(len(counted), 1)
        self.once_seen = np.zeros(len(logits))
        self.once_seen[MISSES + 1 :][: len(_BY_VIEWS)] = share * WIDTHS
        self.once_seen[MISSES + 1 + np.searchsorted(SHARES_OF_VIEWS, USUAL_VIEWS, side="right")] += 1.0 - share
        self.was_missed = self.in_part | ((np.arange(len(logits)) > 0) & (np.arange(len(logits)) <= MISSES))

    def start(self, last_gone: float | None = None, last_light: float = 0.0) -> NDArray[np.float64]:
        """Return what is believed beforehand: level, slope, the classes' own, views, logits of what goes.

        With the share that goes before the last visit, or the logit by which that sees more, where another than the
        usual is to be tried.
        """
        own = np.zeros(self.n_own)
        own[self.of_light] = last_light / LIGHT_SPREAD
        believed = np.where(self.goes, self.share_gone, SHARE_GONE)
        if last_gone is not None:
            believed[-1:] = last_gone
        return np.concatenate([own, np.log(believed / (1.0 - believed))])

    def bounds(self, *, alike: bool, dark: bool = False) -> list[tuple[float, float]]:
        """Return how far from that each of it may be; visits that are `alike` do not differ, the last may be `dark`."""
        own = [(-FARTHEST, FARTHEST)] * self.n_own
        most = 0.0 if alike else FARTHEST_OFF
        own[self.of_visits] = [*[(-most, most)] * (2 * self.n_visits), (-DARKEST if dark else 0.0, 0.0)]
        return own + [FARTHEST_LEAVING] * (self.n_visits - 1)

    @property
    def n_own(self) -> int:
        """How many settings there are before those of what goes."""
        return int(self.of_visits.stop + N_SETTINGS)

    def __call__(self, told: NDArray[np.float64], share_false: float) -> tuple[float, NDArray[np.float64]]:
        """Return minus the log posterior and its gradient."""
        n_own = self.n_own
        chances, leaving, views = self._chances(told), self.leaving(told), self._views(told)
        rates = self._rates(told, share_false)
        ends, log_real, log_false, false = self._weighed(views, chances, leaving, rates)
        unseen_ends, log_unseen = _endings(leaving, np.full(len(self.n_at), -1), self._misses_at(chances))
        met = -np.expm1(log_unseen) + self.place_in_view @ rates
        real, missing = 1.0 - false, self.n_at * np.exp(log_unseen) / met
        value = np.logaddexp(log_real, log_false).sum() - self.n_at @ np.log(met)
        value += (self.closed_hits * np.log(chances) + self.closed_misses * np.log1p(-chances)).sum()
        value += self.n_closed * np.log1p(-leaving).sum()
        # Expected counts: of looks that saw and that missed, of fruits that went and that stayed.
        hits = self.closed_hits + _counts(self.classes, self.seen * real[:, None])
        misses = self.closed_misses + _counts(
            self.classes, (self.in_view & ~self.seen) * _hanging(ends) * real[:, None]
        )
        misses += _counts(self.place_classes, self.place_in_view * _hanging(unseen_ends) * missing[:, None])
        went = real @ ends[:, :-1] + missing @ unseen_ends[:, :-1]
        stayed = self.n_closed + real @ _hanging(ends) + missing @ _hanging(unseen_ends)
        of_logit = (hits - misses * chances / (1.0 - chances)) * (1.0 - chances / MOST_SEEING)
        of_rates = np.bincount(self.last, false, self.n_visits) - rates * (self.n_at / met @ self.place_in_view)
        of_classes = of_logit.sum(axis=0)
        of_classes[0] += of_rates.sum() * (1.0 - self._first_chance(told) / MOST_SEEING)
        of_chances = np.concatenate(
            [
                [LEVEL_SPREAD * of_classes.sum(), SLOPE_SPREAD * of_classes @ self.told],
                [IN_PART_SPREAD * of_classes @ self.in_part],
                OWN_SPREAD * of_classes,
                LEAVES_SPREAD * of_logit @ self.was_missed,
                FALSE_SPREAD * of_rates,
                [LIGHT_SPREAD * of_logit[-1].sum()],
            ]
        )
        again, of_again = self._again(told)
        value -= 0.5 * again**2
        of_chances[: 3 + len(self.told)] -= again * of_again
        seen_first = self.closed_views + self._first_sights(real, false)
        value += (self.closed_views * views.logs[:, :-1]).sum()
        goes = leaving[1:]
        of_belief, went_before, stayed_before = self._belief(goes)
        went, stayed = went[1:] + went_before, stayed[1:] + stayed_before
        value += of_belief
        normal, off = told[:n_own].copy(), told[self.of_visits]
        normal[self.of_visits] = 0.0
        value -= 0.5 * normal @ normal + np.log1p(off**2).sum()
        of_leaving = self.goes * (went * (1.0 - goes) - stayed * goes)
        gradient = np.concatenate([of_chances, views.slopes(seen_first), of_leaving])
        gradient[:n_own] -= normal
        gradient[self.of_visits] -= 2.0 * off / (1.0 + off**2)
        return -value, -gradient

    def _belief(self, goes: NDArray[np.float64]) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """Return the logarithm of the density of shares that go, (V - 1,), beforehand; and fruits of which it is worth.

        Densities of the logits: either a usual week or one in which people thin or pick. Fruits that went and that
        stayed, (V - 1,) each, as if they had been counted before any.
        """
        from scipy.special import betaln

        went, stayed = np.zeros((2, len(goes)))
        often, share = self.goes, self.share_gone[self.goes]
        left, kept = np.log(goes[often]), np.log1p(-goes[often])
        usual = BELIEF_GONE * share, BELIEF_GONE * (1.0 - share)
        cleared = CLEARED * share / SHARE_GONE
        of_usual = np.log1p(-cleared) + usual[0] * left + usual[1] * kept - betaln(*usual)
        of_cleared = np.log(cleared) + left + kept
        together = np.logaddexp(of_usual, of_cleared)
        is_usual = np.exp(of_usual - together)
        went[often], stayed[often] = (is_usual * each + 1.0 - is_usual for each in usual)
        return float(together.sum()), went, stayed

    def lives(self, told: NDArray[np.float64], share_false: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return for each fruit, (K,), that it has gone, if it is one, and that it never was one."""
        chances, leaving, views = self._chances(told), self.leaving(told), self._views(told)
        rates = self._rates(told, share_false)
        ends, _, _, false = self._weighed(views, chances, leaving, rates)
        ends, _, _, false = self._weighed(views, chances, self._leaving_places(leaving, ends, false), rates)
        gone, never = np.zeros(len(self.is_open)), np.zeros(len(self.is_open))
        gone[self.is_open], never[self.is_open] = 1.0 - ends[:, -1], false
        return gone, never

    def _leaving_places(
        self, leaving: NDArray[np.float64], ends: NDArray[np.float64], false: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the share that goes about each open fruit before each visit, (K, V), from those of all, (V,)."""
        went, stayed = np.zeros((len(self.is_open), self.n_visits)), np.ones((len(self.is_open), self.n_visits))
        went[self.is_open] = ends[:, :-1] * (1.0 - false)[:, None]
        stayed[self.is_open] = _hanging(ends) * (1.0 - false)[:, None]
        # What a visit missed beyond its own fruits, it may not have looked at: that says nothing of the place.
        went, stayed = went * self.went_by, stayed * self.went_by
        local = np.tile(leaving, (len(ends), 1))
        for visit in np.flatnonzero(leaving):
            shares = shares_of_places(went[:, visit], stayed[:, visit], float(leaving[visit]), self.about)
            local[:, visit] = np.where(self.in_view[:, visit], shares[self.is_open], leaving[visit])
        return local

    def room(self, told: NDArray[np.float64], share_false: float) -> float:
        """Return `ViewDensities.room` at the top of the log posterior."""
        chances, views = self._chances(told), self._views(told)
        false = self._weighed(views, chances, self.leaving(told), self._rates(told, share_false))[3]
        return views.room(*(_in_bins(self.first_views, each) for each in (false, false * (1.0 - false))))

    def _weighed(
        self,
        views: ViewDensities,
        chances: NDArray[np.float64],
        leaving: NDArray[np.float64],
        rates: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Weigh each open fruit, (K,), by the share that goes before each visit, (V,) or of each, (K, V).

        Return when it goes, as `_endings`; the logarithms of what speaks for a fruit and for none; that it is none.
        """
        logs, rows = np.stack([np.log1p(-chances), np.log(chances)]), np.arange(self.n_visits)
        looks = logs[self.seen.astype(np.int64), rows, self.classes]
        ends, log_real = _endings(leaving, self.last, np.where(self.in_view, looks, 0.0))
        log_real = log_real + views.logs[self.is_late, self.first_views]
        log_false = np.where(self.is_single, np.log(rates)[self.last] + views.logs[2, self.first_views], -np.inf)
        return ends, log_real, log_false, 1.0 / (1.0 + np.exp(log_real - log_false))

    def _first_sights(self, real: NDArray[np.float64], false: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how many first sights of each kind are in each bin, (3, B), as `ViewDensities` has them."""
        weights = (real * (1 - self.is_late), real * self.is_late, false)
        return np.stack([_in_bins(self.first_views, each) for each in weights])

    def _misses_at(self, chances: NDArray[np.float64]) -> NDArray[np.float64]:
        missing = np.log1p(-chances)[np.arange(self.n_visits), self.place_classes]
        return np.where(self.place_in_view, missing, 0.0)

    def _chances(self, told: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the chance of each visit to see a fruit of each class, (V, C)."""
        of_visits = LEAVES_SPREAD * told[self.of_leaves, None] * self.was_missed
        of_visits[-1] += LIGHT_SPREAD * told[self.of_light]
        return np.asarray(MOST_SEEING / (1.0 + np.exp(-self._logits(told) - of_visits)))

    def _again(self, told: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Return by how much more a usual second look sees of all fruits than a first, in its spread; and the slopes.

        Of level, slope, in part and the classes' own.
        """
        chances = MOST_SEEING / (1.0 + np.exp(-self._logits(told)))
        slopes = chances * (1.0 - chances / MOST_SEEING)
        first, missed, seen = chances[0], chances[1], float(self.once_seen @ chances)
        both = first * seen + (1.0 - first) * missed
        of_both, of_first = 1.0 / (both * (1.0 - both)), 1.0 / (first * (1.0 - first))
        of_chances = of_both * first * self.once_seen
        of_chances[:2] += of_both * (seen - missed) - of_first, of_both * (1.0 - first)
        of_logits = of_chances * slopes / AGAIN_SPREAD
        apart = float(np.log(both / (1.0 - both)) - np.log(first / (1.0 - first))) / AGAIN_SPREAD
        common = [LEVEL_SPREAD * of_logits.sum(), SLOPE_SPREAD * of_logits @ self.told]
        return apart, np.array([*common, IN_PART_SPREAD * of_logits @ self.in_part, *OWN_SPREAD * of_logits])

    def _logits(self, told: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the logits of the chances of a usual visit to see a fruit of each class, (C,), of `MOST_SEEING`."""
        common = LEVEL + LEVEL_SPREAD * told[0] + (SLOPE + SLOPE_SPREAD * told[1]) * self.told
        own = OWN_SPREAD * told[3:][: len(self.told)] + IN_PART_SPREAD * told[2] * self.in_part
        return np.asarray(common + own)

    def _first_chance(self, told: NDArray[np.float64]) -> float:
        """Return the chance of a usual visit to see a fruit at a first look."""
        return float(MOST_SEEING / (1.0 + np.exp(-self._logits(told)[0])))

    def _rates(self, told: NDArray[np.float64], share_false: float) -> NDArray[np.float64]:
        """Return how many false points each visit has beside each fruit that hangs, (V,)."""
        of_visits = FALSE_SPREAD * told[self.of_false]
        return np.asarray(share_false / (1.0 - share_false) * self._first_chance(told) * np.exp(of_visits))

    def leaving(self, told: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the share that goes before each visit, (V,); none before the first, nor between two of one date."""
        return np.concatenate([[0.0], self.goes / (1.0 + np.exp(-told[self.n_own :]))])

    def _views(self, told: NDArray[np.float64]) -> ViewDensities:
        return ViewDensities.of(told[self.n_own - N_SETTINGS : self.n_own])


def _counts(classes: NDArray[np.int64], weights: NDArray[np.generic]) -> NDArray[np.float64]:
    """Return the sum of the weights of looks, (K, V), of each visit and class, (V, C)."""
    n_visits, n_classes = classes.shape[1], len(CHANCES_OF_SEEING)
    cells = classes + n_classes * np.arange(n_visits)
    counted = np.bincount(cells.ravel(), weights.ravel().astype(np.float64), n_visits * n_classes)
    return counted.reshape(n_visits, n_classes).astype(np.float64)


def _in_bins(bins: NDArray[np.int64], weights: NDArray[np.generic]) -> NDArray[np.float64]:
    """Return the sum of the weights of the first sights in each bin, (B,), but for those that nobody counted."""
    return np.bincount(bins - UNCOUNTED, weights.astype(np.float64), N_BINS + 1)[1:].astype(np.float64)


def _endings(
    leaving: NDArray[np.float64], last: NDArray[np.int64], logs: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return probabilities of going before each visit, the last column for never, (K, V + 1); and their log sum.

    `leaving`, (V,) or (K, V), are the shares that go before each visit; `logs`, (K, V), are of what each look saw or
    missed; up to the visit `last` the fruit hangs for sure.
    """
    at_first = np.zeros((*leaving.shape[:-1], 1))
    stayed = np.concatenate([at_first, np.cumsum(np.log1p(-leaving), axis=-1)], axis=-1)
    with np.errstate(divide="ignore"):
        going = np.concatenate([np.log(leaving), at_first], axis=-1) + stayed
    weights = np.concatenate([np.zeros((len(logs), 1)), np.cumsum(logs, axis=1)], axis=1) + going
    weights = np.where(np.arange(logs.shape[1] + 1) > last[:, None], weights, -np.inf)
    most = weights.max(axis=1, keepdims=True, initial=-np.inf)
    weights = np.exp(weights - most)
    total = weights.sum(axis=1, keepdims=True)
    return weights / total, (most + np.log(total))[:, 0]


def _hanging(ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the probability that each fruit hangs on each visit, (K, V)."""
    return np.asarray(1.0 - np.cumsum(ends, axis=1)[:, :-1])
