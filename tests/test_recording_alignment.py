"""Right pictures that lie lower or are turned: measured, told and taken out."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from benchmarks.disturbed_boxes import misaligned
from tests.drive_scene import CALIBRATION, drive, sideways

from pomona.errors import PomonaWarning
from pomona.recording import Recording, open_recording
from pomona.recording.alignment import alignment_of, straightened


def recording(folder: Path, lower_px: float = 0.0, turned_deg: float = 0.0) -> Recording:
    """Three pairs whose right pictures are lower, and turned clockwise."""
    scene, change = drive(sideways(3)), misaligned(lower_px, -turned_deg)
    for side in ("left", "right"):
        (folder / side).mkdir(parents=True)
    for row in range(3):
        left, right, _ = scene.pictures(row)
        cv2.imwrite(str(folder / "left" / f"{row:04d}.png"), left)
        cv2.imwrite(str(folder / "right" / f"{row:04d}.png"), change(right, "right", row))
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


def test_what_no_knock_does_is_told_and_left(tmp_path: Path) -> None:
    odd = recording(tmp_path / "row", 4.0)
    with pytest.warns(PomonaWarning, match="calibrate the cameras again"):
        assert straightened(odd) is odd


def test_info_tells(pomona, tmp_path: Path) -> None:
    recording(tmp_path / "good")
    recording(tmp_path / "knocked", 0.0, 0.12)
    code, printed, _ = pomona("info", tmp_path / "good", "--check", "--json")
    assert (code, json.loads(printed)["misaligned"]) == (0, None)
    code, printed, _ = pomona("info", tmp_path / "knocked", "--check")
    assert code == 0
    assert "turned by 0.1" in next(line for line in printed.splitlines() if line.startswith("misaligned"))
