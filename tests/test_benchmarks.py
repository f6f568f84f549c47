"""The parts of the benchmarks that compute: oracle, pose error, scoring, disturbances, tables."""

from itertools import permutations

import numpy as np
import pytest
from benchmarks import cells, cells_report, chance, false_alarms, kinect, results, season, sizes
from benchmarks.disturb import dropped, moved, with_false_points
from benchmarks.oracle import assign_in_gate, gated_pairs, oracle_pairs
from benchmarks.pose import pose_error
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import pomona
from pomona.cloud import FruitCloud
from pomona.evaluate import PairScore, score_pairs
from pomona.synth.clouds import scene_pair

GATE_CHI2 = {dimensions: float(chi2.ppf(0.99, df=dimensions)) for dimensions in (3, 4)}


def pose(rotvec=(0.0, 0.0, 0.0), shift=(0.0, 0.0, 0.0), scale=1.0) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = scale * Rotation.from_rotvec(rotvec).as_matrix()
    matrix[:3, 3] = shift
    return matrix


def best_gain(query: np.ndarray, map_: np.ndarray, sigma_m: float) -> float:
    """Likelihood gained over leaving everything alone, by trying every assignment."""
    cost = (np.linalg.norm(query[:, None] - map_[None], axis=2) / sigma_m) ** 2
    gains = np.maximum(0.0, (GATE_CHI2[query.shape[1]] - cost) / 2.0)
    return max(sum(gains[row, column] for row, column in enumerate(order)) for order in permutations(range(len(map_))))


@pytest.mark.parametrize("dimensions", [3, 4])
@pytest.mark.parametrize("seed", range(8))
def test_the_oracle_assigns_with_the_greatest_likelihood(seed: int, dimensions: int) -> None:
    rng = np.random.default_rng(seed)
    query, map_ = rng.uniform(0.0, 0.15, (2, 6, dimensions))
    gate_chi2 = GATE_CHI2[dimensions]
    pairs = assign_in_gate(query, map_, 0.03)
    assert len(np.unique(pairs[:, 0])) == len(np.unique(pairs[:, 1])) == len(pairs)
    distances = np.linalg.norm(query[pairs[:, 0]] - map_[pairs[:, 1]], axis=1) / 0.03
    assert (distances**2 < gate_chi2).all()
    assert ((gate_chi2 - distances**2) / 2.0).sum() == pytest.approx(best_gain(query, map_, 0.03))


def test_the_oracle_finds_nothing_between_clouds_far_apart() -> None:
    assert assign_in_gate(np.zeros((3, 3)), np.ones((4, 3)), 0.02).shape == (0, 2)


@pytest.mark.parametrize(("cell", "precision", "recall"), [("base", 0.96, 0.98), ("o45s4", 0.58, 0.79)])
def test_the_oracles_reach_what_the_cells_were_described_with(cell: str, precision: float, recall: float) -> None:
    oracle = gated = PairScore(0, 0, 0)
    for seed in range(6):
        pair = scene_pair(cell, seed)
        oracle += score_pairs(oracle_pairs(pair).tolist(), pair.query.ids, pair.map.ids)
        gated += score_pairs(gated_pairs(pair).tolist(), pair.query.ids, pair.map.ids)
    assert gated.precision == pytest.approx(precision, abs=0.03)
    assert gated.recall == pytest.approx(recall, abs=0.03)
    assert oracle.precision + oracle.recall > gated.precision + gated.recall - 0.02


def test_sizes_that_all_grew_alike_bring_the_oracle_and_the_matcher_pairs() -> None:
    verified, likelihood = sizes.of_cell("grown175", 2)
    assert verified["R with sizes"] > verified["R"] + 0.08
    assert likelihood["P with sizes"] > likelihood["P"] + 0.08
    assert likelihood["gain of F1"] > 0.08


def test_pose_errors_are_angle_shift_at_the_centre_and_ratio() -> None:
    query = np.random.default_rng(0).normal((100.0, 0.0, 0.0), 1.0, (50, 3))
    true = pose((0.1, 0.2, 0.3), (1.0, 2.0, 3.0), scale=1.5)
    centre = pose(shift=query.mean(axis=0))
    # Turned by 4 degrees and grown by 3 % about the centre of the query: the centre stays where it is.
    found = true @ centre @ pose((0.0, np.radians(4.0), 0.0), scale=1.03) @ np.linalg.inv(centre)
    error = pose_error(found, true, query)
    assert error.rotation_deg == pytest.approx(4.0)
    assert error.translation_m == pytest.approx(0.0, abs=1e-9)
    assert error.scale == pytest.approx(0.03)
    assert error.success
    assert pose_error(pose(shift=(0.0, 0.31, 0.0)) @ true, true, query).translation_m == pytest.approx(0.31)
    assert not pose_error(pose(shift=(0.0, 0.31, 0.0)) @ true, true, query).success
    assert pose_error(true @ pose((np.pi, 0.0, 0.0)), true, query).rotation_deg == pytest.approx(180.0)


