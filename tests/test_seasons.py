"""Seasons of visits: what each sees, measures and tells of the truth."""

import json
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from command_line import assert_refused
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.synth.row_geometry import FruitSolids, Leaves, Limbs, RowGeometry
from pomona.synth.seasons import SEASONS, Season, SeasonPlan, SeasonVisit, draw_season
from pomona.synth.seasons.drive import Drive
from pomona.synth.seasons.season_files import season_truth, write_season
from pomona.synth.seasons.visibility import shown_shares

SMALL = replace(SEASONS["hard"], n_visits=4, design=replace(SEASONS["hard"].design, n_trees=3, leaves_per_tree=1200))


@pytest.fixture(scope="module")
def season() -> Season:
    return draw_season(SMALL, 7)


def in_map(visit: SeasonVisit) -> np.ndarray:
    pose = visit.map_from_session
    return visit.cloud.positions @ pose[:3, :3].T + pose[:3, 3]


def errors(visit: SeasonVisit) -> tuple[np.ndarray, np.ndarray]:
    """Errors of the places of true fruits in the map's frame, and their rows."""
    rows = np.flatnonzero(visit.fruits)
    true = visit.truth.centres_m[np.searchsorted(visit.truth.ids, visit.fruits[rows])]
    return in_map(visit)[rows] - true, rows


def test_the_same_seed_writes_the_same_bytes(season: Season, tmp_path: Path) -> None:
    write_season(season, tmp_path / "one")
    write_season(draw_season(SMALL, 7), tmp_path / "two")
    names = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert names == [*(f"{day.isoformat()}.csv" for day in SMALL.days), "truth.json"]
    for name in names:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


@pytest.mark.parametrize("hidden", [0.1, 0.4])
def test_as_many_fruits_are_hidden_as_asked(hidden: float) -> None:
    for visit in draw_season(replace(SMALL, hidden_share=hidden, n_visits=2), 1).visits:
        in_view = np.isfinite(visit.shown).sum()
        assert 1 - (visit.fruits > 0).sum() / in_view == pytest.approx(hidden, abs=0.01)


def test_the_hidden_are_those_that_show_least(season: Season) -> None:
    for visit in season.visits:
        seen = np.isin(visit.truth.ids, visit.fruits)
        missed = ~seen & np.isfinite(visit.shown)
        assert visit.shown[missed].mean() < 0.25 < 0.4 < visit.shown[seen].mean()


def test_of_what_shows_nothing_as_few_are_seen_as_the_docs_say() -> None:
    seen = []
    for visit in draw_season(SEASONS["hard"], 3).visits:
        found = np.isin(visit.truth.ids, visit.fruits)
        seen.append((int(found.sum()), int((visit.shown[found] == 0).sum())))
    assert seen[0] == (351, 12)
    assert sum(nothing for _, nothing in seen[1:]) == 1


def test_progress_is_told_visit_by_visit(season: Season) -> None:
    told: list[tuple[int, int]] = []
    draw_season(replace(SMALL, n_visits=2), season.seed, tell=lambda done, total: told.append((done, total)))
    assert told == [(0, 2), (1, 2), (2, 2)]


def test_one_side_sees_what_the_other_does_not() -> None:
    plan = replace(SMALL, skips_end_trees=False, first_after_bloom_days=110, last_after_bloom_days=111, n_visits=2)
    near, far = draw_season(plan, 2).visits
    assert (near.drive.side, far.drive.side) == ("near", "far")
    both = np.intersect1d(near.truth.ids, far.truth.ids)
    by_side = [visit.shown[np.searchsorted(visit.truth.ids, both)] for visit in (near, far)]
    assert (np.abs(by_side[0] - by_side[1]) > 0.5).mean() > 0.2
    depth = near.truth.centres_m[np.searchsorted(near.truth.ids, both), 1]
    assert np.corrcoef(by_side[0] - by_side[1], -depth)[0, 1] > 0.5
    again = draw_season(replace(plan, both_sides=False), 2).visits
    twice = np.stack([visit.shown[np.searchsorted(visit.truth.ids, both)] for visit in again])
    assert np.corrcoef(twice)[0, 1] > 0.8, "the same side sees the same fruits, not other coin flips"


