"""Growth of the fruits of a map against curves that are known, and what its tables, pictures and refusals are."""

import csv
import json
import re
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from benchmarks.growth_draw import draw_sizes
from benchmarks.growth_outside import course_outside
from benchmarks.growth_scores import scores
from numpy.typing import NDArray

from growth_maker import BLOOM, GrownRow, grow_row
from pomona import FruitCloud, PomonaError, geopackage
from pomona.growth.bearing_trees import BearingTrees
from pomona.growth.blocks import Block, blocks_of
from pomona.growth.chance import Chance
from pomona.growth.curve_families import FAMILIES, CurveFamily, FamilyName
from pomona.growth.drawn_names import drawn_name
from pomona.growth.fitting import fit_shape
from pomona.growth.foretelling import CAMERA_SPREAD
from pomona.growth.growth_pictures import draw_curves, draw_variability
from pomona.growth.growth_pictures import draw_sizes as draw_size_classes
from pomona.growth.hierarchy import Hierarchy, Shape
from pomona.growth.mixed_quantiles import mixed_quantile
from pomona.growth.season_growth import SeasonGrowth, grow_season, growth_of
from pomona.growth.size_classes import class_counts, parsed_classes
from pomona.growth.size_table import SizeTable
from pomona.growth.straying import SPELL_DAYS, straying
from pomona.orchard import OrchardMap, Session, add_session
from pomona.synth.seasons import SEASONS
from pomona.viewer.season_page import Wishes, season_document

Pomona = Callable[..., tuple[int, str, str]]

HARVEST = BLOOM + timedelta(days=135)


@pytest.fixture(scope="module")
def row(tmp_path_factory: pytest.TempPathFactory) -> GrownRow:
    return grow_row(tmp_path_factory.mktemp("row") / "orchard.gpkg")


@pytest.fixture(scope="module")
def grown(row: GrownRow) -> SeasonGrowth:
    return grow_season(row.path, harvest=HARVEST)


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


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


def test_sizes_rates_and_forecasts_are_near_the_truth(row: GrownRow, grown: SeasonGrowth) -> None:
    told = grown.foretold
    rates = true_of(row, grown, 95.5) - true_of(row, grown, 94.5)
    assert np.median(np.abs(told.rates_mm_per_day - rates)) < 0.03
    assert np.abs(told.sizes_mm[:, 3] - true_of(row, grown, 95)).mean() < 1.5
    low, high = told.lows_mm[:, -1], told.highs_mm[:, -1]
    true = true_of(row, grown, 135)
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


def test_a_forecast_is_the_wider_the_farther_ahead(grown: SeasonGrowth) -> None:
    soon = growth_of(grown.fruits, harvest=BLOOM + timedelta(days=105)).foretold
    logs = [np.log(told.summaries["blocks"][:, 0, -2]) for told in (soon, grown.foretold)]
    # What all visits share is as wide on every day.
    spreads = [np.sqrt(each.var() - CAMERA_SPREAD**2) for each in logs]
    assert spreads[1] > 1.4 * spreads[0]
    assert sum(curve.weight for curve in grown.curves) == pytest.approx(1.0)
    assert len(grown.curves) == len(FAMILIES)


