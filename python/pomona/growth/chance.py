"""Chance for the draws of a curve: standard normal numbers, a stream of their own for each kind of effect."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

__all__ = ["Chance", "evenly_spread"]

_SEED = 22

Shared = Literal["visits", "straying", "errors", "camera", "hanging"]
Single = Literal["fruits", "trees", "later", "hanging", "stopping", "own"]

Numbers = NDArray[np.float64]


def evenly_spread(name: str, count: int, dimensions: int) -> Numbers:
    """Return points in the unit cube, (count, dimensions), that fill it more evenly than by chance: Sobol's, shifted.

    Parameters
    ----------
    name : str
        What they are for: each has a shift of its own.
    count : int
        A power of two.
    dimensions : int
        More of them begin with the same.
    """
    from scipy.stats.qmc import Sobol

    shift = np.random.default_rng([_SEED, *name.encode()]).random(dimensions)
    return np.asarray((Sobol(dimensions, scramble=False).random(count) + shift) % 1.0)


class Chance:
    """Gives the same numbers to the same effects, whatever else is drawn.

    One more tree, or a day that is foretold, must not give all fruits other numbers: means of some hundred draws would
    move by a tenth of a millimetre. What all fruits share is spread evenly over the draws, and of the rest every other
    draw takes the negatives of the one before it (antithetic draws), so that chance all but leaves the means.

    Parameters
    ----------
    name : str
        Of the curve: each has numbers of its own.
    count : int
        Draws, a power of two.
    n_shapes, n_visits : int
        Numbers that a shape takes, and visits.
    """

    def __init__(self, name: str, count: int, n_shapes: int, n_visits: int) -> None:
        # With the mean, and with the day after the last visit.
        shared: dict[Shared, int] = {"visits": n_visits + 1, "straying": n_visits + 1, "errors": n_visits}
        shared["camera"] = shared["hanging"] = 1
        self._name = name
        # All in one: two sets of points that are spread evenly each are not so together.
        even = evenly_spread(name, count, n_shapes + sum(shared.values()))
        self.shapes = even[:, :n_shapes]
        parts = np.split(ndtri(even[:, n_shapes:]), np.cumsum(list(shared.values()))[:-1], axis=1)
        self._shared = dict(zip(shared, parts, strict=True))
        self._draw = -1

    def next_draw(self) -> None:
        """Go on to the next draw; called before the first, too."""
        self._draw += 1

    def shared(self, kind: Shared) -> Numbers:
        """Give the numbers of what all fruits share."""
        return np.asarray(self._shared[kind][self._draw])

    def single(self, kind: Single, count: int) -> Numbers:
        """Give so many numbers of a kind; asked again, the same."""
        pair, is_second = divmod(self._draw, 2)
        rng = np.random.default_rng([_SEED, pair, *f"{self._name}: {kind}".encode()])
        numbers = rng.normal(size=count)
        return -numbers if is_second else numbers