def test_a_wall_of_leaves_hides_and_empty_air_does_not() -> None:
    ids = np.array([1, 2])
    directions = np.tile([0.0, 0.0, 1.0], (2, 1))
    colours = np.full((2, 3), 0.5)
    fruits = FruitSolids(
        ids, ids, np.array([[0.0, 0.0, 1.5], [0.3, 0.0, 1.5]]), np.full(2, 0.07), np.full(2, 0.07), directions,
        colours, colours, np.zeros(2), directions,
    )  # fmt: skip
    limbs = Limbs(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), np.empty(0), np.empty((0, 3)))
    leaf = Leaves(
        np.array([[0.3, -0.2, 1.4]]), np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, -1.0, 0.0]]),
        np.array([0.2]), np.array([0.2]), np.zeros(1), np.zeros(1), np.full((1, 3), 0.1),
    )  # fmt: skip
    geometry = RowGeometry(fruits, limbs, leaf)
    near = shown_shares(geometry, Drive("near", False, np.array([[0.0, -1.7, 1.5], [5.0, -1.7, 1.5]])))
    assert near[0].tolist() == [1.0, 0.0]
    assert np.isnan(near[1]).all(), "no frame that passes elsewhere sees them"
    far = shown_shares(geometry, Drive("far", False, np.array([[0.0, 1.7, 1.5]])))
    assert far[0].tolist() == [1.0, 1.0]


def test_noise_is_as_large_as_asked_and_longer_along_the_ray() -> None:
    plan = replace(SMALL, drift_scale_sigma=0.0, drift_bend_m=0.0, noise_m=0.02, along_ray=3.0, false_rate=0.0)
    season = draw_season(plan, 4)
    found = [errors(visit) for visit in season.visits]
    residuals = np.concatenate([error for error, _ in found])
    assert np.sqrt((residuals**2).mean()) == pytest.approx(0.02, rel=0.08)
    assert residuals[:, 1].std() > 1.6 * residuals[:, 0].std()
    distances = []
    for visit, (error, rows) in zip(season.visits, found, strict=True):
        turn = visit.map_from_session[:3, :3]
        covariances = turn @ visit.cloud.covariances[rows] @ turn.T
        distances.append(np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariances), error))
    assert np.concatenate(distances).mean() == pytest.approx(3.0, rel=0.1), "the covariances are not those of the noise"


def test_drift_stretches_and_bends_whole_visits() -> None:
    plan = replace(SMALL, noise_m=0.0, drift_scale_sigma=0.05, drift_bend_m=0.1, false_rate=0.0)
    stretches = []
    for visit in draw_season(plan, 5).visits:
        error, rows = errors(visit)
        true = in_map(visit)[rows] - error
        fit, rest, *_ = np.polyfit(true[:, 0], error[:, 0], 1, full=True)
        assert rest[0] < 1e-12, "along the row drift is a stretch"
        assert np.polyfit(true[:, 0], error[:, 1], 2, full=True)[1][0] < 1e-12, "across it a bow"
        stretches.append(fit[0])
    assert np.abs(stretches).max() > 0.005


def test_the_sizes_of_a_visit_share_an_error() -> None:
    season = draw_season(replace(SMALL, size_scale_sigma=0.05, size_noise_m=0.001, false_rate=0.0), 6)
    for visit in season.visits:
        true = visit.truth.diameters_m[np.searchsorted(visit.truth.ids, visit.fruits)]
        ratio = visit.cloud.diameters_m / true
        assert np.median(ratio) == pytest.approx(visit.size_scale, abs=0.012)
        assert (visit.cloud.diameters_m - visit.size_scale * true).std() == pytest.approx(0.001, rel=0.25)
    assert len({visit.size_scale for visit in season.visits}) == len(season.visits)


def test_false_points_are_counted_and_told(season: Season) -> None:
    for visit in season.visits:
        seen = (visit.fruits > 0).sum()
        assert (visit.fruits == 0).sum() == round(SMALL.false_rate * seen)
        assert len(np.unique(visit.fruits[visit.fruits > 0])) == seen
        assert visit.cloud.ids is None
        assert visit.cloud.n_views.min() >= 1
        order = visit.fruits[visit.fruits > 0]
        assert abs(np.corrcoef(order, np.arange(len(order)))[0, 1]) < 0.3, "the order of the rows tells who is who"


