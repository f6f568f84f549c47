"""The fruits of a row: on which spur each hangs, how it grows, ends and colours."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.living.fruit_colours import FruitColours, draw_colours
from pomona.synth.living.fruit_curves import ONSET_DAYS, FruitCurves, slowing_from
from pomona.synth.living.fruit_lives import DROPPED, FruitLives, draw_lives
from pomona.synth.living.fruit_places import hang_beside, hang_fruits
from pomona.synth.living.streams_of_chance import chance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.synth.living.design import RowDesign
    from pomona.synth.living.spurs import Spurs
    from pomona.synth.living.wood import WoodAxes
    from pomona.synth.row_geometry import Limbs

__all__ = ["FULL_GROWN_DAYS", "Crop", "set_fruits"]

FULL_GROWN_DAYS = 175.0
"""After bloom: fruits have room for the size of that day, in October, whenever their harvest is."""


@dataclass(frozen=True, eq=False)
class Crop:
    """Fruits of a season; row i is the fruit with the id i + 1.

    Attributes
    ----------
    trees, spurs : (F,) int64
        Fruits of one spur are a cluster.
    hangs : (F, 3)
        Unit vectors from the spur's tip to the fruit.
    stalks_m : (F,)
        Length of the stalk outside of the fruit.
    curves, lives, colours
        How they grow, end and colour.
    """

    trees: NDArray[np.int64]
    spurs: NDArray[np.int64]
    hangs: NDArray[np.float64]
    stalks_m: NDArray[np.float64]
    curves: FruitCurves
    lives: FruitLives
    colours: FruitColours

    def __len__(self) -> int:
        return len(self.trees)

    def centres_m(self, spur_tips_m: NDArray[np.float64], days: float) -> NDArray[np.float64]:
        """Centres of all fruits, (F, 3), under the tips of all spurs, (S, 3): the more they grow the lower."""
        below = self.stalks_m + self.curves.height_share * self.curves.diameters_m(days) / 2.0
        return np.asarray(spur_tips_m[self.spurs] + self.hangs * below[:, None])


def set_fruits(seed: int, design: RowDesign, wood: WoodAxes, spurs: Spurs, supports: Limbs) -> Crop:
    """Set the fruits of a season.

    Raises
    ------
    PomonaError
        When a tree has no room for its fruits.
    """
    apple = design.apple
    counts = _counts(chance(seed, "counts"), design)
    sizes = _harvest_diameters(chance(seed, "sizes"), design, counts)
    trees = np.repeat(np.arange(design.n_trees), counts)
    n = len(trees)
    onset = ONSET_DAYS + chance(seed, "onset").normal(0.0, design.onset_spread_days, n)
    curves = FruitCurves(
        sizes, np.full(n, apple.harvest_after_bloom_days), onset, np.full(n, np.inf), apple.height_share
    )
    full_grown = curves.diameters_m(FULL_GROWN_DAYS)
    places = hang_fruits(chance(seed, "places"), design, wood, spurs, trees, full_grown)
    if design.clear_of_posts:
        places = hang_beside(chance(seed, "beside posts"), design, wood, spurs, places, full_grown, supports)
    lives = draw_lives(chance(seed, "lives"), design, places.spurs, sizes)
    curves = replace(curves, slowed_from_days=slowing_from(lives.ends_days, lives.causes == DROPPED))
    outward = np.sign(places.centres_m[:, 1]) * np.minimum(
        np.abs(places.centres_m[:, 1]) / design.training.depth_m, 1.0
    )
    colours = draw_colours(chance(seed, "colours"), apple, outward)
    return Crop(trees, places.spurs, places.hangs, places.stalks_m, curves, lives, colours)


def _counts(rng: np.random.Generator, design: RowDesign) -> NDArray[np.int64]:
    least, most = design.fruits_per_tree
    return rng.integers(least, most + 1, design.n_trees)


def _harvest_diameters(rng: np.random.Generator, design: RowDesign, counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Draw normally about the tree's mean, cut at three sigma: no fruit is as big as two."""
    apple = design.apple
    of_trees = 1.0 + design.tree_spread * rng.normal(size=design.n_trees)
    spread = np.clip(rng.normal(size=int(counts.sum())), -3.0, 3.0) * apple.diameter_spread
    return np.asarray(apple.harvest_diameter_m * np.repeat(of_trees, counts) * (1.0 + spread))
