"""How fruits colour up: the ground from green to ripe, and a blush on the side that has the sun."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.living.axis_growth import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.living.cultivars import Cultivar

__all__ = ["FruitColours", "draw_colours"]

_SUN = (0.25, -0.45, 0.7)
"""Where the light comes from over the day: more from one side of the row."""

_RIPENING_SPREAD_DAYS = 6.0
_GROUND_BEFORE_HARVEST_DAYS, _BLUSH_BEFORE_HARVEST_DAYS = 12.0, 35.0
"""Half of the colour is there so long before the harvest: the blush comes first."""


@dataclass(frozen=True, eq=False)
class FruitColours:
    """What is drawn of each fruit.

    Attributes
    ----------
    apple : Cultivar
    ripe_days : (F,)
        After bloom.
    blush_shares : (F,)
        Of the ripe fruit.
    blush_directions : (F, 3)
    tones : (F, 1)
        Brightness against the cultivar's.
    """

    apple: Cultivar
    ripe_days: NDArray[np.float64]
    blush_shares: NDArray[np.float64]
    blush_directions: NDArray[np.float64]
    tones: NDArray[np.float64]

    def on(self, days: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Ground colours (F, 3), blush colours (F, 3) and blush shares (F,), so many days after bloom."""
        apple = self.apple
        ground = self._ripeness(days + _GROUND_BEFORE_HARVEST_DAYS)[:, None]
        blush = self._ripeness(days + _BLUSH_BEFORE_HARVEST_DAYS)
        grounds = np.array(apple.young_colour) * (1.0 - ground) + np.array(apple.ripe_colour) * ground
        deep = (blush * ground[:, 0])[:, None]
        blushes = np.array(apple.dull_blush_colour) * (1.0 - deep) + np.array(apple.blush_colour) * deep
        return self.tones * grounds, self.tones * blushes, self.blush_shares * blush

    def _ripeness(self, days: float) -> NDArray[np.float64]:
        return np.asarray(1.0 / (1.0 + np.exp((self.ripe_days - days) / self.apple.colouring_days)))


def draw_colours(rng: np.random.Generator, apple: Cultivar, outward: NDArray[np.float64]) -> FruitColours:
    """Draw the colours of fruits; `outward`, (F,), is -1 to 1 from one face of the row to the other.

    Fruits inside the tree colour less.
    """
    n = len(outward)
    least, most = apple.blush_shares
    in_light = np.clip(0.35 + 0.65 * np.abs(outward) + rng.normal(0.0, 0.2, n), 0.0, 1.0)
    sun = np.array(_SUN) + outward[:, None] * [0.0, 0.9, 0.0] + rng.normal(0.0, 0.35, (n, 3))
    return FruitColours(
        apple,
        apple.harvest_after_bloom_days + rng.normal(0.0, _RIPENING_SPREAD_DAYS, n),
        least + (most - least) * in_light,
        unit(sun),
        np.exp(rng.normal(0.0, 0.12, (n, 1))),
    )
