r"""How a fruit grows: expolinear in mass, so that its diameter grows fast in June and slowly at the harvest.

The expolinear curve (Goudriaan and Monteith 1990; for apples Lakso et al. 1995) is exponential while cells divide and
linear afterwards: $m(t) = (C / R) \ln(1 + e^{R (t - t_0)})$, $t$ in days after bloom. With $R$ = 0.11 a day and
$t_0$ = 46 days a fruit of 80 mm at 165 days measures 25 mm at 38, grows by 0.8 mm a day then, by 0.4 in August and by
0.2 at the end. The diameter is $(6 m / (\pi \rho h))^{1/3}$, $h$ the height against the diameter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["FruitCurves"]

RATE_PER_DAY, ONSET_DAYS = 0.11, 46.0

_DENSITY_KG_PER_M3 = 830.0
"""Of an apple: it floats."""

_SLOWING_DAYS, _SLOWED = 12.0, 0.25
"""A fruit that will drop grows at a quarter of its rate in its last days (the growth-rate rule of thinning)."""


@dataclass(frozen=True, eq=False)
class FruitCurves:
    """The curves of fruits.

    Attributes
    ----------
    harvest_diameters_m : (F,)
    harvest_days, onset_days : (F,)
        After bloom: when it has that diameter; when it begins to grow in a line.
    slowed_from_days : (F,)
        When it begins to starve, infinite for never.
    height_share : float
    """

    harvest_diameters_m: NDArray[np.float64]
    harvest_days: NDArray[np.float64]
    onset_days: NDArray[np.float64]
    slowed_from_days: NDArray[np.float64]
    height_share: float

    def chosen(self, fruits: NDArray[np.int64]) -> FruitCurves:
        """Curves of some of the fruits."""
        return FruitCurves(
            self.harvest_diameters_m[fruits],
            self.harvest_days[fruits],
            self.onset_days[fruits],
            self.slowed_from_days[fruits],
            self.height_share,
        )

    def diameters_m(self, days: float | NDArray[np.float64]) -> NDArray[np.float64]:
        """Diameters, (F,), so many days after bloom; one day for all or one a fruit."""
        starving = np.maximum(days - self.slowed_from_days, 0.0)
        reached = _expolinear(days - (1.0 - _SLOWED) * starving - self.onset_days)
        return np.asarray(
            self.harvest_diameters_m * np.cbrt(reached / _expolinear(self.harvest_days - self.onset_days))
        )

    def masses_kg(self, days: float) -> NDArray[np.float64]:
        """Masses, (F,)."""
        volumes = np.pi / 6.0 * self.height_share * self.diameters_m(days) ** 3
        return np.asarray(_DENSITY_KG_PER_M3 * volumes)


def slowing_from(end_days: NDArray[np.float64], dropped: NDArray[np.bool_]) -> NDArray[np.float64]:
    """When fruits begin to starve that end on these days, some of them by dropping."""
    return np.where(dropped, end_days - _SLOWING_DAYS, np.inf)


def _expolinear(days: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Mass in units of C / R."""
    return np.asarray(np.logaddexp(0.0, RATE_PER_DAY * np.asarray(days)))