def test_a_drive_that_skips_an_end_tree_does_not_see_it() -> None:
    missed = set()
    for visit in draw_season(replace(SEASONS["hard"], n_visits=8, design=SMALL.design), 3).visits:
        in_view = np.array([np.isfinite(visit.shown[visit.truth.trees == tree]).mean() for tree in range(3)])
        assert in_view[1] > 0.9
        missed |= set(np.flatnonzero(in_view < 0.4))
    assert missed == {0, 2}


def test_sessions_lie_in_frames_of_their_own_unless_asked(season: Season) -> None:
    poses = np.stack([visit.map_from_session for visit in season.visits])
    turns = poses[:, :3, :3]
    np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), np.tile(np.eye(3), (len(poses), 1, 1)), atol=1e-12)
    assert np.ptp(poses[:, :3, 3], axis=0).min() > 1.0
    plain = draw_season(replace(SMALL, own_frames=False, n_visits=1), 7).visits[0]
    np.testing.assert_array_equal(plain.map_from_session, np.eye(4))


def test_a_visit_more_leaves_the_fruits_as_they_are(season: Season) -> None:
    more = draw_season(replace(SMALL, n_visits=7), 7)
    shared = {visit.day: visit for visit in more.visits}
    assert set(SMALL.days) <= set(shared)
    for visit in season.visits:
        np.testing.assert_array_equal(visit.truth.centres_m, shared[visit.day].truth.centres_m)


def test_the_named_seasons_are_as_described() -> None:
    easy, hard = SEASONS["easy"], SEASONS["hard"]
    assert (easy.n_visits, easy.hidden_share, easy.noise_m) == (8, 0.15, 0.010)
    assert (hard.n_visits, hard.design.n_trees, hard.hidden_share, hard.noise_m) == (5, 6, 0.30, 0.018)
    assert hard.false_rate == 0.08
    season = draw_season(replace(hard, n_visits=2), 1)
    row = season.row
    tips = np.linalg.norm(row._bent(155.0, None).shifts_m[row.wood.bears, -1], axis=1)
    assert 0.07 < np.percentile(tips, 99) < 0.13
    first, last = season.plan.days[0], season.plan.days[-1]
    hung = row.states_on(first) == 0
    assert (row.states_on(last)[hung] == 2).mean() == pytest.approx(1 / 3, abs=0.05)


def test_the_truth_tells_of_every_row_and_every_fruit(season: Season) -> None:
    truth = season_truth(season)
    n = len(truth["fruits"]["id"])
    for told, visit in zip(truth["visits"], season.visits, strict=True):
        assert [row or 0 for row in told["rows"]] == visit.fruits.tolist()
        assert {len(told[name]) for name in ("positions_in_map_m", "diameters_m", "states", "seen", "shown")} == {n}
        for fruit, state in enumerate(told["states"]):
            assert (told["diameters_m"][fruit] is not None) == (state == "alive")
            assert told["seen"][fruit] == (fruit + 1 in visit.fruits)
    assert {"alive", "thinned", "dropped"} <= set(truth["visits"][-1]["states"])


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"n_visits": 0}, "visits: found 0, expected 1 to 98"),
        ({"n_visits": 500}, "visits: found 500"),
        ({"hidden_share": 1.5}, "hidden_share: found 1.5, expected 0.0 to 0.95"),
        ({"noise_m": float("nan")}, "noise_m: found nan"),
        ({"false_rate": -1.0}, "false_rate: found -1.0"),
    ],
)
def test_what_cannot_be_is_refused(changes: dict, line: str) -> None:
    with pytest.raises(PomonaError, match=line):
        replace(SEASONS["hard"], **changes)


SHORT = ("synth", "season", "easy", "--trees", "1", "--fruits", "20:20")


