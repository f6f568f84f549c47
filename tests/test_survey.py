"""A scan read ahead, stopped, kept and taken up again, drawn; and the whole front end on stereo pictures."""

import csv
import json
import os
import shutil
import signal
import threading
from collections import Counter

import cv2
import numpy as np
import pytest
from benchmarks.lifting import rigid_residuals, rows_named
from benchmarks.recordings import detector, rendered_truth, true_boxes

from pomona.amounts import amount
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.orchard import load_session
from pomona.recording import Frame, open_recording
from pomona.recording.pictures import UnreadablePictureError
from pomona.survey import Kept, scan
from pomona.survey.prefetch import prefetched
from pomona.survey.preview import LEGIBLE_PX, lettering
from recording_maker import FIELDS, make_recording

STEPS_M = (0.0, 0.05, 0.1, 0.15)


@pytest.fixture
def row(tmp_path):
    return make_recording(tmp_path / "2024-08-09", STEPS_M)


def with_left(folder):
    """Give a recording grey left pictures with a red disc in each box."""
    (folder / "left").mkdir()
    boxes = list(csv.DictReader((folder / "detections.csv").read_text().splitlines()))
    for frame in range(len(STEPS_M)):
        picture = np.full((FIELDS["height"], FIELDS["width"], 3), 90, np.uint8)
        for box in (box for box in boxes if int(box["frame"]) == frame):
            x, y = ((float(box[f"{axis}min"]) + float(box[f"{axis}max"])) / 2 for axis in "xy")
            cv2.circle(picture, (round(x), round(y)), 14, (30, 40, 200), -1)
        assert cv2.imwrite(str(folder / "left" / f"{frame:04d}.png"), picture)
    return folder


def test_pictures_are_decoded_once_ahead_and_in_order():
    read, threads = [], set()

    def reader(number):
        def read_left():
            read.append(number)
            threads.add(threading.current_thread())
            return np.full((2, 2, 3), number, np.uint8)

        return read_left

    frames = (Frame(number=number, read_left=reader(number)) for number in range(5))
    for frame in prefetched(frames, ("left",)):
        assert frame.number in read
        assert frame.read_left() is frame.read_left()
        assert frame.read_left()[0, 0, 0] == frame.number
    assert read == [0, 1, 2, 3, 4]
    assert threading.main_thread() not in threads


def test_pictures_that_nobody_needs_are_not_decoded():
    def never():
        raise AssertionError("decoded")

    frames = list(prefetched([Frame(number=0, read_left=never, read_depth=lambda: np.ones((1, 1), np.float32))], ()))
    assert frames[0].read_depth()[0, 0] == 1


def test_a_picture_that_cannot_be_read_says_so_where_it_is_asked_for():
    def broken():
        raise UnreadablePictureError("0001.png: corrupt")

    frames = list(prefetched([Frame(number=0), Frame(number=1, read_left=broken), Frame(number=2)], ("left",)))
    assert [frame.number for frame in frames] == [0, 1, 2]
    for _ in range(2):
        with pytest.raises(UnreadablePictureError, match="corrupt"):
            frames[1].read_left()


def test_an_error_of_the_recording_comes_through():
    def frames():
        yield Frame(number=0)
        raise PomonaError("video.mp4: cut off")

    with pytest.raises(PomonaError, match="cut off"):
        list(prefetched(frames(), ()))


def test_a_scan_that_is_stopped_keeps_what_it_has(row):
    recording = open_recording(row)
    done = []
    survey = scan(
        recording,
        detector(row, recording),
        progress=lambda *state: done.append(state),
        stop=lambda: len(done) == 2,
    )
    assert done == [(1, 4, 3), (2, 4, 3)]
    assert survey.stopped == 1
    assert survey.trajectory.frames.tolist() == [0, 1]
    assert survey.cloud.n_views.tolist() == [2, 2, 2]


@pytest.fixture
def interrupted(monkeypatch):
    from pomona.detect.from_file import FileDetector

    look = FileDetector.__call__

    def interrupting(self, frame):
        if frame.number == 1:
            signal.raise_signal(signal.SIGINT)  # the real signal, as the terminal sends it
        return look(self, frame)

    monkeypatch.setattr(FileDetector, "__call__", interrupting)


