"""A map on Earth: by known points, by fixes along the way, and what other programs then read."""

import json
import sqlite3
import struct
from pathlib import Path

import duckdb
import numpy as np
import pyogrio
import pytest
from pyogrio.raw import read as read_layer
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from command_line import run
from pomona import FruitCloud, PomonaError
from pomona.earth import Anchor, anchored, ecef_from_geodetic, from_utm, geodetic_from_ecef
from pomona.orchard import OrchardMap, Session, add_session, problems, remove_session
from pomona.trajectory import Trajectory

ZONE = 32632
EAST_M, NORTH_M, HEIGHT_M = 512_345.0, 5_277_000.0, 421.5
HEADING = Rotation.from_euler("z", 33, degrees=True).as_matrix()
"""From a level frame, x along the row, to east, north, up."""
LEVEL_FROM_MAP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""A map's frame is a camera's: x right, y down, z forward."""


def on_earth(places_in_map: np.ndarray) -> np.ndarray:
    """Easting, northing and height, (N, 3), within a row's length of the origin."""
    metres = places_in_map @ LEVEL_FROM_MAP.T @ HEADING.T
    # A zone's metres are 0.9996 of the Earth's at its middle; the grid turns by a few minutes of arc off it.
    return metres * [scale_there(), scale_there(), 1.0] @ grid_turn().T + [EAST_M, NORTH_M, HEIGHT_M]


def scale_there() -> float:
    # And the zone's metres are those of the ellipsoid, far below.
    return 0.9996 * (1.0 + (EAST_M - 500_000.0) ** 2 / (2.0 * 6_381_000.0**2)) * (1.0 - HEIGHT_M / 6_385_000.0)


def grid_turn() -> np.ndarray:
    (place,) = from_utm(ZONE, np.array([EAST_M]), np.array([NORTH_M]))
    return Rotation.from_euler("z", (place[0] - 9.0) * np.sin(np.radians(place[1])), degrees=True).as_matrix()


@pytest.fixture
def orchard(tmp_path: Path) -> Path:
    """Fifty fruits of a row of six metres, seen twice; a camera drove along it."""
    rng = np.random.default_rng(4)
    places = np.column_stack([rng.uniform(0, 6, 50), rng.uniform(-1, 1, 50), rng.uniform(1.5, 2.5, 50)])
    for number, day in enumerate(("2024-08-01", "2024-08-11")):
        poses = np.tile(np.eye(4), (13, 1, 1))
        poses[:, 0, 3] = np.linspace(0, 6, 13)
        cloud = FruitCloud(places + rng.normal(0, 0.003, places.shape), diameters_m=np.full(50, 0.06 + 0.005 * number))
        way = Trajectory(np.arange(13), np.arange(13) * 0.5, poses)
        add_session(tmp_path / "o.gpkg", Session(day, day, "drawn", cloud, way))
    return tmp_path / "o.gpkg"


POSTS = np.array([[0.0, 0.2, 2.0], [6.0, 0.1, 2.0], [3.0, -0.8, 5.0]])


def points_file(orchard: Path, posts: np.ndarray = POSTS, *, heights: bool = True) -> Path:
    path = orchard.with_name("points.csv")
    rows = ["name,x,y,z,easting,northing" + ",height" * heights]
    for number, (place, earth) in enumerate(zip(posts, on_earth(posts), strict=True)):
        cells = [f"P{number}", *map(repr, place.tolist()), *map(repr, earth.tolist()[: 3 if heights else 2])]
        rows.append(",".join(map(str, cells)))
    path.write_text("\n".join(rows) + "\n")
    return path


def in_zone(path: Path, layer: str) -> np.ndarray:
    """Points of a layer as GDAL and PROJ bring them into the zone, (N, 3)."""
    geometries = read_layer(path, sql=f"SELECT ST_Transform(geom, {ZONE}) AS geom FROM {layer} ORDER BY id")[2]
    return np.array([struct.unpack("<3d", wkb[5:29]) for wkb in geometries])


# The Earth.


