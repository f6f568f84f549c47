"""What people meet who type `import pomona`: short answers, files where clouds are, tables for their own tools."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pomona
from pomona import FruitCloud, Index, Match, OrchardMap, PomonaError
from pomona.matching import ReadyCloud, match_expected
from pomona.synth.clouds import scene_pair
from pomona.synth.planting import grow_row

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def visits(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two visits as files."""
    folder, pair = tmp_path_factory.mktemp("visits"), scene_pair("base", 7)
    pair.query.write(folder / "query.csv")
    pair.map.write(folder / "map.csv")
    return folder / "query.csv", folder / "map.csv"


@pytest.fixture(scope="module")
def match(visits: tuple[Path, Path]) -> Match:
    return pomona.match(*visits)


def test_names_of_files_are_clouds(visits: tuple[Path, Path], match: Match) -> None:
    query, map = (FruitCloud.read(path) for path in visits)
    read = pomona.match(query, map)
    np.testing.assert_array_equal(match.pairs, read.pairs)
    np.testing.assert_array_equal(Index(str(visits[1])).match(str(visits[0])).pairs, read.pairs)
    index, pose = Index(visits[1]), match.map_from_query
    np.testing.assert_array_equal(index.pairs_under(visits[0], pose).pairs, index.pairs_under(query, pose).pairs)
    figure = pomona.draw_match(visits[0], visits[1], match)
    assert figure.get_suptitle().startswith("Found")


def test_an_expected_pose_saves_the_search_and_changes_nothing_of_what_is_found() -> None:
    rng = np.random.default_rng(5)
    row = grow_row(rng, 6).positions
    seen = [row[rng.random(len(row)) < 0.8] + rng.normal(0, 0.008, 3) for _ in range(2)]
    query, map = (places + rng.normal(0, 0.006, places.shape) for places in seen)
    turn = Rotation.from_rotvec([0.4, -1.0, 2.0]).as_matrix()
    query = (query - [3.0, 1.0, -2.0]) @ turn
    searched = pomona.match(query, map)
    middle = query.mean(axis=0)
    for off_m in (0.0, 0.02, 0.08):
        expected = searched.map_from_query.copy()
        expected[:3, :3] = Rotation.from_rotvec([0.0, off_m / 10.0, 0.0]).as_matrix() @ expected[:3, :3]
        expected[:3, 3] += searched.map_from_query[:3, :3] @ middle - expected[:3, :3] @ middle + off_m
        found = match_expected(query, map, expected)
        np.testing.assert_array_equal(found.pairs, searched.pairs)
        # Another seed ends in the same pose but for its last digits, and beliefs end where they change by 1e-5.
        np.testing.assert_allclose(found.probabilities, searched.probabilities, atol=2e-6)
    aside = searched.map_from_query + np.pad([[2.0], [2.0], [0.0]], ((0, 1), (3, 0)))
    assert not match_expected(query, map, aside)
    with pytest.raises(PomonaError, match=r"map_from_query: found shape \(3, 3\), expected \(4, 4\)"):
        match_expected(query, map, np.eye(3))


def test_clouds_made_ready_once_are_matched_as_if_they_were_not() -> None:
    rng = np.random.default_rng(6)
    row = grow_row(rng, 4).positions
    visits = [row[rng.random(len(row)) < 0.8] + rng.normal(0, 0.006, 3) for _ in range(3)]
    ready = [ReadyCloud(places, threads=1) for places in visits]
    for one, other in ((0, 1), (1, 0), (2, 0), (2, 1)):
        found, expected = (match_expected(sides[one], sides[other], np.eye(4)) for sides in (ready, visits))
        assert found
        assert found.n_query == len(visits[one])
        np.testing.assert_array_equal(found.pairs, expected.pairs)
        np.testing.assert_array_equal(found.probabilities, expected.probabilities)
        np.testing.assert_array_equal(found.map_from_query, expected.map_from_query)
    with pytest.raises(PomonaError, match="threads: found 0, expected a whole number from 1"):
        ReadyCloud(visits[0], threads=0)


