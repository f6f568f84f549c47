"""What a plan of a farm may say, and what recordings it finds."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pomona.errors import PomonaError
from pomona.farm import read_plan, steps_of
from pomona.farm.farm_plan import Flag, Takes
from pomona.farm.first_plan import guessed_pattern
from pomona.farm.recorded_visits import visits_by_pattern, visits_by_table

TAKES: dict[str, dict[str, Takes]] = {
    "scan": {"model": "path", "detections": "path", "every": "value", "odometry": "switch", "config": "path"},
    "map": {"up": "value", "config": "path"},
    "growth": {"harvest": "value"},
    "report": {},
    "export": {"growth": "switch"},
}
FLAGS = {verb: {name: Flag(what, f"--{name}") for name, what in flags.items()} for verb, flags in TAKES.items()}
FLAGS["scan"]["crops"] = Flag("switch", "--crops", "--no-crops")


def touch(folder: Path, *names: str) -> Path:
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(name.encode())
    return folder


def plan_of(folder: Path, text: str) -> Path:
    path = folder / "farm.toml"
    path.write_text(text, encoding="utf-8")
    return path


SIMPLE = '[recordings]\nfolder = "rec"\npattern = "{row}/{date}.mp4"\n'


@pytest.mark.parametrize(
    ("names", "pattern", "expected"),
    [
        (["a/2024-08-09.mp4"], "{row}/{date}.mp4", [("a", "2024-08-09")]),
        (["2024-08-09/row 3/left.mp4"], "{date}/{row}/left.mp4", [("row 3", "2024-08-09")]),
        (["b_20240809.svo2"], "{row}_{date}.svo2", [("b", "2024-08-09")]),
        (["b-2024-08-09_141530 gala.mp4"], "{row}-{date}*.mp4", [("b", "2024-08-09T14:15:30")]),
        (["x.y/2024-08-09T0910.mp4", "x.y/.2024-08-10.mp4"], "{row}/{date}.mp4", [("x.y", "2024-08-09T09:10:00")]),
        (["b/2024-08-28.mp4", "a/2024-08-09.mp4"], "{row}/{date}.mp4", [("a", "2024-08-09"), ("b", "2024-08-28")]),
    ],
)
def test_recordings_are_found_by_their_names(tmp_path, names, pattern, expected):
    found = visits_by_pattern("pattern", touch(tmp_path, *names), pattern)
    assert [(visit.row, visit.date) for visit in found] == expected
    assert all(visit.path.is_file() for visit in found)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["row1/2024-08-09.mp4", "row2/2024-08-09.mp4"], "{row}/{date}.mp4"),
        (["2024-08-09/row1.mp4", "2024-08-28/row1.mp4", "2024-08-28/calibration.json"], "{date}/{row}.mp4"),
        (["2024-08-09/row1.mp4", "2024-08-09/boxes.csv", "2024-08-09/fruits.csv"], "{date}/{row}.mp4"),
        (["row1/2024-08-09.csv", "row2/2024-08-09.csv"], "{row}/{date}.csv"),
        (["row1_2024-08-09.svo2", "row1_2024-08-28.svo2"], "{row}_{date}.svo2"),
        (["2024-08-09 north.mp4"], "{date} {row}.mp4"),
        (["row1/2024-08-09/left/0000.png", "row1/2024-08-28/left/0000.png"], "{row}/{date}"),
    ],
)
def test_the_pattern_is_guessed_from_the_names(tmp_path, names, expected):
    assert guessed_pattern(touch(tmp_path, *names)) == expected


@pytest.mark.parametrize(
    ("names", "pattern", "told"),
    [
        (["a.mp4"], "{row}.mp4", "expected {date} in it, once"),
        (["a/2024-08-09.mp4"], "{row}/{row}{date}.mp4", "expected {row} in it, once"),
        (["a/2024-08-09.avi"], "{row}/{date}.mp4", "is called {row}/{date}.mp4"),
        (
            ["a/2024-13-09.mp4"],
            "{row}/{date}.mp4",
            "date: found '2024-13-09', expected a day of the calendar: there is no",
        ),
        (["a/2024-08-09_250000.mp4"], "{row}/{date}.mp4", "found '2024-08-09_250000', expected one like 2024-08-09"),
        (["a/2024-08-09.mp4", "a/20240809.mp4"], "{row}/{date}.mp4", "are both row a on 2024-08-09"),
        (["A/2024-08-09.mp4", "a/2024-08-28.mp4"], "{row}/{date}.mp4", "the rows A and a, expected one name"),
        (["-rf/2024-08-09.mp4"], "{row}/{date}.mp4", "row: found '-rf', expected a name that a file can have"),
        (["a\x1b[2J/2024-08-09.mp4"], "{row}/{date}.mp4", r"row: found 'a\\x1b[2J', expected a name"),
    ],
)
def test_names_that_no_season_can_have_are_refused(tmp_path, names, pattern, told):
    touch(tmp_path, *names)
    with pytest.raises(PomonaError) as refused:
        visits_by_pattern("farm.toml: [recordings] pattern", tmp_path, pattern)
    assert told.replace("\\\\", "\\") in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ("row,date\na,2024-08-09\n", "line 1: has no column recording"),
        ("row,date,recording\na,2024-08-09,b.mp4\n", "line 2: recording: 'b.mp4' is not there"),
        ("row,date,recording\n../a,2024-08-09,a.mp4\n", "line 2: row: found '../a'"),
        ("row,date,recording\na,yesterday,a.mp4\n", "line 2: date: found 'yesterday'"),
        ("row,date,recording\n", "has no line"),
        ("row,date,recording\na,2024-08-09\n", "line 2: found 2 cells, expected 3"),
    ],
)
def test_a_wrong_table_is_told_by_its_line(tmp_path, lines, told):
    touch(tmp_path, "a.mp4")
    (tmp_path / "table.csv").write_text(lines, encoding="utf-8")
    with pytest.raises(PomonaError, match=told.replace("..", r"\.\.")):
        visits_by_table(tmp_path / "table.csv")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("speed = 3\n" + SIMPLE, "found 'speed', expected one of results, recordings, scan"),
        (SIMPLE + "[scan]\nspeed = 3\n", "[scan]: found 'speed', expected one of config, crops, detections"),
        (SIMPLE + '[scan]\nodometry = "yes"\n', "[scan] odometry: found 'yes', expected true or false"),
        (SIMPLE + "[scan]\nevery = [2]\n", "[scan] every: found [2], expected a text or a number"),
        (SIMPLE + 'colour = "red"\n', "[recordings]: found 'colour', expected one of folder"),
        (SIMPLE + 'skip = ["b/2024-08-09"]\n', "skip: found 'b/2024-08-09', expected ROW/DATE of a recording"),
        (SIMPLE + 'table = "t.csv"\n', "expected either pattern, with folder, or table"),
        (SIMPLE + '[export]\nto = ["xls"]\n', "[export] to: found ['xls'], expected a list out of csv"),
        ("results = 3\n" + SIMPLE, "results: found 3, expected the name of a folder"),
        ("scan = 3\n" + SIMPLE, "scan: found 3, expected a table, [scan]"),
        ("", "has no [recordings]"),
        ("[recordings\n", "not TOML"),
    ],
)
def test_a_wrong_plan_is_told_in_one_line(tmp_path, text, told):
    touch(tmp_path, "rec/a/2024-08-09.mp4")
    with pytest.raises(PomonaError) as refused:
        read_plan(plan_of(tmp_path, text), FLAGS)
    assert told in str(refused.value)
    assert str(refused.value).startswith(str(tmp_path / "farm.toml"))
    assert "\n" not in str(refused.value)


def test_steps_come_behind_those_they_need_and_name_what_they_read(tmp_path):
    touch(tmp_path, "rec/a/2024-08-09.mp4", "rec/a/2024-08-28.mp4", "rec/a/2024-08-28.csv", "rec/a/calibration.json")
    touch(tmp_path, "rec/b/2024-08-09.mp4", "my.onnx")
    scan = '[scan]\nmodel = "my.onnx"\nevery = 2\nodometry = true\ncrops = false\ndetections = "{beside}/{date}.csv"\n'
    plan = read_plan(plan_of(tmp_path, SIMPLE + scan + '[growth]\n[export]\nto = ["csv", "mcap"]\n'), FLAGS)
    steps = {step.name: step for step in steps_of(plan)}
    assert list(steps) == [
        "scan a/2024-08-09", "scan a/2024-08-28", "map a", "growth a", "export a csv", "export a mcap",
        "scan b/2024-08-09", "map b", "export b csv", "export b mcap",
    ]  # fmt: skip
    first, second = steps["scan a/2024-08-09"], steps["scan a/2024-08-28"]
    assert {path.name for path in first.inputs} == {"2024-08-09.mp4", "calibration.json", "my.onnx"}
    assert {path.name for path in second.inputs} == {"2024-08-28.mp4", "2024-08-28.csv", "calibration.json", "my.onnx"}
    assert second.arguments({})[0][:4] == ["scan", "rec/a/2024-08-28.mp4", "-o", "results/sessions/a/2024-08-28.gpkg"]
    given = ["--model=my.onnx", "--every=2", "--odometry", "--no-crops", "--detections=rec/a/2024-08-28.csv"]
    assert second.arguments({})[0][-5:] == given
    assert steps["map a"].needs == (first.name, second.name)
    made = {first.name: ["1.gpkg", "1-part2.gpkg"], second.name: ["2.gpkg"]}
    added = ["1.gpkg", "1-part2.gpkg", "2.gpkg", "--replace"]
    assert steps["map a"].arguments(made) == [["map", "add", "results/maps/a.gpkg", *added]]


def test_a_first_plan_is_written_for_what_is_there_and_is_a_plan(tmp_path):
    touch(tmp_path, "rec/a/2024-08-09.csv", "rec/a/2024-08-28.csv")
    command = [sys.executable, "-m", "pomona", "farm"]
    ran = subprocess.run([*command, "init", "rec"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "farm.toml: 2 recordings" in ran.stdout
    dry = subprocess.run(
        [*command, "run", "farm.toml", "--dry-run", "--json"], cwd=tmp_path, capture_output=True, check=True
    )
    first = json.loads(dry.stdout)[0]
    assert first["step"] == "map a"
    assert first["commands"][0][:4] == ["map", "add", "results/maps/a.gpkg", "rec/a/2024-08-09.csv"]
    # It was to be looked at and changed.
    plan = (tmp_path / "farm.toml").read_text().replace("skip = []", 'skip = ["a/2024-08-09"]')
    (tmp_path / "farm.toml").write_text(plan)
    again = subprocess.run([*command, "init", "rec"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (again.returncode, again.stdout) == (2, "")
    assert again.stderr == (
        "pomona: farm.toml: is there already and is not a first plan, which takes a name of its own: "
        "take another name, or --force to replace it\n"
    )
    assert (tmp_path / "farm.toml").read_text() == plan
    (tmp_path / "notes.toml").write_text("mine = 1\n")
    refused = subprocess.run(
        [*command, "init", "rec", "-o", "notes.toml"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert refused.returncode == 2
    assert (tmp_path / "notes.toml").read_text() == "mine = 1\n"


@pytest.mark.parametrize(
    ("plan", "told"),
    [
        ('results = "rec"\n' + SIMPLE, "results: "),
        ('results = "."\n' + SIMPLE, "lies in it, expected a folder without recordings"),
        ('results = "a\\u0000b"\n' + SIMPLE, "results: found"),
        (SIMPLE + f"[scan]\nevery = {'9' * 5000}\n", "not TOML"),
        (SIMPLE + '[map]\nconfig = "nowhere.toml"\n', "nowhere.toml: is not there"),
        (SIMPLE + '[map]\nconfig = "{row}.toml"\n', "{row}.toml: is not there"),
        (
            SIMPLE + '[scan]\ndetections = "{besides}/boxes.csv"\n',
            "found '{besides}', expected {row}, {date}, {beside}",
        ),
        ('[recordings]\nfolder = "rec"\npattern = "{row}/*****{date}.mp4"\n', "5 stars, expected 4 at the most"),
        ('[recordings]\ntable = "twice.csv"\n', "found 2 columns row"),
        ('[recordings]\ntable = "more.csv"\n', "found 4 cells, expected 3"),
        ('[recordings]\ntable = "zero.csv"\n', "is no file and no folder"),
    ],
)
def test_plans_that_would_go_wrong_later_are_refused_at_once(tmp_path, plan, told):
    touch(tmp_path, "rec/a/2024-08-09.mp4")
    (tmp_path / "twice.csv").write_text("row,row,date,recording\na,b,2024-08-09,rec/a/2024-08-09.mp4\n")
    (tmp_path / "more.csv").write_text("row,date,recording\na,2024-08-09,rec/a/2024-08-09.mp4,x\n")
    (tmp_path / "zero.csv").write_text("row,date,recording\na,2024-08-09,/dev/zero\n")
    with pytest.raises(PomonaError, match=re.escape(told)) as refused:
        read_plan(plan_of(tmp_path, plan), FLAGS)
    assert "\n" not in str(refused.value)


def test_a_name_is_one_however_its_accents_were_written_and_stands_in_values_as_it_is(tmp_path):
    touch(tmp_path, "rec/Re\u0301/2024-08-09.mp4", "rec/R\u00e9/2024-08-28.mp4", "rec/{date}/2024-08-09.mp4")
    plan = read_plan(plan_of(tmp_path, SIMPLE + '[scan]\ndetections = "{beside}/{row}.csv"\n'), FLAGS)
    assert {visit.row for visit in plan.visits} == {"R\u00e9", "{date}"}
    (odd,) = [step for step in steps_of(plan) if step.name == "scan {date}/2024-08-09"]
    assert "--detections=rec/{date}/{date}.csv" in odd.commands[0]


@pytest.mark.parametrize(
    ("table", "value", "told"),
    [
        ("map", 'method = "magic"', "--method"),
        ("map", 'noise = "a"', "--noise"),
        ("map", "noise = -1", "--noise"),
        ("map", "noise = nan", "--noise"),
        ("growth", 'harvest = "tomorrow"', "--harvest: found 'tomorrow', expected a day"),
        ("report", 'classes = "70,60"', "--classes: found '70,60', expected rising limits"),
    ],
)
def test_the_verbs_look_at_their_flags_before_anything_is_run(tmp_path, table, value, told):
    touch(tmp_path, "rec/a/2024-08-09.mp4", "rec/a/2024-08-16.mp4")
    plan_of(tmp_path, f"{SIMPLE}[{table}]\n{value}\n")
    command = [sys.executable, "-m", "pomona", "farm", "run", "farm.toml", "--dry-run"]
    refused = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"pomona: farm.toml: [{table}]: ")
    assert told in refused.stderr
    assert refused.stderr.count("\n") == 1


def test_flags_may_be_written_as_in_the_help_and_repeated(tmp_path):
    touch(tmp_path, "rec/a/2024-08-09.mp4")
    plan_of(tmp_path, f'{SIMPLE}[map]\nnew-part = true\nup = ["0,0,1", "0,1,0"]\n')
    command = [sys.executable, "-m", "pomona", "farm", "run", "farm.toml", "--dry-run"]
    printed = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert "--new-part --up=0,0,1 --up=0,1,0" in printed
