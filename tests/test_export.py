"""Fruits for other programs: CSV, PLY and GeoJSON, by the command."""

import csv
import json
import struct
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pyogrio
import pytest
from pyogrio.raw import read as read_layer
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from command_line import Pomona
from growth_maker import grow_row
from pomona import FruitCloud, PomonaError
from pomona.cli import app
from pomona.export import export_cloud
from pomona.orchard import add_session, load_session, write_session
from pomona.recording.poses import read_kitti, read_tum
from pomona.trajectory import Trajectory


@pytest.fixture
def session_file(tmp_path: Path, full_cloud: FruitCloud) -> Path:
    path = tmp_path / "visit.gpkg"
    write_session(path, full_cloud, name="visit", date="2024-08-09", recording="test")
    return path


def export(source: Path, to: str, output: Path) -> None:
    result = CliRunner().invoke(app, ["export", str(source), "--to", to, "-o", str(output)])
    assert result.exit_code == 0, result.output
    assert result.stdout == f"{output}: 6 fruits\n"


@pytest.mark.parametrize("to", ["csv", "ply"])
def test_a_session_keeps_everything_but_its_sightings(session_file: Path, full_cloud: FruitCloud, to: str) -> None:
    output = session_file.with_name(f"fruits.{to}")
    export(session_file, to, output)
    cloud = FruitCloud.read(output)
    np.testing.assert_array_equal(cloud.positions, full_cloud.positions)
    np.testing.assert_array_equal(cloud.covariances, full_cloud.covariances)
    np.testing.assert_array_equal(cloud.diameters_m, full_cloud.diameters_m)
    assert cloud.ids == full_cloud.ids
    assert cloud.extras == full_cloud.extras


def test_a_map_gives_the_ids_that_it_gave_out(session_file: Path, full_cloud: FruitCloud) -> None:
    orchard, output = session_file.with_name("orchard.gpkg"), session_file.with_name("fruits.csv")
    add_session(orchard, load_session(session_file))
    export(orchard, "csv", output)
    cloud = FruitCloud.read(output)
    assert cloud.ids == ("1", "2", "3", "4", "5", "6")
    np.testing.assert_array_equal(cloud.positions, full_cloud.positions)
    assert cloud.extras["state"] == ("seen",) * 6
    assert cloud.extras["last_seen"] == ("2024-08-09",) * 6


def test_geojson_says_what_gdal_must_know(session_file: Path, full_cloud: FruitCloud) -> None:
    output = session_file.with_name("fruits.geojson")
    export(session_file, "geojson", output)
    features = json.loads(output.read_text())["features"]
    assert [feature["id"] for feature in features] == list(full_cloud.ids or ())
    assert features[1]["properties"]["diameter_m"] is None
    assert features[2]["properties"] | {"covariance_m2": None} == {
        "id": "apple 2",
        "note": "c",
        "diameter_m": 0.071,
        "n_views": 2,
        "covariance_m2": None,
    }
    assert pyogrio.read_info(output)["crs"].startswith('LOCAL_CS["local metres"')
    geometries = read_layer(output)[2]
    read = np.array([struct.unpack("<3d", wkb[5:]) for wkb in geometries])
    np.testing.assert_array_equal(read, full_cloud.positions)


def test_rows_without_ids_go_by_their_number(tmp_path: Path) -> None:
    export_cloud(FruitCloud(np.zeros((2, 3))), tmp_path / "a.geojson", "geojson")
    features = json.loads((tmp_path / "a.geojson").read_text())["features"]
    assert [feature["id"] for feature in features] == [0, 1]
    export_cloud(FruitCloud(np.zeros((0, 3))), tmp_path / "a.geojson", "geojson")
    assert json.loads((tmp_path / "a.geojson").read_text())["features"] == []


def test_an_unknown_format_and_a_missing_folder_are_refused(tmp_path: Path) -> None:
    cloud = FruitCloud(np.zeros((1, 3)))
    with pytest.raises(PomonaError, match="found 'dxf', expected one of csv, ply, geojson, shp, parquet"):
        export_cloud(cloud, tmp_path / "a.dxf", "dxf")  # type: ignore[arg-type]
    with pytest.raises(PomonaError, match=r"absent/a\.csv: cannot be written: No such file or directory"):
        export_cloud(cloud, tmp_path / "absent" / "a.csv", "csv")


@pytest.fixture
def orchard(tmp_path: Path, session_file: Path, full_cloud: FruitCloud) -> Path:
    """A map of two visits of the same six fruits, three weeks apart."""
    rng = np.random.default_rng(2)
    true = rng.uniform([0, 0, 0], [4, 1, 2], (40, 3))
    for date, moved_m in (("2024-08-09", 0.0), ("2024-08-28", 0.004)):
        extras = {"note": tuple(map(str, range(40)))}
        cloud = FruitCloud(true + rng.normal(0, moved_m, true.shape), diameters_m=np.full(40, 0.07), extras=extras)
        write_session(tmp_path / f"{date}.gpkg", cloud, name=date, date=date, recording="test")
        assert add_session(tmp_path / "orchard.gpkg", load_session(tmp_path / f"{date}.gpkg")).is_added
    return tmp_path / "orchard.gpkg"