def test_a_file_of_unknown_scale_is_read_as_it_is(visits: tuple[Path, Path], tmp_path: Path) -> None:
    query = FruitCloud.read(visits[0])
    (tmp_path / "sfm.csv").write_text("x,y,z\n" + "\n".join(f"{x},{y},{z}" for x, y, z in 1000 * query.positions))
    found = pomona.match(tmp_path / "sfm.csv", visits[1], scale="free")  # a warning of the unit would be an error here
    assert found
    assert found.scale == pytest.approx(0.001, rel=0.01)


def test_a_file_that_is_not_there_is_told() -> None:
    with pytest.raises(PomonaError, match=r"absent\.csv: not found"):
        pomona.match("absent.csv", np.zeros((4, 3)))


def test_a_match_is_true_where_it_was_found(match: Match, visits: tuple[Path, Path]) -> None:
    assert match
    assert not pomona.match(np.zeros((2, 3)), visits[1])


def test_short_answers(match: Match, visits: tuple[Path, Path], tmp_path: Path) -> None:
    cloud, index = FruitCloud.read(visits[1]), Index(visits[1])
    orchard = tmp_path / "orchard.gpkg"
    pomona.add_session(orchard, pomona.load_session(visits[1], date="2024-08-09"))
    whole = OrchardMap(orchard)
    assert re.fullmatch(r"Match\(Found: \d+ of \d+ fruits again among \d+, log-odds \d+\)", repr(match))
    assert re.fullmatch(r"Match\(TooFew: 2 fruits, \d+ in the map\)", repr(index.match(np.zeros((2, 3)))))
    assert repr(cloud).startswith(f"FruitCloud(fruits: {len(cloud)}, extent: ")
    assert repr(FruitCloud(np.zeros((0, 3)))) == "FruitCloud(fruits: 0)"
    assert repr(index) == f"Index({len(cloud)} fruits, verified, metric)"
    assert repr(whole) == f"OrchardMap('{orchard}', map)"
    assert repr(whole.observations()) == f"Observations({len(cloud)} of {len(cloud)} fruits in 1 session)"
    for answer in (match, cloud, index, whole):
        assert len(repr(answer)) < 200
        html = answer._repr_html_()
        assert html.startswith("<table>")
        assert html.count("<tr>") == html.count("</tr>") >= 2


def test_whatever_holds_a_cloud_is_matched(visits: tuple[Path, Path], tmp_path: Path) -> None:
    session = pomona.load_session(visits[1], date="2024-08-09")
    pomona.add_session(tmp_path / "orchard.gpkg", session)
    found = pomona.match(visits[0], OrchardMap(tmp_path / "orchard.gpkg"))
    assert (found.status, found.n_map) == ("Found", len(session.cloud))
    assert pomona.match(visits[0], session).pairs.tolist() == found.pairs.tolist()
    with pytest.raises(PomonaError, match=r"a bare cloud has no date, .*--date YYYY-MM-DD, in Python date="):
        pomona.load_session(visits[1])


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ({"noise_m": "a"}, "noise_m: found 'a', expected metres per axis, or None"),
        ({"noise_m": True}, "noise_m: found True, expected metres per axis, or None"),
        ({"noise_m": [0.1]}, r"noise_m: found \[0.1\], expected metres per axis, or None"),
        ({"per_frame": 1}, "per_frame: found 1, expected True or False"),
        ({"up": "a"}, "up: expected one direction"),
        ({"query": None}, "query: found None, expected fruits"),
        ({"map": None}, "map: found None, expected fruits"),
    ],
)
def test_an_argument_that_is_wrong_is_called_by_its_name(wrong: dict[str, Any], line: str) -> None:
    with pytest.raises(PomonaError, match=f"^{line}"):
        pomona.match(**{"query": np.eye(3), "map": np.eye(3), **wrong})


@pytest.mark.parametrize("pose", ["a", None, [[1], [2, 3]], np.eye(3), np.full((4, 4), np.nan), np.zeros((4, 4))])
def test_a_pose_that_is_none_is_called_by_its_name(pose: Any) -> None:
    for asked in (Index(np.eye(3)).pairs_under, lambda query, pose: match_expected(query, np.eye(3), pose)):
        with pytest.raises(PomonaError, match=r"^map_from_query: "):
            asked(np.eye(3), pose)
    with pytest.raises(PomonaError, match=r"^noise_m: found 'a'"):
        Index(np.eye(3)).pairs_under(np.eye(3), np.eye(4), noise_m="a")  # type: ignore[arg-type]


