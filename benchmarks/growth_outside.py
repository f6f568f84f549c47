"""Years in which a block grows along none of the curves that `pomona growth` knows."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pomona.synth.living.fruit_curves import ONSET_DAYS, FruitCurves

Course = Callable[[FruitCurves, float], NDArray[np.float64]]
"""Diameters, (F,), so many days after bloom."""

HARVEST_DAYS = 155.0


def dry_spell(rng: np.random.Generator) -> Course:
    """Draw some weeks in the middle of the season in which fruits all but stand still."""
    first_day, n_days, speed = rng.uniform(75.0, 100.0), rng.uniform(14.0, 28.0), rng.uniform(0.0, 0.3)
    return lambda curves, days: curves.diameters_m(days - (1.0 - speed) * min(max(days - first_day, 0.0), n_days))


def slowing(rng: np.random.Generator) -> Course:
    """Draw growth that slows evenly to less than a third of what the curve says on the day of the harvest."""
    first_day, speed = rng.uniform(85.0, 110.0), rng.uniform(0.0, 0.3)
    length = HARVEST_DAYS - first_day
    return lambda curves, days: curves.diameters_m(
        days - (1.0 - speed) * max(days - first_day, 0.0) ** 2 / (2 * length)
    )


def stone_fruit(rng: np.random.Generator) -> Course:
    """Draw two rises, and between them weeks in which the stone hardens: a double sigmoid."""
    middles = rng.uniform(42.0, 50.0), rng.uniform(118.0, 130.0)
    share = rng.uniform(0.50, 0.62)
    rates = rng.uniform(0.08, 0.10), rng.uniform(0.07, 0.10)

    def size(days: NDArray[np.float64]) -> NDArray[np.float64]:
        first, second = (1.0 / (1.0 + np.exp(-rates[i] * (days - middles[i]))) for i in (0, 1))
        return np.asarray(share * first + (1.0 - share) * second)

    return along(size)


def monomolecular(rng: np.random.Generator) -> Course:
    """Draw growth that falls from the first day on, as an exponential that runs out."""
    lasting_days = rng.uniform(50.0, 70.0)
    return along(lambda days: 1.0 - np.exp(-(days - 28.0) / lasting_days))


def straight_line(rng: np.random.Generator) -> Course:
    """Draw growth of so many mm a day until the harvest."""
    at_50_days = rng.uniform(0.32, 0.42)
    return along(lambda days: at_50_days + (1.0 - at_50_days) * (days - 50.0) / (HARVEST_DAYS - 50.0))


def along(size: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Course:
    """Fruits that keep their own size at the harvest and their own onset, along another curve."""

    def diameters_m(curves: FruitCurves, days: float) -> NDArray[np.float64]:
        late_days = curves.onset_days - ONSET_DAYS
        return np.asarray(curves.harvest_diameters_m * size(days - late_days) / size(curves.harvest_days))

    return diameters_m


OUTSIDE = {
    "dry spell": dry_spell,
    "slowing": slowing,
    "stone fruit": stone_fruit,
    "monomolecular": monomolecular,
    "straight line": straight_line,
}


def course_outside(name: str, seed: int) -> Course:
    """Return the year of a seed."""
    return OUTSIDE[name](np.random.Generator(np.random.PCG64([seed, 62, list(OUTSIDE).index(name)])))
