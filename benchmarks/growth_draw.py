"""Sizes of the fruits of drawn rows, as visits would measure them, with the truth."""

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.growth_outside import Course
from pomona.cloud import FruitCloud
from pomona.growth.bearing_trees import BearingTrees
from pomona.growth.measured import MeasuredFruits
from pomona.synth.living import LivingRow, grow
from pomona.synth.living.fruit_curves import ONSET_DAYS, FruitCurves
from pomona.synth.living.fruit_lives import ALIVE
from pomona.synth.seasons import SeasonPlan

MEASURED_SHARE = 0.6
SCALE_SIGMAS = (0.02, 0.03)
OWN_CHANCE = 0.5
"""Of being seen on a visit, against what leaves do to a fruit on all of them."""


YEARS = (0.15, 10.0)
"""How much years differ: spread of the logarithm of the rate of growth, and days by which its onset comes late."""


@dataclass(frozen=True)
class Year:
    """A year's weather, as a clock by which fruits grow: faster than usual, and later by so many days."""

    faster: float = 1.0
    late_days: float = 0.0

    @classmethod
    def draw(cls, seed: int) -> "Year":
        """Return the year of a seed."""
        rng = np.random.Generator(np.random.PCG64([seed, 61]))
        return cls(float(np.exp(YEARS[0] * rng.normal())), float(YEARS[1] * rng.normal()))

    def clock(self, days: float) -> float:
        """Days after bloom of the usual year on which fruits are as large."""
        return ONSET_DAYS + self.faster * (days - ONSET_DAYS - self.late_days)

    def diameters_m(self, curves: FruitCurves, days: float) -> NDArray[np.float64]:
        """Diameters, (F,), so many days after bloom."""
        return curves.diameters_m(self.clock(days))


@dataclass(frozen=True, eq=False)
class DrawnSizes:
    """Measured sizes (N, S), and the truth: sizes on the season's last visit, rates now, NaN for what is none."""

    fruits: MeasuredFruits
    harvest: datetime
    true_mm: NDArray[np.float64]
    true_rates: NDArray[np.float64]


def draw_sizes(plan: SeasonPlan, seed: int, course: Course = Year().diameters_m) -> DrawnSizes:
    row, rng = grow(plan.design, seed), np.random.Generator(np.random.PCG64([seed, 60]))
    days = np.array([row.days_after_bloom(day) for day in plan.days])
    measured = days[days <= days[0] + MEASURED_SHARE * (days[-1] - days[0])]
    sizes_mm = np.stack([course(row.crop.curves, day) for day in measured], axis=1) * 1000.0
    alive = np.stack([row.crop.lives.states(day) == ALIVE for day in measured], axis=1)
    shown = rng.normal(size=(len(row.crop), 1)) + OWN_CHANCE * rng.normal(size=sizes_mm.shape)
    seen = alive & (shown > np.quantile(shown, plan.hidden_share))
    rows, columns = np.nonzero(seen)
    false = rng.integers(len(rows), size=round(plan.false_rate * len(rows)))
    sizes_mm = np.concatenate([np.where(seen, sizes_mm, np.nan), single(sizes_mm, rows[false], columns[false])])
    scales = np.exp(rng.uniform(*SCALE_SIGMAS) * rng.normal(size=len(measured)))
    noisy_mm = np.maximum(sizes_mm * scales + rng.normal(0.0, 1000.0 * plan.size_noise_m, sizes_mm.shape), 5.0)
    trees = np.concatenate([row.crop.trees, row.crop.trees[rows[false]]])
    true_mm, rates = truth(row, measured[-1], days[-1], course)
    nothing = np.full(len(false), np.nan)
    return in_order(plan, trees, noisy_mm, np.append(true_mm, nothing), np.append(rates, nothing))


def single(sizes_mm: NDArray[np.float64], rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float64]:
    """Sizes of false points: of some fruit of the visit, and on no other."""
    found = np.full((len(rows), sizes_mm.shape[1]), np.nan)
    found[np.arange(len(rows)), columns] = sizes_mm[rows, columns]
    return found


def truth(
    row: LivingRow, now: float, harvest: float, course: Course
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sizes at the harvest of fruits that hang then, mm, and rates now of those that hang now."""
    curves, lives = row.crop.curves, row.crop.lives
    sizes_mm = np.where(lives.states(harvest) == ALIVE, 1000.0 * course(curves, harvest), np.nan)
    rates = 1000.0 * (course(curves, now + 0.5) - course(curves, now - 0.5))
    return sizes_mm, np.where(lives.states(now) == ALIVE, rates, np.nan)


def in_order(
    plan: SeasonPlan,
    trees: NDArray[np.int64],
    sizes_mm: NDArray[np.float64],
    true_mm: NDArray[np.float64],
    rates: NDArray[np.float64],
) -> DrawnSizes:
    """Fruits that were measured, in order of their trees."""
    kept = np.flatnonzero(~np.isnan(sizes_mm).all(axis=1))
    kept = kept[np.argsort(trees[kept], kind="stable")]
    moments = tuple(datetime.combine(day, datetime.min.time()) for day in plan.days)
    is_judged = ~np.isnan(true_mm[kept])
    fruits = as_fruits(sizes_mm[kept], trees[kept], moments[: sizes_mm.shape[1]], is_judged)
    return DrawnSizes(fruits, moments[-1], true_mm[kept], rates[kept])


def as_fruits(
    sizes_mm: NDArray[np.float64],
    trees: NDArray[np.int64],
    moments: tuple[datetime, ...],
    hanging: NDArray[np.bool_],
) -> MeasuredFruits:
    """Fruits out of arrays; those that do not hang are fitted, and in no block."""
    states = tuple("seen" if hangs else "gone" for hangs in hanging)
    n = len(sizes_mm)
    names, numbers = np.unique(trees, return_inverse=True)
    return MeasuredFruits(
        path=Path("drawn"),
        cloud=FruitCloud(np.zeros((n, 3)), extras={"state": states}),
        ids=np.arange(1, n + 1),
        trees=BearingTrees(tuple(map(str, names + 1)), numbers.astype(np.int64), np.zeros(n), ("",) * len(names)),
        sessions=tuple(moment.isoformat() for moment in moments),
        moments=moments,
        diameters_mm=sizes_mm,
        labels=((None,) * len(moments),) * n,
    )
