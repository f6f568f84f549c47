"""Session files: read back the same, opened by GDAL, and what is refused."""

import datetime
import sqlite3
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyogrio
import pytest
from pyogrio.raw import read as read_layer

from pomona import FruitCloud, PomonaError, geopackage
from pomona.fruit_crop import FruitCrop
from pomona.orchard import load_session, problems, read_session, write_session
from pomona.trajectory import Trajectory
from refusal import refused_of


@pytest.fixture(scope="session")
def trajectory() -> Trajectory:
    """Two frames; the second half a metre to the right, turned by 90 degrees about z."""
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, :3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    poses[1, :3, 3] = (0.5, 0, 0)
    return Trajectory(frames=np.array([4, 9]), times_s=np.array([0.0, 0.2]), session_from_camera=poses)


@pytest.fixture
def session_file(tmp_path: Path, full_cloud: FruitCloud, trajectory: Trajectory) -> Path:
    path = tmp_path / "visit.gpkg"
    write_session(
        path,
        full_cloud,
        name="row 7",
        date="2024-08-09T14:30:00",
        recording="recordings/row 7",
        trajectory=trajectory,
        configuration={"min_views": 5},
        input_hashes={"left/0000.png": "ab"},
    )
    return path


def test_everything_reads_back_the_same(session_file: Path, full_cloud: FruitCloud, trajectory: Trajectory) -> None:
    session = read_session(session_file)
    assert (session.name, session.date, session.recording) == ("row 7", "2024-08-09T14:30:00", "recordings/row 7")
    assert session.configuration == {"min_views": 5}
    assert session.input_hashes == {"left/0000.png": "ab"}
    cloud = session.cloud
    np.testing.assert_array_equal(cloud.positions, full_cloud.positions)
    np.testing.assert_array_equal(cloud.covariances, full_cloud.covariances)
    np.testing.assert_array_equal(cloud.diameters_m, full_cloud.diameters_m)
    np.testing.assert_array_equal(cloud.n_views, full_cloud.n_views)
    assert cloud.ids == full_cloud.ids
    assert cloud.extras == full_cloud.extras
    assert cloud.views is not None
    assert full_cloud.views is not None
    np.testing.assert_array_equal(cloud.views.frames, full_cloud.views.frames)
    np.testing.assert_array_equal(cloud.views.fruits, full_cloud.views.fruits)
    assert session.trajectory is not None
    np.testing.assert_array_equal(session.trajectory.frames, trajectory.frames)
    np.testing.assert_array_equal(session.trajectory.times_s, trajectory.times_s)
    np.testing.assert_allclose(session.trajectory.session_from_camera, trajectory.session_from_camera, atol=1e-15)


def test_a_cloud_reads_from_a_session(session_file: Path, full_cloud: FruitCloud) -> None:
    assert FruitCloud.read(session_file).ids == full_cloud.ids


def test_bare_positions_and_no_fruits_are_sessions_too(tmp_path: Path) -> None:
    for n in (3, 0):
        path = tmp_path / "bare.gpkg"
        write_session(path, FruitCloud(np.ones((n, 3))), name="bare", date="2024-08-09", recording="none")
        session = read_session(path)
        assert len(session.cloud) == n
        assert session.cloud.ids is None
        assert session.cloud.covariances is None
        assert session.cloud.views is None
        assert session.trajectory is None
        assert problems(path) == []


def test_the_same_session_is_the_same_file(session_file: Path, tmp_path: Path) -> None:
    session = read_session(session_file)
    for name in ("a.gpkg", "b.gpkg"):
        write_session(tmp_path / name, session.cloud, name=session.name, date=session.date, recording="same")
    assert (tmp_path / "a.gpkg").read_bytes() == (tmp_path / "b.gpkg").read_bytes()