def test_places_go_to_the_centre_of_the_earth_and_back() -> None:
    rng = np.random.default_rng(0)
    geodetic = np.column_stack([rng.uniform(-180, 180, 300), rng.uniform(-90, 90, 300), rng.uniform(-500, 9000, 300)])
    geodetic = np.vstack([geodetic, [[0, 90, 100], [10, -90, 5], [180, 0, 0]]])
    back = geodetic_from_ecef(ecef_from_geodetic(geodetic))
    np.testing.assert_allclose(back[:, 1], geodetic[:, 1], atol=1e-11)
    np.testing.assert_allclose(back[:, 2], geodetic[:, 2], atol=1e-7)
    np.testing.assert_allclose(np.cos(np.radians(back[:300, 0] - geodetic[:300, 0])), 1.0, atol=1e-15)
    pole = ecef_from_geodetic(np.array([[0.0, 90.0, 0.0]]))[0]
    np.testing.assert_allclose(pole, [0.0, 0.0, 6356752.314245], atol=1e-6)


def test_metres_north_and_east_are_those_of_the_ellipsoid() -> None:
    anchor = Anchor(np.eye(4), 9.1, 47.6, 400.0)
    e2 = (2 - 1 / 298.257223563) / 298.257223563
    (place,) = anchor.geodetic(np.array([[0.0, 100.0, 0.0]]))
    begin, end = np.radians([47.6, place[1]])
    curvature = quad(lambda phi: 6378137.0 * (1 - e2) / (1 - e2 * np.sin(phi) ** 2) ** 1.5 + 400.0, begin, end)
    meridian = curvature[0]
    assert meridian == pytest.approx(100.0, abs=1e-4)
    np.testing.assert_allclose(anchor.east_north_up(anchor.geodetic(POSTS)), POSTS, atol=1e-7)


