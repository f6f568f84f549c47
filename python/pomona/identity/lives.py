"""Which fruits are gone, and which never were: what follows from the visits that looked and did not see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Lives", "lives_of", "states_of"]

ROUNDS = 60
"""Of expectation and maximisation; the shares move by less than 1e-3 after 40."""

SHARE_GONE = 0.02
"""Of the fruits that go between two visits, before the season says its own."""

BELIEF_GONE = 25.0
"""Fruits that this belief is worth: few against the hundreds of a row, so that thinning shows."""

SHARE_FALSE = 0.05
"""Of a visit's fruits that are none."""

BELIEF_FALSE = 50.0

CHANCES_OF_SEEING = np.array([0.62, 0.20, 0.25, 0.35, 0.45, 0.55, 0.65, 0.78, 0.88, 0.95, 0.98])
"""Of a fruit that hangs where a visit looks, by its `visibility_classes`: what to believe before the season says its
own. Low where a fruit was hardly seen before: those that hide for good are seldom among the fruits that tell."""

BELIEF_SEEING = 20.0
"""Looks that this belief is worth."""

MOST_SEEING = 0.985
"""A detector misses fruits that hang free, too."""

SAID_GONE = 0.35
"""Probability from which a fruit is called gone. Below even, for nine in ten of those that are gone shall be found, and
of those that hang one in fifty may be called so: fruits that hung deep in the leaves leave more doubt than that."""


@dataclass(frozen=True, eq=False)
class Lives:
    """What became of each fruit.

    Attributes
    ----------
    gone : (K,) float64
        Probability that it no longer hangs on the day of the newest visit.
    false : (K,) float64
        Probability that it never was a fruit; zero when two visits saw it.
    """

    gone: NDArray[np.float64]
    false: NDArray[np.float64]


def lives_of(seen: NDArray[np.bool_], in_view: NDArray[np.bool_], classes: NDArray[np.int64]) -> Lives:
    r"""Weigh for each fruit that it has gone against that it hides.

    Of a fruit last seen by visit $l$ the others after it say, with the chance $m_v$ that visit $v$ misses it and the
    share $h_v$ of fruits that go before visit $v$: it went before $t$ with weight
    $h_t \prod_{v=l+1}^{t-1} (1 - h_v)\, m_v$, or hangs with $\prod_{v>l} (1 - h_v)\, m_v$.
    A fruit that one visit saw alone may be none: false points are as many as the share $f$ of the visit's fruits,
    real ones that only this visit would see as many as there are fruits, those that no visit saw among them, times
    the chance of that. $h$, $f$ and the chances of seeing are those that explain all fruits best: the looks that missed
    a fruit after it was last seen count as far as it hung then. Were they left out, fruits would seem easier to see
    than they are, as those that hide for long would not be among them.

    Parameters
    ----------
    seen, in_view : (K, V)
        As in `Looks`.
    classes : (K, V)
        `visibility_classes`.
    """
    n_visits = seen.shape[1]
    order = np.arange(n_visits)
    first, last = seen.argmax(axis=1), n_visits - 1 - seen[:, ::-1].argmax(axis=1)
    later = order > first[:, None]
    seen_later = np.bincount(classes[seen & later], minlength=len(CHANCES_OF_SEEING))
    is_single, n_seen = seen.sum(axis=1) == 1, seen.sum(axis=0)
    leaving, share_false = np.full(n_visits, SHARE_GONE), SHARE_FALSE
    false, chances = np.where(is_single, SHARE_FALSE, 0.0), CHANCES_OF_SEEING
    for _ in range(ROUNDS):
        logs = np.where(in_view, np.log1p(-chances)[classes], 0.0)
        ends, log_evidence = _ends(leaving, first, last, logs)
        n_real = np.sum((1.0 - false) / _seen_at_all(logs))
        n_false_here = share_false * n_seen[first]
        n_real_here = n_real * np.exp(_only_here(first, logs) + log_evidence)
        false = np.where(is_single, n_false_here / (n_false_here + n_real_here), 0.0)
        share_false = (false.sum() + BELIEF_FALSE * SHARE_FALSE) / (n_seen.sum() + BELIEF_FALSE)
        leaving = _leaving(ends, first, 1.0 - false)
        looked = (later & in_view) * _hanging(ends, last) * (1.0 - false)[:, None]
        chances = _chances(seen_later, classes, looked)
    return Lives(gone=1.0 - ends[:, -1], false=false)