def test_the_content_hash_tells_clouds_apart(session_file: Path) -> None:
    session = read_session(session_file)
    cloud = session.cloud
    others = (
        replace(cloud, positions=cloud.positions + 1e-12),
        replace(cloud, diameters_m=None),
        replace(cloud, covariances=None),
        replace(cloud, n_views=None),
        replace(cloud, views=None),
        replace(cloud, ids=None),
        cloud.select([0, 1, 2, 3, 4]),
    )
    hashes = {replace(session, cloud=other).content_sha256 for other in (cloud, *others)}
    assert len(hashes) == 1 + len(others)
    assert replace(session, name="another").content_sha256 == session.content_sha256
    assert replace(session, cloud=cloud.select([1, 5, 2, 4, 3, 0])).content_sha256 == session.content_sha256


# What GDAL, and with it QGIS, makes of the file.


def points(layer: Path, name: str) -> np.ndarray:
    """Coordinates out of the well-known binary that GDAL gives: 1 byte order, 4 type, 24 coordinates."""
    geometries = read_layer(layer, layer=name)[2]
    return np.array([struct.unpack("<3d", wkb[5:]) for wkb in geometries]).reshape(-1, 3)


def test_gdal_opens_every_layer(session_file: Path, full_cloud: FruitCloud, trajectory: Trajectory) -> None:
    layers = dict(pyogrio.list_layers(session_file).tolist())
    assert layers == {
        "fruits": "Point Z",
        "observations": "Point Z",
        "poses": "Point Z",
        "trees": "Point Z",
        "rows": "LineString Z",
        "sessions": None,
        "sightings": None,
        "matches": None,
        "changes": None,
        "crops": None,
        "georeference": None,
        "control_points": "Point Z",
        "fruits_wgs84": "Point Z",
        "trees_wgs84": "Point Z",
        "fruit_series": "Point Z",
        "layer_styles": None,
        "pomona_format": None,
    }
    np.testing.assert_array_equal(points(session_file, "fruits"), full_cloud.positions)
    np.testing.assert_array_equal(points(session_file, "observations"), full_cloud.positions)
    np.testing.assert_array_equal(points(session_file, "poses"), trajectory.session_from_camera[:, :3, 3])
    info = pyogrio.read_info(session_file, layer="fruits")
    assert info["crs"].startswith("LOCAL_CS[")
    np.testing.assert_allclose(info["total_bounds"][:2], full_cloud.positions[:, :2].min(axis=0), atol=1e-6)
    _, _, _, (names,) = read_layer(session_file, layer="sessions", columns=["name"])
    assert names.tolist() == ["row 7"]


def test_gdal_finds_fruits_in_a_window(session_file: Path, full_cloud: FruitCloud) -> None:
    x, y, _ = full_cloud.positions[2]
    window = (x - 0.01, y - 0.01, x + 0.01, y + 0.01)
    assert len(read_layer(session_file, layer="fruits", bbox=window)[2]) == 1


def test_what_gdal_adds_keeps_the_file_whole(session_file: Path) -> None:
    tree = struct.pack("<BI3d", 1, 1001, 1.0, 2.0, 0.0)
    pyogrio.raw.write(
        session_file,
        np.array([tree], dtype=object),
        field_data=[np.array(["tree 1"], dtype=object)],
        fields=["name"],
        layer="trees",
        append=True,
        geometry_type="Point Z",
        crs=pyogrio.read_info(session_file, layer="trees")["crs"],
    )
    assert problems(session_file) == []
    with sqlite3.connect(session_file) as connection:
        assert connection.execute("SELECT id, minx, maxy FROM rtree_trees_geom").fetchall() == [(1, 1.0, 2.0)]
    connection.close()


# What is refused.


def change(path: Path, statement: str) -> None:
    connection = sqlite3.connect(path)
    with connection:
        connection.execute(statement)
    connection.close()


def refusal(path: Path) -> str:
    return refused_of(path, FruitCloud.read)


def test_a_newer_format_is_refused(session_file: Path) -> None:
    change(session_file, "UPDATE pomona_format SET format_version = 4")
    assert refusal(session_file) == "has format 4, this program reads up to 3: update pomona"


