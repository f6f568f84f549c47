"""Maps of strangers: nothing in them runs, nothing in them stops the program but with one line."""

import sqlite3
import struct
from pathlib import Path

import numpy as np
import pyogrio
import pytest
from fuzz import geopackage as fuzzed

from command_line import Run, assert_refused
from pomona import PomonaError
from pomona.orchard import OrchardMap, add_session, load_session, problems, remove_session
from pomona.store.opening import snapshot
from pomona.store.rows import columns_of
from refusal import refused_of

MAGIC = b"SQLite format 3\0"

EVERY_CELL = 191
"""One edited cell of so many is tried here."""


@pytest.fixture(scope="module")
def seeds() -> list[bytes]:
    """A session and a map with two visits."""
    return fuzzed.seeds()


@pytest.fixture
def session(tmp_path: Path, seeds: list[bytes]) -> Path:
    path = tmp_path / "visit.gpkg"
    path.write_bytes(seeds[0])
    return path


@pytest.fixture
def orchard(tmp_path: Path, seeds: list[bytes]) -> Path:
    path = tmp_path / "orchard.gpkg"
    path.write_bytes(seeds[1])
    return path


def change(path: Path, script: str) -> None:
    changed = fuzzed.edited(path.read_bytes(), script)
    assert changed is not None
    path.write_bytes(changed)


def refusal(path: Path) -> str:
    """What every reader and writer says, and that the file stays as it is."""
    before = path.read_bytes()
    uses = (problems, lambda path: OrchardMap(path).fruits(), lambda path: remove_session(path, "a"))
    (line,) = {refused_of(path, use) for use in uses}
    assert path.read_bytes() == before
    return line


@pytest.mark.parametrize(
    ("script", "line"),
    [
        (
            "CREATE TRIGGER wipe AFTER INSERT ON sessions BEGIN DELETE FROM observations; END",
            "trigger wipe: touches observations, expected nothing of others to act on Pomona's tables",
        ),
        (
            "CREATE TRIGGER wide AFTER INSERT ON 'fruits' BEGIN UPDATE \"fruits\" SET diameter_m = 1; END",
            "trigger wide: touches fruits, expected nothing of others to act on Pomona's tables",
        ),
        (
            "CREATE TABLE bait (a); CREATE TRIGGER late AFTER INSERT ON bait BEGIN DELETE FROM [Fruits]; END",
            "trigger late: touches fruits, expected nothing of others to act on Pomona's tables",
        ),
        (
            "ALTER TABLE sightings RENAME TO old; CREATE VIEW sightings AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL "
            "SELECT i + 1 FROM n) SELECT i AS id, 1 AS observation_id, i AS frame FROM n",
            "has no table sightings, expected one as Pomona makes it",
        ),
        (
            "CREATE TABLE notes (id INTEGER PRIMARY KEY, fruit REFERENCES fruits(id) ON DELETE CASCADE)",
            "table notes: touches fruits, expected nothing of others to act on Pomona's tables",
        ),
        (
            "CREATE UNIQUE INDEX one ON fruits (id, state)",
            "index one: touches fruits, expected nothing of others to act on Pomona's tables",
        ),
        ("CREATE VIRTUAL TABLE words USING fts5(a)", "words: is a virtual table, expected none but spatial indexes"),
        ("DROP INDEX observations_by_fruit", "has no index observations_by_fruit, expected one as Pomona makes it"),
        ("DROP TRIGGER rtree_fruits_geom_delete", "has no trigger rtree_fruits_geom_delete, expected one"),
        (
            "ALTER TABLE fruits RENAME COLUMN diameter_m TO size_m",
            "table fruits: is not as Pomona makes it: found size_m, expected diameter_m as word",
        ),
        (
            "ALTER TABLE fruits ADD COLUMN twice GENERATED ALWAYS AS (n_missed * 2)",
            "table fruits: is not as Pomona makes it: found ',', expected ')' as word",
        ),
        ("ALTER TABLE pomona_format ADD COLUMN more", "table pomona_format: is not as Pomona makes it"),
    ],
)
def test_a_schema_that_could_act_is_refused_and_named(orchard: Path, script: str, line: str) -> None:
    change(orchard, script)
    assert line in refusal(orchard)


