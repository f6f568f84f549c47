"""Growth of the fruits of a map against curves that are known: sizes, rates, forecasts and how far each is trusted."""

from dataclasses import astuple, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from benchmarks.growth_draw import as_fruits, draw_sizes
from benchmarks.growth_outside import course_outside
from benchmarks.growth_scores import scores
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import multivariate_normal

from command_line import Pomona
from growth_maker import BLOOM, HARVEST, GrownRow, grow_row, rows_of
from pomona import FruitCloud
from pomona.growth.bearing_trees import BearingTrees
from pomona.growth.blocks import Block, blocks_of
from pomona.growth.chance import Chance
from pomona.growth.curve_families import FAMILIES, CurveFamily, FamilyName
from pomona.growth.drawn_fruits import CAMERA_SPREAD
from pomona.growth.fitting import fit_shape
from pomona.growth.foretelling import NINETY
from pomona.growth.hierarchy import Hierarchy, Shape
from pomona.growth.measured import MeasuredFruits
from pomona.growth.mixed_quantiles import mixed_quantile
from pomona.growth.season_growth import SeasonGrowth, grow_season, growth_of
from pomona.growth.size_table import SizeTable
from pomona.growth.straying import SPELL_DAYS, straying
from pomona.orchard import OrchardMap, Session, add_session
from pomona.synth.seasons import SEASONS


def true_of(row: GrownRow, grown: SeasonGrowth, days: float) -> np.ndarray:
    """True sizes in the order of the growth's fruits."""
    numbers = [int(labels[0].split()[1]) for labels in grown.fruits.labels]
    return row.sizes_mm(days)[numbers]


def small_table() -> SizeTable:
    rng = np.random.default_rng(1)
    sizes_mm = 50.0 * np.exp(rng.normal(0.0, 0.1, (5, 3)) + np.array([-0.3, 0.0, 0.2]))
    sizes_mm[1, 0] = sizes_mm[3, 2] = np.nan
    return SizeTable.of(sizes_mm, np.array([0, 0, 0, 1, 1]), np.array([100.0, 114.0, 130.0]))


SHAPE = Shape(0.09, 95.0, 0.07, 3.0, 0.02, 0.025, 2.0, 0.001)


@pytest.mark.parametrize("name", FAMILIES)
def test_the_likelihood_is_that_of_one_large_gaussian(name: str) -> None:
    """All effects as one covariance of all measurements: what the elimination step by step must come to."""
    table, family = small_table(), FAMILIES[name]
    model = Hierarchy(table, family, SHAPE)
    fruits, visits = np.nonzero(table.seen)
    x = SHAPE.rate_per_day * (table.times - SHAPE.onset_day)
    slopes = (-SHAPE.rate_per_day * family.slope(x))[visits]
    middle = np.log(30.0) - model.log_size(np.array(SHAPE.onset_day))
    same_fruit, same_visit = fruits[:, None] == fruits, visits[:, None] == visits
    same_tree = table.trees[fruits][:, None] == table.trees[fruits]
    covariance = 0.2**2 + SHAPE.visit_spread**2 * same_visit + SHAPE.tree_spread**2 * same_tree
    covariance = covariance + SHAPE.stray_per_day**2 * straying(table.times)[np.ix_(visits, visits)]
    of_fruit = SHAPE.fruit_spread**2 + SHAPE.onset_spread_days**2 * np.outer(slopes, slopes)
    covariance = covariance + of_fruit * same_fruit + np.diag((SHAPE.noise_mm / table.typical_mm[visits]) ** 2)
    away = table.logs[fruits, visits] - middle - model.log_size(table.times)[visits]
    expected = -0.5 * (away @ np.linalg.solve(covariance, away) + np.linalg.slogdet(2 * np.pi * covariance)[1])
    assert model.log_likelihood() == pytest.approx(expected, abs=1e-8)
    # The expectations are those of the same Gaussian: the fruit's size given all measurements.
    gain = SHAPE.fruit_spread**2 * (fruits[:, None] == np.arange(5)).T
    np.testing.assert_allclose(model.expected().sizes, gain @ np.linalg.solve(covariance, away), atol=1e-9)


