"""Which fruits are gone, and which never were: what follows from the visits that looked and did not see."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pomona.identity.histories import Histories, HistoryOdds

__all__ = ["SHARE_FALSE", "Lives", "explained", "lives_of", "states_of"]

SHARE_FALSE = 0.05
"""Of a visit's points that are no fruits: what is believed before the season says its own."""

BELIEF_FALSE = 12.0
"""Points that this belief is worth: one detector has none, another three in ten, and two visits cannot tell which."""

SHARES_FALSE = np.array([0.0005, 0.005, 0.018, 0.05, 0.08, 0.12, 0.18, 0.26, 0.36])
"""Where the posterior of the share is asked; between them its logarithm is interpolated."""

USUAL_FALSE = 3
"""Of these the one at which to begin."""

HARDLY = 12.0
"""Logarithm of odds from which a share, and what lies beyond it, counts no more."""

UNEVEN = 12.0
"""Nats by which visits that differ have to explain all better than visits that are alike: most are, and classes of
fruits that hide are no exact model, so a few nats are no proof."""

HALF_GONE = 0.5
"""Share that goes before the last visit where the search begins a second time: of two visits nobody can tell whether
half went, or hides from one of them, and both explain all well."""

DARK = -1.2
"""Logit by which the last visit sees less where it begins a third time: of each class as much, and where fruits went
as many of each. Five visits before it tell the one from the other, two hardly."""

OTHER = 0.1
"""By how much shares that go differ, at least, where a second search ended elsewhere."""

FINE = 400
"""Steps in which the interpolated posterior is summed up."""

SAID_GONE = 0.35
"""Probability from which a fruit is called gone. Below even, for nine in ten of those that are gone shall be found, and
of those that hang one in fifty may be called so: fruits that hung deep in the leaves leave more doubt than that."""

MOST_WRONGLY_GONE = 0.06
"""Of the fruits that hang, the share that may be called gone by what is expected, which is twice of what comes: after
two visits half of what was missed may be gone, and nobody can say which half."""

LEVEL = 0.01
"""Probabilities that differ by less are of fruits that are gone as surely."""


Top = tuple[float, NDArray[np.float64]]
"""Log posterior of a share of false points, and what fits it best."""

Bounds = list[tuple[float, float]]
"""Of each setting."""

Fits = dict[int, Top]
"""Of each share that counts, by its number."""


@dataclass(frozen=True, eq=False)
class Lives:
    """What became of each fruit.

    Attributes
    ----------
    gone : (K,) float64
        Probability that it no longer hangs on the day of the newest visit, if it is a fruit.
    false : (K,) float64
        Probability that it never was a fruit; when two visits saw it, that it is a thing that stays as it is.
    """

    gone: NDArray[np.float64]
    false: NDArray[np.float64]

    def with_emptied(self, emptied: NDArray[np.float64]) -> Lives:
        """Return it with what hung where stretches may have been emptied, (K, V) as `Looks.emptied`, gone as surely."""
        return Lives(np.maximum(self.gone, emptied.max(axis=1, initial=0.0)), self.false)

    def with_still(self, still: NDArray[np.float64]) -> Lives:
        """Return it with what may be things that stay as they are, (K,) probabilities as `still_chances`."""
        return Lives(self.gone, 1.0 - (1.0 - self.false) * (1.0 - still))


def lives_of(histories: Histories) -> Lives:
    r"""Weigh for each fruit that it has gone, or never was, against that it hides.

    Of a fruit last seen by visit $l$ the others after it say, with the chance $m_v$ that visit $v$ misses it and the
    share $h_v$ of fruits that go before visit $v$: it went before $t$ with weight
    $h_t \prod_{v=l+1}^{t-1} (1 - h_v)\, m_v$, or hangs with $\prod_{v>l} (1 - h_v)\, m_v$.
    A fruit that one visit saw alone may be none. How many are, two visits cannot tell from how many hide: as many are
    seen once either way. So the share of false points is not guessed but summed over, from none to a third, each by how
    likely it makes what was seen at the chances of seeing and the shares of going that explain it best (`HistoryOdds`).
    In how many frames false points are seen is summed over, too: what fits best fits many of them better by chance.
    """
    odds = HistoryOdds(histories)
    ways, _ = _best_ways(odds)
    gone, false = np.zeros(len(histories.seen)), np.zeros(len(histories.seen))
    for fits, weights in zip(ways, _weights(ways), strict=True):
        for number, weight in weights.items():
            gone_then, false_then = odds.lives(fits[number][1], SHARES_FALSE[number])
            gone += weight * gone_then
            false += weight * false_then
    return Lives(gone, false)


def explained(histories: Histories, *, at_a_glance: bool = False) -> float:
    """Return how well all is explained by what explains it best, nats; or by the usual share of false points alone."""
    odds = HistoryOdds(histories)
    if not at_a_glance:
        return _best_ways(odds)[1]
    with _one_thread():
        return _climbed(odds, SHARES_FALSE[USUAL_FALSE], odds.start(), odds.bounds(alike=True))[0]


def _one_thread() -> AbstractContextManager[object]:
    """L-BFGS-B asks BLAS for small matrices: threads that wait for each other cost more than they bring."""
    import scipy.optimize  # noqa: F401 - only what is loaded can be limited
    from threadpoolctl import threadpool_limits

    limited: AbstractContextManager[object] = threadpool_limits(1, user_api="blas")
    return limited


