"""Which fruits of a map still hang, for all that it knows, and which tell where trees stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud

__all__ = ["LIKELY", "are_things", "fruit_chances", "hang_chances", "may_hang", "tell_trees"]

LIKELY = 0.5
"""Probability of being a fruit above which one that was missed is one."""


def may_hang(fruits: FruitCloud) -> NDArray[np.bool_]:
    """Tell the fruits, (N,), that are neither gone nor, once missed, likelier no fruit at all.

    Parameters
    ----------
    fruits : FruitCloud
        Of a map, with the columns ``state`` and ``fruit_probability``; what they do not say speaks for it.
    """
    unsaid = ("",) * len(fruits)
    states, chances = (fruits.extras.get(name, unsaid) for name in ("state", "fruit_probability"))
    judged = zip(states, chances, strict=True)
    return np.array([state != "gone" and (state != "missed" or float(p or 1) > LIKELY) for state, p in judged], bool)


def are_things(fruits: FruitCloud) -> NDArray[np.bool_]:
    """Tell what several visits saw and is likelier no fruit, (N,): a thing that stays as it is.

    Parameters
    ----------
    fruits : FruitCloud
        Of a map, with the columns ``n_sessions`` and ``fruit_probability``; what they do not say speaks for a fruit.
    """
    counts = np.array([int(one or 1) for one in fruits.extras.get("n_sessions", ("",) * len(fruits))], np.int64)
    return np.asarray((counts > 1) & (fruit_chances(fruits) <= LIKELY))


def fruit_chances(fruits: FruitCloud) -> NDArray[np.float64]:
    """Probability of each point of a map, (N,), that it is a fruit; 1 where ``fruit_probability`` does not say."""
    return np.array([float(one or 1) for one in fruits.extras.get("fruit_probability", ("",) * len(fruits))], float)


def hang_chances(fruits: FruitCloud) -> NDArray[np.float64]:
    """Probability of each point, (N,), that it is a fruit and hangs.

    ``state_probability`` of `missed` and `gone` is told of what is a fruit: that it hangs, and that it does not. Of
    `seen` and `new` it is that it is a fruit and hangs, so it is no more than ``fruit_probability``: what a later visit
    that looked elsewhere learned of the share that goes counts there, too.

    Parameters
    ----------
    fruits : FruitCloud
        Of a map, with the columns ``state``, ``state_probability`` and ``fruit_probability``; a state or a probability
        that they do not say is taken for sure.
    """
    unsaid = ("",) * len(fruits)
    states, of_states, of_fruits = (
        fruits.extras.get(name, unsaid) for name in ("state", "state_probability", "fruit_probability")
    )
    told = np.array(states)
    sure, real = (np.array([float(one or 1) for one in each], np.float64) for each in (of_states, of_fruits))
    missed, gone = told == "missed", told == "gone"
    return np.asarray(np.select([missed, gone], [real * sure, real * (1.0 - sure)], np.minimum(real, sure)))


def tell_trees(states: Sequence[str], chances: Sequence[float | None]) -> NDArray[np.bool_]:
    """Tell the fruits, (N,), that say where trees stand.

    Those that are gone do. What was seen once, looked for in vain and is likelier no fruit does not.

    Parameters
    ----------
    states : sequence of N str
    chances : sequence of N float or None
        Probability of being a fruit; None where nothing was said.
    """
    judged = zip(states, chances, strict=True)
    return np.array([p is None or p > LIKELY or state in ("new", "seen") for state, p in judged], bool)