def test_a_trigger_does_not_run_when_a_visit_comes(orchard: Path, session: Path) -> None:
    change(orchard, "DELETE FROM sqlite_sequence WHERE name = 'nobody'")
    change(session, "UPDATE sessions SET name = 'c', content_sha256 = 'other'")
    change(orchard, "CREATE TRIGGER wipe AFTER INSERT ON sessions BEGIN DELETE FROM observations; END")
    before = orchard.read_bytes()
    with pytest.raises(PomonaError, match="trigger wipe: touches observations"):
        add_session(orchard, load_session(session))
    assert orchard.read_bytes() == before


def test_what_qgis_and_gdal_add_is_at_rest(orchard: Path) -> None:
    """By GDAL itself: features, layers with and without geometry, metadata, a new kind of reference system."""
    local = pyogrio.read_info(orchard, layer="trees")["crs"]
    point = np.array([struct.pack("<BI3d", 1, 1001, 1.0, 2.0, 0.0)], dtype=object)
    square = np.array([struct.pack("<BIII8d", 1, 3, 1, 4, 0, 0, 1, 0, 1, 1, 0, 0)], dtype=object)
    names = {"field_data": [np.array(["x"], dtype=object)], "fields": ["name"]}
    write = pyogrio.raw.write
    write(orchard, point, layer="trees", append=True, geometry_type="Point Z", crs=local, **names)
    write(orchard, square, layer="my blocks", geometry_type="Polygon", crs="EPSG:32632", **names)
    write(orchard, None, layer="layer_styles", geometry_type=None, **names)
    write(orchard, square, layer="meta", geometry_type="Polygon", crs="EPSG:4326", layer_metadata={"a": "b"}, **names)
    write(orchard, square, layer="derived", geometry_type="Polygon", crs=DERIVED, **names)
    connection = sqlite3.connect(orchard)
    kinds = dict(connection.execute("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL"))
    connection.close()
    assert {"rtree_my blocks_geom_insert", "layer_styles", "gpkg_metadata_reference"} <= set(kinds)
    assert "definition_12_063" in kinds["gpkg_spatial_ref_sys"]
    assert problems(orchard) == []
    assert remove_session(orchard, "b") is not None
    assert problems(orchard) == []


@pytest.mark.parametrize(
    "script",
    [
        'ALTER TABLE "fruits" ADD COLUMN "note" TEXT(80); ALTER TABLE "fruits" ADD COLUMN price REAL',
        'ALTER TABLE "trees" ADD COLUMN "planted" DATE',
        "CREATE INDEX by_state ON fruits (state, last_seen)",
        "CREATE VIEW missed AS SELECT * FROM fruits WHERE state = 'missed'",
        "CREATE TABLE gpkg_ogr_contents(table_name TEXT NOT NULL PRIMARY KEY,feature_count INTEGER DEFAULT NULL)",
        "ANALYZE",
        "VACUUM",
        "PRAGMA journal_mode = WAL",
    ],
)
def test_what_people_do_in_qgis_is_taken(orchard: Path, script: str) -> None:
    change(orchard, script)
    assert problems(orchard) == []
    assert remove_session(orchard, "b") is not None
    assert problems(orchard) == []


