"""What will drop, what stays, what to thin."""

import csv
import json
import re
import shutil
from contextlib import closing
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from command_line import Pomona
from growth_maker import GrownRow, grow_row
from pomona import geopackage
from pomona.growth.clusters import clusters_of
from pomona.growth.fruit_drop import SURE_TO, MeasuredRates, drop_of
from pomona.growth.season_growth import grow_season, growth_of
from pomona.growth.thinning_plan import plan_thinning
from pomona.viewer.season_page import Wishes, season_document
from test_page_document import unpacked

DROPPING = range(0, 60, 6)


@pytest.fixture(scope="module")
def row(tmp_path_factory: pytest.TempPathFactory) -> GrownRow:
    """Fruitlets a week apart, of which every sixth grows at a quarter of its rate."""
    path = tmp_path_factory.mktemp("row") / "orchard.gpkg"
    return grow_row(
        path, days=(35, 42), n_trees=2, noise_mm=0.5, scales=(1.0, 1.0), dropping=DROPPING, slowed_from=35.0
    )


def test_fruits_that_stop_growing_will_drop(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    code, printed, told = pomona("thinning", row.path, "--target", 20, "-o", tmp_path / "thin.csv", "--json")
    assert (code, told) == (0, "")
    with (tmp_path / "thin.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert list(lines[0]) == [
        "fruit_id", "tree", "cluster", "n_in_cluster", "diameter_mm", "rate_mm_per_day", "drop_probability", "action"
    ]  # fmt: skip
    # The first visit gave the ids, in its order.
    said = {int(line["fruit_id"]) - 1 for line in lines if line["action"] == "drops"}
    assert len(said & set(DROPPING)) >= 9
    assert len(said - set(DROPPING)) <= 1
    for tree in json.loads(printed)["trees"]:
        assert tree["n_staying"] - tree["n_to_thin"] == 20
    assert sum(line["action"] == "thin" for line in lines) == sum(
        tree["n_to_thin"] for tree in json.loads(printed)["trees"]
    )


def test_rows_that_are_walked_on_different_days_are_planned_together(row: GrownRow) -> None:
    """Each part of a map by its own last two days."""
    growth = grow_season(row.path)
    one, fruits = plan_thinning(growth, 20), growth.fruits
    parts = 1 + np.arange(len(fruits.ids)) % 2
    apart_mm = np.full((len(parts), 4), np.nan)
    for part in (1, 2):
        apart_mm[np.ix_(parts == part, [part - 1, part + 1])] = fruits.diameters_mm[parts == part]
    moments = tuple(moment + timedelta(days=late) for moment in fruits.moments for late in (0, 1))
    walked = replace(
        fruits,
        diameters_mm=apart_mm,
        parts=parts,
        moments=moments,
        sessions=("a", "b", "c", "d"),
        labels=tuple(tuple(label for label in labels for _ in (0, 1)) for labels in fruits.labels),
    )
    two = plan_thinning(growth_of(walked), 20)
    np.testing.assert_array_equal(two.rows, one.rows)
    np.testing.assert_allclose(two.rates_mm_per_day, one.rates_mm_per_day)
    assert two.n_days == one.n_days
    assert np.mean([now == then for now, then in zip(two.actions, one.actions, strict=True)]) > 0.9


def test_the_fullest_clusters_are_thinned_of_their_smallest(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    assert pomona("thinning", row.path, "--target", 24, "-o", tmp_path / "thin.csv")[0] == 0
    with (tmp_path / "thin.csv").open(newline="") as file:
        lines = [line for line in csv.DictReader(file) if line["action"] != "drops"]
    for tree in ("1", "2"):
        of_tree = [line for line in lines if line["tree"] == tree]
        left: dict[str, list[dict[str, str]]] = {}
        for line in of_tree:
            left.setdefault(line["cluster"], []).append(line)
        kept = {name: [one for one in fruits if one["action"] == "keep"] for name, fruits in left.items()}
        thinned_from = [len(fruits) for name, fruits in left.items() if len(kept[name]) < len(fruits)]
        # Levelled from above: no cluster keeps two more than one that gave a fruit has left.
        if thinned_from:
            least = min(len(kept[name]) for name, fruits in left.items() if len(kept[name]) < len(fruits))
            assert max(map(len, kept.values())) <= least + 1
        for name, fruits in left.items():
            sizes = sorted(float(one["diameter_mm"]) for one in fruits)
            expected = sizes[len(fruits) - len(kept[name]) :]
            assert sorted(float(one["diameter_mm"]) for one in kept[name]) == expected


def test_without_a_target_none_is_thinned(pomona: Pomona, row: GrownRow) -> None:
    code, printed, _ = pomona("thinning", row.path)
    assert code == 0
    assert [line.split()[4] for line in printed.splitlines()[2:]] == ["0", "0"]
    assert pomona("thinning", row.path, "--target", "-3")[0] == 2


def test_fruits_of_no_tree_are_not_called_all(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    path = Path(shutil.copy(row.path, tmp_path))
    (tmp_path / "trees.csv").write_text("name,x,y,z\nA,0,0,1\nB,1.5,0,1\n")
    assert pomona("map", "trees", path, "--trees", tmp_path / "trees.csv")[0] == 0
    with closing(geopackage.connect(path)) as connection, connection:
        connection.execute("UPDATE fruits SET tree_id = NULL WHERE id <= 4")
    code, printed, _ = pomona("thinning", path, "--target", 2)
    assert code == 0
    counts = {line[:14].strip(): int(line[14:22]) for line in printed.splitlines() if line[14:22].strip().isdigit()}
    assert counts == {"A": 26, "B": 30, "no tree": 4}
    # They are no third tree that keeps two.
    assert "4 fruits of no tree: none of them is thinned" in printed
    *trees, of_none = json.loads(pomona("thinning", path, "--target", 2, "--json")[1])["trees"]
    assert [tree["n_staying"] - tree["n_to_thin"] for tree in trees] == [2, 2]
    assert (of_none["tree"], of_none["n_fruits"], of_none["n_to_thin"]) == (None, 4, 0)
    told = season_document(path, Wishes(target=2))
    places = unpacked(told["thinning"]["place"])
    assert (places > 2).sum() == sum(tree["n_to_thin"] for tree in trees)


def test_trees_are_those_that_map_trees_finds(pomona: Pomona, tmp_path: Path) -> None:
    visits, path = tmp_path / "season", tmp_path / "orchard.gpkg"
    assert pomona("synth", "season", "easy", "--trees", 5, "--visits", 2, "--seed", 11, "-o", visits)[0] == 0
    for day in ("2024-06-14", "2024-09-27"):
        assert pomona("map", "add", path, visits / f"{day}.csv", "--date", day)[0] == 0

    def counts() -> list[tuple[int, int]]:
        code, printed, told = pomona("thinning", path, "--target", 80, "--json")
        assert (code, told) == (0, "")
        return [(tree["n_fruits"], tree["n_to_thin"]) for tree in json.loads(printed)["trees"] if tree["tree"]]

    before = counts()
    places = unpacked(season_document(path, Wishes(target=80))["thinning"]["place"])
    assert pomona("map", "trees", path)[0] == 0
    assert before == counts()
    assert len(before) == 5
    assert (places > 80).sum() == sum(n_to_thin for _, n_to_thin in before)


def test_a_target_for_each_tree_needs_trees(pomona: Pomona, tmp_path: Path) -> None:
    path = grow_row(tmp_path / "orchard.gpkg", days=(35, 42), n_trees=1, noise_mm=0.5).path
    code, printed, _ = pomona("thinning", path)
    assert code == 0
    assert printed.splitlines()[-1].split()[:2] == ["all", "30"]
    for verb in (("thinning", path), ("report", path, "-o", tmp_path / "report.html")):
        code, printed, told = pomona(*verb, "--target", 20)
        assert (code, printed) == (2, "")
        assert told.count("\n") == 1
        assert "found no trees, expected those that shall keep 20 each" in told
    assert not (tmp_path / "report.html").exists()


def test_of_apples_near_the_harvest_none_is_foretold_to_drop(pomona: Pomona, tmp_path: Path) -> None:
    """The rule is one of fruitlets: an apple of 60 mm that grows at a quarter of the rate hangs on."""
    path = tmp_path / "orchard.gpkg"
    grow_row(path, days=(100, 114), n_trees=2, noise_mm=0.5, scales=(1.0, 1.0), dropping=DROPPING, slowed_from=100.0)
    code, printed, _ = pomona("thinning", path, "--target", 20, "-o", tmp_path / "thin.csv")
    assert code == 0
    assert "no fruitlets, which are up to 45 mm" in printed
    with (tmp_path / "thin.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert {line["drop_probability"] for line in lines} == {""}
    assert [line["action"] for line in lines].count("thin") == 20


def rates_of(mm_per_day: NDArray[np.float64], n_days: float = 7.0) -> MeasuredRates:
    """As two visits tell them of fruitlets of 20 mm, when nothing is known of their noise."""
    per_mm = np.full(len(mm_per_day), np.sqrt(2.0) / n_days)
    return MeasuredRates(mm_per_day, per_mm, (2.0, 0.6), 0.57 / n_days, 10.0 / n_days)


def drawn_rates(
    share: float, noise_mm: float, n_days: float, seed: int, n: int = 120
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Rates of fruits that stay, 0.8 mm a day give or take a tenth, and of some that grow at 0 to 0.3."""
    rng = np.random.default_rng(seed)
    slow = np.arange(n) < share * n
    true = np.where(slow, rng.uniform(0.0, 0.3, n), rng.normal(0.8, 0.08, n))
    return true + rng.normal(0.0, noise_mm * np.sqrt(2.0) / n_days, n), slow


@pytest.mark.parametrize("share", [0.0, 0.1, 0.33, 0.6])
@pytest.mark.parametrize(("noise_mm", "n_days"), [(0.1, 5.0), (0.5, 7.0), (1.0, 14.0)])
def test_as_many_drop_as_are_slow(share: float, noise_mm: float, n_days: float) -> None:
    rates, slow = drawn_rates(share, noise_mm, n_days, seed=4)
    found = drop_of(rates_of(rates, n_days))
    assert found.is_told
    assert np.mean((found.probabilities > 0.5) == slow) > 0.96
    assert found.share == pytest.approx(share, abs=0.04)
    assert found.fast_mm_per_day == pytest.approx(0.8 + 1.28 * 0.08, abs=0.08)


@pytest.mark.parametrize(("noise_mm", "n_days"), [(2.0, 3.0), (1.0, 1.0), (2.0, 0.014)])
def test_visits_too_close_say_so_and_leave_the_prior(noise_mm: float, n_days: float) -> None:
    """The fastest of noisy rates are the luckiest: against them all others are slow."""
    rates, _ = drawn_rates(0.0, noise_mm, n_days, seed=5)
    found = drop_of(rates_of(rates, n_days))
    assert not found.is_told
    assert found.sigma_mm_per_day == pytest.approx(noise_mm * np.sqrt(2.0) / n_days, rel=0.5)
    # The prior's mean is .29.
    assert 0.1 < found.probabilities.mean() < 0.35
    assert 0.35 < found.wanted_mm_per_day / SURE_TO < 1.0


def test_probabilities_of_dropping_are_those_that_come_true() -> None:
    told = [
        (drop_of(rates_of(rates, n_days)).probabilities, slow)
        for n_days in (4.0, 6.0, 9.0)
        for share in (0.1, 0.3, 0.5)
        for seed in range(4)
        for rates, slow in [drawn_rates(share, 1.0, n_days, seed)]
    ]
    said, slow = (np.concatenate(each) for each in zip(*told, strict=True))
    for low in (0.05, 0.25, 0.5, 0.75):
        some = (said > low) & (said < low + 0.2)
        assert some.sum() > 60
        assert slow[some].mean() == pytest.approx(said[some].mean(), abs=0.12)


def test_a_diameter_of_another_fruit_says_nothing_of_the_others() -> None:
    rates, slow = drawn_rates(0.3, 0.3, 7.0, seed=6)
    rates[-3:] = [-2.0, 3.0, 5.0]
    found = drop_of(rates_of(rates))
    assert found.is_told
    assert np.mean((found.probabilities > 0.5)[:-3] == slow[:-3]) > 0.98
    np.testing.assert_allclose(found.probabilities[-3:], found.share, atol=0.05)


def test_the_order_of_fruits_does_not_move_who_drops() -> None:
    rates, _ = drawn_rates(0.3, 1.0, 6.0, seed=7)
    order = np.random.default_rng(7).permutation(len(rates))
    found, again = drop_of(rates_of(rates, 6.0)), drop_of(rates_of(rates[order], 6.0))
    np.testing.assert_array_equal(again.probabilities, found.probabilities[order])
    assert again.fast_mm_per_day == found.fast_mm_per_day


def test_what_was_not_measured_has_no_probability() -> None:
    found = drop_of(rates_of(np.array([0.9, np.nan, 0.8, 0.95, 0.85, 0.82, 0.88, 0.1]), 60.0))
    assert np.isnan(found.probabilities).tolist() == [False, True, *[False] * 6]
    assert found.probabilities[-1] > 0.9


def test_what_cannot_be_told_is_no_verdict(pomona: Pomona, tmp_path: Path) -> None:
    """Nothing drops, and visits three days apart with 2 mm of noise said that everything will."""
    path = grow_row(tmp_path / "o.gpkg", days=(35, 38), n_trees=2, noise_mm=2.0, scales=(1.0, 1.0)).path
    code, printed, told = pomona("thinning", path, "--target", 20, "-o", tmp_path / "thin.csv")
    assert (code, told) == (0, "")
    assert "from 2024-05-30 to 2024-06-02, cannot tell which fruits will drop" in printed
    assert re.search(r"wait until 2024-06-(0[5-9]|1[0-9]), or measure from nearer", printed)
    assert [line.split()[1:5] for line in printed.splitlines()[3:]] == [["30", "-", "-", "10"]] * 2
    with (tmp_path / "thin.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert [line["action"] for line in lines].count("drops") == 0
    assert all(0.0 < float(line["drop_probability"]) < 0.9 for line in lines)
    found = json.loads(pomona("thinning", path, "--json")[1])
    assert not found["is_told"]
    assert found["rate_sigma_mm_per_day"] > found["wanted_sigma_mm_per_day"]
    assert [tree["n_dropping"] for tree in found["trees"]] == [None, None]


def test_a_third_that_all_but_stand_still_is_found(pomona: Pomona, tmp_path: Path) -> None:
    """Of 90 fruitlets a third at a quarter of the rate, by calipers: none of them was found."""
    slow = range(0, 90, 3)
    row = grow_row(tmp_path / "o.gpkg", (35, 42), noise_mm=0.1, scales=(1.0, 1.0), dropping=slow, slowed_from=35.0)
    assert pomona("thinning", row.path, "-o", tmp_path / "thin.csv")[0] == 0
    with (tmp_path / "thin.csv").open(newline="") as file:
        said = {int(line["fruit_id"]) - 1 for line in csv.DictReader(file) if line["action"] == "drops"}
    assert said == set(slow)


def test_clusters_are_chains_of_neighbours() -> None:
    places = np.array([[0, 0, 0], [2.0, 0, 0], [0.08, 0, 0], [0.16, 0, 0], [2.0, 0.11, 0]])
    assert clusters_of(places).tolist() == [0, 1, 0, 0, 2]
    assert clusters_of(np.empty((0, 3))).tolist() == []
