"""An output never destroys: neither an input, nor a map, nor what its verb would not have made."""

import hashlib
import shutil
import sqlite3
from pathlib import Path

import cv2
import numpy as np
import pytest

from command_line import Pomona, options_of, verbs
from pomona.likes import database_of


def contents(folder: Path) -> dict[str, str]:
    """What is in a folder, byte for byte."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(file.relative_to(folder)): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def refused(pomona: Pomona, folder: Path, command: str, *named: str) -> None:
    """Exit code 2, one line that names what is wrong, and all files as they were."""
    before = contents(folder)
    code, printed, told = pomona(*command.split())
    assert (code, printed, told.count("\n")) == (2, "", 1), told
    for words in named:
        assert words in told
    assert contents(folder) == before


# Every verb with an output, and the output as the last word.
WRITERS = (
    "match query.csv map.csv -o",
    "match query.csv map.csv --plot",
    "scan R -o",
    "scan R -o fruits.csv --preview",
    "export map.csv --to csv -o",
    "export map.csv --to ply -o",
    "export map.csv --to geojson -o",
    "export map.csv --to shp -o",
    "export map.csv --to parquet -o",
)


@pytest.mark.parametrize("force", ["", " --force"])
@pytest.mark.parametrize("command", WRITERS)
def test_a_map_is_never_replaced(pomona: Pomona, here: Path, command: str, force: str) -> None:
    refused(pomona, here, f"{command} orchard.gpkg{force}", "orchard.gpkg: is an orchard map")


@pytest.mark.parametrize("force", ["", " --force"])
@pytest.mark.parametrize("command", WRITERS)
def test_another_database_is_never_replaced(pomona: Pomona, here: Path, command: str, force: str) -> None:
    refused(pomona, here, f"{command} other.sqlite{force}", "other.sqlite: is a database")


@pytest.mark.parametrize("force", ["", " --force"])
@pytest.mark.parametrize(
    ("command", "read"),
    [
        ("match query.csv map.csv -o query.csv", "query.csv"),
        ("match query.csv map.csv -o map.csv", "map.csv"),
        ("match query.csv map.csv --plot ./map.csv", "map.csv"),
        ("match query.csv orchard.gpkg -o orchard.gpkg", "orchard.gpkg"),
        ("match query.csv map.csv --config set.toml -o set.toml", "set.toml"),
        ("export orchard.gpkg --to geojson -o orchard.gpkg", "orchard.gpkg"),
        ("export map.csv --to csv -o symbolic.csv", "map.csv"),
        ("export map.csv --to csv -o hard.csv", "map.csv"),
        ("export symbolic.csv --to csv -o map.csv", "symbolic.csv"),
        ("scan R --force -o R/detections.csv", "R/detections.csv"),
        ("scan R --detections tracks.csv -o tracks.csv", "tracks.csv"),
        ("scan R -o fruits.csv --keep R", "R"),
        ("scan R --detections tracks.csv -o fruits.csv --keep .", "R"),
    ],
)
def test_an_input_is_never_replaced(pomona: Pomona, here: Path, command: str, read: str, force: str) -> None:
    (here / "symbolic.csv").symlink_to("map.csv")
    (here / "hard.csv").hardlink_to("map.csv")
    (here / "set.toml").write_text("[match]\n")
    shutil.copy("R/detections.csv", "tracks.csv")
    refused(pomona, here, command + force, "is the ", f"input {read}")


@pytest.mark.parametrize(
    ("command", "there"),
    [
        ("match query.csv map.csv -o", "session.gpkg"),
        ("match query.csv map.csv -o", "R/detections.csv"),
        ("match query.csv map.csv --plot", "photo.png"),
        ("scan R -o", "truth.csv"),
        ("scan R -o", "scanner.ply"),
        ("scan R -o fruits.csv --preview", "video.mp4"),
        ("scan R -o fruits.csv --keep", "notes"),
        ("export map.csv --to csv -o", "session.gpkg"),
        ("export map.csv --to ply -o", "scanner.ply"),
        ("export map.csv --to geojson -o", "field.json"),
        ("synth clouds base -o", "."),
    ],
)
def test_what_the_verb_would_not_have_made_stays(pomona: Pomona, here: Path, command: str, there: str) -> None:
    cv2.imwrite(str(here / "photo.png"), np.zeros((4, 4), np.uint8))
    (here / "truth.csv").write_text("id,x,y,z,diameter_m\na,0,0,1,0.07\n")
    (here / "scanner.ply").write_text("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n")
    (here / "video.mp4").write_bytes(b"\0\0\0\x20ftypisom" + bytes(100))
    (here / "field.json").write_text('{"type": "FeatureCollection", "features": []}')
    (here / "notes").mkdir()
    (here / "notes" / "poses_tum.txt").write_text("mine")
    refused(pomona, here, f"{command} {there}", f"{there}: is there already and is not ", "--force")


@pytest.mark.parametrize(
    "command",
    [
        "match query.csv map.csv -o new.csv",
        "match query.csv map.csv --plot new.png",
        "match query.csv map.csv --plot new.svg",
        "match query.csv map.csv --plot new.pdf",
        "scan R -o new.gpkg",
        "scan R -o new.csv",
        "scan R -o new.ply --keep kept",
        "scan R -o new.csv --preview seen.mp4",
        "export orchard.gpkg --to csv -o new.csv",
        "export orchard.gpkg --to ply -o new.ply",
        "export orchard.gpkg --to geojson -o new.json",
        "synth clouds base -o drawn",
        "synth clouds base -o drawn --seeds 0:2",
        "demo -o demonstrated",
    ],
)
def test_its_like_is_replaced(pomona: Pomona, here: Path, command: str) -> None:
    for _ in range(2):
        code, _, told = pomona(*command.split())
        assert code == 0, told


def test_force_replaces_what_is_not_alike(pomona: Pomona, here: Path) -> None:
    for name in ("notes.csv", "notes.gpkg"):
        (here / name).write_text("mine")
    assert pomona("match", "query.csv", "map.csv", "-o", "notes.csv", "--force")[0] == 0
    assert (here / "notes.csv").read_text().startswith("query,map,")
    assert pomona("scan", "R", "-o", "notes.gpkg", "--force")[0] == 0
    assert database_of(here / "notes.gpkg") == "session"
    assert pomona("export", "map.csv", "--to", "csv", "-o", "session.gpkg", "--force")[0] == 0


@pytest.mark.parametrize("force", ["", " --force"])
@pytest.mark.parametrize(
    ("command", "told"),
    [
        ("match query.csv map.csv -o pairs.txt", "pairs.txt: found suffix '.txt', expected .csv"),
        ("match query.csv map.csv -o pairs", "pairs: found suffix '', expected .csv"),
        ("localize map.csv R -o poses.csv", "poses.csv: found suffix '.csv', expected .tum, .txt, .kitti"),
        ("localize map.csv R -o poses", "poses: found suffix '', expected .tum, .txt, .kitti"),
    ],
)
def test_a_name_that_says_something_else_is_refused(
    pomona: Pomona, here: Path, command: str, told: str, force: str
) -> None:
    refused(pomona, here, command + force, told)


def test_an_empty_file_holds_nothing_that_could_be_lost(pomona: Pomona, here: Path) -> None:
    (here / "new.csv").touch()
    assert pomona("match", "query.csv", "map.csv", "-o", "new.csv")[0] == 0


def test_a_map_in_its_first_transaction_is_not_replaced(pomona: Pomona, here: Path) -> None:
    connection = sqlite3.connect(here / "new.gpkg", isolation_level=None)
    connection.execute("PRAGMA journal_mode = DELETE")
    connection.execute("BEGIN IMMEDIATE")
    connection.execute("CREATE TABLE t (a)")
    assert (here / "new.gpkg").stat().st_size == 0
    code, _, told = pomona("scan", "R", "-o", "new.gpkg")
    connection.close()
    assert code == 2
    assert "new.gpkg: is a database" in told


@pytest.mark.parametrize(
    "command",
    [
        "match query.csv map.csv -o both.png --plot both.png",
        "match query.csv map.csv -o both.png --plot ./both.png",
        "match query.csv map.csv -o R/../both.png --plot both.png",
        "scan R -o both.csv --preview both.csv",
    ],
)
def test_two_outputs_are_two_files(pomona: Pomona, here: Path, command: str) -> None:
    refused(pomona, here, command, "are the same file, expected two")


def test_two_names_of_one_file_are_one_output(pomona: Pomona, here: Path) -> None:
    (here / "a.csv").touch()
    (here / "a.png").hardlink_to("a.csv")
    refused(pomona, here, "match query.csv map.csv -o a.csv --plot a.png", "a.csv and a.png are the same file")


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("match query.csv map.csv -o missing/pairs.csv", "the folder missing is not there"),
        ("match query.csv map.csv -o dangling.csv", "nowhere/x.csv, and the folder "),
        ("match query.csv map.csv -o R", "R: is a folder"),
        ("scan R -o fruits.csv --keep query.csv", "query.csv: is a file"),
        ("match query.csv map.csv --plot -", "-: found no suffix, expected a picture"),
        ("match query.csv map.csv -o - --json", "both go to the standard output"),
    ],
)
def test_where_nothing_can_be_written_is_told_first(pomona: Pomona, here: Path, command: str, reason: str) -> None:
    (here / "dangling.csv").symlink_to("nowhere/x.csv")
    refused(pomona, here, command, reason)


def test_the_demo_takes_no_other_map_for_its_own(pomona: Pomona, here: Path) -> None:
    for force in ("", " --force"):
        refused(pomona, here, f"demo -o .{force}", "demo")


def test_every_option_that_is_an_output_is_looked_at() -> None:
    # Whoever adds an output marks it (pomona.cli.verbs.Writes), and the verb has --force.
    named_so = {"output", "plot", "preview", "keep"}
    options = {words: {name.lstrip("-") for name in set().union(*options_of(verb))} for words, verb in verbs().items()}
    writers = {words: names for words, names in options.items() if names & named_so}
    assert len(writers) >= 5
    assert [verb for verb, names in writers.items() if "force" not in names] == []
