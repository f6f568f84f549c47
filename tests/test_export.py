"""Fruits for other programs: CSV, PLY and GeoJSON, by the command."""

import json
import struct
from pathlib import Path

import numpy as np
import pyogrio
import pytest
from pyogrio.raw import read as read_layer
from typer.testing import CliRunner

from pomona import FruitCloud, PomonaError
from pomona.cli import app
from pomona.export import export_cloud
from pomona.orchard import add_session, load_session, write_session


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
    assert [feature["id"] for feature in features] == ["0", "1"]
    export_cloud(FruitCloud(np.zeros((0, 3))), tmp_path / "a.geojson", "geojson")
    assert json.loads((tmp_path / "a.geojson").read_text())["features"] == []


def test_an_unknown_format_and_a_missing_folder_are_refused(tmp_path: Path) -> None:
    cloud = FruitCloud(np.zeros((1, 3)))
    with pytest.raises(PomonaError, match="found 'shp', expected one of csv, ply, geojson"):
        export_cloud(cloud, tmp_path / "a.shp", "shp")  # type: ignore[arg-type]
    with pytest.raises(PomonaError, match=r"absent/a\.csv: cannot be written: No such file or directory"):
        export_cloud(cloud, tmp_path / "absent" / "a.csv", "csv")