@pytest.mark.parametrize("name", FAMILIES)
def test_shapes_at_once_are_as_likely_as_one_by_one(name: str) -> None:
    numbers = np.array(astuple(SHAPE)) * np.random.default_rng(2).uniform(0.8, 1.25, (7, 8))
    table, family = small_table(), FAMILIES[name]
    at_once = Hierarchy(table, family, Shape(*numbers.T)).log_likelihood()
    one_by_one = [Hierarchy(table, family, Shape(*each.tolist())).log_likelihood() for each in numbers]
    np.testing.assert_allclose(at_once, one_by_one, rtol=0, atol=1e-9)


N_DRAWS = 4096


def chance_of(n_visits: int) -> Chance:
    return Chance("test", N_DRAWS, 9, n_visits)


def test_draws_scatter_about_their_expectation() -> None:
    model, chance = Hierarchy(small_table(), FAMILIES["expolinear"], SHAPE), chance_of(3)
    drawn, expected = [], model.expected()
    for _ in range(N_DRAWS):
        chance.next_draw()
        drawn.append(model.draw(chance))
    for name in ("visits", "trees", "sizes", "onsets_days"):
        values = np.array([getattr(one, name) for one in drawn])
        np.testing.assert_allclose(values.mean(axis=0), getattr(expected, name), atol=4 * values.std() / 60)
    # A fruit's size given all others: two fruits of one tree, measured alike, are as unsure.
    spread = np.array([one.sizes for one in drawn]).std(axis=0)
    assert spread[0] == pytest.approx(spread[2], rel=0.1)


def test_straying_is_the_sum_of_days_that_are_alike() -> None:
    """Its closed form against days that are summed up one by one."""
    days = np.arange(0.0, 90.0, 0.5) + 0.25
    alike = np.exp(-np.abs(days[:, None] - days) / SPELL_DAYS)
    times = np.array([200.0, 215.0, 215.0, 260.0, 290.0])
    until = (days < (times - times[0])[:, None]) * 0.5
    np.testing.assert_allclose(straying(times), until @ alike @ until.T, rtol=2e-3, atol=1e-9)


def test_draws_of_straying_and_errors_add_up_to_what_visits_share() -> None:
    table, times = small_table(), np.array([100.0, 114.0, 130.0, 190.0])
    model = Hierarchy(table, FAMILIES["expolinear"], SHAPE)
    effects, chance, strays = model.expected(), chance_of(3), []
    for _ in range(N_DRAWS):
        chance.next_draw()
        strays.append(model.draw_stray(effects, times, chance))
    drawn = np.array(strays)
    covariance = SHAPE.stray_per_day**2 * straying(times)
    shared = covariance[:3, :3] + SHAPE.visit_spread**2 * np.eye(3)
    gain = covariance[:, :3] @ np.linalg.inv(shared)
    np.testing.assert_allclose(drawn.mean(axis=0), gain @ effects.visits, atol=0.0025)
    np.testing.assert_allclose(np.cov(drawn.T), covariance - gain @ covariance[:3], atol=1.5e-4)
    # Nothing is known of the weeks after the last visit: there it is widest.
    assert drawn[:, 3].std() > 2.0 * drawn[:, 2].std()


def test_quantiles_of_a_mixture_are_those_of_its_draws() -> None:
    rng = np.random.default_rng(4)
    means, sigmas = [np.array([0.0, 2.0]), np.array([-3.0, 2.0])], [np.array([1.0, 0.5]), np.array([0.2, 0.5])]
    drawn = np.concatenate([rng.normal(m, s, (n, 2)) for m, s, n in zip(means, sigmas, (150_000, 50_000), strict=True)])
    for level in (0.05, 0.5, 0.95):
        found = mixed_quantile(level, (0.75, 0.25), means, sigmas)
        np.testing.assert_allclose(found, np.quantile(drawn, level, axis=0), atol=0.02)
        np.testing.assert_allclose(mixed_quantile(level, (1.0,), means[1:], sigmas[1:])[1], found[1], atol=1e-6)


@pytest.mark.parametrize("family", FAMILIES.values(), ids=list(FAMILIES))
def test_slopes_are_those_of_the_curves(family) -> None:
    x = np.linspace(-8.0, 20.0, 57)
    differences = (family.log_size(x + 1e-5) - family.log_size(x - 1e-5)) / 2e-5
    np.testing.assert_allclose(family.slope(x), differences, rtol=1e-6, atol=1e-9)
    assert np.isfinite(family.log_size(np.array([-1e4, 1e4]))).all()


