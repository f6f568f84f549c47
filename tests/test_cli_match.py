"""`pomona match` as a user meets it: exit code, stdout and stderr of a process of its own."""

import csv
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command_line import POMONA, Run, assert_refused, run, verbs, write_visits
from pomona.cloud import FruitCloud, Views
from pomona.mirrored import mirror_image
from pomona.orchard import write_session
from pomona.synth.clouds import scene_pair
from pomona.trajectory import Trajectory
from pomona.viewer.row_frame import known_vertical


@pytest.fixture(scope="module")
def visits(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_visits(tmp_path_factory.mktemp("visits"))


@pytest.fixture(scope="module")
def found(visits: Path) -> dict[str, object]:
    """The answer of `--json`, which later tests compare with."""
    done = run("match", visits / "query.csv", visits / "map.csv", "--json")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    answer: dict[str, object] = json.loads(done.stdout)
    return answer


def test_the_module_is_the_command() -> None:
    by_name, by_module = (
        subprocess.run([*command, "--version"], capture_output=True, text=True)
        for command in ([POMONA], [sys.executable, "-m", "pomona"])
    )
    assert by_name.returncode == by_module.returncode == 0
    assert by_name.stdout == by_module.stdout


def test_help_of_every_verb_loads_nothing_heavy() -> None:
    program = """
import contextlib, io, json, sys
from pomona.cli import main
helps = {}
for verb in json.loads(sys.argv[1]):
    sys.argv = ["pomona", *verb, "--help"]
    with contextlib.redirect_stdout(io.StringIO()) as printed, contextlib.suppress(SystemExit):
        main()
    helps[" ".join(verb)] = printed.getvalue()
heavy = {"numpy", "scipy", "matplotlib", "cv2", "pyogrio", "onnxruntime"} & set(sys.modules)
print(json.dumps({"heavy": sorted(heavy), "helps": helps}))
"""
    done = subprocess.run(
        [sys.executable, "-c", program, json.dumps(list(verbs()))], capture_output=True, text=True, check=True
    )
    printed = json.loads(done.stdout)
    assert printed["heavy"] == []
    assert len(printed["helps"]) > 8
    assert [verb for verb, text in printed["helps"].items() if "Usage:" not in text] == []


def test_a_row_that_is_torn_apart_is_told(tmp_path: Path, run_here) -> None:
    torn = scene_pair("torn", 0)
    torn.query.write(tmp_path / "query.csv")
    torn.map.write(tmp_path / "map.csv")
    answer = run_here("match", str(tmp_path / "query.csv"), str(tmp_path / "map.csv"))
    assert "2, torn apart" in answer.stdout
    told = json.loads(run_here("match", str(tmp_path / "query.csv"), str(tmp_path / "map.csv"), "--json").stdout)
    assert told["n_parts"] == len(told["parts"]) == 2
    assert told["parts"][0] == told["map_from_query"]
    orchard = str(tmp_path / "row.gpkg")
    for name, date in (("map", "2024-06-01"), ("query", "2024-06-15")):
        added = run_here("map", "add", orchard, str(tmp_path / f"{name}.csv"), "--date", date)
    assert re.search(r"it and the map are torn against each other near fruit \d+, 2 parts", added.stdout)


def test_json_keeps_the_contract(visits: Path, found: dict[str, object]) -> None:
    assert set(found) == {
        "status",
        "map_from_query",
        "scale",
        "log_odds",
        "n_parts",
        "parts",
        "n_query",
        "n_map",
        "matches",
        "unmatched_query",
        "elapsed_s",
    }
    query, map = FruitCloud.read(visits / "query.csv"), FruitCloud.read(visits / "map.csv")
    assert found["status"] == "Found"
    assert (found["n_query"], found["n_map"]) == (len(query), len(map))
    matches = found["matches"]
    assert isinstance(matches, list)
    assert all(set(match) == {"query", "map", "probability", "distance_m"} for match in matches)
    assert all(0.0 <= match["probability"] <= 1.0 for match in matches)
    paired = [match["query"] for match in matches]
    assert query.ids is not None
    assert sorted([*paired, *found["unmatched_query"]]) == sorted(query.ids)  # type: ignore[misc]
    transform = np.array(found["map_from_query"])
    truth = scene_pair("base", seed=7).map_from_query
    assert np.linalg.norm(transform[:3, :3] - truth[:3, :3]) < np.radians(5.0)


def test_text_names_the_verdict_first_and_no_match_is_exit_code_1(visits: Path) -> None:
    done = run("match", visits / "query.csv", visits / "map.csv", "--explain")
    assert done.returncode == 0
    assert done.stdout.startswith("Found: ")
    assert "translation" in done.stdout
    assert " deg about " in done.stdout
    assert "\n  pairs " in done.stdout
    elsewhere = run("match", visits / "elsewhere.csv", visits / "map.csv")
    assert elsewhere.returncode == 1
    assert elsewhere.stdout.startswith("NoMatch: ")
    assert elsewhere.stderr == ""


@pytest.mark.parametrize("method", ["paper", "verified"])
def test_writes_pairs_and_picture(run_here: Run, visits: Path, tmp_path: Path, method: str) -> None:
    pairs, picture = tmp_path / "pairs.csv", tmp_path / "match.png"
    done = run_here(
        "match", visits / "query.csv", visits / "map.csv", "--method", method, "-o", pairs, "--plot", picture
    )
    assert done.returncode == 0, done.stderr
    with pairs.open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["query", "map", "probability", "distance_m"]
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert sorted(tmp_path.iterdir()) == sorted([pairs, picture])
    score = json.loads(run_here("evaluate", "match", visits / "query.csv", visits / "map.csv", pairs, "--json").stdout)
    assert score["true"] + score["false"] == len(rows)
    assert score["precision"] > 0.7
    assert score["recall"] > 0.7


def test_evaluate_reads_the_answer_from_a_pipe(visits: Path, found: dict[str, object]) -> None:
    done = run("evaluate", "match", visits / "query.csv", visits / "map.csv", "-", stdin=json.dumps(found))
    assert done.returncode == 0
    header, values = done.stdout.splitlines()
    assert header.split()[:5] == ["precision", "recall", "true", "false", "missed"]
    assert int(values.split()[2]) > 0


def test_rows_stand_for_fruits_without_ids(
    run_here: Run, visits: Path, tmp_path: Path, found: dict[str, object]
) -> None:
    for side in ("query", "map"):
        FruitCloud(FruitCloud.read(visits / f"{side}.csv").positions).write(tmp_path / f"{side}.csv")
    answer = json.loads(run_here("match", tmp_path / "query.csv", tmp_path / "map.csv", "--json").stdout)
    ids = FruitCloud.read(visits / "query.csv").ids
    assert ids is not None
    assert [ids[match["query"]] for match in answer["matches"]] == [m["query"] for m in found["matches"]]  # type: ignore[attr-defined]


def test_threads_and_repetition_change_nothing(run_here: Run, visits: Path, found: dict[str, object]) -> None:
    for threads in (1, 2):
        done = run_here("match", visits / "query.csv", visits / "map.csv", "--json", "--threads", threads)
        assert {**json.loads(done.stdout), "elapsed_s": 0} == {**found, "elapsed_s": 0}


def test_explain_with_json_leaves_stdout_to_the_program(visits: Path) -> None:
    done = run("match", visits / "query.csv", visits / "map.csv", "--json", "--explain")
    assert json.loads(done.stdout)["status"] == "Found"
    assert done.stderr.strip()


HEADER = "x,y,z\n"


WRONG_CLOUDS = {
    "empty": ("", ["cloud.csv"]),
    "no header": ("1,2,3\n4,5,6\n", ["cloud.csv", "line 1"]),
    "no z": ("x,y,colour\n1,2,red\n", ["cloud.csv", "z"]),
    "a letter": (HEADER + "1,2,3\n4,5o,6\n", ["cloud.csv", "line 3", "y", "5o"]),
    "NaN": (HEADER + "1,2,3\n4,nan,6\n", ["cloud.csv", "line 3"]),
    "infinite": (HEADER + "1,2,3\n4,5,inf\n", ["cloud.csv", "line 3"]),
}


@pytest.mark.parametrize(("content", "side"), [*((content, "query") for content in WRONG_CLOUDS), ("a letter", "map")])
def test_refuses_a_wrong_cloud(visits: Path, tmp_path: Path, content: str, side: str) -> None:
    text, named = WRONG_CLOUDS[content]
    cloud, output = tmp_path / "cloud.csv", tmp_path / "pairs.csv"
    cloud.write_text(text)
    clouds = (cloud, visits / "map.csv") if side == "query" else (visits / "query.csv", cloud)
    assert_refused(run("match", *clouds, "-o", output), *named)
    assert not output.exists()


def test_refuses_what_is_no_cloud_file(visits: Path, tmp_path: Path) -> None:
    (tmp_path / "cloud.txt").write_text(HEADER)
    assert_refused(run("match", tmp_path / "none.csv", visits / "map.csv"), "none.csv")
    assert_refused(run("match", tmp_path, visits / "map.csv"), str(tmp_path))
    assert_refused(run("match", tmp_path / "cloud.txt", visits / "map.csv"), "cloud.txt", ".csv")


@pytest.mark.parametrize(
    ("flags", "named"),
    [
        (["--method", "magic"], ["--method", "magic", "paper"]),
        (["--scale", "big"], ["--scale", "big"]),
        (["--noise", "-1"], ["--noise"]),
        (["--noise", "0"], ["--noise: found 0.0, expected a positive number of metres"]),
        (["--noise", "inf"], ["--noise: found inf, expected a positive number of metres"]),
        (["--up", "nan,0,1"], ["--up: found 'nan,0,1', expected three finite numbers X,Y,Z"]),
        (["--up", "0,1"], ["--up", "0,1", "X,Y,Z"]),
        (["--up", "0,0,0"], ["up"]),
        (["--up", "0,0,1", "--up", "0,0,1", "--up", "0,0,1"], ["--up", "3"]),
        (["--threads", "0"], ["--threads"]),
        (["--unit", "inch"], ["--unit", "inch"]),
        (["--plot", "match.xyz"], ["match.xyz", ".png"]),
        (["--nonsense"], ["--nonsense"]),
        (["-o", "no-such-folder/pairs.csv"], ["no-such-folder/pairs.csv"]),
        (["--config", "no-such-file.toml"], ["no-such-file.toml"]),
    ],
)
def test_refuses_wrong_flags(run_here: Run, visits: Path, flags: list[str], named: list[str]) -> None:
    assert_refused(run_here("match", visits / "query.csv", visits / "map.csv", *flags), *named)


@pytest.mark.parametrize("method", ["paper", "verified"])
@pytest.mark.parametrize(
    ("scene", "scale"),
    [("none", "metric"), ("three", "metric"), ("line", "metric"), ("line", "free"), ("one place", "metric")],
)
def test_a_scene_without_an_answer_is_a_result(
    run_here: Run, visits: Path, tmp_path: Path, method: str, scene: str, scale: str
) -> None:
    steps = np.arange({"none": 0, "three": 3}.get(scene, 40))
    positions = np.outer(0 * steps if scene == "one place" else steps, [0.2, 0.1, 0.3])
    FruitCloud(positions).write(tmp_path / "cloud.csv")
    done = run_here("match", tmp_path / "cloud.csv", visits / "map.csv", "--method", method, "--scale", scale, "--json")
    assert done.returncode == 1, done.stderr
    answer = json.loads(done.stdout)
    assert answer["status"] in ({"TooFew"} if scene in ("none", "three") else {"NoMatch", "TooFew", "Ambiguous"})
    assert (answer["map_from_query"] is None) == (answer["status"] in ("NoMatch", "TooFew"))


def test_millimetres_warn_and_say_what_to_do(visits: Path, found: dict[str, object]) -> None:
    done = run("match", visits / "query_mm.csv", visits / "map_mm.csv", "--json")
    warnings = done.stderr.splitlines()
    assert len(warnings) == 2
    assert all(line.startswith("pomona: warning: ") and line.endswith("say so: --unit mm") for line in warnings)
    told = run("match", visits / "query_mm.csv", visits / "map_mm.csv", "--unit", "mm", "--json")
    assert told.returncode == 0
    assert told.stderr == ""
    assert len(json.loads(told.stdout)["matches"]) == len(found["matches"])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("clouds", "flags", "named", "mended"),
    [
        (("query_mm", "map"), (), "query_mm.csv", "if it is not in metres say so: --query-unit mm"),
        (("query", "map_mm"), (), "map_mm.csv", "if it is not in metres say so: --unit mm --query-unit m"),
        (("query_mm", "map"), ("--unit", "mm"), "map.csv", "not in millimetres say so: --unit m --query-unit mm"),
        (("query", "map_mm"), ("--unit", "mm"), "query.csv", "if it is not in millimetres say so: --query-unit m"),
    ],
)
def test_a_wrong_unit_is_told_with_the_flag_of_its_side(
    run_here: Run, visits: Path, clouds: tuple[str, str], flags: tuple[str, ...], named: str, mended: str
) -> None:
    paths = [visits / f"{cloud}.csv" for cloud in clouds]
    (line, *_) = run_here("match", *paths, *flags).stderr.splitlines()
    assert named in line
    assert line.endswith(mended)
    # What it says helps.
    told = run_here("match", *paths, *flags, *mended.split("say so: ")[1].split())
    assert (told.returncode, told.stderr) == (0, "")


