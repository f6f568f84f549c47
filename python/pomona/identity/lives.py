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

SAID_GONE = 0.52
"""Probability from which a fruit is called gone: a little more than even, as of the living no more than one in fifty
shall be called so."""


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


def lives_of(seen: NDArray[np.bool_], missing: NDArray[np.float64]) -> Lives:
    r"""Weigh for each fruit that it has gone against that it hides.

    Of a fruit last seen by visit $l$ the others after it say, with the chance $m_v$ that visit $v$ misses it and the
    share $h_v$ of fruits that go before visit $v$: it went before $t$ with weight
    $h_t \prod_{v=l+1}^{t-1} (1 - h_v)\, m_v$, or hangs with $\prod_{v>l} (1 - h_v)\, m_v$.
    A fruit that one visit saw alone may be none: false points are as many as the share $f$ of the visit's fruits,
    real ones that only this visit would see as many as there are fruits, those that no visit saw among them, times
    the chance of that. $h$ and $f$ are those that explain all fruits best.

    Parameters
    ----------
    seen : (K, V)
        As in `Looks`.
    missing : (K, V)
        `chances_of_missing`.
    """
    n_fruits, n_visits = seen.shape
    order = np.arange(n_visits)
    first, last = seen.argmax(axis=1), n_visits - 1 - seen[:, ::-1].argmax(axis=1)
    logs = np.log(missing)
    hidden = np.zeros((n_fruits, n_visits + 1))
    hidden[:, 1:] = np.cumsum(np.where(order > last[:, None], logs, 0.0), axis=1)
    only_here = np.where(order < first[:, None], logs, 0.0).sum(axis=1) + np.log1p(-missing[np.arange(n_fruits), first])
    is_single = seen.sum(axis=1) == 1
    # For each fruit that some visit saw there are those that all of them missed.
    seen_at_all = -np.expm1(logs.sum(axis=1))
    n_seen = seen.sum(axis=0)
    leaving = np.full(n_visits, SHARE_GONE)
    share_false = SHARE_FALSE
    false = np.where(is_single, SHARE_FALSE, 0.0)
    # What the last visit saw hangs: nothing is open, and nothing of it is weighed.
    is_open = last < n_visits - 1
    open_first, open_last, open_hidden = first[is_open], last[is_open], hidden[is_open]
    n_hanging = np.array([np.sum(~is_open & (first < visit)) for visit in range(n_visits)])
    log_evidence = np.zeros(n_fruits)
    for _ in range(ROUNDS):
        ends, log_evidence[is_open] = _ends(leaving, open_first, open_last, open_hidden)
        log_evidence[~is_open] = _log_staying(leaving, first[~is_open])
        n_real = np.sum((1.0 - false) / seen_at_all)
        n_false_here = share_false * n_seen[first]
        n_real_here = n_real * np.exp(only_here + log_evidence)
        false = np.where(is_single, n_false_here / (n_false_here + n_real_here), 0.0)
        share_false = (false.sum() + BELIEF_FALSE * SHARE_FALSE) / (n_seen.sum() + BELIEF_FALSE)
        leaving = _leaving(ends, open_first, 1.0 - false[is_open], n_hanging)
    gone = np.zeros(n_fruits)
    gone[is_open] = 1.0 - ends[:, -1]
    return Lives(gone=gone, false=false)


def _log_staying(leaving: NDArray[np.float64], first: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return how likely fruits stay from the visit that saw them first to the last one, (K,), as logarithms."""
    stayed = np.concatenate([[0.0], np.cumsum(np.log1p(-leaving))])
    return np.asarray(stayed[-1] - stayed[first + 1])


def _ends(
    leaving: NDArray[np.float64], first: NDArray[np.int64], last: NDArray[np.int64], hidden: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return probabilities of going before each visit, the last column for never, (K, V + 1); and log evidence."""
    n_visits = len(leaving)
    stayed = np.concatenate([[0.0], np.cumsum(np.log1p(-leaving))])
    logs = hidden + stayed - stayed[first + 1][:, None]
    logs[:, :n_visits] += np.log(leaving)
    logs = np.where(np.arange(n_visits + 1) > last[:, None], logs, -np.inf)
    most = logs.max(axis=1, keepdims=True)
    weights = np.exp(logs - most)
    total = weights.sum(axis=1, keepdims=True)
    return weights / total, (most + np.log(total))[:, 0]


def _leaving(
    ends: NDArray[np.float64], first: NDArray[np.int64], real: NDArray[np.float64], n_hanging: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the share of the fruits there that go before each visit, (V,); others hang for sure, so many, (V,)."""
    n_visits = ends.shape[1] - 1
    leaving = np.full(n_visits, SHARE_GONE)
    # Of each fruit, that it goes before a visit or later.
    still = np.cumsum(ends[:, ::-1], axis=1)[:, ::-1]
    for visit in range(1, n_visits):
        known = (first < visit) * real
        n_going, n_there = known @ ends[:, visit], known @ still[:, visit] + n_hanging[visit]
        leaving[visit] = (n_going + BELIEF_GONE * SHARE_GONE) / (n_there + BELIEF_GONE)
    return leaving


def states_of(
    seen: NDArray[np.bool_], in_view: NDArray[np.bool_], lives: Lives
) -> tuple[list[str], NDArray[np.float64]]:
    """Return the state of each fruit, and its probability.

    `seen` by the last visit that looked there; `new` when that is its only sight and visits before had looked there;
    else `gone` or `missed`, whichever is likelier.
    """
    n_visits = seen.shape[1]
    last_look = n_visits - 1 - in_view[:, ::-1].argmax(axis=1)
    is_seen = seen[np.arange(len(seen)), last_look]
    is_new = is_seen & (seen.sum(axis=1) == 1) & (in_view.sum(axis=1) > 1)
    is_gone = ~is_seen & (lives.gone > SAID_GONE)
    states = np.select([is_new, is_seen, is_gone], ["new", "seen", "gone"], "missed")
    probabilities = np.select([is_seen, is_gone], [1.0 - lives.false, lives.gone], 1.0 - lives.gone)
    return states.tolist(), probabilities