@pytest.mark.parametrize(
    ("cell", "verdict", "right_pose", "expected"),
    [
        ("base", "Found", True, "right"),
        ("base", "Found", False, "wrong"),
        ("base", "NoMatch", False, "none"),
        ("noov", "Found", True, "wrong"),
        ("noov", "NoMatch", False, "right"),
        ("twins", "Ambiguous", False, "right"),
        ("six", "TooFew", False, "right"),
    ],
)
def test_outcomes(cell: str, verdict: str, right_pose: bool, expected: str) -> None:
    assert cells.outcome(scene_pair(cell, 0), verdict, right_pose=right_pose) == expected


def test_a_cells_line_averages_over_the_right_answers_only() -> None:
    def row(outcome: str, verdict: str, true: int, false: int, missed: int) -> dict[str, str]:
        counts = {"true": true, "false": false, "missed": missed, "sure_true": 4, "sure_false": 0}
        ceiling = {"oracle_true": 9, "oracle_false": 1, "gated_true": 5, "gated_false": 0}
        return {"cell": "base", "noise": "given", "outcome": outcome, "verdict": verdict, "cpu_s": "0.01"} | {
            key: str(value) for key, value in (counts | ceiling).items()
        }

    rows = [row("right", "Found", 8, 2, 2), row("right", "Found", 6, 0, 4), row("wrong", "Found", 0, 9, 10)]
    line = dict(zip(cells_report.HEADER, cells_report.line("paper", rows), strict=True))
    assert line["right"] == "2/3"
    assert line["wrong"] == "1"
    assert (line["P"], line["R"]) == ("0.900", "0.700")
    assert (line["oracle P"], line["oracle R"]) == ("0.900", "0.900")
    assert (line["gated P"], line["gated R"]) == ("1.000", "0.500")
    assert (line["P at .9"], line["R at .9"]) == ("1.000", "0.400")
    assert line["verdicts"] == "Found 3"


def test_identities_split_and_merge() -> None:
    kept = [("a", 1), ("a", 1), ("b", 2), ("b", 2)]
    assert kinect.identity_counts(kept) == {
        "observations": 4, "fruits": 2, "identities": 2, "splits": 0, "merges": 0
    }  # fmt: skip
    confused = kinect.identity_counts([("a", 1), ("a", 3), ("b", 2), ("b", 1)])
    assert (confused["identities"], confused["splits"], confused["merges"]) == (3, 2, 1)


def test_disturbances_keep_the_ids_of_the_fruits_that_stay() -> None:
    rng = np.random.default_rng(0)
    cloud = FruitCloud(rng.normal(size=(20, 3)), ids=tuple(f"a{row}" for row in range(20)))
    fewer = with_false_points(rng, dropped(rng, cloud, 0.3), 2, "x")
    assert len(fewer) == 16
    there = {name: cloud.positions[row] for row, name in enumerate(cloud.ids)}
    turned, old_from_new = moved(rng, fewer, scale=2.0)
    back = turned.transformed(old_from_new)
    assert sorted(turned.ids) == sorted(fewer.ids)
    for name, position in zip(back.ids, back.positions, strict=True):
        if name in there:
            np.testing.assert_allclose(position, there[name], atol=1e-12)
    assert sum(name in there for name in back.ids) == 14


def test_season_lifts_apples_to_where_boxes_of_their_size_lie(tmp_path) -> None:
    (tmp_path / "tree9_calipers_mm.csv").write_text("id,2022-07-10,2022-07-30\n7,60,80\n8,,70\n")
    (tmp_path / "tree9_boxes.csv").write_text(
        "date,id,xmin,ymin,xmax,ymax\n"
        "2022-07-20,7,909.5,489.5,1009.5,589.5\n2022-07-20,8*,1309.5,489.5,1409.5,589.5\n"
        "2022-07-20,TB,0,0,60,60\n"
    )
    lifted = season.read_dates(tmp_path, "tree9", flat=False)["2022-07-20"]
    assert lifted.ids == ("7", "8")
    np.testing.assert_allclose(lifted.positions, [[0.0, 0.0, 0.966], [0.4 * 0.7, 0.0, 0.966]], atol=1e-9)
    flat = season.read_dates(tmp_path, "tree9", flat=True)["2022-07-20"]
    np.testing.assert_allclose(flat.positions[:, 2], 1.38 * 65.46 / 60)


