"""Fruits that have stopped growing and hang on: told from the others, which grow as if they were not there."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from growth_maker import FRUITS_OF_TREE, HARVEST, GrownRow, grow_row, rows_of
from pomona.growth.bearing_trees import BearingTrees
from pomona.growth.curve_families import FAMILIES
from pomona.growth.fruit_order import _stretches
from pomona.growth.growth_tables import write_tables
from pomona.growth.hierarchy import Hierarchy, Shape
from pomona.growth.measured import measured_fruits
from pomona.growth.mixed_quantiles import mixed_quantile
from pomona.growth.season_growth import SeasonGrowth, grow_season, growth_of
from pomona.growth.size_table import SizeTable
from pomona.growth.stop_shares import StopShares
from pomona.growth.stopped_fruits import fates, four_numbers, stopped_growth
from pomona.growth.visit_warnings import of_visits

STOPPED = np.arange(3, 90, 10)
STOPPED_ON = 72.0


@pytest.fixture(scope="module")
def stopped(grown_row: GrownRow, row_growth: SeasonGrowth) -> SeasonGrowth:
    """The same, but every tenth fruit stays as it was on a day between the second visit and the third."""
    sizes_mm = row_growth.fruits.diameters_mm.copy()
    for visit, day in enumerate(grown_row.days):
        if day > STOPPED_ON:
            lost_mm = grown_row.sizes_mm(day) - grown_row.sizes_mm(STOPPED_ON)
            sizes_mm[STOPPED, visit] -= lost_mm[_numbers(row_growth)[STOPPED]]
    return growth_of(replace(row_growth.fruits, diameters_mm=sizes_mm), harvest=HARVEST)


def _numbers(grown: SeasonGrowth) -> np.ndarray:
    return np.array([int(labels[0].split()[1]) for labels in grown.fruits.labels])


@pytest.mark.parametrize(("slowed_from", "is_told"), [(0.0, False), (76.0, True)])
def test_that_all_fruits_have_hardly_grown_is_told(tmp_path: Path, slowed_from: float, is_told: bool) -> None:
    """Curves go on where one visit alone says that a whole row does not: it may be off."""
    slow = range(3 * FRUITS_OF_TREE) if is_told else ()
    row = grow_row(tmp_path / "o.gpkg", (50, 75, 100), dropping=slow, slowed_from=slowed_from)
    lines = [line for line in of_visits(grow_season(row.path)) if "have they stopped?" in line]
    assert len(lines) == is_told
    if is_told:
        assert lines[0].startswith("fruits grew by ")
        assert f"from {row.day(75)} to {row.day(100)} where the curves say +" in lines[0]


def test_a_row_that_slows_down_has_its_slower_rate(tmp_path: Path) -> None:
    """A quarter of the pace for the month before the last of four visits: growth has strayed, no visit is off."""
    row = grow_row(tmp_path / "o.gpkg", (50, 65, 80, 110), dropping=range(90), slowed_from=80.0)
    rate = np.mean(row.sizes_mm(110.5) - row.sizes_mm(109.5))
    assert grow_season(row.path).foretold.rates_mm_per_day.mean() == pytest.approx(rate, abs=0.08)


def test_who_has_stopped_is_told(row_growth: SeasonGrowth, stopped: SeasonGrowth) -> None:
    assert row_growth.stopped.max() < 0.2
    assert stopped.stopped[STOPPED].min() > 0.9
    assert np.delete(stopped.stopped, STOPPED).max() < 0.2
    assert not stopped.odd[STOPPED].any()


def test_the_others_grow_as_if_they_were_not_there(row_growth: SeasonGrowth, stopped: SeasonGrowth) -> None:
    others = np.delete(np.arange(90), STOPPED)
    found, alone = stopped.foretold, row_growth.foretold
    ratios = found.rates_mm_per_day[others] / alone.rates_mm_per_day[others]
    assert np.median(ratios) == pytest.approx(1.0, abs=0.02)
    # One or two are so slow that they might have stopped just now.
    assert np.quantile(np.abs(ratios - 1.0), 0.95) < 0.06
    assert np.quantile(np.abs(found.sizes_mm[others] - alone.sizes_mm[others]), 0.95) < 1.0
    assert stopped.curve.name == row_growth.curve.name


def test_a_stopped_fruit_keeps_its_size(grown_row: GrownRow, stopped: SeasonGrowth) -> None:
    true_mm, told = grown_row.sizes_mm(STOPPED_ON)[_numbers(stopped)[STOPPED]], stopped.foretold
    for day in (3, 4):
        inside = (told.lows_mm[STOPPED, day] <= true_mm) & (true_mm <= told.highs_mm[STOPPED, day])
        assert inside.mean() > 0.85
    assert told.rates_mm_per_day[STOPPED].max() < 0.1
    # Two sizes after the stop, 15 days apart, do not rule out that one grows on a little, or shrinks.
    foretold_mm = told.sizes_mm[STOPPED, 4] - told.sizes_mm[STOPPED, 3]
    assert abs(foretold_mm.mean()) < 0.3
    assert np.abs(foretold_mm).max() < 1.5
    # Means and classes of the row hold both.
    means = told.summaries["blocks"].mean(axis=0)[0]
    assert means[4] == pytest.approx(told.sizes_mm[:, 4].mean(), abs=0.3)


def test_one_small_size_shows_no_growth(row_growth: SeasonGrowth) -> None:
    """What was measured once is small for any reason: it is no fruit more often than one that has stopped."""
    sizes_mm = row_growth.fruits.diameters_mm.copy()
    sizes_mm[STOPPED, :-1] = np.nan
    sizes_mm[STOPPED, -1] *= np.linspace(0.55, 1.1, len(STOPPED))
    found = growth_of(replace(row_growth.fruits, diameters_mm=sizes_mm))
    # Learned of these too, the share would be four times as large, and so would the doubt in all.
    assert np.delete(found.stopped, STOPPED).mean() < 0.002
    assert found.stopped[STOPPED].mean() < 0.3


def test_four_numbers_are_those_of_one_gaussian() -> None:
    times = np.array([0.0, 20.0, 45.0, 60.0])
    logs = np.log(np.array([[40.0, 52.0, 60.0, 61.0], [38.0, np.nan, 54.0, 55.0]]))
    table = SizeTable.of(np.exp(logs), np.array([0, 0]), times)
    model = Hierarchy(table, FAMILIES["logistic"], Shape(0.03, -10.0, 0.07, 3.0, 0.02, 0.02, 2.0, 1e-4))
    effects, strayed = model.expected(), np.array([0.0, 0.01, 0.015, 0.02])
    shifts, columns = fates(model, strayed)
    for fruit in (0, 1):
        seen, told, true = table.seen[fruit], [], []
        for stop in range(5):
            trust = np.ones((1, 4))
            found = four_numbers(model, effects, strayed, np.array([fruit]), np.array([stop]), trust)
            told.append(found.log_densities[0])
            own = columns[stop][seen]
            covariance = own @ np.diag([0.07**2, 9.0, 1.0, 1.0]) @ own.T + np.diag(1.0 / model.whole[fruit][seen])
            away = (model.against(effects)[fruit] - shifts[stop])[seen]
            true.append(multivariate_normal(cov=covariance).logpdf(away))
        np.testing.assert_allclose(np.diff(told), np.diff(true), atol=1e-8)


def test_growth_ends_between_two_visits() -> None:
    growth = np.array([[0.0, 0.2, 0.3, 0.5]] * 4)
    ended = stopped_growth(growth, np.array([0, 1, 2, 3]), np.zeros(4), np.zeros(4))
    np.testing.assert_allclose(ended[0], 0.0)
    np.testing.assert_allclose(ended[1], [0.0, 0.1, 0.1, 0.1])
    np.testing.assert_allclose(ended[2], [0.0, 0.2, 0.25, 0.25])
    np.testing.assert_allclose(ended[3], [0.0, 0.2, 0.3, 0.4])


def test_what_has_stopped_may_grow_on_a_little() -> None:
    growth = np.array([[0.0, 0.2, 0.3, 0.5]] * 2)
    ended = stopped_growth(growth, np.array([1, 2]), np.zeros(2), np.array([1.0, -0.5]))
    np.testing.assert_allclose(ended[0], [0.0, 0.1, 0.1 + 0.15 * 0.1, 0.1 + 0.15 * 0.3])
    np.testing.assert_allclose(ended[1], [0.0, 0.2, 0.25, 0.25 - 0.075 * 0.2])


@pytest.mark.parametrize("keeps", [0.0, 0.15], ids=["stands", "grows on a little"])
@pytest.mark.parametrize("trees", [(1,), (0, 2)], ids=["one tree", "two trees"])
def test_trees_that_have_stopped_are_told_from_the_others(
    grown_row: GrownRow, row_growth: SeasonGrowth, trees: tuple[int, ...], keeps: float
) -> None:
    """One curve for both suited neither, with onsets far apart and scales of visits that double, and none had stopped.

    In logarithms: a fruit's size is its own, and 2 % a size are as good as any other noise.
    """
    fruits = row_growth.fruits
    dry = np.isin(_numbers(row_growth) // 30, trees)
    until, sizes_mm = 58.0, fruits.diameters_mm.copy()
    for visit, day in enumerate(grown_row.days):
        lost = np.log(grown_row.sizes_mm(max(day, until)) / grown_row.sizes_mm(until))[_numbers(row_growth)]
        sizes_mm[dry, visit] *= np.exp(-(1.0 - keeps) * lost[dry])
    found = growth_of(replace(fruits, diameters_mm=sizes_mm))
    assert found.stopped[dry].min() > 0.9
    assert np.median(found.stopped[~dry]) < 0.02
    assert np.abs(np.log(found.foretold.scales)).max() < 0.05
    rates, usual = found.foretold.rates_mm_per_day, row_growth.foretold.rates_mm_per_day
    assert np.median(rates[~dry] / usual[~dry]) == pytest.approx(1.0, abs=0.05)
    assert rates[dry].mean() == pytest.approx(keeps * usual[dry].mean(), abs=0.06)
    assert not of_visits(found)


@pytest.fixture(scope="module")
def long_row(tmp_path_factory: pytest.TempPathFactory) -> GrownRow:
    return grow_row(tmp_path_factory.mktemp("long") / "row.gpkg", (45, 65, 85, 105, 125), n_trees=6, scales=(1.0,) * 5)


@pytest.mark.parametrize("dry_trees", [(0, 1, 2), (0, 2, 4)], ids=["half a row", "every second tree"])
def test_half_a_row_of_another_sort_is_told_where_no_trees_are_known(
    long_row: GrownRow, dry_trees: tuple[int, ...]
) -> None:
    """One curve suits both sorts where visits may measure two and three times what there is."""
    fruits = measured_fruits(long_row.path)
    numbers = np.array([int(labels[0].split()[1]) for labels in fruits.labels])
    dry, rng = np.isin(numbers // 30, dry_trees), np.random.default_rng(3)
    sizes_mm = np.stack(
        [
            np.where(dry, long_row.sizes_mm(min(day, 77))[numbers], 0.75 * long_row.sizes_mm(day)[numbers])
            for day in long_row.days
        ],
        axis=1,
    )
    sizes_mm *= np.exp(rng.normal(0.0, 0.04, sizes_mm.shape)) * np.array([1.0, 1.02, 0.99, 1.01, 0.98])
    nowhere = BearingTrees(("",), np.zeros(len(numbers), np.int64), fruits.trees.along_m, ("",))
    found = growth_of(replace(fruits, diameters_mm=sizes_mm, trees=nowhere))
    assert (found.stopped[dry] > 0.5).mean() > 0.9
    assert (found.stopped[~dry] < 0.5).mean() > 0.9
    assert np.abs(np.log(found.foretold.scales)).max() < 0.08
    assert not of_visits(found)


def test_stretches_of_a_row_are_the_same_from_either_end() -> None:
    places = np.random.default_rng(1).permutation(60).astype(float)
    there, back = _stretches(places), _stretches(-places)
    assert np.bincount(there).tolist() == [30, 30]
    np.testing.assert_array_equal(there, 1 - back)
    assert _stretches(places[:10]).tolist() == [0] * 10


def test_shares_are_learned_where_a_stop_shows() -> None:
    """What stopped just before the last visit grew less, as do many that grow on."""
    sizes_mm = np.full((4, 3), 40.0)
    sizes_mm[3, 1:] = np.nan
    table = SizeTable.of(sizes_mm, np.array([0, 0, 1, 1]), np.array([0.0, 20.0, 40.0]))
    stops = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    shares = StopShares.learned(table, stops, np.array([1.0, 1.0, 1.0, 1.0]))
    # Three fruits show a stop in the first 30 of 50 days, one does; before them one of a hundred had.
    share = 2.0 / (100.0 + 3 * 0.6)
    np.testing.assert_allclose(shares.row, [0.2 * share, *[0.4 * share] * 2, 1.0 - share])
    np.testing.assert_allclose(shares.trees[0, :3], (5.0 * shares.row[:3] + [0.0, 1.0, 0.0]) / 7.0)
    np.testing.assert_allclose(shares.trees[1, :3], 5.0 * shares.row[:3] / 6.0)
    np.testing.assert_allclose(shares.trees.sum(axis=1), 1.0)
    assert shares.log_prior() < StopShares.before(table).log_prior()


@pytest.mark.parametrize("later", [1, 3])
def test_two_visits_of_one_day_tell_what_each_tells(row_growth: SeasonGrowth, later: int) -> None:
    """No fruit stops between them; growth ended there in a failure."""
    fruits = row_growth.fruits
    moments = list(fruits.moments)
    moments[later] = moments[later - 1]
    sizes_mm = fruits.diameters_mm.copy()
    sizes_mm[:, later] = sizes_mm[:, later - 1]
    found = growth_of(replace(fruits, diameters_mm=sizes_mm, moments=tuple(moments)))
    assert np.isfinite(found.foretold.sizes_mm).all()
    # One of ninety may have stopped, by growth over less of the season.
    assert np.median(found.stopped) < 0.05
    ratios = found.foretold.sizes_mm[:, 0] / row_growth.foretold.sizes_mm[:, 0]
    assert np.median(ratios) == pytest.approx(1.0, abs=0.03)


def test_a_quantile_asks_nothing_of_what_has_no_weight() -> None:
    weights, means = [np.array([1.0, 0.5]), np.array([0.0, 0.5])], [np.array([3.0, 0.0]), np.array([np.nan, 10.0])]
    sigmas = [np.ones(2), np.array([np.nan, 1.0])]
    np.testing.assert_allclose(mixed_quantile(0.5, weights, means, sigmas), [3.0, 5.0], atol=0.01)


def test_the_table_says_who_has_stopped(tmp_path: Path, stopped: SeasonGrowth) -> None:
    write_tables(tmp_path, stopped, pack_kg=13.0)
    lines = {int(line["fruit_id"]): line for line in rows_of(tmp_path / "fruits.csv")}
    told = [float(lines[fruit]["stopped_probability"]) for fruit in stopped.fruits.ids[STOPPED].tolist()]
    assert min(told) > 0.9
