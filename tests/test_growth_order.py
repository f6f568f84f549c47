"""The same fruits and sizes grow alike: whatever the order of visits and ids, the harvest asked for, one odd size."""

from dataclasses import replace
from datetime import timedelta
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from growth_maker import BLOOM, GrownRow, grow_row
from pomona import FruitCloud
from pomona.growth.bearing_trees import BearingTrees
from pomona.growth.chance import Chance, evenly_spread
from pomona.growth.curve_families import FAMILIES
from pomona.growth.fitting import likeliest_shape
from pomona.growth.fruit_order import reckoned_order
from pomona.growth.measured import MeasuredFruits
from pomona.growth.season_growth import SeasonGrowth, grow_season, growth_of
from pomona.growth.shares import equal_shares
from pomona.growth.size_table import SizeTable
from pomona.growth.straying import straying, straying_root
from pomona.growth.thinning_plan import plan_thinning
from pomona.growth.trust import trust_in_sizes
from pomona.orchard import Session, add_session

HARVEST = BLOOM + timedelta(days=135)
BORDER_MM = 8.25
"""Added to a size of which the noise is 1 mm in a season of two trees: at the border of what is its fruit's."""


@pytest.fixture(scope="module")
def row(tmp_path_factory: pytest.TempPathFactory) -> GrownRow:
    return grow_row(tmp_path_factory.mktemp("row") / "orchard.gpkg", days=(50, 65, 80), n_trees=2)


@pytest.fixture(scope="module")
def grown(row: GrownRow) -> SeasonGrowth:
    return grow_season(row.path, harvest=HARVEST)


def with_sizes(fruits: MeasuredFruits, sizes_mm: NDArray[np.float64]) -> MeasuredFruits:
    return replace(fruits, diameters_mm=sizes_mm)


def holed(fruits: MeasuredFruits) -> MeasuredFruits:
    """Every third fruit missed on a visit, so that the fruits differ in what they say, and one size at the border."""
    sizes_mm = fruits.diameters_mm.copy()
    sizes_mm[::3, 1] = np.nan
    sizes_mm[1::7, 0] = np.nan
    sizes_mm[5, 2] += BORDER_MM
    return with_sizes(fruits, sizes_mm)


def shuffled(fruits: MeasuredFruits, seed: int) -> tuple[MeasuredFruits, NDArray[np.int64]]:
    """The same fruits with other ids, trees told from the other end; and the row that each was in."""
    trees = fruits.trees
    numbers = len(trees.names) - 1 - trees.numbers
    rows = np.random.default_rng(seed).permutation(len(numbers))
    rows = rows[np.argsort(numbers[rows], kind="stable")]
    others = BearingTrees(trees.names, numbers[rows], trees.along_m[rows], trees.rows)
    labels = tuple(fruits.labels[number] for number in rows)
    cloud, sizes_mm = fruits.cloud.select(rows), fruits.diameters_mm[rows]
    return replace(fruits, cloud=cloud, trees=others, diameters_mm=sizes_mm, labels=labels), rows


@pytest.mark.parametrize("seed", range(3))
def test_ids_of_fruits_and_trees_do_not_matter(grown: SeasonGrowth, seed: int) -> None:
    fruits = holed(grown.fruits)
    others, rows = shuffled(fruits, seed)
    found, again = growth_of(fruits, harvest=HARVEST), growth_of(others, harvest=HARVEST)
    for name in ("sizes_mm", "lows_mm", "highs_mm", "rates_mm_per_day", "rate_sigmas_mm_per_day"):
        np.testing.assert_array_equal(getattr(again.foretold, name), getattr(found.foretold, name)[rows])
    np.testing.assert_array_equal(again.foretold.scales, found.foretold.scales)
    np.testing.assert_array_equal(again.odd, found.odd[rows])
    blocks, same = (each.foretold.summaries["blocks"] for each in (found, again))
    # Sums over the same fruits in another order; the trees are named from the other end.
    np.testing.assert_allclose(same[:, [0, 2, 1]], blocks, rtol=1e-12)


