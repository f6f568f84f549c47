"""Right pictures that lie lower or are turned: measured, told and taken out."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from benchmarks.disturbed_boxes import misaligned
from tests.drive_scene import CALIBRATION, drive, sideways

from pomona.errors import PomonaWarning
from pomona.recording import Recording, open_recording
from pomona.recording.alignment import alignment_of, straightened
from pomona.recording.eye_lag import lag_of


def recording(
    folder: Path, lower_px: float = 0.0, turned_deg: float = 0.0, size: float = 1.0, frames: int = 3, pace: float = 1.0
) -> Recording:
    """Pairs whose right pictures are lower, turned clockwise, and larger."""
    scene, change = drive(sideways(frames, pace=pace)), misaligned(lower_px, -turned_deg)
    for side in ("left", "right"):
        (folder / side).mkdir(parents=True)
    for row in range(frames):
        left, right, _ = scene.pictures(row)
        cv2.imwrite(str(folder / "left" / f"{row:04d}.png"), left)
        larger = cv2.getRotationMatrix2D((CALIBRATION.cx - 0.5, CALIBRATION.cy - 0.5), 0.0, size)
        right = cv2.warpAffine(change(right, "right", row), larger, right.shape[1::-1], flags=cv2.INTER_CUBIC)
        cv2.imwrite(str(folder / "right" / f"{row:04d}.png"), right)
    names = ("width", "height", "fx", "fy", "cx", "cy", "baseline_m")
    numbers = {name: getattr(CALIBRATION, name) for name in names}
    (folder / "calibration.json").write_text(json.dumps(numbers))
    return open_recording(folder)


def test_a_good_pair_is_left_alone(tmp_path: Path) -> None:
    good = recording(tmp_path / "row")
    assert straightened(good) is good


@pytest.mark.parametrize(("lower_px", "turned_deg"), [(0.5, 0.0), (2.0, 0.0), (-3.0, 0.0), (0.0, 0.5), (1.5, -0.3)])
def test_offset_and_turn_are_measured(tmp_path: Path, lower_px: float, turned_deg: float) -> None:
    found = alignment_of(recording(tmp_path / "row", lower_px, turned_deg))
    assert found is not None
    assert found.is_off
    assert found.is_correctable
    assert found.lower_px == pytest.approx(lower_px, abs=0.2)
    assert np.degrees(found.turned_rad) == pytest.approx(turned_deg, abs=0.05)


def test_a_knocked_camera_is_told_and_taken_out(tmp_path: Path) -> None:
    knocked = recording(tmp_path / "row", 2.0, 0.3)
    with pytest.warns(
        PomonaWarning, match=r"the right picture is 2\.\d px lower and turned by 0\.3\d degrees: taken out"
    ):
        straight = straightened(knocked)
    again = alignment_of(straight)
    assert again is not None
    assert not again.is_off
    assert (straight.numbers, len(straight), straight.path) == (knocked.numbers, len(knocked), knocked.path)


def rewritten(row: Recording, eyes: tuple[str, ...], seen_from: np.ndarray) -> Recording:
    """The recording whose eyes show what was seen at other places, (H, W, 2) in pixels."""
    for file in (file for eye in eyes for file in (row.path / eye).iterdir()):
        moved = cv2.remap(cv2.imread(str(file)), *np.moveaxis(seen_from.astype(np.float32), -1, 0), cv2.INTER_CUBIC)
        cv2.imwrite(str(file), moved)
    return open_recording(row.path)


def normalised() -> np.ndarray:
    """Places of the pixels from the principal point in focal lengths, (H, W, 2)."""
    columns, rows = np.meshgrid(np.arange(CALIBRATION.width) + 0.5, np.arange(CALIBRATION.height) + 0.5)
    return np.stack([(columns - CALIBRATION.cx) / CALIBRATION.fx, (rows - CALIBRATION.cy) / CALIBRATION.fy], axis=-1)


def in_pixels(places: np.ndarray) -> np.ndarray:
    return places * (CALIBRATION.fx, CALIBRATION.fy) + (CALIBRATION.cx - 0.5, CALIBRATION.cy - 0.5)


@pytest.mark.parametrize("k1", [-0.25, -0.12, 0.12])
def test_a_lens_that_is_not_taken_out_is_told(pomona, tmp_path: Path, k1: float) -> None:
    """Not as right pictures that are turned, or late; of both eyes alike."""
    bent = normalised()
    straight = bent
    for _ in range(20):
        straight = bent / (1 + k1 * (straight**2).sum(axis=-1, keepdims=True))
    row = rewritten(recording(tmp_path / "row", frames=6), ("left", "right"), in_pixels(straight))
    found = alignment_of(row)
    assert found is not None
    assert found.bend is not None
    assert found.bend.k1 == pytest.approx(k1, rel=0.5)
    with pytest.warns(
        PomonaWarning, match=r"rows of left and right part towards the corners, .*: rectify the pictures"
    ):
        assert straightened(row) is row
    code, printed, _ = pomona("info", row.path, "--check")
    assert code == 1
    assert "a lens that is not taken out" in printed


@pytest.mark.parametrize("turned_deg", [-1.0, 0.5])
def test_an_eye_that_is_turned_about_the_vertical_is_told(tmp_path: Path, turned_deg: float) -> None:
    turned = seen_by_a_turned_eye(np.radians(turned_deg))
    found = alignment_of(rewritten(recording(tmp_path / "row", frames=6), ("right",), turned))
    assert found is not None
    assert found.bend is not None
    assert abs(np.degrees(found.bend.turned_rad)) == pytest.approx(abs(turned_deg), rel=0.3)


def seen_by_a_turned_eye(turn_rad: float) -> np.ndarray:
    """Where an eye that is turned about the vertical sees what a straight one sees at the pixels, (H, W, 2)."""
    rays = np.concatenate([normalised(), np.ones((CALIBRATION.height, CALIBRATION.width, 1))], axis=-1)
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    rays = rays @ np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    return in_pixels(rays[..., :2] / rays[..., 2:])


def among_leaves(row: Recording, turned_deg: float, sigma_px: float) -> Recording:
    """The recording with a turned right eye, in whose pictures every patch lies elsewhere by this much."""
    rng, turned = np.random.default_rng(5), seen_by_a_turned_eye(np.radians(turned_deg))
    for file in sorted((row.path / "right").iterdir()):
        moved = cv2.GaussianBlur(rng.normal(size=turned.shape), (0, 0), 8.0)
        seen_from = (turned + sigma_px * moved / moved.std()).astype(np.float32)
        cv2.imwrite(str(file), cv2.remap(cv2.imread(str(file)), *np.moveaxis(seen_from, -1, 0), cv2.INTER_CUBIC))
    return open_recording(row.path)


@pytest.mark.parametrize("turned_deg", [-0.5, 0.0, 0.5])
def test_an_eye_that_is_turned_is_told_among_leaves(pomona, tmp_path: Path, turned_deg: float) -> None:
    """Where corners err by more than it parts them many of them tell, and nothing else is told."""
    row = among_leaves(recording(tmp_path / "row", frames=24), turned_deg, 0.6)
    code, printed, _ = pomona("info", row.path, "--check")
    told = next(line for line in printed.splitlines() if line.startswith("misaligned"))
    assert (code, "about the vertical (by 0.5 degrees)" in told) == ((1, True) if turned_deg else (0, False))


def test_what_no_knock_does_is_told_and_left(tmp_path: Path) -> None:
    odd = recording(tmp_path / "row", 4.0)
    with pytest.warns(PomonaWarning, match="calibrate the cameras again"):
        assert straightened(odd) is odd


@pytest.mark.parametrize("side", ["larger", "smaller"])
def test_another_size_is_told_and_taken_out(tmp_path: Path, side: str) -> None:
    stretch = 0.01 if side == "larger" else -0.01
    odd = recording(tmp_path / "row", size=1 + stretch)
    found = alignment_of(odd)
    assert found is not None
    assert found.stretch == pytest.approx(stretch, abs=0.002)
    with pytest.warns(PomonaWarning, match=rf"and (0\.9|1\.0|1\.1)% {side}: taken out"):
        straight = straightened(odd)
    again = alignment_of(straight)
    assert again is not None
    assert not again.is_off


@pytest.mark.parametrize(("lower_px", "turned_deg", "size"), [(15.0, 0.0, 1.0), (0.0, 4.0, 1.0), (0.0, 0.0, 1.05)])
def test_what_lies_beyond_the_rows_that_are_searched_is_told(
    tmp_path: Path, lower_px: float, turned_deg: float, size: float
) -> None:
    found = alignment_of(recording(tmp_path / "row", lower_px, turned_deg, size))
    assert found is not None
    assert (found.is_off, found.is_correctable) == (True, False)
    measured = [found.lower_px, np.degrees(found.turned_rad), 1 + found.stretch]
    np.testing.assert_allclose(measured, [lower_px, turned_deg, size], atol=0.7)


def test_info_fails_where_a_scan_would(pomona, tmp_path: Path) -> None:
    recording(tmp_path / "far", 15.0)
    code, printed, _ = pomona("info", tmp_path / "far", "--check")
    assert code == 1
    assert "px lower" in next(line for line in printed.splitlines() if line.startswith("misaligned"))


def test_one_camera_twice_is_refused(pomona, tmp_path: Path) -> None:
    row = recording(tmp_path / "row").path
    for picture in row.glob("left/*"):
        (row / "right" / picture.name).write_bytes(picture.read_bytes())
    code, _, told = pomona("info", row, "--check")
    assert code == 2
    assert "found the same picture in 3 of 3 frames" in told


def test_info_tells(pomona, tmp_path: Path) -> None:
    recording(tmp_path / "good")
    recording(tmp_path / "knocked", 0.0, 0.12)
    code, printed, _ = pomona("info", tmp_path / "good", "--check", "--json")
    assert (code, json.loads(printed)["misaligned"]) == (0, None)
    code, printed, _ = pomona("info", tmp_path / "knocked", "--check")
    assert code == 0
    assert "turned by 0.1" in next(line for line in printed.splitlines() if line.startswith("misaligned"))


def late(source: Path, folder: Path, frames: int) -> Recording:
    """The recording with right pictures that are so many frames late."""
    shutil.copytree(source, folder, symlinks=True)
    rights = sorted((source / "right").iterdir())
    for row, file in enumerate(sorted((folder / "right").iterdir())):
        file.unlink()
        shutil.copy(rights[min(max(row - frames, 0), len(rights) - 1)], file)
    return open_recording(folder)


@pytest.mark.parametrize(
    ("frames", "when"), [(1, "are a frame late"), (-1, r"were taken (0\.9|1\.0)\d of a frame after")]
)
def test_right_pictures_of_other_frames_are_told(pomona, tmp_path: Path, frames: int, when: str) -> None:
    row = late(recording(tmp_path / "row", frames=8).path, tmp_path / "late", frames)
    with pytest.warns(PomonaWarning, match=rf"the right pictures {when}.*: trigger the cameras at once"):
        assert straightened(row) is row
    code, printed, _ = pomona("info", row.path, "--check")
    assert code == 1
    assert re.search(when, printed)


@pytest.mark.parametrize(("date", "frames", "when"), [("08-09", -1, "early"), ("08-28", 1, "late")])
def test_they_are_told_of_a_fast_camera_too(
    shared_data: Path, tmp_path: Path, date: str, frames: int, when: str
) -> None:
    """Its pictures of two moments have too few corners in common to tell by what part of a frame."""
    found = alignment_of(late(shared_data / f"rendered_row/2024-{date}", tmp_path / "row", frames))
    assert found is not None
    assert f"a frame {when}" in str(found)


@pytest.mark.parametrize("late_by", [-1, 0, 1, 2])
def test_eyes_that_are_not_triggered_at_once_are_told_with_by_how_much(tmp_path: Path, late_by: int) -> None:
    """Of every fourth picture the right one is of others between."""
    fine, row = recording(tmp_path / "fine", frames=40, pace=0.1).path, tmp_path / "row"
    for side, first in (("left", 1), ("right", 1 + late_by)):
        (row / side).mkdir(parents=True)
        for frame, file in enumerate(sorted((fine / side).iterdir())[first::4]):
            shutil.copy(file, row / side / f"{frame:04d}.png")
    shutil.copy(fine / "calibration.json", row)
    found = lag_of(open_recording(row))
    assert found is not None
    assert found.frames == pytest.approx(late_by / 4, abs=0.05)
    assert found.is_told == (late_by != 0)


def along_the_baseline(folder: Path, n_alike: int) -> Recording:
    """Steps as long as the baseline: each right picture is the next left one; `n_alike` rows show in more than one."""
    rng = np.random.default_rng(3)
    posts = cv2.GaussianBlur(rng.integers(0, 255, (n_alike, 800), np.uint8), (0, 0), 2)
    seen = [cv2.GaussianBlur(rng.integers(0, 255, (180, 320), np.uint8), (0, 0), 2) for _ in range(13)]
    for frame, picture in enumerate(seen):
        picture[100 : 100 + n_alike] = posts[:, 12 * frame : 12 * frame + 320]
    for side, first in (("left", 0), ("right", 1)):
        (folder / side).mkdir(parents=True)
        for frame in range(12):
            cv2.imwrite(str(folder / side / f"{frame:04d}.png"), seen[frame + first])
    numbers = {"width": 320, "height": 180, "fx": 210, "fy": 210, "cx": 160, "cy": 90, "baseline_m": 0.1}
    (folder / "calibration.json").write_text(json.dumps(numbers))
    return open_recording(folder)


@pytest.mark.parametrize("n_alike", [4, 16, 20, 60])
def test_steps_along_the_baseline_do_not_make_pictures_late(tmp_path: Path, n_alike: int) -> None:
    found = alignment_of(along_the_baseline(tmp_path / "row", n_alike))
    assert found is None or not found.is_off


@pytest.mark.parametrize("name", ["rendered_row/2024-08-09", "rendered_row/2024-08-28", "kitti_stereo"])
def test_real_pairs_are_of_one_time(shared_data: Path, name: str) -> None:
    found = alignment_of(open_recording(shared_data / name))
    assert found is not None
    assert found.frames_late == 0


def test_tall_pictures_are_measured_in_a_halving(tmp_path: Path) -> None:
    row = recording(tmp_path / "row", 1.0).path
    for file in row.glob("*/*.png"):
        cv2.imwrite(str(file), cv2.resize(cv2.imread(str(file)), None, fx=3, fy=3, interpolation=cv2.INTER_CUBIC))
    numbers = json.loads((row / "calibration.json").read_text())
    larger = {name: 3 * numbers[name] for name in ("width", "height", "fx", "fy", "cx", "cy")}
    (row / "calibration.json").write_text(json.dumps(numbers | larger))
    found = alignment_of(open_recording(row))
    assert found is not None
    assert found.lower_px == pytest.approx(3.0, abs=0.3)
    assert np.degrees(found.turned_rad) == pytest.approx(0.0, abs=0.05)