def test_an_ambiguous_answer_names_all_its_transforms(run_here: Run, tmp_path: Path) -> None:
    pair = scene_pair("twins", seed=1)
    pair.query.write(tmp_path / "query.csv")
    pair.map.write(tmp_path / "map.csv")
    done = run_here("match", tmp_path / "query.csv", tmp_path / "map.csv")
    assert done.returncode == 1
    assert done.stdout.startswith("Ambiguous: ")
    assert "or, as good (1 of " in done.stdout
    assert done.stdout.count("translation") >= 2


def test_frame_by_frame_is_of_the_paper_alone(run_here: Run, visits: Path, tmp_path: Path) -> None:
    clouds = visits / "query.csv", visits / "map.csv"
    line = "--per-frame: found it with the method verified, expected it with --method paper alone"
    assert_refused(run_here("match", *clouds, "--per-frame"), line)
    (tmp_path / "set.toml").write_text("[match]\nper_frame = true\n")
    assert_refused(run_here("config", "--config", tmp_path / "set.toml"), "set.toml: match.per_frame: found it with")
    assert run_here("config", "--config", tmp_path / "set.toml", "--method", "paper").returncode == 0


def test_frame_by_frame_needs_to_know_who_saw_what(run_here: Run, visits: Path, tmp_path: Path) -> None:
    flags = ("--method", "paper", "--per-frame")
    assert_refused(run_here("match", visits / "query.csv", visits / "map.csv", *flags), "per_frame", "frame")
    query = FruitCloud.read(visits / "query.csv")
    # Four frames, each of which sees half of the fruits' extent along the first axis.
    along = np.argsort(np.argsort(query.positions[:, 0])) / len(query)
    seen = [np.flatnonzero((along >= start) & (along <= start + 0.5)) for start in (0.0, 0.2, 0.35, 0.5)]
    views = Views(
        frames=np.repeat(np.arange(4), [len(rows) for rows in seen]),
        fruits=np.concatenate(seen),
    )
    session = tmp_path / "query.gpkg"
    write_session(session, replace(query, views=views), name="query", date="2024-08-28", recording="made")
    done = run_here("match", session, visits / "map.csv", *flags, "--json")
    assert done.returncode == 0, done.stderr
    matches = json.loads(done.stdout)["matches"]
    assert len({match["query"] for match in matches}) == len({match["map"] for match in matches}) == len(matches)
    assert np.mean([match["query"] == match["map"] for match in matches]) > 0.7


