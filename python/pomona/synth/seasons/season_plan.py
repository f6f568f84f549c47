"""What a season of visits is asked to be; the named ones are `easy` and `hard`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date, timedelta

import numpy as np

from pomona.errors import PomonaError
from pomona.synth.living import RowDesign

__all__ = ["SEASONS", "SeasonPlan"]


@dataclass(frozen=True)
class SeasonPlan:
    """A row and the visits to it.

    Attributes
    ----------
    name
        Of the cell.
    design
        The row; nothing behind it and no grass, which a cloud would not show.
    n_visits, first_after_bloom_days, last_after_bloom_days
        How many visits, evenly between two days.
    hidden_share
        Share of the fruits in view that a visit misses: those of which leaves, wood and other fruits leave least to
        see. How much that is, the leaves of the design decide.
    noise_m
        Standard deviation of a fruit's place, root mean square over the three axes.
    along_ray
        How much larger it is along the line of sight than across.
    false_rate
        False points as a fraction of the fruits seen.
    size_noise_m, size_scale_sigma
        Standard deviation of a diameter, and of the factor that all diameters of a visit share.
    drift_scale_sigma, drift_bend_m
        Standard deviations of the trajectory's faults: its length against the true one, and how far its middle bulges
        sideways over the whole row.
    both_sides
        Whether some visits drive along the other side of the row, at +y; all of them drive either way.
    skips_end_trees
        Whether two of three visits leave out the tree at one end.
    own_frames
        Whether every session lies in a frame of its own, turned and moved at random; else in the row's.
    """

    name: str
    design: RowDesign
    n_visits: int
    first_after_bloom_days: int
    last_after_bloom_days: int
    hidden_share: float
    noise_m: float
    false_rate: float
    size_scale_sigma: float
    drift_scale_sigma: float
    drift_bend_m: float
    along_ray: float = 2.0
    size_noise_m: float = 0.002
    both_sides: bool = False
    skips_end_trees: bool = False
    own_frames: bool = True

    def __post_init__(self) -> None:
        days = self.last_after_bloom_days - self.first_after_bloom_days
        if not 1 <= self.n_visits <= days + 1:
            raise PomonaError(f"visits: found {self.n_visits}, expected 1 to {days + 1}, one a day of the season")
        for name, low, high in _LIMITS:
            found = getattr(self, name)
            if not low <= found <= high:  # NaN is in no range
                raise PomonaError(f"{name}: found {found}, expected {low} to {high}")

    @property
    def days(self) -> list[date]:
        """Dates of the visits."""
        after = np.linspace(self.first_after_bloom_days, self.last_after_bloom_days, self.n_visits)
        return [self.design.bloom + timedelta(days=round(day)) for day in after]


_LIMITS = (
    ("hidden_share", 0.0, 0.95),
    ("noise_m", 0.0, 1.0),
    ("along_ray", 1.0, 20.0),
    ("false_rate", 0.0, 5.0),
    ("size_noise_m", 0.0, 0.05),
    ("size_scale_sigma", 0.0, 0.2),
    ("drift_scale_sigma", 0.0, 0.2),
    ("drift_bend_m", 0.0, 1.0),
)

_BARE = RowDesign(row_behind=False, grass_blades_per_m2=0.0, clear_of_posts=False)
"""No pictures are made of it; whatever was measured on the named seasons stays true."""

SEASONS = {
    "easy": SeasonPlan(
        name="easy",
        design=replace(
            _BARE, n_trees=5, fruits_per_tree=(60, 100), june_drop_share=0.05, softness=0.6, leaves_per_tree=1500
        ),
        n_visits=8,
        first_after_bloom_days=50,
        last_after_bloom_days=155,
        hidden_share=0.15,
        noise_m=0.010,
        false_rate=0.02,
        size_scale_sigma=0.01,
        drift_scale_sigma=0.003,
        drift_bend_m=0.005,
    ),
    "hard": SeasonPlan(
        name="hard",
        design=replace(
            _BARE,
            n_trees=6,
            fruits_per_tree=(80, 140),
            cluster_sizes=(0.1, 0.25, 0.35, 0.3),
            thinned_share=1.0 / 3.0,
            thinned_after_bloom_days=75,
            softness=2.6,
            leaves_per_tree=2500,
        ),
        n_visits=5,
        first_after_bloom_days=58,
        last_after_bloom_days=155,
        hidden_share=0.30,
        noise_m=0.018,
        false_rate=0.08,
        size_scale_sigma=0.02,
        drift_scale_sigma=0.01,
        drift_bend_m=0.02,
        both_sides=True,
        skips_end_trees=True,
    ),
}
"""Easy: eight visits, 15 % hidden, 1 cm. Hard: five visits to six trees, 30 % hidden, 1.8 cm, branches that sink by
10 cm, a third of the fruits thinned out of their clusters, passes along both sides that miss an end tree, 8 % false."""