def test_sizes_rates_and_forecasts_are_near_the_truth(grown_row: GrownRow, row_growth: SeasonGrowth) -> None:
    told = row_growth.foretold
    rates = true_of(grown_row, row_growth, 95.5) - true_of(grown_row, row_growth, 94.5)
    assert np.median(np.abs(told.rates_mm_per_day - rates)) < 0.03
    assert np.abs(told.sizes_mm[:, 3] - true_of(grown_row, row_growth, 95)).mean() < 1.5
    low, high = told.lows_mm[:, -1], told.highs_mm[:, -1]
    true = true_of(grown_row, row_growth, 135)
    assert np.mean((low < true) & (true < high)) > 0.8
    mean = told.summaries["blocks"][:, 0, -2]
    assert np.quantile(mean, 0.05) < true.mean() < np.quantile(mean, 0.95)
    # A block's mean is surer than a fruit, and never as sure as fruits whose errors were their own would make it.
    assert (high - low).mean() > np.ptp(np.quantile(mean, (0.05, 0.95))) > 0.5


def test_what_no_curve_foretells_is_in_the_interval() -> None:
    """Growth that slows down towards the harvest, which three visits do not show: 3 mm less than the curve says."""
    drawn = draw_sizes(SEASONS["hard"], 1, course_outside("slowing", 1))
    found = scores(growth_of(drawn.fruits, harvest=drawn.harvest.date()), drawn)
    assert found["bias_mm"] > 2.5
    assert found["block_covered"]
    assert found["fruits_covered"] > 0.8 * found["n_fruits"]


def test_rates_of_three_visits_hold_a_bend_that_is_sharper_than_usual() -> None:
    """Growth that falls from 0.9 to 0.4 mm a day in five weeks, where the usual curve falls to 0.5."""
    rng, days = np.random.default_rng(5), np.array([0.0, 16.0, 34.0])
    last_mm, onsets = 72.0 * np.exp(rng.normal(0.0, 0.08, (60, 1))), rng.normal(0.0, 3.0, (60, 1))
    rates = (0.026 * last_mm * np.exp(-0.026 * (days[-1] + 25.0 - onsets)))[:, 0]
    true_mm = last_mm * (1.0 - np.exp(-0.026 * (days + 25.0 - onsets)))
    sizes_mm = true_mm * np.exp(rng.normal(0.0, 0.035, (60, 3)))
    moments = tuple(datetime(2024, 5, 25) + timedelta(day) for day in days)
    told = growth_of(as_fruits(sizes_mm, np.zeros(60, np.int64), moments, np.ones(60, bool))).foretold
    surprises = (told.rates_mm_per_day - rates) / told.rate_sigmas_mm_per_day
    assert np.mean(np.abs(surprises) < ndtri(NINETY[1])) > 0.85
    low, high = np.quantile(told.summaries["blocks"][:, 0, -1], NINETY)
    assert low < rates.mean() < high


def test_a_forecast_is_the_wider_the_farther_ahead(row_growth: SeasonGrowth) -> None:
    soon = growth_of(row_growth.fruits, harvest=BLOOM + timedelta(days=105)).foretold
    logs = [np.log(told.summaries["blocks"][:, 0, -2]) for told in (soon, row_growth.foretold)]
    # What all visits share is as wide on every day.
    spreads = [np.sqrt(each.var() - CAMERA_SPREAD**2) for each in logs]
    assert spreads[1] > 1.4 * spreads[0]
    assert sum(curve.weight for curve in row_growth.curves) == pytest.approx(1.0)
    assert len(row_growth.curves) == len(FAMILIES)


def test_the_error_that_a_visit_shares_is_told(row_growth: SeasonGrowth) -> None:
    told = np.log(row_growth.foretold.scales)
    assert np.corrcoef(told - told.mean(), np.log([1.0, 1.02, 0.99, 1.01]))[0, 1] > 0.8
    assert row_growth.curve.fitted.likeliest.noise_mm == pytest.approx(1.0, abs=0.15)


