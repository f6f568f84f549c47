"""`pomona synth video` as a user meets it, and what its parts promise."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from command_line import run
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.recording import open_recording
from pomona.recording.calibration import Calibration
from pomona.render.camera_path import PATHS, camera_path, pairs_along
from pomona.render.filming import Filming, film
from pomona.render.motion_blur import blurred, moved_while_open, right_depth_m
from pomona.render.sensor import Sensor, exposure_for
from pomona.render.weather import WEATHERS, draw_weather
from pomona.synth.living import RowDesign

SMALL = ("--trees", "1", "--pairs", "10", "--width", "320", "--height", "180", "--date", "2024-09-01")
REACH_M = (0.0, 8.0)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("video") / "row"
    done = run("synth", "video", "-o", folder, *SMALL)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{folder}: 10 pairs of 320x180\n"
    return folder


def content(folder):
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def test_a_video_opens_as_a_recording_with_its_truth(recording):
    opened = open_recording(recording)
    assert (len(opened), opened.date) == (10, "2024-09-01")
    frame = next(iter(opened.frames([4])))
    left, right = frame.read_left(), frame.read_right()
    assert left.shape == right.shape == (180, 320, 3)
    assert 40 < left.mean() < 200
    assert np.isfinite(frame.session_from_camera).all()


def test_a_scan_of_it_finds_its_fruits(recording, tmp_path):
    """By true boxes, with depth between left and right: the fruits that show well are found where they are."""
    session = tmp_path / "row.gpkg"
    done = run("scan", recording, "-o", session, "--depth", "stereo", "--retrack", "--json")
    assert done.returncode == 0, done.stderr
    boxes = np.genfromtxt(recording / "boxes.csv", delimiter=",", names=True)
    wide = np.minimum(boxes["xmax"] - boxes["xmin"], boxes["ymax"] - boxes["ymin"]) >= 7
    ids, frames = np.unique(boxes["id"][(boxes["visible"] > 0.5) & wide], return_counts=True)
    well_shown = ids[frames >= 5].astype(int)
    truth, found = FruitCloud.read(recording / "fruits.csv"), FruitCloud.read(session)
    places = truth.positions[[truth.ids.index(str(number)) for number in well_shown]]
    errors_m, rows = cKDTree(found.positions).query(places)
    assert len(places) >= 10
    assert (errors_m < 0.02).mean() >= 0.9
    assert np.median(errors_m) < 0.008
    assert len(np.unique(rows)) == len(rows)
    assert len(found) == json.loads(done.stdout)["n_fruits"] <= len(np.unique(boxes["id"]))


def test_an_interrupted_video_is_gone_on_with(recording, tmp_path):
    folder = tmp_path / "row"
    shutil.copytree(recording, folder)
    for name in ("left/0007.png", "left/0008.png", "left/0009.png", "ids/0008.png", "calibration.json", "boxes.csv"):
        (folder / name).unlink()
    kept_s = (folder / "left/0006.png").stat().st_mtime_ns
    assert run("synth", "video", "-o", folder, *SMALL).returncode == 0
    assert content(folder) == content(recording)
    assert (folder / "left/0006.png").stat().st_mtime_ns == kept_s


def test_a_video_of_other_settings_is_refused(recording):
    before = content(recording)
    done = run("synth", "video", "-o", recording, *SMALL, "--seed", 5)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "seed: found 0, expected 5: remove the folder or take another" in done.stderr
    for flags, named in (
        (("--system", "wall"), "design.system: found 'spindle', expected 'wall': remove"),
        (("--shutter-ms", 3), "eyes[0].shutter_s: found 0.002, expected 0.003: remove"),
    ):
        assert named in run("synth", "video", "-o", recording, *SMALL, *flags).stderr
    assert content(recording) == before


def test_a_folder_of_something_else_is_refused(tmp_path):
    (tmp_path / "mine.txt").write_text("notes")
    done = run("synth", "video", "-o", tmp_path, *SMALL)
    assert done.returncode == 2
    assert "is there already and is not a rendered recording" in done.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (("--trees", "0"), "--trees: found 0"),
        (("--system", "vase"), "--system: found 'vase'"),
        (("--jitter", "nan"), "--jitter': found 'nan', expected less than or equal to 1"),
        (("--width", "0"), "width, height: found a size of 0x180"),
        (("--width", "99999"), "width, height: found a size of 99999x180"),
        (("--path", "boat"), "no path is called 'boat'; expected one of tractor"),
        (("--weather", "snow"), "no weather is called 'snow'; expected one of sun"),
        (("--renderer", "brush"), "no renderer is called 'brush'; expected one of raster"),
    ],
)
def test_what_cannot_be_is_one_line_and_writes_nothing(tmp_path, asked, said):
    done = run("synth", "video", "-o", tmp_path / "row", *SMALL, *asked)
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "row").exists()


def test_a_row_without_fruit_is_refused(tmp_path):
    bare = Filming(design=RowDesign(n_trees=1, fruits_per_tree=(0, 0), row_behind=False), seed=3)
    with pytest.raises(PomonaError, match="seed 3: no fruit hangs on 2024-08-09, expected some to film"):
        film(bare, tmp_path / "row")
    assert not (tmp_path / "row").exists()


@pytest.mark.parametrize("path", PATHS)
def test_every_path_sees_the_row_all_along(path):
    poses = camera_path(path, REACH_M, 60, seed=1).session_from_camera
    rotations, places = poses[:, :3, :3], poses[:, :3, 3]
    assert np.allclose(rotations @ rotations.transpose(0, 2, 1), np.eye(3))
    assert np.allclose(np.linalg.det(rotations), 1.0)
    nearest = np.stack([places[:, 0].clip(*REACH_M), np.zeros(60)], axis=1)
    level = nearest - places[:, :2]
    towards_row = (level / np.linalg.norm(level, axis=1, keepdims=True) * rotations[:, :2, 2]).sum(axis=1)
    assert (towards_row > 0.8).all()
    assert places[:, 0].min() < 0.4
    assert places[:, 0].max() > 7.6


def test_paths_differ_as_they_are_called():
    ways = {name: camera_path(name, REACH_M, 60, seed=1).session_from_camera for name in PATHS}
    assert ways["tractor-back"][0, 0, 3] > ways["tractor-back"][-1, 0, 3]
    assert (ways["other-side"][:, 1, 3] > 1.0).all()
    assert (ways["upside-down"][:, 2, 1] > 0.9).all()  # the camera's down is up
    assert (ways["upside-down-back"][:, 2, 1] > 0.9).all()
    assert (ways["tractor"][:, 2, 1] < -0.9).all()
    for name in ("upside-down-back", "walking-far"):
        assert ways[name][0, 0, 3] > ways[name][-1, 0, 3]
    assert ways["walking-far"][:, 1, 3].mean() < ways["hand-held"][:, 1, 3].mean() - 0.5
    assert (np.diff(ways["hand-held"][:, 0, 3]).std() > 2 * np.diff(ways["tractor"][:, 0, 3]).std()).all()
    assert pairs_along("fast", REACH_M) < pairs_along("tractor", REACH_M) < pairs_along("hand-held", REACH_M)


def test_the_way_around_sees_both_sides_and_comes_back():
    pairs = pairs_along("around", REACH_M)
    poses = camera_path("around", REACH_M, pairs, seed=1).session_from_camera
    places, steps_m = poses[:, :3, 3], np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    assert places[:, 1].min() < -1.4
    assert places[:, 1].max() > 1.4
    assert steps_m.max() < 0.25  # 1.8 m/s at 10 Hz, some 5 % faster at times, and the shake
    middles = np.stack([places[:, 0].clip(*REACH_M), np.zeros(pairs)], axis=1)
    assert np.allclose(np.linalg.norm(places[:, :2] - middles, axis=1), 1.5, atol=0.03)
    again = camera_path("tractor", REACH_M, 44, seed=1).session_from_camera
    nearest_m = np.linalg.norm(again[:, :3, 3] - places[-1], axis=1)
    assert nearest_m.min() < 0.15
    assert 1.0 < again[nearest_m.argmin(), 0, 3] < 2.0


def test_a_path_is_its_seed():
    same, again, other = (camera_path("tractor", REACH_M, 20, seed, jitter=1.0) for seed in (4, 4, 5))
    assert np.array_equal(same.session_from_camera, again.session_from_camera)
    assert not np.allclose(same.session_from_camera, other.session_from_camera)


@pytest.mark.parametrize("kind", WEATHERS)
def test_weathers_lie_within_what_they_are_called(kind):
    drawn = [draw_weather(kind, seed) for seed in range(50)]
    assert all(0.0 < weather.sun_elevation_rad < np.pi / 2 for weather in drawn)
    strengths = np.array([weather.sun_strength for weather in drawn])
    assert (strengths == 0).all() if kind == "overcast" else np.unique(strengths).size == 50
    with pytest.raises(PomonaError, match="no weather is called"):
        draw_weather("snow", 0)


GREY = np.full((90, 160, 3), 0.3, np.float32)


def test_exposure_goes_in_thirds_of_a_stop_and_brings_grey_to_grey():
    factors = [exposure_for(GREY * light) for light in np.geomspace(0.05, 20.0, 40)]
    stops = 3.0 * np.log2(factors)
    assert np.allclose(stops, np.round(stops))
    assert 10 < len(np.unique(factors)) < 40
    calm = Sensor(vignetting=0.0, full_well=1e9, read_noise=0.0)
    means = [calm.develop(GREY * light, exposure_for(GREY * light), rng()).mean() for light in (0.05, 1.0, 20.0)]
    assert max(means) - min(means) < 25


def rng():
    return np.random.default_rng(0)


def test_a_darker_eye_is_darker_and_corners_too():
    calm = Sensor(vignetting=0.3, full_well=1e9, read_noise=0.0)
    bright = calm.develop(GREY, 0.4, rng())
    assert replace(calm, gain=0.7).develop(GREY, 0.4, rng()).mean() < bright.mean() - 10
    assert bright[0, 0].mean() < bright[45, 80].mean() - 10
    blue, green, red = replace(calm, white_balance=(1.3, 0.8)).develop(GREY, 0.4, rng()).mean(axis=(0, 1))
    assert red > green > blue


def test_noise_grows_where_light_lacks():
    noise = [Sensor(vignetting=0.0).develop(GREY / factor, 0.4 * factor, rng()).std() for factor in (1.0, 100.0)]
    assert 0 < noise[0] < 0.5 * noise[1]


CAMERA = Calibration(160, 90, 100.0, 100.0, 80.0, 45.0, 0.12)


def test_motion_blurs_along_the_way_by_its_length():
    """A stripe 2 m away, the camera 100 mm to the right while it is exposed: 5 px."""
    light = np.zeros((90, 160, 3), np.float32)
    light[:, 80] = 1.0
    moved = np.eye(4)
    moved[0, 3] = -0.1
    smeared = blurred(light, np.full((90, 160), 2.0, np.float32), CAMERA, moved)[45, :, 0]
    spread = np.flatnonzero(smeared > 1e-3)
    assert 5 <= spread[-1] - spread[0] + 1 <= 7
    assert smeared.sum() == pytest.approx(1.0, abs=0.05)
    assert np.array_equal(blurred(light, np.full((90, 160), 200.0, np.float32), CAMERA, moved), light)


def test_a_shutter_opens_for_its_share_of_the_way():
    way = camera_path("tractor", REACH_M, 50, seed=0)
    speed_m_s = 1.8
    moved = moved_while_open(way, 20, 0.01)
    assert np.linalg.norm(moved[:3, 3]) == pytest.approx(0.01 * speed_m_s, rel=0.3)


def test_depth_is_carried_to_the_right_eye():
    depth_m = np.full((90, 160), 4.0, np.float32)
    depth_m[:, 60:80] = 1.0  # 12 px against 3
    carried = right_depth_m(depth_m, CAMERA)
    assert (carried[:, 48:68] == 1.0).all()
    assert (carried[:, 90:150] == 4.0).all()


def test_what_the_left_eye_does_not_see_is_as_far_as_beside():
    """A near post before a wall: the wall comes out behind it, and at the right edge of the right picture."""
    depth_m = np.full((CAMERA.height, CAMERA.width), 4.0, np.float32)
    depth_m[:, 100:140] = 1.0
    depth_m[0] = np.inf
    carried = right_depth_m(depth_m, CAMERA)
    near = carried[1:] == 1.0
    assert (near.sum(axis=1) == 40).all()
    assert (carried[1:][~near] == 4.0).all()
    assert (carried[0] >= 1e4).all()
