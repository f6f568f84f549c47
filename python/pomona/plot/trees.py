"""Where the trees of a row stand."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud

__all__ = ["Trees"]

STEP_M = 0.05
SMOOTHED_M = 0.25
"""Of the count of fruits along the row: a branch's clusters melt together, two trees do not."""

MIN_DROP = 0.15
"""Between two trees the count falls by so much of what a usual tree has; less is a hedge, of which nothing is said."""

SIGMAS = 2.5
"""And by so many standard deviations of what chance does to fruits that hang anywhere."""

MIN_FRUITS = 30


@dataclass(frozen=True, eq=False)
class Trees:
    """Where the trees of a row stand along it.

    Attributes
    ----------
    places : (T,) float64
        Metres, ascending.
    names : tuple of T str
        Their names where they are known; else each is a guess.
    """

    places: NDArray[np.float64]
    names: tuple[str, ...] | None

    @classmethod
    def along(cls, axis: NDArray[np.float64], map: FruitCloud, everything: NDArray[np.float64]) -> Trees:
        """Take the trees that a column `tree` of the map names; else guess, if any stand out.

        Parameters
        ----------
        axis
            (3,) unit vector along the row.
        map
            The map.
        everything
            (N, 3) fruits of both visits in the map's frame, to guess from.
        """
        if "tree" not in map.extras:
            return cls(_guessed(everything @ axis), None)
        of_fruits = np.array(map.extras["tree"])
        place_of = {
            str(name): (map.positions[of_fruits == name] @ axis).mean() for name in set(of_fruits.tolist()) - {""}
        }
        names = sorted(place_of, key=place_of.__getitem__)
        return cls(np.array([place_of[name] for name in names]), tuple(names))


def _guessed(along: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.ndimage import gaussian_filter1d
    from scipy.signal import find_peaks

    if len(along) < MIN_FRUITS:
        return np.empty(0)
    margin_m = 4 * SMOOTHED_M
    edges = np.arange(along.min() - margin_m, along.max() + margin_m + STEP_M, STEP_M)
    counts = gaussian_filter1d(np.histogram(along, edges)[0].astype(float), SMOOTHED_M / STEP_M)
    usual = np.quantile(counts[counts > 0.1 * counts.max()], 0.8)
    # Standard deviation of the smoothed count of fruits that hang anywhere, by Poisson and the square of a Gaussian.
    chance = np.sqrt(usual / (2 * np.sqrt(np.pi) * SMOOTHED_M / STEP_M))
    drop = max(MIN_DROP * usual, SIGMAS * chance)
    peaks, _ = find_peaks(counts, prominence=drop)
    # Of two that are equally high each is prominent, whatever lies between.
    apart = all(counts[one:other].min() <= counts[[one, other]].min() - drop for one, other in pairwise(peaks))
    return edges[peaks] + STEP_M / 2 if len(peaks) > 1 and apart else np.empty(0)
