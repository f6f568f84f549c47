"""What `pomona growth` gives and refuses: tables, JSON, pictures, and one line for what cannot be."""

import json
import re
from contextlib import closing
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from command_line import Pomona
from growth_maker import HARVEST, GrownRow, grow_row, rows_of
from pomona import FruitCloud, PomonaError, geopackage
from pomona.growth.curve_families import FAMILIES
from pomona.growth.drawn_names import drawn_name
from pomona.growth.growth_pictures import draw_curves, draw_variability
from pomona.growth.growth_pictures import draw_sizes as draw_size_classes
from pomona.growth.season_growth import SeasonGrowth, growth_of
from pomona.growth.size_classes import class_counts, class_masses, parsed_classes
from pomona.orchard import OrchardMap, Session, add_session
from pomona.viewer.season_page import Wishes, season_document


def test_what_is_gone_has_no_size_now(pomona: Pomona, grown_row: GrownRow, tmp_path: Path) -> None:
    """Its curve ends with the visit that measured it last; tables, layers and the page say the same."""
    path = tmp_path / "orchard.gpkg"
    path.write_bytes(grown_row.path.read_bytes())
    with closing(geopackage.connect(path)) as connection, connection:
        sessions = [number for (number,) in connection.execute("SELECT id FROM sessions ORDER BY date")]
        connection.execute("UPDATE fruits SET state = 'gone', last_session_id = ? WHERE id = 7", (sessions[1],))
        connection.execute("DELETE FROM observations WHERE fruit_id = 7 AND session_id IN (?, ?)", sessions[2:])
    assert pomona("growth", path, "-o", tmp_path / "g", "--harvest", HARVEST)[0] == 0
    gone = next(line for line in rows_of(tmp_path / "g" / "fruits.csv") if line["fruit_id"] == "7")
    assert {gone[name] for name in ("rate_mm_per_day", "rate_sigma_mm_per_day", "forecast_mm")} == {""}
    days = [line["date"] for line in rows_of(tmp_path / "g" / "curves.csv") if line["fruit_id"] == "7"]
    assert days == [str(grown_row.day(50)), str(grown_row.day(65))]
    assert pomona("export", path, "-o", tmp_path / "g.csv", "--growth", "--harvest", HARVEST)[0] == 0
    exported = {line["id"]: line for line in rows_of(tmp_path / "g.csv")}
    assert {exported["7"][name] for name in ("size_mm", "rate_mm_per_day", "forecast_mm")} == {""}
    assert exported["7"]["diameter_m"] != ""
    assert float(exported["8"]["size_mm"]) > 40.0


def test_tables_have_their_columns_and_their_fruits(pomona: Pomona, grown_row: GrownRow, tmp_path: Path) -> None:
    folder = tmp_path / "growth"
    code, printed, told = pomona("growth", grown_row.path, "-o", folder, "--harvest", HARVEST, "--classes", "60,65,70")
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
        "hangs_probability", "stopped_probability",
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
    assert pomona("growth", grown_row.path, "-o", folder)[0] == 0
    assert rows_of(folder / "fruits.csv")[0]["forecast_mm"] == ""
    (folder / "fruits.csv").write_text("mine\n")
    code, _, told = pomona("growth", grown_row.path, "-o", folder)
    assert (code, told.count("\n")) == (2, 1)
    assert "is not a folder of growth" in told


def test_json_says_the_same(pomona: Pomona, grown_row: GrownRow, tmp_path: Path) -> None:
    code, printed, _ = pomona("growth", grown_row.path, "-o", tmp_path / "g", "--harvest", HARVEST, "--json")
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
def test_what_cannot_be_is_one_line(
    pomona: Pomona, grown_row: GrownRow, tmp_path: Path, flags: list[str], said: str
) -> None:
    code, printed, told = pomona("growth", grown_row.path, "-o", tmp_path / "g", *flags)
    assert (code, printed, told.count("\n")) == (2, "", 1)
    assert said in told
    assert not (tmp_path / "g").exists()


@pytest.mark.parametrize(
    ("dates", "said"),
    [
        (
            ("2024-01-05", "2024-03-25", "2024-06-10", "2024-08-25"),
            "found visits from 2024-01-05 to 2024-08-25, expected those of one season",
        ),
        (("2004-06-14", "2024-06-29"), "one day"),
        (("0224-06-14", "0224-06-29"), "found a visit on 0224-06-14, expected a year from 1900 to 2199"),
        (("0001-01-01", "0001-01-16"), "found a visit on 0001-01-01, expected a year from 1900 to 2199"),
        (("9999-12-01", "9999-12-31"), "found a visit on 9999-12-01, expected a year from 1900 to 2199"),
    ],
)
def test_visits_that_are_not_of_one_season_are_no_growth(
    pomona: Pomona, tmp_path: Path, dates: tuple[str, ...], said: str
) -> None:
    path = grow_row(tmp_path / "o.gpkg", days=(50, 65, 80, 95)[: len(dates)], n_trees=1).path
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
def test_limits_that_do_not_rise_are_refused(row_growth: SeasonGrowth, limits_mm: object) -> None:
    with pytest.raises(PomonaError, match=r"limits_mm: found .*, expected rising limits in mm"):
        growth_of(row_growth.fruits, limits_mm=limits_mm)


def test_a_harvest_is_a_day_however_it_is_said(row_growth: SeasonGrowth) -> None:
    few = row_growth.fruits
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