def test_markdown_tables_line_up() -> None:
    assert results.markdown(("a", "P"), [("base", "0.9")]) == "| a    |   P |\n| :--- | --: |\n| base | 0.9 |\n"


def test_false_alarms_go_on_where_the_last_run_stopped(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []

    def answered(cell: str, seed: int, rate: float) -> str:
        drawn.append((cell, seed, rate))
        return "Ambiguous" if seed == 0 else "NoMatch"

    monkeypatch.setattr(results, "FOLDER", tmp_path)
    monkeypatch.setattr(false_alarms, "status", answered)
    monkeypatch.setattr(false_alarms, "AT_ONCE", 2)
    false_alarms.main(["--cells", "noov", "--most-s", "0"])
    assert drawn == []
    false_alarms.main(["--cells", "noov", "vine-noov", "--pairs", "3"])
    false_alarms.main(["--cells", "noov", "--pairs", "5"])
    assert sorted(drawn) == [("noov", seed, 3e-4) for seed in range(5)] + [
        ("vine-noov", seed, 3e-4) for seed in range(3)
    ]
    assert results.read_rows("false_alarms.csv")[0] == {
        "cell": "noov",
        "rate": "0.0003",
        "pairs": "5",
        "found": "0",
        "ambiguous": "1",
    }
    false_alarms.main(["--cells", "vine-noov", "--pairs", "1", "--anew"])
    assert drawn[-1] == ("vine-noov", 0, 3e-4)
    assert "vine-noov" in (tmp_path / "false_alarms.md").read_text(encoding="utf-8")


def test_the_law_of_chance_is_fitted_to_searches_that_follow_it() -> None:
    rng = np.random.default_rng(3)
    sizes = rng.integers(5, 12, 8000)
    poses = np.exp(sizes.astype(float))
    nats = 4.0 + 1.5 * np.log(poses) + rng.gumbel(0.0, 2.0, len(poses))
    # What is below the tail does not count, however it is spread.
    nats -= rng.exponential(3.0, len(nats)) * (nats < 5.0 + 1.5 * np.log(poses))
    b, c, d = chance.fitted(sizes.astype(str), poses, nats)
    assert (b, c, d) == (pytest.approx(4.0, abs=0.7), pytest.approx(2.0, abs=0.15), pytest.approx(1.5, abs=0.08))
    for rate in (0.2, 0.01):
        above = np.mean(nats > chance.threshold((b, c, d), poses, rate))
        assert above == pytest.approx(1.0 - np.exp(-rate), abs=0.02)


def test_the_law_of_the_code_is_that_of_its_thresholds() -> None:
    pair = scene_pair("single-noov", 0)
    config = {"verified": {"false_alarm_rate": 1e-6}}
    stages = dict(pomona.match(pair.query, pair.map, config=config, threads=1).stages)
    poses = np.array(stages["query_fruits"] * stages["map_fruits"])
    assert chance.threshold(chance.law_in_the_code(), poses, 1e-6) == pytest.approx(stages["threshold_nats"])


def test_chance_is_reported_beside_the_code(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    nats = np.random.default_rng(4).gumbel(20.0, 2.0, 20)
    found = [{"size": "noov", "seed": seed, "poses": 1e3 * (1 + seed), "nats": nats[seed]} for seed in range(20)]
    monkeypatch.setattr(results, "FOLDER", tmp_path)
    monkeypatch.setattr(chance, "RESAMPLED", 5)
    monkeypatch.setattr(chance, "searched", lambda cell, seed: found[seed] if cell.name == "noov" and seed else None)
    monkeypatch.setattr(chance, "law_in_the_code", lambda: (1.25, 2.25, 3.25))
    chance.main(["--pairs", "20"])
    assert len(results.read_rows("chance.csv")) == 19
    report = (tmp_path / "chance.md").read_text(encoding="utf-8")
    assert all(told in report for told in ("19 of 20", "1.25", "2.25", "3.25"))
