"""Maps of rows whose fruits grow along a curve that is known, and what is written of them."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path

import numpy as np

from pomona import FruitCloud
from pomona.orchard import Session, add_session
from pomona.synth.living.fruit_curves import FruitCurves

BLOOM = date(2024, 4, 25)
HARVEST = BLOOM + timedelta(days=135)
FRUITS_OF_TREE = 30


@dataclass(frozen=True, eq=False)
class GrownRow:
    """A map, and the truth: fruits in the order of their labels `apple 0`, `apple 1`, ..."""

    path: Path
    curves: FruitCurves
    days: tuple[int, ...]

    def sizes_mm(self, days: float) -> np.ndarray:
        return 1000.0 * self.curves.diameters_m(days)

    def day(self, after_bloom: int) -> date:
        return BLOOM + timedelta(days=after_bloom)


def grow_row(
    path: Path,
    days: Sequence[int] = (50, 65, 80, 95),
    *,
    n_trees: int = 3,
    noise_mm: float = 1.0,
    scales: Sequence[float] = (1.0, 1.02, 0.99, 1.01),
    seed: int = 0,
    dropping: Sequence[int] = (),
    slowed_from: float = 0.0,
    labels: str = "apple {}",
    name: str = "{}",
    dated: Sequence[int] = (),
    numbered_anew: bool = False,
) -> GrownRow:
    """Make a map of visits so many days after bloom; fruits that drop grow at a quarter of their rate from a day on.

    `dated` are days that were noted instead of the true ones. Where visits are `numbered_anew` each begins with another
    fruit.
    """
    rng = np.random.default_rng(seed)
    n = n_trees * FRUITS_OF_TREE
    slowed = np.full(n, np.inf)
    slowed[list(dropping)] = slowed_from
    onsets = rng.normal(46.0, 2.5, n)
    curves = FruitCurves(rng.normal(0.073, 0.005, n), np.full(n, 135.0), onsets, slowed, 0.9)
    along = np.repeat(np.arange(n_trees), FRUITS_OF_TREE) * 1.5 + rng.uniform(-0.3, 0.3, n)
    places = np.column_stack([along, rng.uniform(-0.2, 0.2, n), rng.uniform(0.5, 2.5, n)])
    for after_bloom, noted, scale in zip(days, dated or days, scales, strict=False):
        true_mm = 1000.0 * curves.diameters_m(after_bloom)
        measured_m = (true_mm * scale + rng.normal(0.0, noise_mm, n)) / 1000.0
        day = (BLOOM + timedelta(days=noted)).isoformat()
        ids = tuple(labels.format((row + numbered_anew * after_bloom) % n) for row in range(n))
        cloud = FruitCloud(places + rng.normal(0.0, 0.003, places.shape), ids=ids, diameters_m=measured_m)
        added = add_session(path, Session(name.format(day), day, "drawn", cloud))
        assert added.is_added
        assert added.n_matched in (0, n)
    return GrownRow(path, curves, tuple(days))


def rows_of(path: Path) -> list[dict[str, str]]:
    """The lines of a table, by the names of its columns."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