def test_an_index_has_the_name_of_a_file() -> None:
    with pytest.raises(PomonaError, match="path: found None, expected the name of a file"):
        Index.open(None, np.eye(3))  # type: ignore[arg-type]


@pytest.mark.parametrize("config", ["pomona.toml", 5, {"verified": {"rate": object()}}])
def test_a_config_that_is_no_table_is_refused(visits: tuple[Path, Path], config: Any) -> None:
    with pytest.raises(PomonaError, match=r"^config: (found|Object)"):
        pomona.match(*visits, config=config)


@pytest.mark.parametrize(
    ("diagonal", "found"), [((1, 1, -1, 1), "a mirror"), ((1, 2, 1, 1), "a stretch or shear"), ((0, 0, 0, 1), "a st")]
)
def test_a_cloud_is_not_mirrored_or_stretched(diagonal: tuple[int, ...], found: str) -> None:
    cloud = FruitCloud(np.eye(3))
    with pytest.raises(PomonaError, match=f"map_from_query: found {found}"):
        cloud.transformed(np.diag(diagonal))
    assert cloud.transformed(np.diag((2, 2, 2, 1))).positions.tolist() == (2 * np.eye(3)).tolist()


def test_names_of_strangers_do_nothing_in_a_notebook() -> None:
    cloud = FruitCloud(np.zeros((1, 3)), extras={"<script>alert(1)</script>": ("a",)})
    assert "<script>" not in cloud._repr_html_()


def test_every_public_part_is_documented_and_there() -> None:
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    documented = set(re.findall(r"^::: pomona\.(\w+)$", page, re.MULTILINE))
    assert documented == set(pomona.__all__) - {"__version__"}
    assert all(hasattr(pomona, name) for name in pomona.__all__)
    assert {"scan", "OrchardMap", "match", "Survey"} <= documented


def test_tables_without_their_libraries_are_refused_in_one_line(
    monkeypatch: pytest.MonkeyPatch, match: Match, visits: tuple[Path, Path]
) -> None:
    cloud = FruitCloud.read(visits[1])
    for name in ("pandas", "geopandas"):
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(PomonaError, match=f"^{name}: not installed, expected it here: pip install {name}$"):
            getattr(cloud, f"to_{name}")()


def test_tables_for_pandas_have_numbers_for_numbers(full_cloud: FruitCloud) -> None:
    pytest.importorskip("pandas")
    table = full_cloud.to_pandas()
    assert list(table["id"]) == list(full_cloud.ids or ())
    assert table["n_views"].dtype == np.int64
    np.testing.assert_array_equal(table[["x", "y", "z"]].to_numpy(), full_cloud.positions)


def test_tables_for_geopandas_have_points_in_local_metres(full_cloud: FruitCloud) -> None:
    pytest.importorskip("geopandas")
    table = full_cloud.to_geopandas()
    assert [point.z for point in table.geometry] == full_cloud.positions[:, 2].tolist()
    assert table.crs.to_wkt().startswith("ENGCRS")


def test_observations_are_a_long_table(visits: tuple[Path, Path], tmp_path: Path) -> None:
    orchard = tmp_path / "orchard.gpkg"
    for path, date in zip(reversed(visits), ("2024-08-09", "2024-08-28"), strict=True):
        assert pomona.add_session(orchard, pomona.load_session(path, date=date)).is_added
    columns = OrchardMap(orchard).observations().columns()
    assert list(columns) == ["fruit", "session", "date", "label", "x", "y", "z", "diameter_m", "probability"]
    assert len({len(column) for column in columns.values()}) == 1
    assert set(zip(columns["session"], columns["date"], strict=True)) == {
        ("map", "2024-08-09"),
        ("query", "2024-08-28"),
    }
    assert np.isnan(columns["probability"]).any()
    assert (columns["probability"] > 0.5).any()


def test_importing_pomona_loads_no_numpy() -> None:
    code = "import sys, pomona; dir(pomona); assert 'numpy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
