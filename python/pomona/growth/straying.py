r"""How the growth of a block strays from its curve: spells of faster and slower growth, which all its fruits share.

No family knows a drought or a cool September. The relative growth of a day is off by $\sigma_u u(t)$, with $u$ of
variance 1 and the correlation $e^{-|t - t'| / \ell}$: a spell lasts some weeks, and what it took stays lost. The
logarithm of a size is then off by the sum from the first visit on,
$\delta(t) = \sigma_u \int_{t_1}^{t} u\,\mathrm{d}s$, of which the covariance is known in closed form (an integrated
Ornstein-Uhlenbeck process). Beyond the last visit it widens with every day.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["SPELL_DAYS", "straying", "straying_root"]

Numbers = NDArray[np.float64]

SPELL_DAYS = 30.0
"""Over which a spell fades, the length of a dry one."""

_FINEST_DAYS = 1e-4
"""Straying that is nothing, by which times that say the same are told apart."""


def straying(times: Numbers) -> Numbers:
    r"""Return the covariance of $\delta / \sigma_u$ at times, (Q, Q), in days squared.

    Parameters
    ----------
    times : (Q,) float64
        The first of them is the first visit, none is before it.
    """
    elapsed = (times - times[0]) / SPELL_DAYS
    fading = np.exp(-elapsed)
    both = 2.0 * np.minimum(elapsed[:, None], elapsed) + fading[:, None] + fading - 1.0
    return np.asarray(SPELL_DAYS**2 * (both - np.exp(-np.abs(elapsed[:, None] - elapsed))))


def straying_root(times: Numbers) -> Numbers:
    """Return a lower triangle R of which R R' is the covariance, (Q, Q), in days: no row depends on later times."""
    return np.asarray(np.linalg.cholesky(straying(times) + _FINEST_DAYS**2 * np.eye(len(times))), np.float64)