def test_a_query_may_have_a_unit_of_its_own(visits: Path, run_here: Run) -> None:
    metres = run_here("match", visits / "query.csv", visits / "map.csv", "--json")
    mixed = run_here("match", visits / "query_mm.csv", visits / "map.csv", "--query-unit", "mm", "--json")
    assert mixed.returncode == 0, mixed.stderr
    assert mixed.stderr == ""
    np.testing.assert_allclose(json.loads(mixed.stdout)["map_from_query"], json.loads(metres.stdout)["map_from_query"])


def test_draws_the_view_that_was_asked_for(visits: Path, run_here: Run, tmp_path: Path) -> None:
    for view in ("row", "lines"):
        done = run_here(
            "match", visits / "query.csv", visits / "map.csv", "--plot", tmp_path / f"{view}.svg", "--plot-view", view
        )
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "row.svg").read_bytes() != (tmp_path / "lines.svg").read_bytes()


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("method", ["verified", "paper"])
def test_left_handed_axes_are_told(run_here: Run, visits: Path, tmp_path: Path, axis: int, method: str) -> None:
    cloud = FruitCloud.read(visits / "query.csv")
    flipped = replace(cloud, positions=cloud.positions * np.where(np.arange(3) == axis, -1.0, 1.0))
    flipped.write(tmp_path / "flipped.csv")
    done = run_here("match", tmp_path / "flipped.csv", visits / "map.csv", "--method", method)
    told = re.search(
        r"pomona: the mirror image of QUERY fits MAP, with (\d+) pairs: the axes .* left-handed", done.stderr
    )
    assert told, done.stderr
    assert int(told[1]) > 0.4 * len(cloud)


