"""`pomona scan`, `pomona info` and `pomona import`: from folders to sessions, and every kind of wrong folder."""

import hashlib
import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from benchmarks.lifting import rigid_residuals, rows_named
from benchmarks.recordings import rendered_truth, scanned, scanned_captures, with_true_boxes

from command_line import assert_refused
from pomona.cloud import FruitCloud
from pomona.detect.opening import open_detector
from pomona.orchard import load_session
from pomona.recording import open_recording
from pomona.survey.believing import Believing
from pomona.survey.part import OpenPart
from pomona.survey.seeing import Seeing
from pomona.survey.tracking import Tracker
from recording_maker import FIELDS, FRUITS, HEADER, make_recording


@pytest.fixture
def row(tmp_path: Path) -> Path:
    """Three frames, 10 cm apart."""
    return make_recording(tmp_path / "2024-08-09", (0.0, 0.1, 0.2))


def assert_true_places(cloud: FruitCloud, within_m: float = 0.001) -> None:
    assert cloud.ids == tuple(FRUITS)
    np.testing.assert_allclose(cloud.positions, [fruit.centre for fruit in FRUITS.values()], atol=within_m)
    assert cloud.diameters_m is not None


def assert_nothing_made(done: subprocess.CompletedProcess[str], output: Path, *named: str) -> None:
    """One line that names what is wrong, and nothing written."""
    assert_refused(done, *named)
    assert not output.exists()
    assert not list(output.parent.glob("*.partial"))
    assert not list(output.parent.glob(".*.partial"))


def test_a_recording_becomes_a_session(run_here, row, tmp_path):
    done = run_here("scan", row, "-o", tmp_path / "session.gpkg")
    assert (done.returncode, done.stderr) == (0, "")
    assert "3 fruits, median diameter 7" in done.stdout
    session = load_session(tmp_path / "session.gpkg")
    assert_true_places(session.cloud)
    assert (session.name, session.date) == ("2024-08-09", "2024-08-09")
    assert session.cloud.n_views.tolist() == [3, 3, 3]
    seen = sorted(zip(session.cloud.views.frames.tolist(), session.cloud.views.fruits.tolist(), strict=True))
    assert seen == [(frame, fruit) for frame in range(3) for fruit in range(3)]
    np.testing.assert_allclose(session.trajectory.session_from_camera[:, 0, 3], [0, 0.1, 0.2])
    assert float(session.cloud.extras["diameter_sigma_m"][0]) < 0.01
    depth = row / "depth" / "0001.png"
    assert session.input_hashes["depth/0001.png"] == hashlib.sha256(depth.read_bytes()).hexdigest()
    assert {"calibration.json", "poses_tum.txt", "detections.csv"} <= set(session.input_hashes)


@pytest.mark.parametrize("suffix", [".csv", ".ply"])
def test_fruits_alone_by_suffix(run_here, row, tmp_path, suffix):
    assert run_here("scan", row, "-o", tmp_path / f"fruits{suffix}").returncode == 0
    cloud = FruitCloud.read(tmp_path / f"fruits{suffix}")
    assert_true_places(cloud)
    assert cloud.covariances is not None


def test_the_same_recording_gives_the_same_file(run_here, row, tmp_path):
    for name in ("first.csv", "second.csv"):
        assert run_here("scan", row, "-o", tmp_path / name).returncode == 0
    assert (tmp_path / "first.csv").read_bytes() == (tmp_path / "second.csv").read_bytes()


def test_json_says_what_was_found(run_here, row, tmp_path):
    done = run_here("scan", row, "-o", tmp_path / "fruits.csv", "--json")
    found = json.loads(done.stdout)
    assert (found["n_fruits"], found["n_boxes"], found["n_frames"], found["n_refused"]) == (3, 9, 3, {})
    assert found["median_diameter_mm"] == pytest.approx(75, abs=3)


