"""Precision and recall against truth, from rows and from files."""

import io
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from command_line import Pomona
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.evaluate import PairScore, score_pairs, score_placed_pairs
from pomona.pairs import read_pairs, write_pairs
from pomona.scanning import scan as pomona_scan
from recording_maker import make_recording

QUERY_TRUTH = ("a", "b", "c", "only-query")
MAP_TRUTH = ("c", "only-map", "a", "b")


def test_counts_true_false_and_missed() -> None:
    # a is right, b got the partner of nobody, c got none.
    score = score_pairs([(0, 2), (1, 1)], QUERY_TRUTH, MAP_TRUTH)
    assert score == PairScore(true=1, false=1, missed=2)
    assert score.common == 3
    assert score.precision == 0.5
    assert score.recall == pytest.approx(1 / 3)


def test_nothing_found_has_no_precision_and_no_overlap_no_recall() -> None:
    assert score_pairs([], QUERY_TRUTH, MAP_TRUTH).precision is None
    assert score_pairs([], QUERY_TRUTH, MAP_TRUTH).recall == 0.0
    assert score_pairs([(0, 0)], ("a",), ("b",)).recall is None


def test_a_fruit_of_unknown_truth_counts_neither_way() -> None:
    assert score_pairs([(0, 0), (1, 1)], ("", "b"), ("a", "b")) == PairScore(true=1, false=0, missed=0, unjudged=1)


def test_refuses_a_repeated_id_and_a_row_that_is_not_there() -> None:
    with pytest.raises(PomonaError, match="map: id 'a' names 2 fruits"):
        score_pairs([], ("a",), ("a", "a"))
    with pytest.raises(PomonaError, match="row 4 of the query, found 4 rows"):
        score_pairs([(4, 0)], QUERY_TRUTH, MAP_TRUTH)


@given(st.permutations(range(8)), st.integers(0, 8))
def test_the_truth_scores_one_and_a_shift_scores_zero(order: list[int], found: int) -> None:
    truth_in_query = tuple(map(str, range(8)))
    truth_in_map = tuple(map(str, order))
    right = [(row, order.index(row)) for row in range(found)]
    wrong = [(row, order.index((row + 1) % 8)) for row in range(found)]
    assert score_pairs(right, truth_in_query, truth_in_map) == PairScore(true=found, false=0, missed=8 - found)
    assert score_pairs(wrong, truth_in_query, truth_in_map) == PairScore(true=0, false=found, missed=8)


def test_scores_add_up() -> None:
    assert PairScore(1, 2, 3, 4) + PairScore(10, 20, 30, 40) == PairScore(11, 22, 33, 44)


@pytest.fixture
def clouds() -> tuple[FruitCloud, FruitCloud]:
    positions = np.arange(12.0).reshape(4, 3)
    return FruitCloud(positions, ids=QUERY_TRUTH), FruitCloud(positions, ids=MAP_TRUTH)


def test_reads_pairs_by_id_from_csv_and_from_json(tmp_path: Path, clouds: tuple[FruitCloud, FruitCloud]) -> None:
    as_csv, as_json = tmp_path / "pairs.csv", tmp_path / "match.json"
    as_csv.write_text("probability,map,query\n0.9,a,a\n0.8,only-map,b\n")
    as_json.write_text(json.dumps({"matches": [{"query": "a", "map": "a"}, {"query": "b", "map": "only-map"}]}))
    assert read_pairs(as_csv, *clouds) == read_pairs(as_json, *clouds) == [(0, 2), (1, 1)]


def test_pairs_of_any_names_read_back_the_same(tmp_path: Path) -> None:
    names = ("a\rb", "a\nb", 'a",\r\n"b', " ", "林檎")
    cloud = FruitCloud(np.arange(15.0).reshape(5, 3), ids=names)
    pairs = [(row, 4 - row) for row in range(5)]
    match = SimpleNamespace(pairs=np.array(pairs), probabilities=np.full(5, 0.5), distances_m=np.zeros(5))
    write_pairs(tmp_path / "pairs.csv", match, cloud, cloud)  # type: ignore[arg-type]
    assert read_pairs(tmp_path / "pairs.csv", cloud, cloud) == pairs


def test_reads_rows_where_there_are_no_ids(tmp_path: Path) -> None:
    cloud = FruitCloud(np.zeros((3, 3)))
    (tmp_path / "pairs.csv").write_text("query,map\n2,0\n")
    assert read_pairs(tmp_path / "pairs.csv", cloud, cloud) == [(2, 0)]


def test_reads_the_standard_input(monkeypatch: pytest.MonkeyPatch, clouds: tuple[FruitCloud, FruitCloud]) -> None:
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"query,map\na,a\n")))
    assert read_pairs(Path("-"), *clouds) == [(0, 2)]


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("", "line 1: found nothing, expected a header with the columns query and map"),
        ("x,y\n1,2\n", "line 1: found 'x,y', expected a header"),
        ("query,map\na\n", "line 2: found 1 values, expected 2"),
        ("query,map\na,a\nzzz,a\n", "line 3: query 'zzz' is no fruit of the query"),
        ('{"matches": [{"query": "a"}]}', "expected the JSON of `pomona match --json`"),
        ('{"matches": [{"query": "a", "map": "zzz"}]}', r"matches\[0\]: map 'zzz' is no fruit of the map"),
        ("{broken", "expected the JSON of `pomona match --json`"),
    ],
)
def test_refuses_what_are_no_pairs(
    tmp_path: Path, clouds: tuple[FruitCloud, FruitCloud], content: str, complaint: str
) -> None:
    path = tmp_path / "pairs.csv"
    path.write_text(content)
    with pytest.raises(PomonaError, match=complaint) as caught:
        read_pairs(path, *clouds)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_refuses_a_missing_file(tmp_path: Path, clouds: tuple[FruitCloud, FruitCloud]) -> None:
    with pytest.raises(PomonaError, match="not found, expected pairs"):
        read_pairs(tmp_path / "none.csv", *clouds)


