"""From which side a visit looked, where nobody says: what leaves hide from one side may hang free for the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pomona.identity.histories import histories_of
from pomona.identity.lives import UNEVEN, explained
from pomona.identity.looks import Looks

__all__ = ["sided"]


def sided(looks: Looks, days: NDArray[np.float64]) -> Looks:
    """Return looks with two sides for visits of which nobody knows any, where that explains what was seen far better.

    Where cameras or covariances tell the side of a visit it is as they say; those that agree with it look from there.
    """
    untold = np.asarray(np.isnan(looks.towards).all(axis=(0, 2)), bool)
    if not untold.any():
        return looks
    told = _from(looks, _sides_by_agreement(looks), untold)
    as_one, as_two = (histories_of(each, days) for each in (looks, told))
    # By a glance first: most visits are of one side.
    for at_a_glance in (True, False):
        if explained(as_two, at_a_glance=at_a_glance) <= explained(as_one, at_a_glance=at_a_glance) + UNEVEN:
            return looks
    return told


def _sides_by_agreement(looks: Looks) -> NDArray[np.float64]:
    """Return the side of each visit, (V,) of 1 and -1: those of one side see the same fruits and miss the same.

    By the signs of the first principal axis of how visits are correlated (a cut of their graph in two, relaxed).
    """
    off = np.where(looks.in_view, looks.seen - looks.seen.sum(axis=0) / np.maximum(looks.in_view.sum(axis=0), 1), 0.0)
    lengths = np.maximum(np.linalg.norm(off, axis=0), 1e-9)
    agreement = off.T @ off / np.outer(lengths, lengths)
    np.fill_diagonal(agreement, 0.0)
    axis = np.linalg.eigh(agreement)[1][:, -1]
    return np.where(axis * axis[0] < 0.0, -1.0, 1.0)


def _from(looks: Looks, side: NDArray[np.float64], untold: NDArray[np.bool_]) -> Looks:
    """Return looks with those of which nobody knows from these sides, (V,) of 1 and -1: 1 is where the others say."""
    known = side[~untold, None] * looks.towards[:, ~untold]
    known = known[~np.isnan(known).any(axis=-1)]
    first = known.mean(axis=0) if len(known) else np.array([0.0, 1.0, 0.0])
    towards = looks.towards.copy()
    towards[:, untold] = side[untold, None] * first / max(float(np.linalg.norm(first)), 1e-9)
    return replace(looks, towards=towards)