def test_poses_put_the_fruits_into_their_frame(tmp_path):
    folder = make_recording(tmp_path / "row", (0.0,))
    half = np.sqrt(0.5)
    # The camera looks along the session's y, its y axis points down.
    (folder / "poses_tum.txt").write_text(f"0 5 -2 1.5 {-half} 0 0 {half}\n")
    cloud = scanned(folder).cloud
    x, y, z = FRUITS["a"].centre
    np.testing.assert_allclose(cloud.positions[0], [5 + x, -2 + z, 1.5 - y], atol=0.001)
    # The covariance turns with it: its long axis along y now.
    assert np.argmax(np.diagonal(cloud.covariances[0])) == 1


def test_one_frame_needs_no_poses_and_no_ids(run_here, tmp_path):
    folder = make_recording(tmp_path / "2024-08-09", ids=False)
    assert run_here("scan", folder, "-o", tmp_path / "fruits.csv").returncode == 0
    cloud = FruitCloud.read(tmp_path / "fruits.csv")
    assert cloud.ids == ("0", "1", "2")
    assert cloud.n_views.tolist() == [1, 1, 1]


def test_more_frames_fuse_to_smaller_covariances(row, tmp_path):
    one = scanned(make_recording(tmp_path / "one")).cloud
    three = scanned(row).cloud
    assert (np.trace(three.covariances, axis1=1, axis2=2) < np.trace(one.covariances, axis1=1, axis2=2)).all()


def test_no_detections_are_a_valid_empty_session(run_here, row, tmp_path):
    (row / "detections.csv").write_text(HEADER + "\n")
    done = run_here("scan", row, "-o", tmp_path / "empty.gpkg")
    assert done.returncode == 0
    assert "found no boxes in 3 frames, so no fruits: check the file of the boxes" in done.stderr
    assert "0 fruits, from 0 boxes" in done.stdout
    assert "no fruit was found: there is nothing to add to a map" in done.stdout
    session = load_session(tmp_path / "empty.gpkg")
    assert len(session.cloud) == 0
    assert len(session.trajectory) == 3


def test_one_of_each_is_told_as_one(run_here, tmp_path):
    folder = make_recording(tmp_path / "2024-08-09")
    boxes = (folder / "detections.csv").read_text().splitlines()
    (folder / "detections.csv").write_text("\n".join(boxes[:2]) + "\n")
    done = run_here("scan", folder, "-o", tmp_path / "one.gpkg")
    assert "one.gpkg: 1 fruit, median diameter" in done.stdout
    assert "from 1 box in 1 frame\n" in done.stdout


def test_boxes_without_depth_are_counted(run_here, row, tmp_path):
    with (row / "detections.csv").open("a") as file:
        file.write("0,625,465,640,480,0.5,corner\n")
    done = run_here("scan", row, "-o", tmp_path / "fruits.csv")
    assert done.stdout.splitlines()[1:] == [
        "        10 boxes",
        "         9   of a fruit",
        "         1   cut by the edge of the picture",
        "         4 tracks",
        "         3   a fruit",
        "         1   never measured",
    ]
    assert len(FruitCloud.read(tmp_path / "fruits.csv")) == 3


def test_other_detections_name_and_date(run_here, row, tmp_path):
    other = tmp_path / "other.csv"
    other.write_text("\n".join(line for line in (row / "detections.csv").read_text().splitlines() if ",c" not in line))
    arguments = ("--detections", other, "--name", "row 3", "--date", "2024-08-10T09:30:00")
    assert run_here("scan", row, "-o", tmp_path / "session.gpkg", *arguments).returncode == 0
    session = load_session(tmp_path / "session.gpkg")
    assert (session.name, session.date, len(session.cloud)) == ("row 3", "2024-08-10T09:30:00", 2)


def test_an_unknown_date_is_said(run_here, tmp_path):
    folder = make_recording(tmp_path / "row")
    done = run_here("scan", folder, "-o", tmp_path / "session.gpkg")
    assert done.returncode == 0
    assert "no date noted" in done.stderr
    # And asked again before it goes into a map.
    orchard = tmp_path / "orchard.gpkg"
    asked = run_here("map", "add", orchard, tmp_path / "session.gpkg")
    assert asked.returncode == 2
    assert "was guessed from the age of files, say the day of the visit: --date YYYY-MM-DD" in asked.stderr
    assert not orchard.exists()
    assert "--date" in done.stderr