@pytest.mark.parametrize("wrong", ["format_version = 0", "kind = 'tree'"])
def test_a_format_that_never_was_is_refused(session_file: Path, wrong: str) -> None:
    change(session_file, f"UPDATE pomona_format SET {wrong}")
    assert "expected 1 to 3 and 'session' or 'map'" in refusal(session_file)


def test_what_is_not_ours_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.gpkg"
    assert refusal(path) == "is not there, expected a session or a map (.gpkg)"
    path.write_text("x,y,z\n" * 100)
    assert refusal(path) == "is not a GeoPackage"
    path.write_bytes(b"")
    assert refusal(path) == "is empty: a map that another program is making just now, or never finished; try again"
    change(path, "CREATE TABLE fruits (id INTEGER PRIMARY KEY)")
    assert refusal(path) == "is not a GeoPackage: application id 0x0, expected 'GPKG'"
    path.unlink()
    connection = geopackage.connect(path, create=True)
    geopackage.create(connection)
    connection.close()
    assert refusal(path) == "is a GeoPackage but not one of pomona: it has no table pomona_format"


def test_a_damaged_file_is_refused(session_file: Path) -> None:
    content = bytearray(session_file.read_bytes())
    content[4096:] = b"\x5a" * (len(content) - 4096)
    session_file.write_bytes(content)
    assert refusal(session_file) == "is damaged; restore it from a copy"


def test_a_geometry_of_another_kind_is_refused(session_file: Path) -> None:
    connection = geopackage.connect(session_file)
    connection.execute("UPDATE observations SET geom = CAST(geom || x'00' AS BLOB) WHERE id = 3")
    connection.close()
    with pytest.raises(
        PomonaError,
        match=r"observations 3: geom: found b'GP.*, expected a little-endian POINT Z",
    ):
        FruitCloud.read(session_file)


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ({"name": " "}, "session: found an empty name, expected one that is used once in a map"),
        (
            {"date": "9 August"},
            "session: found the date '9 August', expected ISO 8601 as 2021-09-27 or 2021-09-27T11:40:12",
        ),
        (
            {"date": "2024-08-09T14:30:00+02:00"},
            "session: found the date '2024-08-09T14:30:00+02:00' with a time zone, expected the orchard's local time",
        ),
        (
            {"configuration": {"radius": float("nan")}},
            "session: configuration is not JSON: Out of range float values are not JSON compliant",
        ),
        ({"name": None}, "session: name: found NoneType, expected str"),
        ({"name": "\ud800"}, r"session: found '\ud800', expected characters of Unicode"),
        ({"recording": Path("row.bag")}, "session: recording: found PosixPath, expected str"),
        ({"date": 5}, "session: found the date 5, expected ISO 8601"),
        (
            {"date": datetime.datetime(2024, 8, 9, tzinfo=datetime.UTC)},
            "session: found the date '2024-08-09T00:00:00+00:00' with a time zone",
        ),
        ({"cloud": np.zeros((1, 3))}, "session: cloud: found ndarray, expected FruitCloud"),
        ({"trajectory": np.eye(4)}, "session: trajectory: found ndarray, expected Trajectory"),
        ({"configuration": [1]}, "session: configuration: found list, expected a mapping"),
        ({"input_hashes": "a"}, "session: input_hashes: found str, expected a mapping"),
        ({"crops": [b""]}, "session: crops: found list, expected a mapping"),
        ({"crops": {0: b""}}, "session: crops: found bytes, expected FruitCrop"),
        ({"crops": {-1: FruitCrop(0, b"")}}, "session: crops: found row -1, expected one of 1 fruits"),
        ({"path": None}, "path: found None, expected the name of a file"),
        ({"path": "f.csv"}, "f.csv: found suffix '.csv', expected .gpkg"),
    ],
)
def test_a_wrong_session_is_not_written(tmp_path: Path, wrong: dict[str, object], line: str) -> None:
    about = {"path": tmp_path / "a.gpkg", "cloud": FruitCloud(np.zeros((1, 3))), "name": "a", "date": "2024-08-09"}
    with pytest.raises(PomonaError) as caught:
        write_session(**{**about, "recording": "r", **wrong})  # type: ignore[arg-type]
    assert str(caught.value).startswith(line)
    assert not list(tmp_path.iterdir())