def test_observations_are_a_long_table(pomona: Pomona, orchard: Path) -> None:
    output = orchard.with_name("seen.csv")
    assert pomona("export", orchard, "--observations", "-o", output) == (0, f"{output}: 80 observations\n", "")
    with output.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert set(rows[0]) == {"x", "y", "z", "diameter_m", "fruit", "session", "date", "label", "probability"}
    of_first = [row for row in rows if row["fruit"] == rows[0]["fruit"]]
    assert [row["date"] for row in of_first] == ["2024-08-09", "2024-08-28"]
    assert [row["probability"] != "" for row in of_first] == [False, True]
    assert [float(row["diameter_m"]) for row in rows] == pytest.approx([0.07] * 80)
    code, _, err = pomona("export", output, "--observations", "-o", orchard.with_name("again.csv"))
    assert code == 2
    assert "found a cloud, expected a session or a map" in err


def test_numbers_are_numbers_for_gdal(pomona: Pomona, orchard: Path) -> None:
    output = orchard.with_name("seen.geojson")
    assert pomona("export", orchard, "--observations", "-o", output)[0] == 0
    about = pyogrio.read_info(output)
    types = dict(zip(about["fields"].tolist(), about["dtypes"].tolist(), strict=True))
    assert (types["fruit"], types["probability"], types["diameter_m"]) == ("int32", "float64", "float64")
    assert types["date"] == "datetime64[D]"


def test_numbers_are_numbers_in_ply(tmp_path: Path) -> None:
    extras = {
        "whole": ("3", "-4"),
        "share": ("0.50", ""),
        "name": ("007", "8"),
        "large": ("1723190400000", "1"),
        "blank": ("", ""),
    }
    cloud = FruitCloud(np.zeros((2, 3)), ids=("1.5", "2"), extras=extras)
    cloud.write(tmp_path / "a.ply")
    header = (tmp_path / "a.ply").read_bytes().split(b"end_header")[0].decode()
    assert "property int whole\n" in header
    assert "property double share\n" in header
    read = FruitCloud.read(tmp_path / "a.ply")
    assert read.ids == cloud.ids
    assert read.extras == {**extras, "share": ("0.5", "")}


def test_numbers_are_numbers_in_geojson(tmp_path: Path) -> None:
    extras = {"whole": ("3", ""), "share": ("0.50", "1e-3"), "name": ("007", "8")}
    export_cloud(FruitCloud(np.zeros((2, 3)), ids=("7", "8"), extras=extras), tmp_path / "a.geojson", "geojson")
    features = json.loads((tmp_path / "a.geojson").read_text())["features"]
    assert features[0]["properties"] == {"id": 7, "whole": 3, "share": 0.5, "name": "007"}
    assert features[1]["properties"] == {"id": 8, "whole": None, "share": 0.001, "name": "8"}
    assert features[0]["id"] == 7


def test_the_suffix_says_the_format_and_must_not_contradict(pomona: Pomona, session_file: Path) -> None:
    output = session_file.with_name("fruits.geojson")
    assert pomona("export", session_file, "-o", output)[0] == 0
    assert json.loads(output.read_text())["type"] == "FeatureCollection"
    for name, flags, said in (
        ("a.geojson", ["--to", "csv"], "found suffix '.geojson' and --to csv, expected the same or one of them"),
        (
            "a.dxf",
            [],
            "expected --to FORMAT, or one of .csv, .ply, .geojson, .json, .shp, .parquet, .mcap, .tum, .kitti",
        ),
        ("a.txt", ["--to", "shp"], "a Shapefile is five files, expected a name that ends in .shp"),
    ):
        code, out, err = pomona("export", session_file, "-o", session_file.with_name(name), *flags)
        assert (code, out) == (2, "")
        assert said in err
        assert not session_file.with_name(name).exists()
    assert pomona("export", session_file, "--to", "csv", "-o", session_file.with_name("fruits.txt"))[0] == 0