@pytest.mark.parametrize(("unit_m", "diameter"), [(0.01, r"7\d\d mm"), (0.0001, r"7\.\d+ mm")])
def test_a_wrong_depth_unit_is_said(run_here, tmp_path, unit_m, diameter):
    folder = make_recording(tmp_path / "2024-08-09")
    (folder / "calibration.json").write_text(json.dumps({**FIELDS, "depth_unit_m": unit_m}))
    done = run_here("scan", folder, "-o", tmp_path / "fruits.csv")
    assert done.returncode == 0
    said = rf"the median diameter is {diameter}, expected 10 to \d+ mm: check depth_unit_m {unit_m:g}"
    assert re.search(said, done.stderr)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"fy": 0.7 * FIELDS["fx"]}, "fy: found"),
        ({"cx": 0.5}, "cx: found 0.5, expected about the middle"),
        ({}, None),
    ],
)
def test_a_camera_that_is_no_rectified_one_is_told(run_here, tmp_path, changed, said):
    folder = make_recording(tmp_path / "2024-08-09")
    (folder / "calibration.json").write_text(json.dumps({**FIELDS, **changed}))
    err = run_here("scan", folder, "-o", tmp_path / "fruits.csv").stderr
    assert ("expected about" in err) == (said is not None)
    assert said is None or said in err


def test_frames_without_poses_and_colour_are_refused(run_here, tmp_path):
    folder = make_recording(tmp_path / "row", (0.0, 0.1), poses=False)
    output = tmp_path / "session.gpkg"
    assert_nothing_made(run_here("scan", folder, "-o", output), output, "found depth pictures and no poses")


@pytest.mark.parametrize("frames", [2, 8])
def test_boxes_without_ids_are_tracked(run_here, tmp_path, frames):
    folder = make_recording(tmp_path / "2024-08-09", tuple(0.03 * np.arange(frames)), ids=False)
    assert run_here("scan", folder, "-o", tmp_path / "fruits.csv").returncode == 0
    cloud = FruitCloud.read(tmp_path / "fruits.csv")
    assert cloud.ids == ("1", "2", "3")
    assert cloud.n_views.tolist() == [frames] * 3
    np.testing.assert_allclose(cloud.positions, [fruit.centre for fruit in FRUITS.values()], atol=0.001)


def test_ids_can_be_left_aside(run_here, tmp_path):
    folder = make_recording(tmp_path / "2024-08-09", tuple(0.03 * np.arange(6)))
    boxes = folder / "detections.csv"
    boxes.write_text(boxes.read_text().replace(",a\n", ",x\n", 2))  # two of them misnamed
    assert run_here("scan", folder, "-o", tmp_path / "named.csv").returncode == 0
    assert run_here("scan", folder, "-o", tmp_path / "tracked.csv", "--retrack").returncode == 0
    assert len(FruitCloud.read(tmp_path / "named.csv")) == 4
    assert len(FruitCloud.read(tmp_path / "tracked.csv")) == 3


def test_a_setting_of_the_tracker(run_here, tmp_path):
    folder = make_recording(tmp_path / "2024-08-09", tuple(0.03 * np.arange(6)), ids=False)
    settings = tmp_path / "pomona.toml"
    boxes = folder / "detections.csv"
    lines = boxes.read_text().splitlines()  # three boxes a frame; of the last four frames one each is left
    boxes.write_text("\n".join([*lines[:7], *lines[7::3]]) + "\n")
    for least, found in ((2, 3), (5, 1)):
        settings.write_text(f"[tracking]\nmin_views = {least}\n")
        assert run_here("scan", folder, "-o", tmp_path / "fruits.csv", "--config", settings).returncode == 0
        assert len(FruitCloud.read(tmp_path / "fruits.csv")) == found
    settings.write_text("[tracking]\nviews = 3\n")
    output = tmp_path / "other.csv"
    assert_nothing_made(run_here("scan", folder, "-o", output, "--config", settings), output, "views")


def test_a_recording_without_depth_is_refused(run_here, row, tmp_path):
    (row / "depth").rename(row / "left")
    output = tmp_path / "fruits.csv"
    assert_nothing_made(run_here("scan", row, "-o", output), output, "found left pictures, expected depth")


