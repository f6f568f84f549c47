"""What the page is told of a map."""

import base64
import json
import zlib
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from growth_maker import FRUITS_OF_TREE, GrownRow, grow_row
from pomona import FruitCloud
from pomona.orchard import OrchardMap, Session, add_session
from pomona.orchard.control_points import read_control_points
from pomona.orchard.georeferencing import georeference
from pomona.orchard.hanging import hang_chances
from pomona.trajectory import Trajectory
from pomona.viewer.packed_columns import packed
from pomona.viewer.row_frame import guessed_vertical
from pomona.viewer.season_page import Wishes, season_document


def unpacked(column: dict) -> np.ndarray:
    """As the page does it."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(column["bytes"])), np.uint8).reshape(4, column["n"])
    folded = planes.T.copy().view("<u4").ravel().astype(np.int64)
    codes = np.cumsum(np.where(folded % 2, -(folded + 1) // 2, folded // 2))
    return np.where(codes == 0, np.nan, (column["low"] + codes - 1) * column["step"])


def texts(column: str) -> list[str]:
    return json.loads(zlib.decompress(base64.b64decode(column)))


@pytest.fixture(scope="module")
def row(grown_row: GrownRow) -> Path:
    return grown_row.path


@pytest.mark.parametrize(
    "values",
    [[], [np.nan], [3.0], [1.0, np.nan, -2.5, 4.0], [1e12, -1e12, 0.0], [1e300], np.arange(70_000) / 10.0],
)
def test_columns_come_back_to_the_nearest_step(values: list[float]) -> None:
    column = packed(values, 0.1)
    found = unpacked(column)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(values))
    np.testing.assert_allclose(found, values, atol=0.51 * column["step"])


def test_columns_are_told_in_multiples_of_their_step() -> None:
    """Whatever the least of them is: no probability is above 1, and all sizes are tenths."""
    shares = unpacked(packed([0.0004, 0.5, 0.8996, 0.9996, 1.0], 0.001))
    assert shares.tolist() == [0.0, 0.5, 0.9, 1.0, 1.0]
    sizes = np.random.default_rng(0).normal(70.0, 8.0, 200)
    np.testing.assert_array_equal(np.round(unpacked(packed(sizes, 0.1)), 9), np.round(sizes, 1))


def test_all_fruits_are_told_where_the_map_has_them(row: Path) -> None:
    told = season_document(row, Wishes(up=np.array([0.0, 0.0, 1.0])))
    orchard = OrchardMap(row)
    ids, seen = texts(told["fruits"]["ids"]), orchard.observations()
    assert sorted(ids, key=int) == list(orchard.fruits().ids)
    placed = np.stack([unpacked(told["sights"][axis]) for axis in "xyz"] + [np.ones(len(seen))])
    in_map = (np.array(told["map_from_page"]) @ placed)[:3].T
    fruit, visit = (unpacked(told["sights"][name]).astype(int) for name in ("fruit", "visit"))
    names = [one["name"] for one in told["visits"]]
    found = {(ids[f], names[v]): place for f, v, place in zip(fruit, visit, in_map, strict=True)}
    for fruit_id, session, place in zip(seen.fruit_ids, seen.sessions, seen.positions_in_map, strict=True):
        np.testing.assert_allclose(found[str(fruit_id), session], place, atol=0.001)


def test_growth_and_thinning_are_those_of_their_verbs(row: Path) -> None:
    told = season_document(row, Wishes(harvest=date(2024, 9, 1), target=20))
    growth, thinning = told["growth"], told["thinning"]
    n = 3 * FRUITS_OF_TREE
    assert unpacked(growth["median_mm"]).reshape(n, -1).shape == (n, len(growth["days"]))
    assert growth["days"][-1] == growth["harvest"] == "2024-09-01"
    assert sum(one["n_fruits"] for one in growth["classes"] if one["date"] == "2024-09-01") == pytest.approx(n, abs=1)
    assert growth["blocks"][0]["n_fruits"] == n
    place = unpacked(thinning["place"])
    stays = place[~np.isnan(place)]
    assert (stays > 20).sum() == sum(max(0, count - 20) for count in np.bincount(_trees(told)[~np.isnan(place)]))


def _trees(told: dict) -> np.ndarray:
    return unpacked(told["fruits"]["tree"]).astype(int)


def test_a_map_of_one_visit_says_why_there_is_no_growth(tmp_path: Path) -> None:
    path = grow_row(tmp_path / "orchard.gpkg", (50,)).path
    told = season_document(path, Wishes())
    assert told["growth"] is None
    assert told["thinning"] is None
    assert "one day" in told["no_growth"]


def test_a_map_of_one_visit_tells_the_sizes_that_it_has(tmp_path: Path) -> None:
    path = grow_row(tmp_path / "orchard.gpkg", (80,)).path
    told = season_document(path, Wishes(limits_mm=np.array([45.0, 50.0, 55.0]), pack_kg=2.0))["sizes"]
    sizes_mm = 1000.0 * OrchardMap(path).fruits().diameters_m
    chances = hang_chances(OrchardMap(path).fruits())
    counts = np.bincount(np.searchsorted([45.0, 50.0, 55.0], sizes_mm, side="right"), chances, minlength=4)
    assert {(one["from_mm"], one["below_mm"]): one["n_fruits"] for one in told} == {
        limits: pytest.approx(count, abs=0.001)
        for limits, count in zip([(None, 45), (45, 50), (50, 55), (55, None)], counts, strict=True)
        if count
    }
    assert {one["date"] for one in told} == {"2024-07-14"}
    kg = 900.0 * np.pi / 6.0 * (sizes_mm / 1000.0) ** 3
    assert sum(one["packs"] for one in told) == pytest.approx(kg @ chances / 2.0, abs=0.01)
    assert {one["n_fruits_low"] for one in told} == {None}


def test_a_map_without_diameters_has_no_sizes(tmp_path: Path) -> None:
    places = np.random.default_rng(7).uniform((0, 0, 0), (6, 1, 2), (40, 3))
    add_session(tmp_path / "orchard.gpkg", Session("one", "2024-06-01", "drawn", FruitCloud(places)))
    told = season_document(tmp_path / "orchard.gpkg", Wishes())
    assert (told["growth"], told["sizes"]) == (None, None)
    assert told["no_growth"] == "orchard.gpkg: found no diameters, expected sessions that measured them"


def test_the_page_does_not_tell_where_the_map_lies(tmp_path: Path) -> None:
    """A report is mailed."""
    path = tmp_path / "seasons.gpkg"
    rng = np.random.default_rng(8)
    places = rng.uniform((0, 0, 0), (6, 1, 2), (40, 3))
    for day in ("2023-12-01", "2024-02-20", "2024-05-10", "2024-08-01"):
        cloud = FruitCloud(places + rng.normal(0, 0.003, places.shape), diameters_m=np.full(40, 0.06))
        add_session(path, Session(day, day, "drawn", cloud))
    told = season_document(path, Wishes())
    assert told["no_growth"].startswith("seasons.gpkg: found visits from 2023-12-01 to 2024-08-01")
    assert str(tmp_path) not in json.dumps(told)


def test_the_same_map_is_told_the_same(row: Path) -> None:
    assert json.dumps(season_document(row, Wishes())) == json.dumps(season_document(row, Wishes()))


def drive_along(path: Path, rows: list[np.ndarray]) -> Path:
    """A map of rows in a camera's frame, y down, past which a camera drove."""
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, 0, 3] = np.linspace(0, 6, 5)
    way = Trajectory(np.arange(5), np.arange(5) * 0.5, poses)
    add_session(path, Session("one", "2024-08-01", "drawn", FruitCloud(np.vstack(rows)), way))
    return path