def test_utm_is_that_of_proj(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    east, north = rng.uniform(250_000, 750_000, 40), rng.uniform(100_000, 9_000_000, 40)
    mine = from_utm(ZONE, east, north)
    path = tmp_path / "zone.gpkg"
    wkb = np.array([struct.pack("<BI2d", 1, 1, *pair) for pair in zip(east, north, strict=True)], dtype=object)
    pyogrio.raw.write(path, wkb, field_data=[], fields=[], layer="p", geometry_type="Point", crs=f"EPSG:{ZONE}")
    geometries = read_layer(path, sql="SELECT ST_Transform(geom, 4326) AS geom FROM p ORDER BY fid")[2]
    theirs = np.array([struct.unpack("<2d", one[5:21]) for one in geometries])
    # A hundred millionth of a degree is a millimetre.
    np.testing.assert_allclose(mine, theirs, atol=1e-9)
    south = from_utm(32732, east[:1], 10_000_000.0 - north[:1])
    np.testing.assert_allclose(south[0], [mine[0, 0], -mine[0, 1]], atol=1e-9)


# The fit.


@pytest.mark.parametrize("heights", [True, False])
@pytest.mark.parametrize("n", [2, 3])
def test_fruits_lie_where_proj_says(orchard: Path, n: int, heights: bool) -> None:
    done = run(
        "map",
        "georeference",
        orchard,
        "--points",
        points_file(orchard, POSTS[:n], heights=heights),
        "--epsg",
        ZONE,
        "--json",
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["rms_m"] < 0.001
    assert (told["height_m"] is None) == (not heights)
    wanted = on_earth(OrchardMap(orchard).fruits().positions)
    found = in_zone(orchard, "fruits_wgs84")
    np.testing.assert_allclose(found[:, :2], wanted[:, :2], atol=0.002)
    if heights:
        np.testing.assert_allclose(found[:, 2], wanted[:, 2], atol=0.002)
    info = pyogrio.read_info(orchard, layer="fruits_wgs84")
    assert (info["crs"], info["features"]) == ("EPSG:4326", 50)
    # Fruits stay where they were.
    assert pyogrio.read_info(orchard, layer="fruits")["crs"].startswith("LOCAL_CS[")
    assert problems(orchard) == []


def test_a_vertical_that_is_told_holds(orchard: Path) -> None:
    tilted = Rotation.from_euler("x", 12, degrees=True).as_matrix()
    places = OrchardMap(orchard).fruits().positions
    anchor = anchored(POSTS[:2] @ tilted.T, _geodetic(POSTS[:2]), tilted @ [0.0, -1.0, 0.0])
    np.testing.assert_allclose(
        anchor.east_north_up(anchor.geodetic(places @ tilted.T)), anchor.east_north_up(_geodetic(places)), atol=0.003
    )


def test_without_cameras_nobody_tells_the_vertical(tmp_path: Path) -> None:
    """A table of fruits with z up was laid on its side."""
    rng = np.random.default_rng(4)
    upright = np.column_stack([rng.uniform(0, 6, 50), rng.uniform(-1, 1, 50), rng.uniform(0.5, 2.5, 50)])
    path = tmp_path / "o.gpkg"
    add_session(path, Session("may", "2024-05-01", "drawn", FruitCloud(upright)))
    posts = np.array([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [0.0, 0.0, 3.0]])
    points = points_file(path, posts[:2], heights=False)
    before = path.read_bytes()
    refused = run("map", "georeference", path, "--points", points, "--epsg", ZONE)
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert "found no cameras in the map, which would tell the vertical, expected --up X,Y,Z" in refused.stderr
    assert path.read_bytes() == before
    assert run("map", "georeference", path, "--points", points, "--epsg", ZONE, "--up", "0,0,1").returncode == 0
    np.testing.assert_allclose(in_zone(path, "fruits_wgs84")[:, 2], upright[:, 2], atol=0.002)
    all_points = points_file(path, posts)
    assert run("map", "georeference", path, "--points", all_points, "--epsg", ZONE).returncode == 0
    np.testing.assert_allclose(in_zone(path, "fruits_wgs84"), on_earth(upright), atol=0.003)


def _geodetic(places_in_map: np.ndarray) -> np.ndarray:
    earth = on_earth(places_in_map)
    return np.column_stack([from_utm(ZONE, earth[:, 0], earth[:, 1]), earth[:, 2]])


def test_another_scale_is_found_where_it_is_free() -> None:
    anchor = anchored(POSTS / 1.03, _geodetic(POSTS), np.array([0.0, -1.0, 0.0]), free_scale=True)
    assert np.cbrt(np.linalg.det(anchor.enu_from_map[:3, :3])) == pytest.approx(1.03, abs=1e-6)
    assert np.abs(anchor.off_m(POSTS / 1.03, _geodetic(POSTS))).max() < 0.001


@pytest.mark.parametrize("column", ["frame", "time"])
def test_fixes_along_the_way(orchard: Path, column: str) -> None:
    way = np.column_stack([np.linspace(0, 6, 13), np.zeros(13), np.zeros(13)])
    rng = np.random.default_rng(2)
    fixes = _geodetic(way + rng.normal(0, 0.01, way.shape))
    path = orchard.with_name("fixes.csv")
    moments = np.arange(13) * (1.0 if column == "frame" else 0.5)
    lines = [
        f"{moment:g},{lon!r},{lat!r},{height!r}"
        for moment, (lon, lat, height) in zip(moments, fixes.tolist(), strict=True)
    ]
    path.write_text("\n".join([f"{column},lon,lat,height", *lines]) + "\n")
    refused = run("map", "georeference", orchard, "--points", path)
    assert refused.returncode == 2
    assert "--session: found 2 sessions with poses, expected the one" in refused.stderr
    done = run("map", "georeference", orchard, "--points", path, "--session", "2024-08-01")
    assert done.returncode == 0, done.stderr
    assert "13 known points" in done.stdout
    wanted = on_earth(OrchardMap(orchard).fruits().positions)
    assert np.abs(in_zone(orchard, "fruits_wgs84") - wanted).max() < 0.03
    with sqlite3.connect(orchard) as connection:
        rows = connection.execute("SELECT DISTINCT session, source FROM control_points, georeference").fetchall()
    connection.close()
    assert rows == [("2024-08-01", "trajectory")]


def test_layers_on_earth_follow_the_map(orchard: Path) -> None:
    assert run("map", "georeference", orchard, "--points", points_file(orchard), "--epsg", ZONE).returncode == 0
    places = OrchardMap(orchard).fruits().positions
    scattered = places + np.random.default_rng(1).normal(0, 0.005, places.shape)
    more = np.vstack([scattered, [[6.4, 0.0, 2.0]]])
    assert add_session(orchard, Session("new", "2024-08-21", "drawn", FruitCloud(more))).is_added
    np.testing.assert_allclose(
        in_zone(orchard, "fruits_wgs84"), on_earth(OrchardMap(orchard).fruits().positions), atol=0.003
    )
    assert remove_session(orchard, "new") is not None
    assert len(in_zone(orchard, "fruits_wgs84")) == 50
    anchor = OrchardMap(orchard).anchor()
    assert anchor is not None
    assert problems(orchard) == []


# Exports.


@pytest.fixture
def anchored_orchard(orchard: Path) -> Path:
    assert run("map", "georeference", orchard, "--points", points_file(orchard), "--epsg", ZONE).returncode == 0
    return orchard


@pytest.mark.parametrize("suffix", ["geojson", "shp"])
def test_gdal_reads_exports_on_earth(anchored_orchard: Path, suffix: str) -> None:
    path = anchored_orchard.with_name(f"fruits.{suffix}")
    assert run("export", anchored_orchard, "-o", path).returncode == 0
    # Of points with heights GDAL says so: 4979 is WGS 84 with three dimensions.
    assert pyogrio.read_info(path)["crs"] in ("EPSG:4326", "EPSG:4979")
    read = np.array([struct.unpack("<3d", wkb[5:29]) for wkb in read_layer(path)[2]])
    wanted = _geodetic(OrchardMap(anchored_orchard).fruits().positions)
    np.testing.assert_allclose(read[:, :2], wanted[:, :2], rtol=0, atol=3e-8)
    np.testing.assert_allclose(read[:, 2], wanted[:, 2], rtol=0, atol=3e-3)
    assert run("export", anchored_orchard, "-o", path, "--local").returncode == 0
    assert pyogrio.read_info(path)["crs"].startswith("LOCAL_CS[")


def test_duckdb_reads_geoparquet_on_earth(anchored_orchard: Path) -> None:
    path = anchored_orchard.with_name("fruits.parquet")
    assert run("export", anchored_orchard, "-o", path).returncode == 0
    with duckdb.connect() as connection:
        ((geo,),) = connection.sql(f"SELECT value FROM parquet_kv_metadata('{path}') WHERE key = 'geo'").fetchall()
    column = json.loads(bytes(geo))["columns"]["geometry"]
    # Without a name the system is OGC:CRS84, longitude and latitude.
    assert "crs" not in column
    assert 9.0 < column["bbox"][0] < 9.3
    assert 47.5 < column["bbox"][1] < 47.8


def test_a_csv_has_both(anchored_orchard: Path) -> None:
    path = anchored_orchard.with_name("fruits.csv")
    assert run("export", anchored_orchard, "-o", path).returncode == 0
    cloud, fruits = FruitCloud.read(path), OrchardMap(anchored_orchard).fruits()
    np.testing.assert_array_equal(cloud.positions, fruits.positions)
    names = ("longitude_deg", "latitude_deg", "height_m")
    told = np.array([[float(cell) for cell in cloud.extras[name]] for name in names]).T
    np.testing.assert_allclose(told[:, :2], _geodetic(fruits.positions)[:, :2], atol=3e-8)


# What is refused.


@pytest.mark.parametrize(
    ("table", "flags", "line"),
    [
        ("x,y,z,lon,lat\n0,0,0,9.1,47.6\n", (), "wrong.csv: found 1 known points, expected two or more"),
        ("x,y,z,lon,lat\n", (), "found no known points"),
        ("x,y,lon,lat\n0,0,9.1,47.6\n", (), "found the header 'x,y,lon,lat', expected x,y,z (or frame"),
        ("x,y,z,lon,lat\n0,0,0,9.1,147.6\n", (), "line 2: lat: found 147.6, expected degrees from -90 to 90"),
        ("x,y,z,lon,lat\n0,0,0,here,47\n", (), "line 2: lon: found 'here', expected a number"),
        ("x,y,z,easting,northing\n0,0,0,1,2\n", (), "found columns easting, northing without --epsg"),
        ("x,y,z,lon,lat\n0,0,0,9,47\n", ("--epsg", "32632"), "found --epsg 32632 with columns lon, lat"),
        ("x,y,z,easting,northing\n0,0,0,1,2\n", ("--epsg", "4326"), "--epsg: found 4326, expected a UTM zone"),
        ("x,y,z,lon,lat\n0,0,0,9.1,47.6\n0.5,0,0,9.1,47.6\n", (), "wrong.csv: known points reach 0.5 m in plan, "),
        (
            "x,y,z,easting,northing\n0,0,0,-1,2\n",
            ("--epsg", "32632"),
            "wrong.csv: line 2: found easting -1 and northing 2, expected metres in the zone of --epsg 32632",
        ),
        (
            "name,x,y,z,lon,lat\nA,0,0,0,9.1,47.6\nB,6,0,0,9.2,47.6\n",
            (),
            "line 3: A and B are 6.00 m apart in the map and 7520.04 m on Earth",
        ),
        (
            "frame,lon,lat\n0,9.1,47.6\n99,9.2,47.6\n",
            ("--session", "2024-08-01"),
            "line 3: frame: found 99, expected one",
        ),
        ("frame,lon,lat\n0,9.1,47.6\n", ("--session", "May"), "--session: found 'May', expected one of the map's"),
        ("x,y,z,lon,lat\n0,0,0,9,47\n1e300,0,0,9,47\n", (), "line 3: x: found '1e300', expected a number"),
        ("x,y,z,lon,lat\n0,0,0,9,47\n", ("--within", "0"), "--within: found 0, expected metres above 0"),
        ("x,y,z,lon,lat\n0,0,0,9,47\n", ("--up", "0,0,0"), "--up: found '0,0,0', expected three numbers"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(orchard: Path, table: str, flags: tuple[str, ...], line: str) -> None:
    path = orchard.with_name("wrong.csv")
    path.write_text(table)
    before = orchard.read_bytes()
    done = run("map", "georeference", orchard, "--points", path, *flags)
    assert done.returncode == 2
    assert line in done.stderr
    assert done.stderr.count("\n") == 1
    assert orchard.read_bytes() == before


def test_a_wrong_point_is_named(orchard: Path) -> None:
    posts = np.vstack([POSTS, [[5.0, 0.0, 6.0], [1.0, 0.0, 4.0]]])
    path = points_file(orchard, posts)
    lines = path.read_text().splitlines()
    cells = lines[2].split(",")
    cells[4] = str(float(cells[4]) + 12.0)
    path.write_text("\n".join([*lines[:2], ",".join(cells), *lines[3:]]) + "\n")
    done = run("map", "georeference", orchard, "--points", path, "--epsg", ZONE)
    assert done.returncode == 2
    assert f"{path}: line 3: P1 is " in done.stderr
    assert "from where the other points put it, expected at most 1 m: a wrong point?" in done.stderr


def test_two_georeferences_are_damage(anchored_orchard: Path) -> None:
    with sqlite3.connect(anchored_orchard) as connection:
        connection.execute(
            """INSERT INTO georeference (enu_from_map, longitude_deg, latitude_deg, height_m, source, n_points, rms_m)
            SELECT enu_from_map, longitude_deg, latitude_deg, height_m, source, n_points, rms_m FROM georeference"""
        )
    connection.close()
    with pytest.raises(PomonaError, match=r"georeference: found 2 rows, expected one or none$"):
        OrchardMap(anchored_orchard).anchor()