def test_the_way_of_a_session_is_poses_for_other_programs(pomona: Pomona, tmp_path: Path) -> None:
    turned = Rotation.from_euler("xyz", [[0, 0, 0], [3, 20, -4], [5, 40, 8]], degrees=True).as_matrix()
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :3, :3], poses[:, 0, 3] = turned, [0.0, 0.5, 1.25]
    way = Trajectory(np.array([0, 1, 3]), np.array([10.0, 10.1, 10.3]), poses)
    session = tmp_path / "row.gpkg"
    cloud = FruitCloud(np.random.default_rng(0).normal(size=(5, 3)))
    write_session(session, cloud, name="row", date="2024-08-09", recording="test", trajectory=way)
    assert pomona("export", session, "-o", tmp_path / "way.tum") == (0, f"{tmp_path / 'way.tum'}: 3 poses\n", "")
    times_s, read = read_tum(tmp_path / "way.tum")
    np.testing.assert_allclose(times_s, way.times_s, atol=1e-6)
    np.testing.assert_allclose(read, poses, atol=1e-8)
    assert pomona("export", session, "-o", tmp_path / "way.txt", "--to", "kitti")[0] == 0
    np.testing.assert_allclose(read_kitti(tmp_path / "way.txt"), poses, atol=1e-8)
    assert pomona("export", session, "-o", tmp_path / "way.tum")[0] == 0, "ours is written anew"
    code, _, told = pomona("export", session, "-o", tmp_path / "way.txt", "--to", "kitti")
    assert code == 2, "a recording's poses look like this"
    assert "way.txt" in told


def test_what_has_no_way_is_told(pomona: Pomona, session_file: Path, orchard: Path) -> None:
    for source in (orchard, session_file):
        code, out, err = pomona("export", source, "-o", source.with_name("way.tum"))
        assert (code, out) == (2, "")
        assert err.count("\n") == 1
        assert str(source) in err
    assert "alone" in pomona("export", session_file, "-o", session_file.with_name("way.tum"), "--observations")[2]


def mixed_cloud(n: int) -> FruitCloud:
    """Text of all kinds, numbers, blanks, and names that a table of dBASE must cut."""
    rng = np.random.default_rng(n)
    return FruitCloud(
        rng.normal(size=(n, 3)),
        ids=tuple(map(str, range(5, 5 + n))),
        diameters_m=np.where(np.arange(n) % 3 == 0, np.nan, 0.07),
        covariances=np.tile(np.eye(3) * 1e-4, (n, 1, 1)),
        extras={
            "tree": tuple("ä林檎" if row % 2 else "<b>$x'\\x1b" for row in range(n)),
            "whole": tuple(str(row) if row % 4 else "" for row in range(n)),
            "a_very_long_name": ("x" * 300,) * n,
            "a_very_long_name_2": ("1.25",) * n,
            "geometry": ("mine",) * n,
        },
    )


def test_gdal_reads_the_shapefile(pomona: Pomona, tmp_path: Path) -> None:
    cloud = mixed_cloud(20)
    export_cloud(cloud, tmp_path / "a.shp", "shp")
    about, _, points, columns = pyogrio.raw.read(tmp_path / "a.shp")
    fields = dict(zip(about["fields"].tolist(), columns, strict=True))
    assert about["geometry_type"] == "Point Z"
    assert "LOCAL_CS" in about["crs"]
    assert fields["id"].tolist() == list(range(5, 25))
    assert fields["tree"].tolist() == list(cloud.extras["tree"])
    assert fields["whole"][1:4].tolist() == [1, 2, 3]
    assert np.isnan(fields["whole"][0])
    np.testing.assert_allclose(fields["diameter_m"], cloud.diameters_m)
    assert {"a_very_lon", "a_very_lo2"} <= fields.keys()
    assert fields["a_very_lon"][0] == "x" * 254
    assert fields["cxx"][0] == pytest.approx(1e-4)
    read = np.array([np.frombuffer(point[5:], "<f8") for point in points])
    np.testing.assert_array_equal(read, cloud.positions)


@pytest.mark.parametrize("n", [0, 2, 20])
def test_duckdb_reads_the_geoparquet(tmp_path: Path, n: int) -> None:
    cloud = mixed_cloud(n)
    export_cloud(cloud, tmp_path / "a.parquet", "parquet")
    file = str(tmp_path / "a.parquet")
    (geo,) = duckdb.execute("SELECT value FROM parquet_kv_metadata(?) WHERE key = 'geo'", [file]).fetchone()
    about = json.loads(bytes(geo))
    assert about["primary_column"] == "geometry"
    assert about["columns"]["geometry"]["geometry_types"] == ["Point Z"]
    named = "id, diameter_m, tree, whole, a_very_long_name, geometry_, cyy"
    rows = duckdb.execute(f"SELECT {named}, CAST(geometry AS VARCHAR) FROM read_parquet(?)", [file]).fetchall()
    assert len(rows) == n
    for row, (name, diameter_m, tree, whole, text, mine, variance, point) in enumerate(rows):
        assert name == row + 5
        assert diameter_m == (None if row % 3 == 0 else 0.07)
        assert (tree, text, mine) == (cloud.extras["tree"][row], "x" * 300, "mine")
        assert whole == (row if row % 4 else None)
        assert variance == pytest.approx(1e-4)
        numbers = point.removeprefix("POINT Z (").removesuffix(")").split()
        np.testing.assert_allclose(list(map(float, numbers)), cloud.positions[row], rtol=1e-12)