def test_a_corrupt_picture_in_the_middle_is_skipped_counted_and_named(run_here, row, tmp_path):
    picture = row / "depth" / "0001.png"
    picture.write_bytes(picture.read_bytes()[:500])
    done = run_here("scan", row, "-o", tmp_path / "fruits.csv", "--json")
    assert done.returncode == 0
    found = json.loads(done.stdout)
    assert (found["n_skipped_frames"], found["n_boxes"]) == (1, 9)
    assert found["boxes"] == {"fruit": 6, "skipped": 3}
    assert done.stderr.count("\n") == 1
    assert "skipped 1 of 3 frames" in done.stderr
    assert "0001.png" in done.stderr
    assert FruitCloud.read(tmp_path / "fruits.csv").n_views.tolist() == [2, 2, 2]


def test_fruits_are_what_was_seen_again(run_here, tmp_path):
    folder = make_recording(tmp_path / "2024-08-09", tuple(0.03 * np.arange(6)), ids=False)
    poses = folder / "poses_tum.txt"
    poses.write_text("".join(f"{0.1 * frame:.1f} {30 * frame} 0 0 0 0 0 1\n" for frame in range(6)))  # in millimetres
    done = run_here("scan", folder, "-o", tmp_path / "far.csv", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert (found["n_fruits"], found["n_boxes"], found["tracks"]) == (0, 18, {"few_views": 18})
    single = make_recording(tmp_path / "2024-08-10")  # nothing can be seen twice in one frame
    assert run_here("scan", single, "-o", tmp_path / "one.csv", "--retrack").returncode == 0
    assert len(FruitCloud.read(tmp_path / "one.csv")) == 3


@pytest.mark.parametrize(("n_frames", "n_fruits"), [(1, 0), (2, 3)])
def test_a_part_that_saw_nothing_twice_has_no_fruits(row, n_frames, n_fruits):
    recording = open_recording(row)
    (row / "detections.csv").write_text(
        "\n".join(line.rpartition(",")[0] for line in (row / "detections.csv").read_text().splitlines()) + "\n"
    )
    seeing = Seeing(recording, open_detector(None, None, recording))
    part = OpenPart(0, None, lambda _: Tracker(recording.calibration), Believing(recording.calibration, {}))
    frames = list(recording.frames())[:n_frames]
    for frame in frames:
        part.add(seeing(frame), frame.time_s, frame.session_from_camera)
    closed = part.closed(np.stack([frame.session_from_camera for frame in frames]))
    assert len(closed.cloud) == n_fruits
    assert closed.tally.boxes.total() == 3 * n_frames


def test_a_recording_that_cannot_be_read_leaves_the_old_session_as_it_was(run_here, row, tmp_path):
    output = tmp_path / "session.gpkg"
    assert run_here("scan", row, "-o", output).returncode == 0
    before = output.read_bytes()
    for picture in (row / "depth").iterdir():
        picture.write_bytes(picture.read_bytes()[:500])
    done = run_here("scan", row, "-o", output)
    assert done.returncode == 2
    assert "0000.png" in done.stderr
    assert output.read_bytes() == before
    assert sorted(file.name for file in tmp_path.iterdir()) == [row.name, "session.gpkg"]


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda row: (row / "calibration.json").unlink(), ["calibration.json"]),
        (lambda row: (row / "detections.csv").unlink(), ["found depth pictures", "expected left ones"]),
        (lambda row: (row / "detections.csv").write_text(f"{HEADER}\n9,1,2,3,4,1,a\n"), ["line 2", "frame: found 9"]),
        (lambda row: (row / "detections.csv").write_text(f"{HEADER}\n0,9,2,3,4,1,a\n"), ["line 2", "xmin 9"]),
        (lambda row: (row / "depth" / "0000.png").unlink(), ["3 poses", "2 frames"]),
    ],
)
def test_a_broken_folder_is_refused(run_here, row, tmp_path, change, named):
    change(row)
    output = tmp_path / "session.gpkg"
    assert_nothing_made(run_here("scan", row, "-o", output), output, *named)