def test_ctrl_c_writes_a_valid_session_and_says_so(pomona, row, tmp_path, interrupted):
    before = signal.getsignal(signal.SIGINT)
    code, printed, _ = pomona("scan", row, "-o", tmp_path / "session.gpkg")
    assert code == 130
    assert "stopped after frame" in printed
    session = load_session(tmp_path / "session.gpkg")
    assert len(session.cloud) == 3
    # Frames are looked at ahead, so the signal may come while the first is still followed.
    assert 1 <= len(session.trajectory) <= 2
    assert printed.splitlines()[0].endswith(f"in {amount(len(session.trajectory), 'frame')}")
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_replaces_nothing(pomona, row, tmp_path, request):
    keep, session, preview = tmp_path / "keep", tmp_path / "session.gpkg", tmp_path / "seen.mp4"
    whole = (with_left(row), "--keep", keep, "--preview", preview)
    assert pomona("scan", *whole, "-o", session)[0] == 0
    files = [session, preview, keep / "tracks.csv", keep / "poses_tum.txt"]
    before = [file.read_bytes() for file in files]
    shutil.rmtree(keep / "looks")
    request.getfixturevalue("interrupted")
    code, printed, told = pomona("scan", *whole, "-o", session)
    assert (code, printed) == (130, "")
    assert told.splitlines()[-1].endswith(f": {session} is left as it was")
    shutil.rmtree(keep / "looks")
    code, printed, told = pomona("scan", *whole, "-o", tmp_path / "new.gpkg")  # which writes it, and nothing else
    assert code == 130
    assert "stopped after frame" in printed
    assert f"{preview} is left as it was" in told
    assert [file.read_bytes() for file in files] == before


def test_every_from_and_to(pomona, row, tmp_path):
    code, printed, _ = pomona("scan", row, "-o", tmp_path / "s.gpkg", "--every", 2, "--from", 1, "--json")
    assert code == 0
    assert json.loads(printed)["n_frames"] == 2
    assert load_session(tmp_path / "s.gpkg").trajectory.frames.tolist() == [1, 3]