@pytest.mark.parametrize(
    ("script", "line"),
    [
        (
            "UPDATE fruits SET state = 7 WHERE id = 3",
            "fruits 3: state: found '7', expected 'new', 'seen', 'missed' or 'gone'",
        ),
        (
            "UPDATE fruits SET geom = x'00' WHERE id = 3",
            "fruits 3: geom: found b'\\x00', expected a little-endian",
        ),
        (
            "UPDATE fruits SET n_missed = -1 WHERE id = 3",
            "fruits 3: n_missed: found -1, expected a whole",
        ),
        ("UPDATE fruits SET diameter_m = 'big' WHERE id = 3", "fruits 3: diameter_m: found 'big', expected metres"),
        ("UPDATE sessions SET date = '9 August' WHERE id = 2", "sessions 2: date: found '9 August', expected ISO 8601"),
        ("UPDATE sessions SET name = CAST(x'ff' AS TEXT) WHERE id = 2", "sessions 2: name: found '\\udcff', expected"),
        (
            "UPDATE sessions SET map_from_session = '[[1]]' WHERE id = 2",
            "map_from_session: found '[[1]]', expected",
        ),
        ("UPDATE sessions SET settings = '{' WHERE id = 2", "sessions 2: settings: found '{', expected a JSON object"),
        ("UPDATE observations SET cxx = 9e999 WHERE id = 5", "observations 5: cxx: found inf, expected square metres"),
        ("UPDATE poses SET qx = 2 WHERE id = 1", "poses 1: qx: found 2.0, expected a number from -1 to 1"),
        (
            "UPDATE sqlite_sequence SET seq = 'x' WHERE name = 'fruits'",
            "sqlite_sequence: fruits: found 'x', expected",
        ),
        ("DELETE FROM sessions", "points to a row of sessions that is not there"),
    ],
)
def test_check_names_the_cell(orchard: Path, script: str, line: str) -> None:
    change(orchard, script)
    assert any(line in problem for problem in problems(orchard)), problems(orchard)


@pytest.mark.parametrize(
    ("script", "line"),
    [
        ("UPDATE poses SET qw = 0", "poses 1: found a quaternion of length 0, expected 1"),
        ("UPDATE observations SET label = 'twin'", "observations: ids: rows 0 and 1 are both 'twin'"),
        ("UPDATE observations SET cxy = 1 WHERE id = 3", "observations: covariances: row 2 is not symmetric positive"),
        (
            "UPDATE observations SET other_columns = '{}' WHERE id = 3",
            "observations 3: other_columns: found",
        ),
        ("UPDATE sessions SET configuration = '[]'", "sessions 1: configuration: found '[]', expected a JSON object"),
        ("DELETE FROM sessions", "is a session file with 0 sessions, expected 1"),
        ("INSERT INTO pomona_format VALUES (2, 1, 'map', '')", "has format None and kind None, expected 1 to 3 and"),
    ],
)
def test_a_session_that_cannot_be_is_refused(session: Path, script: str, line: str) -> None:
    change(session, script)
    with pytest.raises(PomonaError) as caught:
        load_session(session)
    assert str(caught.value).startswith(f"{session}: {line}")


@pytest.mark.parametrize(
    "content", [b"", b"SQLite format 3\0" + bytes(84), b"SQLite format 3\0" + bytes(range(256)) * 40]
)
def test_the_command_line_says_it_in_a_line(tmp_path: Path, content: bytes, run_here: Run) -> None:
    path = tmp_path / "odd.gpkg"
    path.write_bytes(content)
    for verb in (
        ("map", "check"),
        ("map", "info"),
        ("map", "remove", "--yes"),
        ("export", "--to", "csv", "-o", "a.csv"),
    ):
        done = run_here(*verb, path, *(["a"] if "remove" in verb else []))
        assert_refused(done, f"pomona: {path}: ")


def test_pages_that_repeat_themselves_end(orchard: Path) -> None:
    """Twelve times over, an inner page names the next one four hundred times: 400^12 rows in 60 KB."""
    orchard.write_bytes(with_repeating_pages(orchard.read_bytes()))
    for use in (read_whole_table, lambda path: remove_session(path, "a")):
        with pytest.raises(PomonaError, match=r"^[^\n]*(is damaged|gives more rows|asks for more work)[^\n]*$"):
            use(orchard)
    assert any("2nd reference to page" in line for line in problems(orchard))