def test_visits_may_be_added_in_any_order(row: GrownRow, tmp_path: Path) -> None:
    """Six maps of the same three visits, with a size at the border: the same numbers for each fruit, by its label."""
    rng = np.random.default_rng(5)
    n = 60
    places = np.column_stack([np.repeat([0.0, 1.5], 30), np.zeros(n), np.zeros(n)]) + rng.uniform(-0.3, 0.3, (n, 3))
    sessions = []
    for day in row.days:
        sizes_mm = row.sizes_mm(day) + rng.normal(0.0, 1.0, n)
        sizes_mm[5] += BORDER_MM * (day == row.days[-1])
        labels = tuple(f"apple {number}" for number in range(n))
        seen = rng.permutation(n)[: n - 6]
        scattered = places + rng.normal(0.0, 0.005, places.shape)
        cloud = FruitCloud(scattered, ids=labels, diameters_m=sizes_mm / 1000.0).select(seen)
        sessions.append(Session(str(row.day(day)), str(row.day(day)), "drawn", cloud))
    told = []
    for number, order in enumerate(permutations(sessions)):
        path = tmp_path / f"{number}.gpkg"
        assert all(add_session(path, session).is_added for session in order)
        found = grow_season(path, harvest=HARVEST)
        names = [next(filter(None, labels)) for labels in found.fruits.labels]
        by_name = np.argsort(names)
        told.append((found.foretold.rates_mm_per_day[by_name], found.foretold.sizes_mm[by_name], found.odd[by_name]))
    for rates, sizes_mm, odd in told[1:]:
        np.testing.assert_allclose(rates, told[0][0], atol=1e-9)
        np.testing.assert_allclose(sizes_mm, told[0][1], atol=1e-9)
        np.testing.assert_array_equal(odd, told[0][2])


def test_the_harvest_does_not_move_what_is_told_of_now(grown: SeasonGrowth) -> None:
    fruits = holed(grown.fruits)
    plain, *others = (growth_of(fruits, harvest=day) for day in (None, fruits.days[-1], HARVEST))
    n = len(fruits.days)
    for found in others:
        for name in ("sizes_mm", "lows_mm", "highs_mm"):
            np.testing.assert_allclose(getattr(found.foretold, name)[:, :n], getattr(plain.foretold, name), rtol=1e-12)
        for name in ("rates_mm_per_day", "rate_sigmas_mm_per_day", "scales"):
            np.testing.assert_allclose(getattr(found.foretold, name), getattr(plain.foretold, name), rtol=1e-9)
        blocks, same = (each.foretold.summaries["blocks"] for each in (plain, found))
        np.testing.assert_allclose(np.delete(same, n, axis=2), blocks, rtol=1e-9)
        rates = plan_thinning(found).drop.fast_mm_per_day, plan_thinning(plain).drop.fast_mm_per_day
        assert rates[0] == pytest.approx(rates[1], rel=1e-9)


def test_one_size_at_the_border_moves_the_others_little_by_little(grown: SeasonGrowth) -> None:
    """A size that comes to be another fruit's, a quarter of a millimetre at a time: no step puts it aside at once."""
    others = np.arange(len(grown.fruits.ids)) != 5
    rates, trusted = [], []
    for off_mm in np.arange(7.0, 9.8, 0.25):
        sizes_mm = grown.fruits.diameters_mm.copy()
        sizes_mm[5, 2] += off_mm
        found = growth_of(with_sizes(grown.fruits, sizes_mm))
        rates.append(found.foretold.rates_mm_per_day[others].mean())
        trusted.append(1 - found.put_aside[5].any())
    assert (trusted[0], trusted[-1]) == (1, 0)
    assert np.abs(np.diff(rates)).max() < 0.003 * np.mean(rates)


def test_sizes_count_by_the_trust_in_them(grown: SeasonGrowth) -> None:
    fruits = grown.fruits
    sizes_mm = fruits.diameters_mm.copy()
    sizes_mm[7, 2] += 25.0
    sizes_mm[9] = [sizes_mm[9, 0] - 8.0, sizes_mm[9, 1] + 8.0, np.nan]
    order, trees = reckoned_order(fruits)
    rows = np.argsort(order)
    table = SizeTable.of(sizes_mm[order], trees, np.array([0.0, 15.0, 30.0]))
    found = trust_in_sizes(table)
    trust, aside = found.in_curve[rows], found.put_aside[rows]
    assert trust[7, 2] < 0.001
    assert trust[7, :2].min() > 0.9
    # One of the two is wrong, and neither is sure to be the one.
    assert trust[9, :2].sum() == pytest.approx(1.0, abs=0.1)
    assert aside[7, 2]
    assert aside[9].sum() == 1
    assert aside[9, trust[9].argmin()]
    # By chance, 3.6 sigma and more.
    assert aside.sum() <= 3
    assert np.delete(trust, [7, 9], axis=0).mean() > 0.97
    # What is not trusted says nothing: of the noise, of the spread, of the curve.
    gone = SizeTable.of(np.where(aside, np.nan, sizes_mm)[order], trees, table.times)
    shapes = [likeliest_shape(one, FAMILIES["expolinear"])[0] for one in (table.trusted(~aside[order] * 1.0), gone)]
    assert shapes[0].noise_mm == pytest.approx(shapes[1].noise_mm, rel=0.02)
    assert shapes[0].rate_per_day == pytest.approx(shapes[1].rate_per_day, rel=0.02)