def _seen_at_all(logs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the chance that some visit sees each fruit, (K,): beside one that is seen are those that all missed."""
    return np.asarray(-np.expm1(logs.sum(axis=1)))


def _only_here(first: NDArray[np.int64], logs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the log chance that the visits before miss each fruit and the first one sees it, (K,)."""
    before = np.where(np.arange(logs.shape[1]) < first[:, None], logs, 0.0).sum(axis=1)
    return np.asarray(before + np.log(-np.expm1(logs[np.arange(len(first)), first])))


def _hanging(ends: NDArray[np.float64], last: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the probability that each fruit hangs on each visit from its first on, (K, V)."""
    goes_later = np.cumsum(ends[:, :0:-1], axis=1)[:, ::-1]
    return np.where(np.arange(ends.shape[1] - 1) > last[:, None], goes_later, 1.0)


def _chances(n_seen: NDArray[np.int64], classes: NDArray[np.int64], looked: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the chance of seeing a fruit of each class, (C,); `looked` at, as far as it hung, (K, V)."""
    n_looked = np.bincount(classes.ravel(), looked.ravel(), len(n_seen)).astype(np.float64)
    learnt = (n_seen + BELIEF_SEEING * CHANCES_OF_SEEING) / (n_looked + BELIEF_SEEING)
    return np.asarray(np.minimum(learnt, MOST_SEEING))


def _ends(
    leaving: NDArray[np.float64], first: NDArray[np.int64], last: NDArray[np.int64], logs_missing: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return probabilities of going before each visit, the last column for never, (K, V + 1); and log evidence."""
    n_fruits, n_visits = logs_missing.shape
    stayed = np.concatenate([[0.0], np.cumsum(np.log1p(-leaving))])
    # What the last visit saw hangs.
    ends, log_evidence = np.zeros((n_fruits, n_visits + 1)), stayed[-1] - stayed[first + 1]
    ends[:, -1] = 1.0
    is_open = last < n_visits - 1
    hidden = np.zeros((np.count_nonzero(is_open), n_visits + 1))
    unseen = np.arange(n_visits + 1) > last[is_open, None]
    np.cumsum(np.where(unseen[:, :-1], logs_missing[is_open], 0.0), axis=1, out=hidden[:, 1:])
    logs = hidden + stayed - stayed[first[is_open] + 1][:, None]
    logs[:, :n_visits] += np.log(leaving)
    logs = np.where(unseen, logs, -np.inf)
    most = logs.max(axis=1, keepdims=True, initial=-np.inf)
    weights = np.exp(logs - most)
    total = weights.sum(axis=1, keepdims=True)
    ends[is_open], log_evidence[is_open] = weights / total, (most + np.log(total))[:, 0]
    return ends, log_evidence


def _leaving(ends: NDArray[np.float64], first: NDArray[np.int64], real: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the share of the fruits there that go before each visit, (V,)."""
    n_visits = ends.shape[1] - 1
    leaving = np.full(n_visits, SHARE_GONE)
    # Of each fruit, that it goes before a visit or later.
    still = np.cumsum(ends[:, ::-1], axis=1)[:, ::-1]
    for visit in range(1, n_visits):
        known = (first < visit) * real
        n_going, n_there = known @ ends[:, visit], known @ still[:, visit]
        leaving[visit] = (n_going + BELIEF_GONE * SHARE_GONE) / (n_there + BELIEF_GONE)
    return leaving


def states_of(
    seen: NDArray[np.bool_], in_view: NDArray[np.bool_], lives: Lives
) -> tuple[list[str], NDArray[np.float64]]:
    """Return the state of each fruit, and its probability.

    `seen` by the last visit that looked there; `new` when that is its only sight and visits before had looked there;
    else `gone` with a probability of `SAID_GONE` and more, or `missed`.
    """
    n_visits = seen.shape[1]
    last_look = n_visits - 1 - in_view[:, ::-1].argmax(axis=1)
    is_seen = seen[np.arange(len(seen)), last_look]
    is_new = is_seen & (seen.sum(axis=1) == 1) & (in_view.sum(axis=1) > 1)
    is_gone = ~is_seen & (lives.gone > SAID_GONE)
    states = np.select([is_new, is_seen, is_gone], ["new", "seen", "gone"], "missed")
    probabilities = np.select([is_seen, is_gone], [1.0 - lives.false, lives.gone], 1.0 - lives.gone)
    return states.tolist(), probabilities