def test_the_same_map_gives_the_same_growth(grown_row: GrownRow, row_growth: SeasonGrowth) -> None:
    again = grow_season(grown_row.path, harvest=HARVEST)
    np.testing.assert_array_equal(again.foretold.sizes_mm, row_growth.foretold.sizes_mm)
    np.testing.assert_array_equal(again.foretold.summaries["counts"], row_growth.foretold.summaries["counts"])


def _exact_sizes(family: CurveFamily, rate_per_day: float, times: NDArray[np.float64]) -> SizeTable:
    """Two hundred fruits, 74 mm as a median on the last day, without noise to speak of."""
    rng = np.random.default_rng(3)
    curve = family.log_size(rate_per_day * (times - times[0] + 10.0))
    sizes = np.exp(4.3 + 0.06 * rng.normal(size=(200, 1)) + curve - curve[-1])
    return SizeTable.of(sizes + rng.normal(0.0, 0.2, sizes.shape), np.zeros(200, np.int64), times)


@pytest.mark.parametrize("truth", FAMILIES)
def test_the_families_are_told_apart_where_sizes_tell(truth: FamilyName) -> None:
    """Over a season in which growth ends. By little: any other curve is one that growth has strayed from."""
    table = _exact_sizes(FAMILIES[truth], FAMILIES[truth].usual_rate_per_day, np.linspace(120.0, 360.0, 9))
    evidence = {name: fit_shape(table, family).log_evidence for name, family in FAMILIES.items()}
    assert max(evidence, key=lambda name: evidence[name]) == truth


@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)
def test_rounding_does_not_end_the_climb(family: CurveFamily) -> None:
    """Sums in another order round differently; sizes this exact, of a rate that nobody expects, make steep slopes."""
    table = _exact_sizes(FAMILIES["logistic"], 0.09, np.linspace(140.0, 260.0, 9))
    turned = SizeTable.of(np.exp(table.logs[::-1]), table.trees, table.times)
    fits = [fit_shape(each, family) for each in (table, turned)]
    assert fits[0].log_evidence == pytest.approx(fits[1].log_evidence, abs=0.05)
    assert fits[0].likeliest.rate_per_day == pytest.approx(fits[1].likeliest.rate_per_day, rel=0.01)


def test_a_size_of_another_fruit_is_put_aside(tmp_path: Path, grown_row: GrownRow, row_growth: SeasonGrowth) -> None:
    sizes_mm = row_growth.fruits.diameters_mm.copy()
    sizes_mm[7, 2] += 25.0
    found = growth_of(replace(row_growth.fruits, diameters_mm=sizes_mm), harvest=HARVEST)
    assert found.put_aside[7, 2]
    assert found.odd[7]
    assert found.put_aside.sum() <= 2
    assert found.foretold.sizes_mm[7, -1] == pytest.approx(row_growth.foretold.sizes_mm[7, -1], abs=2.0)


@pytest.mark.parametrize("n", [1, 2])
def test_few_fruits_and_no_growth_have_curves_too(row_growth: SeasonGrowth, n: int) -> None:
    """Priors carry what two sizes cannot; equal sizes are no division by nothing."""
    few = row_growth.fruits
    some = replace(
        few,
        cloud=few.cloud.select(np.arange(n)),
        ids=few.ids[:n],
        trees=few.trees.select(np.arange(n)),
        diameters_mm=np.full((n, 4), 60.0),
        labels=few.labels[:n],
    )
    found = growth_of(some, harvest=HARVEST)
    assert np.isfinite(found.foretold.sizes_mm).all()
    assert (found.foretold.lows_mm < found.foretold.highs_mm).all()
    np.testing.assert_allclose(found.foretold.sizes_mm[:, 3], 60.0, atol=6.0)


def test_a_visit_of_another_scale_is_carried_by_its_shared_error(tmp_path: Path) -> None:
    """Fruits of harvest size in spring: the search for a curve comes where numbers end, and goes on."""
    row = grow_row(tmp_path / "spring.gpkg", days=(6, 50, 85, 120), scales=(18.0, 1.0, 1.0, 1.0), n_trees=2)
    found = grow_season(row.path)
    assert np.isfinite(found.foretold.sizes_mm).all()
    assert found.foretold.scales[0] > 1.5