def test_a_session_and_sizes_that_are_none_are_refused(pomona: Pomona, here: Path, grown_row: GrownRow) -> None:
    code, _, told = pomona("growth", "session.gpkg", "-o", "g")
    assert (code, told.count("\n")) == (2, 1)
    assert "found a session, expected a map" in told
    for size in (0.0, -0.05):
        (here / "bad.gpkg").write_bytes(grown_row.path.read_bytes())
        with closing(geopackage.connect(here / "bad.gpkg")) as connection:
            connection.execute("UPDATE observations SET diameter_m = ? WHERE id = 5", (size,))
        code, _, told = pomona("growth", "bad.gpkg", "-o", "g")
        assert (code, told.count("\n")) == (2, 1)
        assert "diameter_m" in told


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


def test_dates_that_fruits_deny_are_doubted(pomona: Pomona, tmp_path: Path) -> None:
    row = grow_row(tmp_path / "o.gpkg", (50, 95, 80, 65), n_trees=2, dated=(50, 65, 80, 95))
    code, printed, told = pomona("growth", row.path, "-o", tmp_path / "g", "--json")
    assert code == 0
    for day, odd in json.loads(printed)["odd_visits"].items():
        word = "are likely" if odd["probability"] > 0.5 else "may be"
        assert re.search(f"sizes of {day} {word} off together: .*; its unit, its camera, its date", told)
    assert f"fruits are 15 % smaller on {row.day(95)} than on {row.day(80)} (60 in both), and none shrinks" in told
    assert f"than on {row.day(50)}" not in told


def test_fruits_beyond_the_last_visit_are_told_of(pomona: Pomona, tmp_path: Path) -> None:
    """A half that was picked and one that was not visited look alike."""
    path = grow_row(tmp_path / "o.gpkg", days=(50, 65, 80), n_trees=4).path
    known_m = OrchardMap(path).cloud.positions
    half_m = known_m[known_m[:, 0] < np.median(known_m[:, 0])]
    half_m = half_m + np.random.default_rng(1).normal(0.0, 0.005, half_m.shape)
    half = FruitCloud(half_m, diameters_m=np.full(len(half_m), 0.06))
    added = add_session(path, Session("late", "2024-07-29", "drawn", half))
    assert added.is_added
    assert 50 < added.n_beyond < 70
    told = pomona("growth", path, "-o", tmp_path / "g")[2]
    assert re.search(r"6\d of 12\d fruits hang beyond what was seen on 2024-07-29: they count as on 2024-07-14", told)
    told = pomona("growth", grow_row(tmp_path / "all.gpkg", days=(50, 65), n_trees=1).path, "-o", tmp_path / "h")[2]
    assert "beyond" not in told


def test_what_visits_share_has_an_interval(
    pomona: Pomona, grown_row: GrownRow, row_growth: SeasonGrowth, tmp_path: Path
) -> None:
    """Said as no bound: one visit and how far it may be off; what all share is not seen at all."""
    told = row_growth.foretold
    assert (told.scale_lows < told.scales).all()
    assert (told.scales < told.scale_highs).all()
    true = np.log([1.0, 1.02, 0.99, 1.01])
    inside = (np.log(told.scale_lows) < true) & (true < np.log(told.scale_highs))
    assert inside.all()
    printed = pomona("growth", grown_row.path, "-o", tmp_path / "g")[1]
    said = r"is off most, [+-]\d\.\d % \([+-]\d\.\d to [+-]\d\.\d\); what all share, some 3 %, only calipers tell"
    assert re.search(rf"scales of visits: 2024-\d\d-\d\d {said}", printed)


def test_a_last_visit_without_sizes_is_told(pomona: Pomona, grown_row: GrownRow, tmp_path: Path) -> None:
    path = tmp_path / "o.gpkg"
    path.write_bytes(grown_row.path.read_bytes())
    places = OrchardMap(path).fruits().positions
    cloud = FruitCloud(places + np.random.default_rng(1).normal(0, 0.005, places.shape))
    assert add_session(path, Session("later", str(grown_row.day(99)), "drawn", cloud)).is_added
    code, printed, told = pomona("growth", path, "-o", tmp_path / "g")
    assert (code, told.count("\n")) == (0, 1)
    assert f"no sizes on {grown_row.day(99)}, growth is told of {grown_row.day(95)}" in told
    assert f"to {grown_row.day(95)}" in printed


@pytest.mark.parametrize("n", [90, 30, 1])
def test_all_fruits_are_in_the_picture(row_growth: SeasonGrowth, n: int) -> None:
    """However short the row is: metres are as long in both directions, and begin at the first and the lowest."""
    fruits = row_growth.fruits
    hanging = tuple("seen" if row < n else "gone" for row in range(90))
    cloud = replace(fruits.cloud, extras={**fruits.cloud.extras, "state": hanging})
    figure = draw_variability(replace(row_growth, fruits=replace(fruits, cloud=cloud)))
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


def test_legends_lie_on_nothing_that_is_drawn(row_growth: SeasonGrowth) -> None:
    curves = draw_curves(row_growth).axes[0].get_legend()
    assert [text.get_text() for text in curves.get_texts()] == [
        "curves of fruits", "mean of all, with 90 %", "sizes as measured"
    ]  # fmt: skip
    figure = draw_size_classes(row_growth)
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
    count, weigh = (one(parsed_classes("60,65,70")) for one in (class_counts, class_masses))
    sizes, chances = np.array([[59.999], [60.0], [65.0], [70.0], [62.0]]), np.array([1.0, 1.0, 1.0, 0.25, 0.0])
    np.testing.assert_array_equal(count(sizes, np.zeros(5), chances)[:, 0], [1, 1, 1, 0.25])
    of_one_kg = 900.0 * np.pi / 6.0 * 0.07**3
    assert weigh(sizes, np.zeros(5), chances)[3, 0] == pytest.approx(0.25 * of_one_kg)