def test_a_bare_cloud_is_a_session_with_a_date(tmp_path: Path, full_cloud: FruitCloud) -> None:
    path = tmp_path / "august.csv"
    full_cloud.write(path)
    session = load_session(path, date="2024-08-09")
    assert (session.name, session.recording, session.date) == ("august", "august.csv", "2024-08-09")
    assert list(session.input_hashes) == ["august.csv"]
    with pytest.raises(PomonaError, match="a bare cloud has no date, give the day of the visit: --date YYYY-MM-DD"):
        load_session(path)


def test_a_date_can_be_corrected(session_file: Path) -> None:
    assert load_session(session_file).date == "2024-08-09T14:30:00"
    assert load_session(session_file, date="2024-08-10").date == "2024-08-10"


@pytest.mark.parametrize("day", [datetime.date(2024, 8, 9), datetime.datetime(2024, 8, 9, 14, 30)])
def test_a_date_is_one_of_python_too(tmp_path: Path, full_cloud: FruitCloud, day: datetime.date) -> None:
    write_session(tmp_path / "a.gpkg", full_cloud, name="a", date=day, recording="r")
    assert read_session(tmp_path / "a.gpkg").date == day.isoformat()
    full_cloud.write(tmp_path / "a.csv")
    assert load_session(tmp_path / "a.csv", date=day).date == day.isoformat()


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ({"date": 5}, "a.csv: date: found the date 5, expected ISO 8601"),
        ({"date": np.datetime64("2024-08-09")}, "a.csv: date: found the date np.datetime64"),
        ({"unit": ""}, "unit: found '', expected one of m, cm, mm, free"),
        ({"unit": 5}, "unit: found 5, expected one of m, cm, mm, free"),
        ({"path": None}, "path: found None, expected the name of a file"),
    ],
)
def test_a_session_is_not_loaded_by_a_wrong_argument(
    tmp_path: Path, full_cloud: FruitCloud, wrong: dict[str, object], line: str
) -> None:
    full_cloud.write(tmp_path / "a.csv")
    with pytest.raises(PomonaError) as caught:
        load_session(**{"path": tmp_path / "a.csv", "date": "2024-08-09", **wrong})  # type: ignore[arg-type]
    assert str(caught.value).removeprefix(f"{tmp_path}/").startswith(line)


def test_only_a_session_gives_its_place_to_another(tmp_path: Path, session_file: Path, full_cloud: FruitCloud) -> None:
    notes, about = tmp_path / "notes.gpkg", {"name": "a", "date": "2024-08-09", "recording": "r"}
    notes.write_text("mine")
    with pytest.raises(PomonaError, match="is there already and is not a session: take another name, or force=True"):
        write_session(notes, full_cloud, **about)
    assert notes.read_text() == "mine"
    with pytest.raises(PomonaError, match=r"the folder .* is not there"):
        write_session(tmp_path / "missing" / "a.gpkg", full_cloud, **about)
    write_session(str(session_file), full_cloud, **about)
    assert read_session(session_file).name == "a"
    write_session(notes, full_cloud, **about, force=True)
    assert read_session(notes).name == "a"


def test_an_empty_name_of_an_earlier_version_is_no_name(session_file: Path, full_cloud: FruitCloud) -> None:
    connection = geopackage.connect(session_file)
    connection.execute("UPDATE observations SET label = '' WHERE id = 2")
    connection.close()
    cloud = FruitCloud.read(session_file)
    assert cloud.ids is None
    np.testing.assert_array_equal(cloud.positions, full_cloud.positions)