def test_fruits_that_are_gone_count_in_no_block(row_growth: SeasonGrowth) -> None:
    fruits = row_growth.fruits
    states = tuple("gone" if row < 40 else "seen" for row in range(90))
    cloud = replace(fruits.cloud, extras={**fruits.cloud.extras, "state": states})
    found = blocks_of(replace(fruits, cloud=cloud))
    assert [block.n_fruits for block in found] == [50, 20, 30]
    in_rows = replace(fruits.cloud, extras={"row": ("east",) * 30 + ("west",) * 59 + ("",)})
    of_rows = [block for block in blocks_of(replace(fruits, cloud=in_rows)) if block.kind == "row"]
    rows = [(block.name, block.n_fruits) for block in of_rows]
    assert rows == [("east", 30), ("west", 59)]
    over = replace(fruits.cloud, extras={"state": ("gone",) * 90})
    assert blocks_of(replace(fruits, cloud=over))[0].n_fruits == 90


def test_fruits_of_no_tree_are_a_block_where_others_have_one(
    pomona: Pomona, grown_row: GrownRow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def told_otherwise(cloud: FruitCloud) -> BearingTrees:
        numbers = np.repeat([0, 1, 2], [30, 55, 5])
        return BearingTrees(("1", "tree 2", ""), numbers, cloud.positions[:, 0], ("", "", ""))

    monkeypatch.setattr("pomona.growth.measured.bearing_trees", told_otherwise)
    code, printed, told = pomona("growth", grown_row.path, "-o", tmp_path / "g")
    assert (code, told) == (0, "")
    lines = {line[:20].strip(): int(line[20:].split()[0]) for line in printed.splitlines()[-4:]}
    assert lines == {"all": 90, "tree 1": 30, "tree 2": 55, "no tree": 5}
    blocks = [(one["block"], one["name"], one["n_fruits"]) for one in rows_of(tmp_path / "g" / "blocks.csv")]
    assert blocks == [("all", "", "90"), ("tree", "1", "30"), ("tree", "tree 2", "55"), ("tree", "", "5")]
    titles = [Block(kind, name, np.ones(1, bool)).title for kind, name in (("row", "row 1"), ("row", "1"), ("all", ""))]
    assert titles == ["row 1", "row 1", "all"]


def judged(grown: SeasonGrowth, **extras: tuple[str, ...]) -> MeasuredFruits:
    return replace(grown.fruits, cloud=replace(grown.fruits.cloud, extras=extras))


def test_each_counts_by_the_probability_that_it_is_a_fruit_and_hangs(row_growth: SeasonGrowth) -> None:
    fruits = judged(
        row_growth,
        state=("seen", "new", "missed", "missed", "gone", "gone") + ("seen",) * 84,
        state_probability=("0.7", "0.3", "0.1", "", "0.8", "") + ("1.0",) * 84,
        fruit_probability=("0.9", "0.3", "0.5", "0.6", "0.5", "1.0") + ("1.0",) * 84,
    )
    expected = [0.7, 0.3, 0.05, 0.6, 0.1, 0.0, *[1.0] * 84]
    found = blocks_of(fruits)
    np.testing.assert_allclose(found[0].chances, expected, atol=1e-12)
    assert [block.n_fruits for block in found] == [86, 26, 30, 30]
    assert fruits.hanging.tolist() == [True] * 2 + [False, True, False, False] + [True] * 84, "as forecasts are told"
    sizes_mm = np.array([10.0] * 6 + [60.0] * 84)
    assert found[1].mean_of(sizes_mm) == pytest.approx((1.75 * 10.0 + 24 * 60.0) / 25.75)


def test_trees_on_which_half_a_fruit_is_expected_are_no_block(row_growth: SeasonGrowth) -> None:
    """Two of three trees were picked: of their fruits the map says missed, and that one in a hundred hangs."""
    states, sure = ("missed",) * 60 + ("seen",) * 30, ("0.01",) * 60 + ("1.0",) * 30
    assert [block.n_fruits for block in blocks_of(judged(row_growth, state=states, state_probability=sure))] == [31, 30]
    assert [block.n_fruits for block in blocks_of(judged(row_growth, state=states))] == [90, 30, 30, 30]


def test_counts_kilograms_and_classes_hold_the_doubt_of_what_hangs(row_growth: SeasonGrowth) -> None:
    """Of 60 missed fruits one in ten hangs: 36 are expected, and no 90; what is believed errs for all 60 together."""
    picked = judged(
        row_growth, state=("missed",) * 60 + ("seen",) * 30, state_probability=("0.1",) * 60 + ("1.0",) * 30
    )
    found, sure = growth_of(picked, harvest=HARVEST), row_growth.foretold.summaries
    told = found.foretold.summaries
    # Two hang both with more than .1 * .1: two fifths of the variance of their lots are common.
    both = multivariate_normal.cdf([ndtri(0.1)] * 2, cov=[[1.0, 0.4], [0.4, 1.0]])
    spread = np.sqrt(60 * 0.1 * 0.9 + 60 * 59 * (both - 0.1 * 0.1))
    assert spread > 3.0 * np.sqrt(60 * 0.1 * 0.9)
    n_fruits = told["n_fruits"][:, 0]
    assert found.blocks[0].n_fruits == 36
    assert n_fruits.mean() == pytest.approx(36, abs=0.5)
    assert n_fruits.std() == pytest.approx(spread, rel=0.15)
    assert sure["n_fruits"][:, 0].std() < 1e-9, "of what is sure to hang there is no doubt"
    low, high = np.quantile(n_fruits, NINETY)
    assert low == pytest.approx(30.0, abs=1.0), "none of what is sure to hang is missing"
    assert 36 + 1.645 * spread < high < 36 + 3.0 * spread
    of_classes, kg, kg_of_all = told["counts"][:, :, -1], told["masses_kg"][:, :, -1], sure["masses_kg"][:, :, -1]
    assert of_classes.mean(axis=0).sum() == pytest.approx(36, abs=0.5)
    assert kg.mean(axis=0).sum() / kg_of_all.mean(axis=0).sum() == pytest.approx(36 / 90, rel=0.1)
    np.testing.assert_array_equal(found.foretold.sizes_mm, row_growth.foretold.sizes_mm, "forecasts of fruits stay")


def test_an_error_that_all_visits_share_is_in_the_intervals(row_growth: SeasonGrowth) -> None:
    """Of one camera: all sizes 3 % too large move all that is told, and stay inside; differences hardly widen."""
    larger = growth_of(replace(row_growth.fruits, diameters_mm=1.03 * row_growth.fruits.diameters_mm), harvest=HARVEST)
    now = len(row_growth.fruits.days) - 1
    true = row_growth.foretold.sizes_mm[:, now]
    lows, highs = (each[:, now] for each in (larger.foretold.lows_mm, larger.foretold.highs_mm))
    assert np.mean((lows < true) & (true < highs)) > 0.95
    means = larger.foretold.summaries["blocks"][:, 0]
    assert np.log(means[:, now]).std() > CAMERA_SPREAD
    assert means[:, -1].std() / means[:, -1].mean() < 0.2
    grew = np.log(means[:, now + 1] / means[:, now])
    assert grew.std() < CAMERA_SPREAD


def test_two_visits_of_one_day_have_an_error_each(tmp_path: Path) -> None:
    row = grow_row(tmp_path / "twice.gpkg", days=(50, 65), scales=(1.0, 1.0))
    again = OrchardMap(row.path).fruits()
    scattered = again.positions + np.random.default_rng(1).normal(0, 0.003, again.positions.shape)
    cloud = FruitCloud(scattered, diameters_m=1.05 * row.curves.diameters_m(65.2))
    assert add_session(row.path, Session("evening", f"{row.day(65)}T18:00:00", "drawn", cloud)).is_added
    found = grow_season(row.path)
    assert len(found.fruits.days) == 3
    assert found.foretold.scales[2] > found.foretold.scales[1] + 0.02
    assert found.fruits.n_days.max() == 2


def test_sizes_that_were_copied_from_one_visit_to_the_next_can_be_told(tmp_path: Path) -> None:
    path = grow_row(tmp_path / "orchard.gpkg", (50,), n_trees=1).path
    fruits = OrchardMap(path).fruits()
    scattered = fruits.positions + np.random.default_rng(1).normal(0, 0.005, fruits.positions.shape)
    again = FruitCloud(scattered, diameters_m=fruits.diameters_m)
    assert add_session(path, Session("again", "2024-07-01", "drawn", again)).is_added
    grown = grow_season(path)
    assert np.isfinite(grown.foretold.sizes_mm).all()
    assert (np.abs(grown.foretold.rates_mm_per_day) < 0.2).all()
