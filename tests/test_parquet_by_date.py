"""Observations as analysts open them: GeoParquet in folders by row and date, read back by DuckDB."""

import shutil
import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import duckdb
import pytest

from command_line import run
from pomona.orchard import OrchardMap, add_sessions, load_session, remove_session
from pomona.synth.seasons import SEASONS, draw_season
from pomona.synth.seasons.season_files import write_season


@pytest.fixture(scope="module")
def orchard(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("by_date")
    easy = SEASONS["easy"]
    plan = replace(easy, n_visits=3, design=replace(easy.design, n_trees=2, fruits_per_tree=(20, 25)))
    write_season(draw_season(plan, 1), folder / "visits")
    sessions = [load_session(path, date=path.stem) for path in sorted((folder / "visits").glob("2*.csv"))]
    add_sessions(folder / "row 3.gpkg", sessions)
    return folder / "row 3.gpkg"


def export(orchard: Path, folder: Path, *flags: str) -> subprocess.CompletedProcess[str]:
    return run("export", orchard, "--to", "parquet-by-date", "-o", folder, *flags)


def read(folder: Path) -> list[tuple[object, ...]]:
    query = f"""SELECT row, CAST(date AS VARCHAR), fruit, geometry, diameter_m, probability
    FROM read_parquet('{folder}/**/*.parquet', hive_partitioning = true) ORDER BY date, fruit"""
    with duckdb.connect() as connection:
        return connection.sql(query).fetchall()


def test_duckdb_reads_what_the_map_holds(orchard, tmp_path):
    assert export(orchard, tmp_path / "lake").returncode == 0
    seen = OrchardMap(orchard).observations()
    rows = read(tmp_path / "lake")
    assert len(rows) == len(seen.fruit_ids) > 100
    by_key = {(row[1], int(str(row[2]))): row for row in rows}
    for number, key in enumerate(zip(seen.dates, seen.fruit_ids.tolist(), strict=True)):
        row = by_key[key]
        assert row[0] == "row 3"
        assert isinstance(row[3], bytes)
        # Well-known binary of a point ends with its three coordinates.
        assert struct.unpack("<3d", row[3][-24:]) == tuple(seen.positions_in_map[number].tolist())
        assert row[4] == pytest.approx(seen.diameters_m[number])


def test_maps_share_a_folder_and_each_replaces_its_own(orchard, tmp_path):
    mine = tmp_path / "a.gpkg"
    shutil.copy(orchard, mine)
    lake = tmp_path / "lake"
    for one in (orchard, mine):
        assert export(one, lake).returncode == 0
    last = OrchardMap(mine).visits()[-1]
    remove_session(mine, last.name)
    assert export(mine, lake).returncode == 0
    rows = read(lake)
    assert {row[1] for row in rows if row[0] == "row 3"} - {row[1] for row in rows if row[0] == "a"} == {last.date}
    assert export(mine, lake, "--growth").returncode == 2


def test_a_file_of_somebody_else_is_left_alone(orchard, tmp_path):
    theirs = tmp_path / "lake" / "row=row 3" / "date=2024-06-14" / "observations.parquet"
    theirs.parent.mkdir(parents=True)
    theirs.write_bytes(b"PAR1 mine")
    refused = export(orchard, tmp_path / "lake")
    assert refused.returncode == 2
    assert "is not a folder of observations by date" in refused.stderr
    assert theirs.read_bytes() == b"PAR1 mine"