def test_the_command_writes_a_season_and_takes_its_folder_again(tmp_path, run_here) -> None:
    folder = tmp_path / "season"
    arguments = (*SHORT, "-o", str(folder), "--seed", "2", "--hidden", "0", "--noise-mm", "0", "--same-frame")
    assert run_here(*arguments, "--visits", 3).stdout.count("fruits, near side") == 3
    truth = json.loads((folder / "truth.json").read_text())
    dates = [visit["date"] for visit in truth["visits"]]
    assert [date.fromisoformat(day) for day in dates] == sorted(date.fromisoformat(day) for day in dates)
    for visit in truth["visits"]:
        cloud = FruitCloud.read(folder / visit["file"])
        for row, fruit in enumerate(visit["rows"]):
            if fruit is not None:
                np.testing.assert_allclose(cloud.positions[row], visit["positions_in_map_m"][fruit - 1], atol=0.05)
    (folder / "notes.txt").write_text("mine")
    assert run_here(*arguments, "--visits", 2).returncode == 0
    assert {path.name for path in folder.iterdir()} == {
        f"{dates[0]}.csv",
        f"{dates[-1]}.csv",
        "truth.json",
        "notes.txt",
    }


def test_the_command_leaves_visits_alone_that_it_did_not_write(tmp_path, run_here) -> None:
    mine = tmp_path / "2024-07-01.csv"
    mine.write_text("x,y,z\n0,0,0\n")
    assert_refused(run_here(*SHORT, "-o", tmp_path), "is not a folder of the season easy with seed 0")
    assert run_here(*SHORT, "-o", tmp_path, "--visits", 2, "--force").returncode == 0
    assert mine.read_text() == "x,y,z\n0,0,0\n"


def test_another_season_is_not_replaced_without_a_word(tmp_path, run_here) -> None:
    folder = tmp_path / "season"
    arguments = (*SHORT, "-o", str(folder), "--visits", "2")
    assert run_here(*arguments, "--seed", 1).returncode == 0
    before = (folder / "truth.json").read_bytes()
    assert_refused(run_here(*arguments, "--seed", 2), "is not a folder of the season easy with seed 2")
    assert (folder / "truth.json").read_bytes() == before
    assert run_here(*arguments, "--seed", 2, "--force").returncode == 0
    assert json.loads((folder / "truth.json").read_text())["seed"] == 2


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("synth", "season", "spring"), "no season is called 'spring'; expected one of easy, hard"),
        (("synth", "season", "easy", "--trees", "0"), "--trees: found 0, expected 1 to 200"),
        (("synth", "season", "easy", "--hidden", "3"), "--hidden: found 3.0, expected 0.0 to 0.95"),
        (("synth", "season", "easy", "--noise-mm", "5000"), "--noise-mm: found 5000, expected 0 to 1000"),
        (("synth", "season", "easy", "--noise-mm", "nan"), "--noise-mm: found nan, expected 0 to 1000"),
        (("synth", "season", "easy", "--false", "nan"), "--false: found nan, expected 0.0 to 5.0"),
        (("synth", "season", "easy", "--visits", "0"), "--visits: found 0, expected 1 to"),
        (("synth", "season", "easy", "--fruits", "9:3"), "--fruits: found 9 to 3, expected"),
        (("synth", "clouds", "base", "--seeds", "1:3", "--seed", "4"), "found --seed 4 and --seeds 1:3, expected one"),
        (("synth", "season", "easy", "--trees", "1", "--fruits", "999:999"), "has room for"),
        (("synth", "season", "easy", "--fruits", "many"), "--fruits: found 'many', expected LEAST:MOST"),
        (("synth", "season", "easy", "--system", "vase"), "--system: found 'vase'"),
        (("synth", "season", "easy", "--seed", "-1"), "seed -1 is negative"),
    ],
)
def test_the_command_refuses_in_one_line(tmp_path, run_here, arguments, line) -> None:
    assert_refused(run_here(*arguments, "-o", tmp_path / "none"), line)
    assert not (tmp_path / "none").exists()


def test_a_plan_is_what_it_was_told(season: Season) -> None:
    assert isinstance(season.plan, SeasonPlan)
    assert [visit.day for visit in season.visits] == SMALL.days