def test_what_is_gone_has_no_size_now(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    """Its curve ends with the visit that measured it last; tables, layers and the page say the same."""
    path = tmp_path / "orchard.gpkg"
    path.write_bytes(row.path.read_bytes())
    with closing(geopackage.connect(path)) as connection, connection:
        sessions = [number for (number,) in connection.execute("SELECT id FROM sessions ORDER BY date")]
        connection.execute("UPDATE fruits SET state = 'gone', last_session_id = ? WHERE id = 7", (sessions[1],))
        connection.execute("DELETE FROM observations WHERE fruit_id = 7 AND session_id IN (?, ?)", sessions[2:])
    assert pomona("growth", path, "-o", tmp_path / "g", "--harvest", HARVEST)[0] == 0
    gone = next(line for line in rows_of(tmp_path / "g" / "fruits.csv") if line["fruit_id"] == "7")
    assert {gone[name] for name in ("rate_mm_per_day", "rate_sigma_mm_per_day", "forecast_mm")} == {""}
    days = [line["date"] for line in rows_of(tmp_path / "g" / "curves.csv") if line["fruit_id"] == "7"]
    assert days == [str(row.day(50)), str(row.day(65))]
    assert pomona("export", path, "-o", tmp_path / "g.csv", "--growth", "--harvest", HARVEST)[0] == 0
    exported = {line["id"]: line for line in rows_of(tmp_path / "g.csv")}
    assert {exported["7"][name] for name in ("size_mm", "rate_mm_per_day", "forecast_mm")} == {""}
    assert exported["7"]["diameter_m"] != ""
    assert float(exported["8"]["size_mm"]) > 40.0


def test_the_error_that_a_visit_shares_is_told(grown: SeasonGrowth) -> None:
    told = np.log(grown.foretold.scales)
    assert np.corrcoef(told - told.mean(), np.log([1.0, 1.02, 0.99, 1.01]))[0, 1] > 0.8
    assert grown.curve.fitted.likeliest.noise_mm == pytest.approx(1.0, abs=0.15)


def test_the_same_map_gives_the_same_growth(row: GrownRow, grown: SeasonGrowth) -> None:
    again = grow_season(row.path, harvest=HARVEST)
    np.testing.assert_array_equal(again.foretold.sizes_mm, grown.foretold.sizes_mm)
    np.testing.assert_array_equal(again.foretold.summaries["counts"], grown.foretold.summaries["counts"])


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


def test_a_size_of_another_fruit_is_put_aside(tmp_path: Path, row: GrownRow, grown: SeasonGrowth) -> None:
    sizes_mm = grown.fruits.diameters_mm.copy()
    sizes_mm[7, 2] += 25.0
    found = growth_of(replace(grown.fruits, diameters_mm=sizes_mm), harvest=HARVEST)
    assert found.put_aside[7, 2]
    assert found.odd[7]
    assert found.put_aside.sum() <= 2
    assert found.foretold.sizes_mm[7, -1] == pytest.approx(grown.foretold.sizes_mm[7, -1], abs=2.0)


def test_tables_have_their_columns_and_their_fruits(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    folder = tmp_path / "growth"
    code, printed, told = pomona("growth", row.path, "-o", folder, "--harvest", HARVEST, "--classes", "60,65,70")
    assert (code, told) == (0, "")
    assert "90 fruits on 4 visits" in printed
    series, fruits, blocks, classes, curves = (
        rows_of(folder / f"{name}.csv") for name in ("series", "fruits", "blocks", "classes", "curves")
    )
    assert list(series[0]) == ["fruit_id", "date", "diameter_mm", "sigma_mm"]
    assert len(series) == 4 * 90
    assert list(fruits[0]) == [
        "fruit_id", "tree", "n_dates", "rate_mm_per_day", "rate_sigma_mm_per_day", "rate_relative_per_day",
        "forecast_mm", "forecast_low_mm", "forecast_high_mm", "outlier",
    ]  # fmt: skip
    assert [int(line["fruit_id"]) for line in fruits] == list(range(1, 91))
    assert {line["tree"] for line in fruits} == {"1", "2", "3"}
    assert all(
        float(one["forecast_low_mm"]) < float(one["forecast_mm"]) < float(one["forecast_high_mm"]) for one in fruits
    )
    assert [(one["block"], one["n_fruits"]) for one in blocks] == [("all", "90"), *[("tree", "30")] * 3]
    harvested = [one for one in classes if one["date"] == str(HARVEST)]
    assert sum(float(one["n_fruits"]) for one in harvested) == pytest.approx(90, abs=0.01)
    assert float(harvested[0]["packs"]) == pytest.approx(float(harvested[0]["kg"]) / 13.0, abs=1e-3)
    assert len(curves) == 5 * 90
    for name in ("curves", "sizes", "variability"):
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    # It is taken again, and nothing else of these names is.
    assert pomona("growth", row.path, "-o", folder)[0] == 0
    assert rows_of(folder / "fruits.csv")[0]["forecast_mm"] == ""
    (folder / "fruits.csv").write_text("mine\n")
    code, _, told = pomona("growth", row.path, "-o", folder)
    assert (code, told.count("\n")) == (2, 1)
    assert "is not a folder of growth" in told


def test_json_says_the_same(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    code, printed, _ = pomona("growth", row.path, "-o", tmp_path / "g", "--harvest", HARVEST, "--json")
    found = json.loads(printed)
    assert code == 0
    assert found["curve"] in FAMILIES
    assert [block["n_fruits"] for block in found["blocks"]] == [90, 30, 30, 30]
    assert found["blocks"][0]["forecast_low_mm"] < found["blocks"][0]["forecast_mm"]
    assert set(found["held_out_log_likelihood"]) == {f"{name} over days" for name in FAMILIES}


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (
            ["--harvest", "2024-07-01"],
            "found 2024-07-01, expected the last visit's day or later: 2024-07-29",
        ),
        (["--harvest", "2025-02-20"], "found 2025-02-20, expected a day of the same season, at most 200 days after"),
        (["--harvest", "9999-12-31"], "found 9999-12-31, expected a day of the same season"),
        (["--harvest", "soon"], "--harvest: found 'soon', expected a day"),
        (["--classes", "70,60"], "--classes: found '70,60', expected rising limits in mm"),
        (["--classes", "-5,60"], "expected rising limits"),
        (["--classes", "nan"], "expected rising limits"),
        (["--temperature", "absent.csv"], "absent.csv: not found"),
    ],
)
def test_what_cannot_be_is_one_line(pomona: Pomona, row: GrownRow, tmp_path: Path, flags: list[str], said: str) -> None:
    code, printed, told = pomona("growth", row.path, "-o", tmp_path / "g", *flags)
    assert (code, printed, told.count("\n")) == (2, "", 1)
    assert said in told
    assert not (tmp_path / "g").exists()


@pytest.mark.parametrize(
    ("dates", "said"),
    [
        (("2004-06-14", "2024-06-29"), "found visits from 2004-06-14 to 2024-06-29, expected those of one season"),
        (("0224-06-14", "2024-06-29"), "found a visit on 0224-06-14, expected a year from 1900 to 2199"),
        (("0001-01-01", "0001-01-16"), "found a visit on 0001-01-01, expected a year from 1900 to 2199"),
        (("9999-12-01", "9999-12-31"), "found a visit on 9999-12-01, expected a year from 1900 to 2199"),
    ],
)
def test_visits_of_several_seasons_are_no_growth(
    pomona: Pomona, tmp_path: Path, dates: tuple[str, str], said: str
) -> None:
    path = grow_row(tmp_path / "o.gpkg", days=(50, 65), n_trees=1).path
    with closing(geopackage.connect(path)) as connection, connection:
        sessions = [number for (number,) in connection.execute("SELECT id FROM sessions ORDER BY date")]
        connection.executemany("UPDATE sessions SET date = ? WHERE id = ?", zip(dates, sessions, strict=True))
    for verb in (["growth", path, "-o", tmp_path / "g"], ["thinning", path]):
        code, printed, told = pomona(*verb)
        assert (code, printed, told.count("\n")) == (2, "", 1)
        assert said in told
    # The page shows what there is, and says why there is no growth.
    assert said in season_document(path, Wishes())["no_growth"]


@pytest.mark.parametrize("limits_mm", [[70.0, 60.0], [np.nan], [], [0.0, 60.0], [[60.0, 70.0]], "large"])
def test_limits_that_do_not_rise_are_refused(grown: SeasonGrowth, limits_mm: object) -> None:
    with pytest.raises(PomonaError, match=r"limits_mm: found .*, expected rising limits in mm"):
        growth_of(grown.fruits, limits_mm=limits_mm)


def test_a_harvest_is_a_day_however_it_is_said(grown: SeasonGrowth) -> None:
    few = grown.fruits
    for told in (HARVEST, HARVEST.isoformat(), datetime.combine(HARVEST, datetime.max.time())):
        found = growth_of(few, harvest=told)
        assert found.harvest == HARVEST
        assert found.days[-1] == HARVEST
    for told in ("soon", 20240925, np.datetime64("2024-09-25")):
        with pytest.raises(PomonaError, match=r"--harvest: found .*, expected a day as 2024-09-10"):
            growth_of(few, harvest=told)


def test_one_day_is_no_growth(pomona: Pomona, tmp_path: Path) -> None:
    row = grow_row(tmp_path / "once.gpkg", days=(50,))
    code, _, told = pomona("growth", row.path, "-o", tmp_path / "g")
    assert (code, told.count("\n")) == (2, 1)
    assert "found diameters of one day, 2024-06-14, expected two or more" in told


def test_a_session_and_sizes_that_are_none_are_refused(pomona: Pomona, here: Path, row: GrownRow) -> None:
    code, _, told = pomona("growth", "session.gpkg", "-o", "g")
    assert (code, told.count("\n")) == (2, 1)
    assert "found a session, expected a map" in told
    for size in (0.0, -0.05):
        (here / "bad.gpkg").write_bytes(row.path.read_bytes())
        with closing(geopackage.connect(here / "bad.gpkg")) as connection:
            connection.execute("UPDATE observations SET diameter_m = ? WHERE id = 5", (size,))
        code, _, told = pomona("growth", "bad.gpkg", "-o", "g")
        assert (code, told.count("\n")) == (2, 1)
        assert "diameter_m" in told


@pytest.mark.parametrize("n", [1, 2])
def test_few_fruits_and_no_growth_have_curves_too(grown: SeasonGrowth, n: int) -> None:
    """Priors carry what two sizes cannot; equal sizes are no division by nothing."""
    few = grown.fruits
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


def test_fruits_that_are_gone_count_in_no_block(grown: SeasonGrowth) -> None:
    fruits = grown.fruits
    states = tuple("gone" if row < 40 else "seen" for row in range(90))
    cloud = replace(fruits.cloud, extras={**fruits.cloud.extras, "state": states})
    found = blocks_of(replace(fruits, cloud=cloud))
    assert [int(block.members.sum()) for block in found] == [50, 20, 30]
    in_rows = replace(fruits.cloud, extras={"row": ("east",) * 30 + ("west",) * 59 + ("",)})
    of_rows = [block for block in blocks_of(replace(fruits, cloud=in_rows)) if block.kind == "row"]
    rows = [(block.name, int(block.members.sum())) for block in of_rows]
    assert rows == [("east", 30), ("west", 59)]
    over = replace(fruits.cloud, extras={"state": ("gone",) * 90})
    assert int(blocks_of(replace(fruits, cloud=over))[0].members.sum()) == 90


def test_fruits_of_no_tree_are_a_block_where_others_have_one(
    pomona: Pomona, row: GrownRow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def told_otherwise(cloud: FruitCloud) -> BearingTrees:
        numbers = np.repeat([0, 1, 2], [30, 55, 5])
        return BearingTrees(("1", "tree 2", ""), numbers, cloud.positions[:, 0], ("", "", ""))

    monkeypatch.setattr("pomona.growth.measured.bearing_trees", told_otherwise)
    code, printed, told = pomona("growth", row.path, "-o", tmp_path / "g")
    assert (code, told) == (0, "")
    lines = {line[:20].strip(): int(line.split()[-3]) for line in printed.splitlines()[-4:]}
    assert lines == {"all": 90, "tree 1": 30, "tree 2": 55, "no tree": 5}
    blocks = [(one["block"], one["name"], one["n_fruits"]) for one in rows_of(tmp_path / "g" / "blocks.csv")]
    assert blocks == [("all", "", "90"), ("tree", "1", "30"), ("tree", "tree 2", "55"), ("tree", "", "5")]
    titles = [Block(kind, name, np.ones(1, bool)).title for kind, name in (("row", "row 1"), ("row", "1"), ("all", ""))]
    assert titles == ["row 1", "row 1", "all"]


def test_what_is_likelier_no_fruit_counts_in_no_block(grown: SeasonGrowth) -> None:
    states = ("missed",) * 60 + ("new",) * 30
    chances = ("0.31",) * 40 + ("0.62",) * 20 + ("0.31",) * 30
    cloud = replace(grown.fruits.cloud, extras={"state": states, "fruit_probability": chances})
    found = blocks_of(replace(grown.fruits, cloud=cloud))[0]
    assert found.members.tolist() == [False] * 40 + [True] * 50


@pytest.mark.parametrize(("factor", "percent"), [(2.0, 100.0), (0.82, -18.0), (1.0, None)])
def test_a_visit_of_another_scale_is_named(
    pomona: Pomona, tmp_path: Path, factor: float, percent: float | None
) -> None:
    row = grow_row(tmp_path / "o.gpkg", (50, 65, 80, 95), n_trees=2, scales=(1.0, 1.01, 0.99 * factor, 1.0))
    code, printed, told = pomona("growth", row.path, "-o", tmp_path / "g", "--json")
    assert code == 0
    found = json.loads(printed)["odd_visits"]
    if percent is None:
        assert (told, found) == ("", {})
        return
    day = str(row.day(80))
    assert list(found) == [day]
    assert found[day]["probability"] > 0.5
    assert 100 * (found[day]["scale"] - 1) == pytest.approx(percent, abs=12.0)
    assert f"sizes of {day} are likely off together" in told
    assert f"sizes of {day} are likely off together" in pomona("thinning", row.path)[2]


def test_what_visits_share_has_an_interval(pomona: Pomona, row: GrownRow, grown: SeasonGrowth, tmp_path: Path) -> None:
    """Said as no bound: one visit and how far it may be off; what all share is not seen at all."""
    told = grown.foretold
    assert (told.scale_lows < told.scales).all()
    assert (told.scales < told.scale_highs).all()
    true = np.log([1.0, 1.02, 0.99, 1.01])
    inside = (np.log(told.scale_lows) < true) & (true < np.log(told.scale_highs))
    assert inside.all()
    printed = pomona("growth", row.path, "-o", tmp_path / "g")[1]
    said = r"is off most, [+-]\d\.\d % \([+-]\d\.\d to [+-]\d\.\d\); what all share, some 3 %, only calipers tell"
    assert re.search(rf"scales of visits: 2024-\d\d-\d\d {said}", printed)


def test_an_error_that_all_visits_share_is_in_the_intervals(grown: SeasonGrowth) -> None:
    """Of one camera: all sizes 3 % too large move all that is told, and stay inside; differences hardly widen."""
    larger = growth_of(replace(grown.fruits, diameters_mm=1.03 * grown.fruits.diameters_mm), harvest=HARVEST)
    now = len(grown.fruits.days) - 1
    true = grown.foretold.sizes_mm[:, now]
    lows, highs = (each[:, now] for each in (larger.foretold.lows_mm, larger.foretold.highs_mm))
    assert np.mean((lows < true) & (true < highs)) > 0.95
    means = larger.foretold.summaries["blocks"][:, 0]
    assert np.log(means[:, now]).std() > CAMERA_SPREAD
    assert means[:, -1].std() / means[:, -1].mean() < 0.2
    grew = np.log(means[:, now + 1] / means[:, now])
    assert grew.std() < CAMERA_SPREAD


def test_a_last_visit_without_sizes_is_told(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    path = tmp_path / "o.gpkg"
    path.write_bytes(row.path.read_bytes())
    cloud = FruitCloud(OrchardMap(path).fruits().positions)
    assert add_session(path, Session("later", str(row.day(99)), "drawn", cloud)).is_added
    code, printed, told = pomona("growth", path, "-o", tmp_path / "g")
    assert (code, told.count("\n")) == (0, 1)
    assert f"no sizes on {row.day(99)}, growth is told of {row.day(95)}" in told
    assert f"to {row.day(95)}" in printed


def test_two_visits_of_one_day_have_an_error_each(tmp_path: Path) -> None:
    row = grow_row(tmp_path / "twice.gpkg", days=(50, 65), scales=(1.0, 1.0))
    again = OrchardMap(row.path).fruits()
    cloud = FruitCloud(again.positions, diameters_m=1.05 * row.curves.diameters_m(65.2))
    assert add_session(row.path, Session("evening", f"{row.day(65)}T18:00:00", "drawn", cloud)).is_added
    found = grow_season(row.path)
    assert len(found.fruits.days) == 3
    assert found.foretold.scales[2] > found.foretold.scales[1] + 0.02
    assert found.fruits.n_days.max() == 2


@pytest.mark.parametrize("n", [90, 30, 1])
def test_all_fruits_are_in_the_picture(grown: SeasonGrowth, n: int) -> None:
    """However short the row is: metres are as long in both directions, and begin at the first and the lowest."""
    fruits = grown.fruits
    hanging = tuple("seen" if row < n else "gone" for row in range(90))
    cloud = replace(fruits.cloud, extras={**fruits.cloud.extras, "state": hanging})
    figure = draw_variability(replace(grown, fruits=replace(fruits, cloud=cloud)))
    figure.draw_without_rendering()
    above, below, bar = figure.axes
    places = np.asarray(above.collections[0].get_offsets())
    assert len(places) == n
    assert (np.abs(places.min(axis=0)) < 1e-9).all()
    (left, right), (bottom, top) = above.get_xlim(), above.get_ylim()
    assert ((places > [left, bottom]) & (places < [right, top])).all()
    box = above.get_window_extent()
    assert box.width / (right - left) == pytest.approx(box.height / (top - bottom), rel=1e-3)
    assert below.get_xlim() == (left, right)
    assert top - bottom > 0.9
    # Fruits that grow alike have one colour, not a bar of millionths.
    assert np.ptp(bar.get_ylim()) >= 0.02 - 1e-9


def test_legends_lie_on_nothing_that_is_drawn(grown: SeasonGrowth) -> None:
    curves = draw_curves(grown).axes[0].get_legend()
    assert [text.get_text() for text in curves.get_texts()] == [
        "curves of fruits", "mean of all, with 90 %", "sizes as measured"
    ]  # fmt: skip
    figure = draw_size_classes(grown)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    assert axes.get_legend().get_window_extent().y0 >= axes.get_window_extent().y1 - 1.0


def test_names_of_strangers_are_drawn_as_text(pomona: Pomona, tmp_path: Path) -> None:
    """Formulas, markup, escapes, letters that no font has."""
    row = grow_row(
        tmp_path / "evil.gpkg", days=(50, 65), n_trees=1, labels="$\\frac{{ <b>\x1b[2J 林檎 {}", name="$x^ \x1b {}"
    )
    code, printed, told = pomona("growth", row.path, "-o", tmp_path / "g")
    assert (code, told) == (0, "")
    assert "\x1b" not in printed


def test_long_names_lose_their_middle() -> None:
    assert drawn_name("a$b\x1b林") == "a?b??"
    assert drawn_name("first " + 100 * "x" + " last") == "first " + 10 * "x" + "..." + 11 * "x" + " last"


def test_sizes_classes_take_their_minimum_and_leave_their_maximum() -> None:
    count = class_counts(parsed_classes("60,65,70"), np.array([True, True, True, True, False]))
    sizes = np.array([[59.999], [60.0], [65.0], [70.0], [62.0]])
    np.testing.assert_array_equal(count(sizes, np.zeros(5))[:, 0], [1, 1, 1, 1])


def test_sizes_that_were_copied_from_one_visit_to_the_next_can_be_told(tmp_path: Path) -> None:
    path = grow_row(tmp_path / "orchard.gpkg", (50,), n_trees=1).path
    fruits = OrchardMap(path).fruits()
    again = FruitCloud(fruits.positions, diameters_m=fruits.diameters_m)
    assert add_session(path, Session("again", "2024-07-01", "drawn", again)).is_added
    grown = grow_season(path)
    assert np.isfinite(grown.foretold.sizes_mm).all()
    assert (np.abs(grown.foretold.rates_mm_per_day) < 0.2).all()