def test_a_row_that_is_not_there_is_no_mirror_image_either(run_here: Run, tmp_path: Path) -> None:
    pair = scene_pair("noov", seed=7)
    pair.query.write(tmp_path / "query.csv")
    pair.map.write(tmp_path / "map.csv")
    done = run_here("match", tmp_path / "query.csv", tmp_path / "map.csv")
    assert (done.returncode, done.stderr) == (1, "")


@pytest.mark.parametrize("vertical", [False, True])
def test_left_handed_axes_are_told_under_a_vertical(run_here: Run, tmp_path: Path, vertical: bool) -> None:
    pair = scene_pair("part1o45up", seed=7)
    assert pair.up is not None
    across = np.cross(pair.up, [0.6, 0.0, 0.8])
    mirror_image(pair.query, pair.up if vertical else across).write(tmp_path / "query.csv")
    pair.map.write(tmp_path / "map.csv")
    up = ",".join(map(str, pair.up))
    done = run_here("match", tmp_path / "query.csv", tmp_path / "map.csv", f"--up={up}")
    assert done.returncode == 1
    assert "pomona: the mirror image of QUERY fits MAP, with " in done.stderr


def test_a_dozen_fruits_that_lie_somewhat_like_their_mirror_image(run_here: Run, tmp_path: Path) -> None:
    draw = np.random.default_rng(3)
    told = 0
    for _ in range(6):
        places = draw.uniform(-0.4, 0.4, (10, 3))
        for name, sign in (("map", 1.0), ("query", -1.0)):
            FruitCloud(places * (1, 1, sign) + draw.normal(0, 0.02, (10, 3))).write(tmp_path / f"{name}.csv")
        told += "mirror image" in run_here("match", tmp_path / "query.csv", tmp_path / "map.csv").stderr
    assert told >= 5