def read_whole_table(path: Path) -> None:
    with snapshot(path) as (connection, _):
        columns_of(connection, "observations", ("label",))


def with_repeating_pages(data: bytes) -> bytes:
    connection = sqlite3.connect(":memory:")
    connection.deserialize(data)
    (root,) = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = 'observations'").fetchone()
    connection.close()
    size = struct.unpack(">H", data[16:18])[0]
    pages = [bytearray(data[start : start + size]) for start in range(0, len(data), size)]
    leaf = bytes(pages[root - 1])
    first = len(pages) + 1
    pages[root - 1][:] = inner_page(size, first)
    pages += [bytearray(inner_page(size, first + depth + 1)) for depth in range(11)]
    pages.append(bytearray(leaf))
    content = bytearray(b"".join(pages))
    content[28:32] = struct.pack(">I", len(pages))
    return bytes(content)


def inner_page(size: int, child: int) -> bytes:
    """A table's inner page with as many pointers to one child as there is room for."""
    n = (size - 12) // 7
    cells = [size - 5 * (row + 1) for row in range(n)]
    page = bytearray(size)
    page[:12] = struct.pack(">BHHHBI", 5, 0, n, cells[-1], 0, child)
    for row, start in enumerate(cells):
        page[12 + 2 * row : 14 + 2 * row] = struct.pack(">H", start)
        page[start : start + 5] = struct.pack(">IB", child, row % 128)
    return bytes(page)


def test_edited_schemas_are_refused_or_read(seeds: list[bytes]) -> None:
    for seed in seeds:
        for _, data in fuzzed.schema_edits(seed):
            fuzzed.target(data)


def test_edited_cells_are_refused_or_read(seeds: list[bytes]) -> None:
    for seed in seeds:
        for _, data in fuzzed.cell_edits(seed, every=EVERY_CELL):
            fuzzed.target(data)


DERIVED = """DERIVEDPROJCRS["row",BASEPROJCRS["WGS 84 / UTM zone 32N",BASEGEOGCRS["WGS 84",
DATUM["World Geodetic System 1984",ELLIPSOID["WGS 84",6378137,298.257223563,LENGTHUNIT["metre",1]]],
PRIMEM["Greenwich",0,ANGLEUNIT["degree",0.0174532925199433]]],CONVERSION["UTM zone 32N",
METHOD["Transverse Mercator",ID["EPSG",9807]],
PARAMETER["Latitude of natural origin",0,ANGLEUNIT["degree",0.0174532925199433]],
PARAMETER["Longitude of natural origin",9,ANGLEUNIT["degree",0.0174532925199433]],
PARAMETER["Scale factor at natural origin",0.9996,SCALEUNIT["unity",1]],
PARAMETER["False easting",500000,LENGTHUNIT["metre",1]],PARAMETER["False northing",0,LENGTHUNIT["metre",1]]]],
DERIVINGCONVERSION["Affine",METHOD["Affine parametric transformation",ID["EPSG",9624]],
PARAMETER["A0",5.0,LENGTHUNIT["metre",1.0],ID["EPSG",8623]],
PARAMETER["A1",1.0,SCALEUNIT["coefficient",1.0],ID["EPSG",8624]],
PARAMETER["A2",0.0,SCALEUNIT["coefficient",1.0],ID["EPSG",8625]],
PARAMETER["B0",1.0,LENGTHUNIT["metre",1.0],ID["EPSG",8639]],
PARAMETER["B1",0.0,SCALEUNIT["coefficient",1.0],ID["EPSG",8640]],
PARAMETER["B2",1.0,SCALEUNIT["coefficient",1.0],ID["EPSG",8641]]],
CS[Cartesian,2],AXIS["(E)",east],AXIS["(N)",north],LENGTHUNIT["metre",1.0]]"""
"""A reference system that only WKT2 can say."""