def _best_ways(odds: HistoryOdds) -> tuple[list[Fits], float]:
    """Return what fits best, of visits that are alike or, where that explains far more, that differ; and how well."""
    with _one_thread():
        ways, uneven = (_ways(odds, alike=alike) for alike in (True, False))
    best, best_uneven = (max(map(_best, each)) for each in (ways, uneven))
    return (uneven, best_uneven - UNEVEN) if best_uneven - best > UNEVEN else (ways, best)


def _ways(odds: HistoryOdds, *, alike: bool) -> list[Fits]:
    """Return what fits best as a rule, and what does where half went before the last visit, or where that saw less.

    As far as these are other ways: by the shares that go. Whether it was dark is asked where many seem to have gone.
    """
    climbed = partial(_climbed, odds, SHARES_FALSE[USUAL_FALSE])
    usual, dark = odds.bounds(alike=alike), odds.bounds(alike=alike, dark=True)
    tops = [(climbed(start, usual), usual) for start in (odds.start(), odds.start(HALF_GONE))]
    if max(odds.leaving(told)[-1] for (_, told), _ in tops) > OTHER:
        tops.append((climbed(odds.start(last_light=DARK), dark), dark))
    ways: list[tuple[Top, Bounds]] = []
    for top, bounds in tops:
        if all(np.abs(odds.leaving(top[1]) - odds.leaving(told)).max() > OTHER for (_, told), _ in ways):
            ways.append((top, bounds))
    return [_fits(odds, *way) for way in ways]


def _fits(odds: HistoryOdds, usual: Top, bounds: Bounds) -> Fits:
    """Follow the top at the usual share to those of all shares that count."""
    fits = {USUAL_FALSE: usual}
    best = usual[0]
    for numbers in (range(USUAL_FALSE - 1, -1, -1), range(USUAL_FALSE + 1, len(SHARES_FALSE))):
        told = usual[1]
        for number in numbers:
            fits[number] = _climbed(odds, SHARES_FALSE[number], told, bounds)
            best, told = max(best, fits[number][0]), fits[number][1]
            if fits[number][0] < best - HARDLY:
                break
    return dict(sorted(fits.items()))


def _best(fits: Fits) -> float:
    return max(log_posterior for log_posterior, _ in fits.values())


def _climbed(odds: HistoryOdds, share: float, told: NDArray[np.float64], bounds: Bounds) -> Top:
    """Return the log posterior of a share, by the top at this share from `told` on, and where that is."""
    from scipy.optimize import minimize

    # A step remembered for each setting: settings hang together, and with ten steps it takes twice as many looks.
    top = minimize(
        odds, told, (share,), jac=True, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-8, "maxcor": len(told)}
    )
    belief = SHARE_FALSE * BELIEF_FALSE * np.log(share) + ((1.0 - SHARE_FALSE) * BELIEF_FALSE - 1.0) * np.log1p(-share)
    return float(belief - top.fun - odds.room(top.x, share)), top.x


def _weights(ways: list[Fits]) -> list[dict[int, float]]:
    """Return the weights of the shares of each way: integrals over their logarithm of what is linear between them."""
    from scipy.interpolate import PchipInterpolator

    most, weights = max(map(_best, ways)), []
    for fits in ways:
        logs = np.log(SHARES_FALSE[list(fits)])
        fine = np.linspace(logs[0], logs[-1], FINE)
        density = np.exp(PchipInterpolator(logs, [log_posterior for log_posterior, _ in fits.values()])(fine) - most)
        density *= (logs[-1] - logs[0]) / FINE
        weights.append(
            {number: float(np.interp(fine, logs, logs == logs[at]) @ density) for at, number in enumerate(fits)}
        )
    total = sum(sum(each.values()) for each in weights)
    return [{number: weight / total for number, weight in each.items()} for each in weights]


def states_of(
    seen: NDArray[np.bool_], in_view: NDArray[np.bool_], lives: Lives
) -> tuple[list[str], NDArray[np.float64]]:
    """Return the state of each fruit, and its probability.

    That a fruit `seen` or `new` is one and hangs: it may have gone since, before a visit that looked elsewhere.
    `seen` by the last visit that looked there; `new` when that is its only sight and visits before had looked there;
    else `gone` with a probability of `SAID_GONE` and more, as far as `MOST_WRONGLY_GONE` allows, or `missed`.
    """
    n_visits = seen.shape[1]
    last_look = n_visits - 1 - in_view[:, ::-1].argmax(axis=1)
    is_seen = seen[np.arange(len(seen)), last_look]
    is_new = is_seen & (seen.sum(axis=1) == 1) & (in_view.sum(axis=1) > 1)
    is_gone = ~is_seen & (lives.gone > _least_gone(lives.gone, ~is_seen))
    states = np.select([is_new, is_seen, is_gone], ["new", "seen", "gone"], "missed")
    hangs = 1.0 - lives.gone
    probabilities = np.select([is_seen, is_gone], [(1.0 - lives.false) * hangs, lives.gone], hangs)
    return states.tolist(), probabilities


def _least_gone(gone: NDArray[np.float64], is_unseen: NDArray[np.bool_]) -> float:
    """Return the probability above which the fruits that were not seen are called gone.

    Of fruits that are gone as surely all are called so, or none: all where half of them may.
    """
    levels, which = np.unique(gone[is_unseen] // LEVEL, return_inverse=True)
    wrongly = np.bincount(which, 1.0 - gone[is_unseen], len(levels))[::-1]
    beyond = levels[::-1][np.cumsum(wrongly) - 0.5 * wrongly > MOST_WRONGLY_GONE * (1.0 - gone).sum()]
    return max(SAID_GONE, float(beyond[0] + 1.0) * LEVEL) if len(beyond) else SAID_GONE