def test_some_of_many_fruits_are_the_same_whoever_was_seen_first() -> None:
    rng = np.random.default_rng(2)
    sizes_mm = rng.normal(60.0, 5.0, (80, 3))
    sizes_mm[rng.random((80, 3)) < 0.3] = np.nan
    sizes_mm = sizes_mm[~np.isnan(sizes_mm).all(axis=1)]
    trees = np.sort(rng.integers(0, 3, len(sizes_mm)))
    rows = rng.permutation(len(sizes_mm))
    rows = rows[np.argsort(trees[rows], kind="stable")]
    times = np.array([0.0, 14.0, 30.0])
    kept = [SizeTable.of(sizes_mm[each], trees, times).some_fruits(30) for each in (np.arange(len(rows)), rows)]
    first, second = ({tuple(np.nan_to_num(logs)) for logs in table.logs} for table in kept)
    assert first == second
    assert 30 <= len(first) <= 33
    # Neither the small nor the large ones.
    assert np.nanmean(kept[0].logs) == pytest.approx(np.nanmean(np.log(sizes_mm)), abs=0.02)


def test_more_trees_and_later_days_leave_the_numbers_of_the_fruits(grown: SeasonGrowth) -> None:
    chances = [Chance("expolinear over days", 64, 9, 3) for _ in range(2)]
    drawn = []
    for chance, n_trees in zip(chances, (2, 5), strict=True):
        for _ in range(3):
            chance.next_draw()
            trees = chance.single("trees", n_trees)
            drawn.append((chance.shared("visits"), trees[:2], chance.single("fruits", 20)))
    for one, other in zip(drawn[:3], drawn[3:], strict=True):
        for mine, same in zip(one, other, strict=True):
            np.testing.assert_array_equal(mine, same)
    np.testing.assert_array_equal(drawn[0][2], -drawn[1][2])
    assert not np.array_equal(np.abs(drawn[0][2]), np.abs(drawn[2][2]))


def test_even_points_are_even() -> None:
    points = evenly_spread("any", 256, 20)
    assert points.shape == (256, 20)
    # A sixteenth of the points in each sixteenth of each axis.
    counts = np.array([np.histogram(column, np.linspace(0.0, 1.0, 17))[0] for column in points.T])
    assert np.abs(counts - 16).max() <= 1
    np.testing.assert_array_equal(evenly_spread("any", 256, 5), points[:, :5])
    assert not np.array_equal(evenly_spread("other", 256, 20), points)


def test_equal_shares_keep_the_mean_and_the_quantiles() -> None:
    rng = np.random.default_rng(1)
    drawn, weights = rng.normal(size=(4000, 2, 3)), rng.uniform(0.0, 2.0, 4000)
    shares = equal_shares(drawn, weights, 300)
    assert shares.shape == (300, 2, 3)
    np.testing.assert_allclose(shares.mean(axis=0), np.average(drawn, axis=0, weights=weights), atol=1e-12)
    twice = np.repeat(drawn, np.round(100 * weights).astype(int), axis=0)
    for level in (0.05, 0.5, 0.95):
        np.testing.assert_allclose(np.quantile(shares, level, axis=0), np.quantile(twice, level, axis=0), atol=0.04)
    np.testing.assert_allclose(equal_shares(drawn[:50], np.ones(50), 50), np.sort(drawn[:50], axis=0), atol=1e-12)


def test_the_root_of_straying_does_not_look_ahead() -> None:
    times = np.array([200.0, 215.0, 215.0, 230.0, 231.0, 270.0])
    root = straying_root(times)
    np.testing.assert_allclose(root @ root.T, straying(times), atol=1e-6)
    np.testing.assert_allclose(straying_root(times[:5]), root[:5, :5], rtol=1e-9, atol=1e-12)