def test_a_mirror_image_keeps_distances_and_covariances_and_turns_the_hand() -> None:
    normal = np.array([0.3, -0.5, 0.8])
    cloud = scene_pair("base", seed=7).query
    cloud = replace(cloud, covariances=np.tile(np.diag([1e-4, 4e-4, 9e-4]), (len(cloud), 1, 1)))
    image = mirror_image(cloud, normal)
    np.testing.assert_allclose(mirror_image(image, normal).positions, cloud.positions, atol=1e-12)
    moved = image.positions - cloud.positions
    np.testing.assert_allclose(np.cross(moved, normal), 0, atol=1e-12)
    apart, apart_then = (each.positions[1:] - each.positions[:-1] for each in (cloud, image))
    np.testing.assert_allclose(np.linalg.norm(apart_then, axis=1), np.linalg.norm(apart, axis=1))
    assert np.linalg.det(apart[:3]) == pytest.approx(-np.linalg.det(apart_then[:3]))
    for row in (0, 5):
        weighed, weighed_then = (
            offset @ np.linalg.solve(each.covariances[row], offset)
            for each, offset in ((cloud, apart[row]), (image, apart_then[row]))
        )
        assert weighed == pytest.approx(weighed_then)


def test_no_match_under_a_vertical_that_is_not_theirs_says_so(run_here: Run, visits: Path) -> None:
    done = run_here("match", visits / "query.csv", visits / "map.csv", "--up", "0,0,1")
    assert (done.returncode, done.stdout.split(":")[0]) == (1, "NoMatch")
    assert "only poses that stand upright by --up were taken" in done.stderr


def test_a_plot_of_sessions_stands_upright_by_their_cameras(tmp_path: Path) -> None:
    """The camera's y points down: neither `--up` nor a guess by the fruits is needed."""
    turned = np.eye(4)
    turned[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]  # the camera looks along y, z is up
    cloud = FruitCloud(np.random.default_rng(3).uniform((0, 0, 0), (4, 1, 2), (60, 3)))
    way = Trajectory(np.arange(3), np.arange(3.0), np.repeat(turned[None], 3, axis=0))
    of_day = {"date": "2024-08-09", "recording": "drawn"}
    write_session(tmp_path / "filmed.gpkg", cloud, name="filmed", trajectory=way, **of_day)
    write_session(tmp_path / "bare.gpkg", cloud, name="bare", **of_day)
    up = known_vertical(tmp_path / "filmed.gpkg")
    assert up is not None
    assert np.allclose(up, (0, 0, 1))
    assert known_vertical(tmp_path / "bare.gpkg") is None
    pictures = []
    for name in ("filmed", "bare"):
        done = run("match", tmp_path / "bare.gpkg", tmp_path / f"{name}.gpkg", "--plot", tmp_path / f"{name}.png")
        assert done.returncode == 0, done.stderr
        pictures.append((tmp_path / f"{name}.png").read_bytes())
    assert pictures[0] != pictures[1]
