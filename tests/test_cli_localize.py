"""`pomona localize` as a user meets it: processes, poses, exit codes."""

import json
import re
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from benchmarks.row_drive import step_to

from command_line import run
from pomona import FruitCloud, Localizer
from pomona.detect.opening import open_detector
from pomona.localize import following
from pomona.recording import open_recording
from pomona.recording.poses import read_tum
from recording_maker import make_recording

ROW = Path(__file__).parents[1] / "examples" / "row"
MAP, DRIVE = ROW / "2024-08-09" / "fruits.csv", ROW / "2024-08-28"
FRAMES = ("--from", 4, "--to", 16, "--every", 4)


localize = partial(run, "localize")


def true_poses() -> np.ndarray:
    return read_tum(DRIVE / "poses_tum.txt")[1]


@pytest.fixture
def drive() -> tuple[object, ...]:
    return (DRIVE / "row.mp4", "--detections", DRIVE / "boxes.csv", *FRAMES)


@pytest.mark.parametrize("mode", [(), ("--single",)])
def test_every_frame_of_another_date_is_found(tmp_path, drive, mode):
    poses = tmp_path / "poses.tum"
    done = localize(MAP, *drive, *mode, "-o", poses, "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["statuses"] == {"Found": 4}
    assert told["n_tracked"] == (0 if mode else 3)
    times_s, found = read_tum(poses)
    assert times_s == pytest.approx([0.4, 0.8, 1.2, 1.6])
    assert poses.read_text().splitlines()[0].endswith("map_from_camera")
    for frame, pose, row in zip((4, 8, 12, 16), found, told["frames"], strict=True):
        step = step_to(pose, true_poses()[frame])
        assert np.linalg.norm(step[:3]) < 0.05
        assert np.degrees(np.linalg.norm(step[3:])) < 2.0
        assert row["frame"] == frame
        assert row["map_from_camera"] == pytest.approx(pose, abs=1e-6)
        assert np.linalg.eigvalsh(row["covariance"]).min() > 0


@pytest.mark.parametrize(("in_camera", "statuses"), [("0,-1,0", {"Found": 4}), ("0,1,0", {"NoMatch": 4})])
def test_the_vertical_leaves_only_poses_that_have_it(tmp_path, drive, in_camera, statuses):
    """Where it is right nothing is lost; told upside down it rules out the true pose, and there is no other."""
    in_map = true_poses()[10][:3, :3] @ (0, -1, 0)
    up = ("--up", in_camera, "--up", ",".join(f"{value:.4f}" for value in in_map))
    done = localize(MAP, *drive, "--single", "-o", tmp_path / "poses.tum", "--json", *up)
    assert json.loads(done.stdout)["statuses"] == statuses


def test_poses_go_to_the_standard_output_and_the_summary_does_not(drive):
    done = localize(MAP, *drive, "--single", "-o", "-")
    assert done.returncode == 0
    assert len(done.stdout.splitlines()) == 1 + 4
    assert "4 of 4 frames found among 436 fruits" in done.stderr


def test_no_frame_found_is_a_result(tmp_path, drive):
    rng = np.random.default_rng(1)
    elsewhere, poses = tmp_path / "elsewhere.csv", tmp_path / "poses.tum"
    rows = "\n".join(",".join(f"{value:.4f}" for value in place) for place in rng.uniform(0, (6, 1, 2), (300, 3)))
    elsewhere.write_text(f"x,y,z\n{rows}\n")
    done = localize(elsewhere, *drive, "-o", poses)
    assert done.returncode == 1
    assert "0 of 4 frames found" in done.stdout
    assert len(poses.read_text().splitlines()) == 1


def test_frames_of_few_fruits_are_numbered_where_nothing_is_timed(tmp_path):
    """Three fruits are too few; the exit code says that nothing was found."""
    folder = make_recording(tmp_path / "few", (0.0, 0.1), poses=False)
    done = localize(MAP, folder, "--single", "-o", tmp_path / "poses.tum", "--json")
    assert done.returncode == 1
    told = json.loads(done.stdout)
    assert told["statuses"] == {"TooFew": 2}
    assert [frame["time_s"] for frame in told["frames"]] == [0.0, 1.0]


def test_an_index_is_kept_beside_the_map_and_made_anew_where_the_map_has_changed(tmp_path, drive):
    index, poses, told = tmp_path / "row.index", tmp_path / "poses.tum", []
    grown = tmp_path / "grown.csv"
    grown.write_text(f"{MAP.read_text().rstrip()}\n9999,4.5,0.1,1.2,0.07\n")
    for map in (MAP, MAP, grown):
        done = localize(map, *drive, "--index", index, "-o", poses)
        assert done.returncode == 0, done.stderr
        assert "4 of 4 frames found" in done.stdout
        told.append(done.stderr)
    assert not told[0]
    assert not told[1]
    assert f"{index}: " in told[2]
    assert "made from another map" in told[2]
    assert "made anew" in told[2]


def test_a_recording_without_calibration_is_one_line(tmp_path):
    shutil.copy(DRIVE / "row.mp4", tmp_path / "row.mp4")
    done = localize(MAP, tmp_path / "row.mp4", "-o", tmp_path / "poses.tum")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "calibration" in done.stderr
    assert not (tmp_path / "poses.tum").exists()


def test_time_that_goes_back_is_one_line(tmp_path):
    folder = make_recording(tmp_path / "back", (0.0, 0.1, 0.2))
    (folder / "poses_tum.txt").write_text("0 0 0 0 0 0 0 1\n0.2 0 0 0 0 0 0 1\n0.1 0 0 0 0 0 0 1\n")
    done = localize(MAP, folder, "-o", tmp_path / "poses.tum")
    assert done.returncode == 2
    assert "does not come after" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("precious", ["orchard", "own_poses"])
def test_nothing_is_destroyed(tmp_path, precious):
    folder = make_recording(tmp_path / "few", (0.0, 0.1))
    own = tmp_path / "map.csv"
    own.write_text("x,y,z\n1,0,0\n0,1,0\n0,0,1\n")
    target = own if precious == "orchard" else folder / "poses_tum.txt"
    before = target.read_bytes()
    done = localize(own, folder, "-o", target)
    assert done.returncode == 2
    assert target.read_bytes() == before


class Told(Localizer):
    """Notes what it is told of the motion."""

    def __init__(self, map: object) -> None:
        super().__init__(map)
        self.moved_m: list[float | None] = []

    def update(self, cloud, moved=None, *, up=None):
        self.moved_m.append(None if moved is None else round(float(moved[0, 3]), 6))
        return super().update(cloud, moved, up=up)


def test_the_motion_past_a_picture_that_cannot_be_read_is_not_lost(tmp_path):
    folder = make_recording(tmp_path / "broken", (0.0, 0.02, 0.06, 0.12, 0.2))
    for frame in (1, 2):
        (folder / "depth" / f"000{frame}.png").write_bytes(b"no picture")
    localizer = Told(MAP)
    recording = open_recording(folder)
    way = following.localize(recording, open_detector(folder / "detections.csv", None, recording), localizer)
    assert sorted(way.skipped) == [1, 2]
    assert localizer.moved_m == [None, 0.12, 0.08]


def test_a_map_in_millimetres_is_named_and_read_as_it_says(tmp_path, drive):
    header, *lines = MAP.read_text().splitlines()
    columns = header.split(",")
    places = [[line.split(",")[columns.index(axis)] for axis in "xyz"] for line in lines]
    in_mm, poses = tmp_path / "mm.csv", tmp_path / "poses.tum"
    in_mm.write_text("x,y,z\n" + "".join(",".join(str(1000 * float(at)) for at in place) + "\n" for place in places))
    done = localize(in_mm, *drive, "--single", "-o", poses)
    assert done.returncode == 1
    assert "say so: --unit mm" in done.stderr
    done = localize(in_mm, *drive, "--single", "-o", poses, "--unit", "mm", "--json")
    assert json.loads(done.stdout)["statuses"] == {"Found": 4}
    session = ROW / "2024-08-09" / "row.gpkg"
    for unit, wrong in (("free", in_mm), ("mm", session)):
        done = localize(wrong, *drive, "-o", tmp_path / "other.tum", "--unit", unit)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert done.stderr.startswith("pomona: --unit: found ")


@pytest.mark.parametrize(("factor", "said"), [(1.0, None), (1.06, "shorter"), (0.94, "longer")])
def test_metres_that_are_not_the_maps_are_told(tmp_path, factor, said):
    """Frames are found all the same, and every pose is off by as much."""
    known = FruitCloud.read(MAP)
    FruitCloud(factor * known.positions).write(tmp_path / "map.csv")
    video = (DRIVE / "row.mp4", "--detections", DRIVE / "boxes.csv")
    done = localize(tmp_path / "map.csv", *video, "-o", tmp_path / "poses.tum", "--json")
    told = json.loads(done.stdout)
    assert told["n_found"] > 40
    if said is None:
        assert (told["length_in_map"], done.stderr) == (None, "")
    else:
        assert told["length_in_map"] == pytest.approx(factor, abs=0.03)
        assert re.search(rf"row.mp4: fruits lie [4567]% {said} apart in the frames than in the map", done.stderr)