def test_what_is_kept_is_not_looked_at_again_and_changes_nothing(pomona, row, tmp_path):
    keep = tmp_path / "keep"
    assert pomona("scan", row, "-o", tmp_path / "plain.csv")[0] == 0
    assert pomona("scan", row, "-o", tmp_path / "first.csv", "--keep", keep)[0] == 0
    assert len(list((keep / "looks").iterdir())) == len(STEPS_M)
    for picture in (row / "depth").iterdir():  # the same size and age: only a look at it would tell
        stat = picture.stat()
        picture.write_bytes(b"\0" * stat.st_size)
        os.utime(picture, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert pomona("scan", row, "-o", tmp_path / "again.csv", "--keep", keep)[0] == 0
    plain = (tmp_path / "plain.csv").read_bytes()
    assert (tmp_path / "first.csv").read_bytes() == plain
    assert (tmp_path / "again.csv").read_bytes() == plain


def test_kept_stages_are_inputs_of_the_next_scan(pomona, row, tmp_path):
    keep = tmp_path / "keep"
    assert pomona("scan", row, "-o", tmp_path / "first.csv", "--keep", keep)[0] == 0
    tracks = keep / "tracks.csv"
    assert pomona("scan", row, "-o", tmp_path / "again.csv", "--detections", tracks)[0] == 0
    first, again = (FruitCloud.read(tmp_path / name) for name in ("first.csv", "again.csv"))
    assert first.ids == again.ids
    np.testing.assert_allclose(first.positions, again.positions, atol=2e-4)
    assert (keep / "poses_tum.txt").read_text().count("\n") == 1 + len(STEPS_M)


def test_looks_of_other_boxes_are_not_taken_up(pomona, row, tmp_path):
    keep = tmp_path / "keep"
    assert pomona("scan", row, "-o", tmp_path / "first.csv", "--keep", keep)[0] == 0
    with (row / "detections.csv").open("a") as file:
        file.write("0,100,100,120,120,0.5,d\n")
    code, _, told = pomona("scan", row, "-o", tmp_path / "again.csv", "--keep", keep)
    assert (code, told.count("\n")) == (2, 1)
    assert "made_from.json: files" in told
    assert "remove the folder" in told


def test_a_kept_frame_that_is_cut_off_is_named(row, tmp_path):
    recording = open_recording(row)
    kept = Kept(tmp_path / "keep", {})
    scan(recording, detector(row, recording), keep=kept)
    file = tmp_path / "keep" / "looks" / "000002.npz"
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(PomonaError, match=r"000002\.npz: not a kept frame"):
        scan(recording, detector(row, recording), keep=kept)


def test_fruits_have_the_colour_of_their_pictures(row):
    recording = open_recording(with_left(row))
    cloud = scan(recording, detector(row, recording)).cloud
    assert cloud.extras["colour"] == ("#c8281e",) * 3


def test_the_preview_shows_every_frame_with_boxes_on_it(pomona, row, tmp_path):
    av = pytest.importorskip("av")
    with_left(row)
    preview = tmp_path / "preview.mp4"
    assert pomona("scan", row, "-o", tmp_path / "fruits.csv", "--preview", preview)[0] == 0
    with av.open(str(preview)) as video:
        pictures = [frame.to_ndarray(format="bgr24") for frame in video.decode(video=0)]
    assert len(pictures) == len(STEPS_M)
    boxes = list(csv.DictReader((row / "detections.csv").read_text().splitlines()))
    for frame, picture in enumerate(pictures):
        assert picture.shape == (2 * FIELDS["height"], 2 * FIELDS["width"], 3)  # enlarged to be legible
        for box in (box for box in boxes if int(box["frame"]) == frame):
            x, y = round(2 * float(box["xmin"])), round(float(box["ymin"]) + float(box["ymax"]))
            edge = picture[y - 3 : y + 4, x - 1 : x + 2].astype(int)
            # Grey is what was there: an edge of a fruit's box has a strong colour.
            assert np.ptp(edge, axis=2).max() > 60


def test_a_preview_needs_pictures_and_a_name_that_says_video(pomona, row, tmp_path):
    for arguments, words in (
        (("--preview", tmp_path / "p.mp4"), "no left pictures"),
        (("--preview", tmp_path / "p.avi"), "suffix '.avi'"),
    ):
        code, _, told = pomona("scan", row, "-o", tmp_path / "fruits.csv", *arguments)
        assert (code, told.count("\n")) == (2, 1)
        assert words in told
        assert not list(tmp_path.glob("*.mp4"))
        assert not (tmp_path / "fruits.csv").exists()


def stereo_row(shared_data, folder, frames):
    """Left and right pictures of the rendered row with true boxes, no names, no poses; the true fruits of the boxes."""
    source = shared_data / "rendered_row" / "2024-08-09"
    for kind in ("left", "right"):
        (folder / kind).mkdir(parents=True)
        pictures = sorted((source / kind).iterdir())
        for number, frame in enumerate(frames):
            (folder / kind / f"{number:04d}{pictures[frame].suffix}").symlink_to(pictures[frame].resolve())
    (folder / "calibration.json").write_bytes((source / "calibration.json").read_bytes())
    number_of = {frame: number for number, frame in enumerate(frames)}
    boxes = [box for box in true_boxes(source) if box.frame in number_of]
    lines = [",".join(map(str, (number_of[box.frame], *box.box_px))) for box in boxes]
    (folder / "detections.csv").write_text("\n".join(["frame,xmin,ymin,xmax,ymax", *lines]) + "\n")
    return {(number_of[box.frame], tuple(map(float, box.box_px))): box.fruit for box in boxes}


def test_stereo_pictures_and_boxes_are_enough(shared_data, tmp_path):
    true_of = stereo_row(shared_data, tmp_path / "row", range(18))
    recording = open_recording(tmp_path / "row")
    survey = scan(recording, detector(tmp_path / "row", recording))
    (part,) = survey.parts
    boxes, votes = part.boxes, [Counter() for _ in range(len(part.cloud))]
    for frame, box_px, fruit in zip(boxes.frames.tolist(), boxes.boxes_px, boxes.fruits.tolist(), strict=True):
        if fruit >= 0:
            votes[fruit][true_of[frame, tuple(box_px)]] += 1
    names = [vote.most_common(1)[0][0] for vote in votes]
    often = {fruit for fruit, n in Counter(true_of.values()).items() if n >= 5}
    assert len(often) > 40
    assert abs(len(names) - len(often)) <= 3
    assert len(set(names)) == len(names)  # none in two
    truth = rows_named(rendered_truth(shared_data / "rendered_row" / "2024-08-09"), names)
    distances_m = rigid_residuals(part.cloud.positions, truth.positions)
    assert np.median(distances_m) < 0.02
    assert np.percentile(distances_m, 95) < 0.05
    sizes_m = part.cloud.diameters_m - truth.diameters_m
    assert np.sqrt((sizes_m**2).mean()) < 0.004
    assert all(len(colour) == 7 for colour in part.cloud.extras["colour"])


def test_where_the_track_breaks_a_new_session_begins(pomona, shared_data, tmp_path):
    stereo_row(shared_data, tmp_path / "2024-08-09", [*range(6), *range(28, 36)])
    code, printed, _ = pomona("scan", tmp_path / "2024-08-09", "-o", tmp_path / "row.gpkg", "--keep", tmp_path / "kept")
    assert code == 0
    first, second = (load_session(tmp_path / name) for name in ("row-part1.gpkg", "row.gpkg"))
    assert (first.name, second.name) == ("2024-08-09 part 1", "2024-08-09")
    assert max(first.trajectory.frames) <= 5 < min(second.trajectory.frames)
    assert not (tmp_path / "row-part2.gpkg").exists()
    assert {path.name for path in (tmp_path / "kept").glob("*.csv")} == {"tracks.csv", "tracks-part1.csv"}
    for session in (first, second):
        assert len(session.cloud) > 10
        np.testing.assert_allclose(session.trajectory.session_from_camera[0], np.eye(4), atol=1e-9)
    assert f"row.gpkg: {len(second.cloud)} fruits in the longest of 2 parts" in printed
    assert f"row-part1.gpkg: frames 0 to 5, {len(first.cloud)} fruits\n" in printed


def test_odometry_reads_no_poses_that_it_overrides(pomona, shared_data, tmp_path):
    stereo_row(shared_data, tmp_path / "2024-08-09", range(6))
    code, _, told = pomona("scan", tmp_path / "2024-08-09", "-o", tmp_path / "bare.csv")
    assert code == 0, told
    (tmp_path / "2024-08-09" / "poses_tum.txt").write_text("0.0 1 2\nnonsense\n")
    found = ("--odometry", "--poses", tmp_path / "no.tum")
    code, _, told = pomona("scan", tmp_path / "2024-08-09", "-o", tmp_path / "found.csv", *found)
    assert code == 0, told
    assert "no times of frames are taken from there" in told
    assert (tmp_path / "found.csv").read_bytes() == (tmp_path / "bare.csv").read_bytes()


def test_depth_can_be_measured_otherwise(pomona, shared_data, tmp_path):
    stereo_row(shared_data, tmp_path / "2024-08-09", range(6))
    clouds = {}
    for how in ("auto", "stereo", "dense"):
        code, _, _ = pomona("scan", tmp_path / "2024-08-09", "-o", tmp_path / f"{how}.csv", "--depth", how)
        assert code == 0
        clouds[how] = (tmp_path / f"{how}.csv").read_bytes()
    assert clouds["auto"] == clouds["stereo"] != clouds["dense"]
    code, _, told = pomona("scan", tmp_path / "2024-08-09", "-o", tmp_path / "no.csv", "--depth", "sgbm")
    assert (code, told.count("\n")) == (2, 1)
    assert "depth: found 'sgbm', expected stereo, dense or a stereo network" in told


@pytest.mark.parametrize("size_px", [(640, 360), (1280, 720), (1920, 1080), (3840, 2160)])
def test_letters_of_the_preview_are_legible_whatever_the_size(size_px):
    """Letters take the same part of the picture's height, and no fewer pixels than a letter has strokes."""
    times = -(-LEGIBLE_PX // size_px[0])
    height_px = times * size_px[1]
    (_, letter_px), _ = cv2.getTextSize("7", cv2.FONT_HERSHEY_SIMPLEX, 0.38 * lettering(height_px), 1)
    assert letter_px >= 8
    assert 1 / 100 <= letter_px / height_px <= 1 / 50


def test_the_table_adds_up_and_is_in_the_json_too(pomona, shared_data, tmp_path):
    stereo_row(shared_data, tmp_path / "2024-08-09", range(6))
    boxes = tmp_path / "2024-08-09" / "detections.csv"
    lines = boxes.read_text().splitlines()
    boxes.write_text("\n".join([*lines, "3,10,10,40,40", "3,600,1,620,21"]) + "\n")
    code, printed, told = pomona("scan", tmp_path / "2024-08-09", "-o", tmp_path / "row.csv", "--json")
    assert code == 0, told
    found = json.loads(printed)
    assert sum(found["boxes"].values()) == found["n_boxes"] == len(lines) + 1
    assert sum(found["tracks"].values()) == found["n_tracks"]
    assert found["tracks"]["fruit"] == found["n_fruits"] > 10
    assert found["boxes"]["fruit"] < found["n_boxes"]
    assert len(found["tracks"]) > 1