def upwards(told: dict) -> np.ndarray:
    """The page's z in the map."""
    return np.array(told["map_from_page"])[:3, 2]


def test_the_vertical_is_that_of_the_cameras_of_the_earth_or_given(tmp_path: Path) -> None:
    places = np.random.default_rng(5).uniform((0, -1, 0), (6, 1, 5), (80, 3))
    path = drive_along(tmp_path / "orchard.gpkg", [places])
    told = season_document(path, Wishes())
    np.testing.assert_allclose(upwards(told), [0, -1, 0], atol=1e-9)
    assert not told["is_vertical_guessed"]
    posts = np.array([[0.0, 0.2, 2.0], [6.0, 0.1, 2.0], [3.0, -0.8, 5.0]])
    tilted = np.array([0.0, -1.0, 0.2]) / np.hypot(1.0, 0.2)
    east, north = 500_000.0 + posts[:, 0], 5_277_000.0 + posts @ np.cross(tilted, [1, 0, 0])
    lines = [
        f"P{n},{','.join(map(str, row))}" for n, row in enumerate(np.column_stack([posts, east, north, posts @ tilted]))
    ]
    (tmp_path / "points.csv").write_text("name,x,y,z,easting,northing,height\n" + "\n".join(lines) + "\n")
    georeference(path, read_control_points(tmp_path / "points.csv", 32632))
    told = season_document(path, Wishes())
    np.testing.assert_allclose(upwards(told), tilted, atol=0.01)
    assert not told["is_vertical_guessed"]
    told = season_document(path, Wishes(up=np.array([0.0, 0.0, 2.0])))
    np.testing.assert_allclose(upwards(told), [0, 0, 1], atol=1e-9)
    assert not told["is_vertical_guessed"]


def test_without_cameras_the_vertical_is_guessed_row_by_row(row: Path) -> None:
    told = season_document(row, Wishes())
    assert told["is_vertical_guessed"]
    assert upwards(told)[2] > 0.95
    rng = np.random.default_rng(6)
    rows = np.vstack([rng.uniform((0, 4.0 * k, 0), (12, 4.0 * k + 0.7, 2), (90, 3)) for k in range(5)])
    cloud = FruitCloud(rows, extras={"row": tuple(str(k) for k in range(5) for _ in range(90))})
    assert guessed_vertical(cloud)[2] > 0.95
    assert guessed_vertical(FruitCloud(rows))[2] < 0.1, "an orchard of no rows is wider than high"