@pytest.fixture
def seen(tmp_path: Path) -> Path:
    """Two scans of six fruits, which call them by numbers of their own; the true fruits of both dates."""
    rng = np.random.default_rng(3)
    true = rng.uniform([0, 0, 0], [3, 1, 2], (60, 3))
    grown = true + rng.normal(0, 0.05, true.shape)
    for name, positions in (("truth_query", grown), ("truth_map", true)):
        FruitCloud(positions, ids=tuple(f"apple {row}" for row in range(60))).write(tmp_path / f"{name}.csv")
    order = rng.permutation(60)
    found = grown[order] + rng.normal(0, 0.003, true.shape)
    found[0] = [9.0, 9.0, 9.0]  # a false fruit
    FruitCloud(found, ids=tuple(f"q{row}" for row in range(60))).write(tmp_path / "query.csv")
    FruitCloud(true + 0.002, ids=tuple(f"m{row}" for row in range(60))).write(tmp_path / "map.csv")
    right = [f"q{row},m{order[row]}" for row in range(1, 41)]
    (tmp_path / "pairs.csv").write_text("\n".join(["query,map", "q0,m0", f"q50,m{order[51]}", *right]) + "\n")
    return tmp_path


def judged(pomona: Pomona, seen: Path, *flags: object) -> dict[str, float]:
    code, out, err = pomona(
        "evaluate", "match", seen / "query.csv", seen / "map.csv", seen / "pairs.csv", "--json", *flags
    )
    assert code == 0, err
    return json.loads(out)


def truths(seen: Path) -> list[object]:
    return ["--truth", seen / "truth_query.csv", "--truth", seen / "truth_map.csv"]


def test_judges_by_place_where_ids_say_nothing(pomona: Pomona, seen: Path) -> None:
    score = judged(pomona, seen, *truths(seen))
    # A pair of a false fruit is false, as is one of two different fruits.
    assert (score["true"], score["false"], score["common"]) == (40, 2, 59)
    assert judged(pomona, seen, *truths(seen), "--within", 0.0101)["true"] <= 40


def test_finds_frames_of_their_own_in_the_truth(pomona: Pomona, seen: Path) -> None:
    turn = np.array([[0.0, -1, 0, 5], [1, 0, 0, -2], [0, 0, 1, 1], [0, 0, 0, 1]])
    FruitCloud.read(seen / "query.csv").transformed(turn).write(seen / "query.csv")
    command = ("evaluate", "match", seen / "query.csv", seen / "map.csv", seen / "pairs.csv", *truths(seen))
    code, out, err = pomona(*command)
    assert (code, out) == (2, "")
    assert "query.csv: found 0 of 60 fruits within 3 cm of a true one" in err
    assert "--align" in err
    assert judged(pomona, seen, *truths(seen), "--align")["true"] == 40


def test_one_truth_may_be_that_of_both(pomona: Pomona, seen: Path) -> None:
    (seen / "pairs.csv").write_text("query,map\nm3,m3\nm4,m5\n")
    command = ("evaluate", "match", seen / "map.csv", seen / "map.csv", seen / "pairs.csv")
    code, out, _ = pomona(*command, "--truth", seen / "truth_map.csv", "--json")
    assert code == 0
    assert (json.loads(out)["true"], json.loads(out)["false"]) == (1, 1)


def test_two_fruits_at_one_true_one_are_both_right() -> None:
    assert score_placed_pairs([(0, 0), (1, 1)], ("a", "a", ""), ("a", "b")) == PairScore(true=1, false=1, missed=0)
    assert score_placed_pairs([(2, 0)], ("a", "a", ""), ("a", "b")) == PairScore(true=0, false=1, missed=1)


def test_scans_without_common_ids_are_refused_and_not_scored(pomona: Pomona, seen: Path) -> None:
    code, out, err = pomona("evaluate", "match", seen / "query.csv", seen / "map.csv", seen / "pairs.csv")
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert "found no id in common, expected true ids; --truth FRUITS judges by place" in err


def test_numbers_of_a_tracker_are_no_true_ids(pomona: Pomona, tmp_path: Path) -> None:
    row = make_recording(tmp_path / "2024-08-09", (0.0, 0.02, 0.04, 0.06, 0.08), ids=False)
    for name in ("a", "b"):
        assert len(pomona_scan(row, output=tmp_path / f"{name}.gpkg").cloud) == 3
    (tmp_path / "pairs.csv").write_text("query,map\n1,1\n")
    code, out, err = pomona("evaluate", "match", tmp_path / "a.gpkg", tmp_path / "b.gpkg", tmp_path / "pairs.csv")
    assert (code, out) == (2, "")
    assert "a.gpkg: found ids that its tracker gave, expected true ids" in err


@pytest.mark.parametrize(("flags", "said"), [(["--align"], "--align"), (["--within", 0.1], "--within")])
def test_flags_of_the_truth_come_with_it(pomona: Pomona, seen: Path, flags: list[object], said: str) -> None:
    code, _, err = pomona("evaluate", "match", seen / "query.csv", seen / "map.csv", seen / "pairs.csv", *flags)
    assert code == 2
    assert f"{said}: found without --truth FRUITS" in err
