"""From which side a visit looked, where nobody says: what leaves hide from one side may hang free for the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pomona.identity.histories import histories_of
from pomona.identity.lives import explained
from pomona.identity.looks import Looks

__all__ = ["sided"]

TWO_SIDED = 7.0
"""Nats by which two sides have to explain all better than one. Visits of one side, with rows thinned, picked, dark or
halved between them, parted into two, had up to 6.1 (340 times); true ones mostly have more from the fourth visit on."""


def sided(looks: Looks, days: NDArray[np.float64]) -> Looks:
    """Return looks with two sides for visits of which nobody knows any, where that explains what was seen far better.

    Where cameras or covariances tell the side of a visit it is as they say; those that agree with it look from there.
    """
    untold = np.asarray(np.isnan(looks.towards).all(axis=(0, 2)), bool)
    if not untold.any():
        return looks
    as_one = histories_of(looks, days)
    parted = [_from(looks, sides, untold) for sides in _sides_by_agreement(looks)]
    as_two = [histories_of(each, days) for each in parted]
    # By a glance first: most visits are of one side.
    glances = [explained(each, at_a_glance=True) for each in as_two]
    best = int(np.argmax(glances))
    if glances[best] <= explained(as_one, at_a_glance=True) + TWO_SIDED:
        return looks
    return parted[best] if explained(as_two[best]) > explained(as_one) + TWO_SIDED else looks


def _sides_by_agreement(looks: Looks) -> list[NDArray[np.float64]]:
    """Return how visits may be parted in sides, (V,) of 1 and -1 each: those of one see the same and miss the same.

    By the signs of the first principal axis of how visits are correlated (a cut of their graph in two, relaxed): as
    they are, and less what all are, for what hangs free is seen from either side.
    """
    off = np.where(looks.in_view, looks.seen - looks.seen.sum(axis=0) / np.maximum(looks.in_view.sum(axis=0), 1), 0.0)
    lengths = np.maximum(np.linalg.norm(off, axis=0), 1e-9)
    agreement = off.T @ off / np.outer(lengths, lengths)
    each_other = ~np.eye(len(agreement), dtype=bool)
    np.fill_diagonal(agreement, agreement[each_other].mean() if each_other.any() else 0.0)
    centred = agreement - agreement.mean(axis=0)
    centred -= centred.mean(axis=1)[:, None]
    axes = (np.linalg.eigh(each)[1][:, -1] for each in (agreement, centred))
    first, second = (np.where(axis * axis[0] < 0.0, -1.0, 1.0) for axis in axes)
    return [first] if np.array_equal(first, second) else [first, second]


def _from(looks: Looks, side: NDArray[np.float64], untold: NDArray[np.bool_]) -> Looks:
    """Return looks with those of which nobody knows from these sides, (V,) of 1 and -1: 1 is where the others say."""
    known = side[~untold, None] * looks.towards[:, ~untold]
    known = known[~np.isnan(known).any(axis=-1)]
    first = known.mean(axis=0) if len(known) else np.array([0.0, 1.0, 0.0])
    towards = looks.towards.copy()
    towards[:, untold] = side[untold, None] * first / max(float(np.linalg.norm(first)), 1e-9)
    return replace(looks, towards=towards)