def test_parquet_has_as_many_groups_of_rows_as_it_needs(tmp_path: Path) -> None:
    n = (1 << 17) + 3
    cloud = FruitCloud(np.arange(3.0 * n).reshape(n, 3))
    export_cloud(cloud, tmp_path / "a.parquet", "parquet")
    file = str(tmp_path / "a.parquet")
    assert duckdb.execute("SELECT count(*), sum(id) FROM read_parquet(?)", [file]).fetchone() == (n, n * (n - 1) // 2)
    assert duckdb.execute("SELECT max(row_group_id) FROM parquet_metadata(?)", [file]).fetchone() == (1,)


def test_a_shapefile_is_taken_again_and_a_strangers_is_not(pomona: Pomona, session_file: Path) -> None:
    output = session_file.with_name("fruits.shp")
    assert pomona("export", session_file, "-o", output)[0] == 0
    assert pomona("export", session_file, "-o", output)[0] == 0
    output.with_suffix(".prj").write_text('GEOGCS["WGS 84"]')
    before = output.read_bytes()
    code, _, told = pomona("export", session_file, "-o", output)
    assert (code, told.count("\n")) == (2, 1)
    assert "is not a Shapefile of fruits" in told
    assert output.read_bytes() == before
    session_file.with_name("roads.dbf").write_bytes(b"of another program")
    code, _, told = pomona("export", session_file, "-o", session_file.with_name("roads.shp"))
    assert code == 2
    assert "roads.dbf: is there already" in told


def test_growth_is_exported_as_columns(pomona: Pomona, tmp_path: Path) -> None:
    row = grow_row(tmp_path / "orchard.gpkg", days=(50, 65), n_trees=1)
    output = tmp_path / "grown.shp"
    assert pomona("export", row.path, "--growth", "--harvest", "2024-09-07", "-o", output)[0] == 0
    about, _, _, columns = pyogrio.raw.read(output)
    fields = dict(zip(about["fields"].tolist(), columns, strict=True))
    assert fields["id"].tolist() == list(range(1, 31))
    assert (fields["forecast_m"] > fields["size_mm"]).all()
    assert (fields["rate_mm_pe"] > 0.2).all()
    for flags in (["--harvest", "2024-09-07"], ["--growth", "--observations"]):
        code, _, told = pomona("export", row.path, *flags, "-o", output)
        assert (code, told.count("\n")) == (2, 1)
        assert "--growth: found it with --observations, or --harvest without it" in told


def read_scene(path: Path) -> tuple[list[Any], int]:
    """Entities of the only message of an MCAP, decoded by the definitions that it has, and when it was logged."""
    with AnyReader([path], default_typestore=get_typestore(Stores.EMPTY)) as reader:
        ((connection, at_ns, body),) = reader.messages()
        assert (connection.topic, connection.msgtype) == ("/pomona/fruits", "foxglove_msgs/msg/SceneUpdate")
        return reader.deserialize(body, connection.msgtype).entities, at_ns


def test_an_mcap_is_a_scene_for_foxglove(session_file: Path, full_cloud: FruitCloud) -> None:
    orchard, output = session_file.with_name("orchard.gpkg"), session_file.with_name("fruits.mcap")
    add_session(orchard, load_session(session_file))
    export(orchard, "mcap", output)
    entities, at_ns = read_scene(output)
    assert [entity.id for entity in entities] == ["1", "2", "3", "4", "5", "6"]
    assert {entity.frame_id for entity in entities} == {"map"}
    places = [entity.spheres[0].pose.position for entity in entities]
    np.testing.assert_array_equal([(place.x, place.y, place.z) for place in places], full_cloud.positions)
    assert [entity.spheres[0].size.x for entity in entities][:2] == [0.07, 0.07]  # the second one's is not known
    assert {(note.key, note.value) for note in entities[0].metadata} >= {("state", "seen")}
    assert at_ns == 1_723_161_600 * 10**9  # 2024-08-09, when they were seen
    again = session_file.with_name("again.mcap")
    export(orchard, "mcap", again)
    assert again.read_bytes() == output.read_bytes()
    export(orchard, "mcap", output)  # an export may take the place of one


def test_a_bag_is_not_replaced_by_an_export(session_file: Path) -> None:
    bag = session_file.with_name("drive.mcap")
    bag.write_bytes(b"\x89MCAP0\r\n and a day of work")
    result = CliRunner().invoke(app, ["export", str(session_file), "-o", str(bag)])
    assert isinstance(result.exception, PomonaError)
    assert "is not an MCAP of fruits" in str(result.exception)
    assert bag.read_bytes().endswith(b"a day of work")