def test_a_wrong_output_is_refused_before_the_work(run_here, row, tmp_path):
    (row / "depth" / "0000.png").write_bytes(b"")  # would be the error if work had begun
    for output, named in ((tmp_path / "session.txt", "suffix '.txt'"), (tmp_path / "no" / "s.csv", "is not there")):
        assert_nothing_made(run_here("scan", row, "-o", output), output, named)
    output = tmp_path / "session.gpkg"
    assert_nothing_made(run_here("scan", row, "-o", output, "--date", "9 August"), output, "--date", "ISO 8601")
    zoned = ("--date", "2024-08-09T14:30:00+02:00")
    assert_nothing_made(run_here("scan", row, "-o", output, *zoned), output, "--date", "local time")


def test_info_says_what_is_there(run_here, row):
    assert "frames         3" in run_here("info", row).stdout
    found = json.loads(run_here("info", row, "--json").stdout)
    assert (found["frames"], found["poses"], found["pictures"]) == (3, True, {"depth": 3})


def test_import_says_where_there_is_no_colour(run_here, shared_data, tmp_path):
    done = run_here("import", "kinect-apples", shared_data / "kinect_apples", tmp_path / "out")
    lines = done.stdout.splitlines()
    assert done.returncode == 0
    assert [("no colour picture" in line) for line in lines] == [True, True, False, False]
    again = run_here("import", "kinect-apples", shared_data / "kinect_apples", tmp_path / "out")
    assert again.returncode == 2
    assert "already there" in again.stderr


@pytest.fixture(scope="module")
def captures(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, FruitCloud]:
    return scanned_captures(shared_data, tmp_path_factory.mktemp("kinect"))


def test_captures_agree_at_least_as_well_as_the_positions_that_came_with_them(captures, shared_data):
    names = list(captures)
    ours, theirs = [], []
    for first, second in ((a, b) for a in names for b in names if a < b):
        shipped = [FruitCloud.read(shared_data / "kinect_apples" / f"{name}_fruits.csv") for name in (first, second)]
        scans = [captures[name] for name in (first, second)]
        common = sorted(set.intersection(*(set(cloud.ids) for cloud in (*shipped, *scans))))
        assert len(common) >= 27
        for found, clouds in ((ours, scans), (theirs, shipped)):
            found.append(rigid_residuals(*(rows_named(cloud, common).positions for cloud in clouds)))
    ours, theirs = np.concatenate(ours), np.concatenate(theirs)
    assert np.median(ours) < np.median(theirs) + 0.0001
    assert np.percentile(ours, 90) < np.percentile(theirs, 90)
    assert ours.max() < 0.012 < theirs.max()


def test_every_box_of_the_captures_becomes_a_fruit(captures):
    assert [len(cloud) for cloud in captures.values()] == [28, 28, 28, 28]
    # Behind the row of the scene, at 2.5 m and more, hang more apples.
    assert max(cloud.positions[:, 2].max() for cloud in captures.values()) < 2.0


@pytest.mark.parametrize("date", ["2024-08-09", "2024-08-28"])
def test_the_rendered_row_is_found_where_it_is(shared_data, tmp_path, date):
    source = shared_data / "rendered_row" / date
    with_true_boxes(source, tmp_path / date)
    cloud = scanned(tmp_path / date).cloud
    truth = rows_named(rendered_truth(source), list(cloud.ids))
    often = cloud.n_views >= 5
    distances_mm = 1000 * np.linalg.norm(cloud.positions - truth.positions, axis=1)[often]
    sizes_mm = 1000 * (cloud.diameters_m - truth.diameters_m)[often]
    assert often.sum() > 100
    assert np.median(distances_mm) < 3.0
    assert np.percentile(distances_mm, 95) < 7.0
    assert abs(sizes_mm.mean()) < 1.5
    assert np.sqrt((sizes_mm**2).mean()) < 3.0
    # The covariances tell the truth: the mean of chi^2 with 3 degrees of freedom is 3.
    errors = (cloud.positions - truth.positions)[often]
    mean_chi2 = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(cloud.covariances[often]), errors).mean()
    assert 1.5 < mean_chi2 < 4.5
