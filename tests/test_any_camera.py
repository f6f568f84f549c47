"""Scans of the rendered row as worse detectors and cameras see it; `python -m benchmarks disturbed` has all cases."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.disturbed import CASES, Date, Scanned, date_row
from benchmarks.disturbed_boxes import write_recording
from benchmarks.recordings import DATES, TrueBox, detector

from pomona.errors import PomonaWarning
from pomona.recording import open_recording
from pomona.survey import scan

CASE = {case.name: case for case in CASES}


@pytest.fixture(scope="module")
def date(shared_data: Path) -> Date:
    return Date(shared_data / "rendered_row" / DATES[0])


def scanned(date: Date, name: str, folder: Path) -> tuple[Scanned, dict[str, object]]:
    found = date.scanned(CASE[name], 7, folder / "row")
    assert found is not None
    return found, date_row(date, found)


def test_nothing_is_said_of_a_clean_row(date: Date, tmp_path: Path) -> None:
    _, row = scanned(date, "clean", tmp_path)
    assert row["told"] == 0


def late(box: TrueBox) -> list[TrueBox]:
    return [replace(box, frame=box.frame + 1)]


def halved(box: TrueBox) -> list[TrueBox]:
    xmin, ymin, xmax, ymax = box.box_px
    middle = (ymin + ymax) / 2
    return [replace(box, box_px=(xmin, ymin, xmax, middle)), replace(box, box_px=(xmin, middle, xmax, ymax))]


def longer(box: TrueBox) -> list[TrueBox]:
    xmin, ymin, xmax, ymax = box.box_px
    return [replace(box, box_px=(xmin, ymin, xmax, min(ymax + 0.8 * (ymax - ymin), 359.0)))]


@pytest.mark.parametrize(
    ("change", "share", "words"),
    [
        (late, 1, "the boxes fit the pictures a frame before theirs"),
        (halved, 4, "boxes make one square with the box beside them"),
        (longer, 5, "boxes of fruits are long as two of them"),
    ],
)
def test_boxes_that_cannot_be_right_are_told(
    date: Date, tmp_path: Path, change: Callable[[TrueBox], list[TrueBox]], share: int, words: str
) -> None:
    fruits = sorted({box.fruit for box in date.boxes})[::share]
    boxes = [one for box in date.boxes for one in (change(box) if box.fruit in fruits else [box])]
    write_recording(date.source, tmp_path / "row", range(12), [box for box in boxes if box.frame < 12], None)
    recording = open_recording(tmp_path / "row")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", PomonaWarning)
        scan(recording, detector(tmp_path / "row", recording), odometry=True)
    assert words in " ".join(str(one.message) for one in told)


def test_fruits_that_pass_by_in_half_the_frames_are_counted(date: Date, tmp_path: Path) -> None:
    found, row = scanned(date, "every 2nd frame", tmp_path)
    assert row["parts"] == 1
    assert abs(float(str(row["count_error"]))) < 0.15
    probabilities = np.array(found.part.cloud.extras["probability"], float)
    assert ((probabilities >= 0.25) & (probabilities <= 1.0)).all()


def test_leaves_that_come_back_to_their_place_are_no_fruits(date: Date, tmp_path: Path) -> None:
    _, row = scanned(date, "10 % false boxes that last ten frames", tmp_path)
    assert int(str(row["false"])) < 10  # of 15 that come back; some of the others lie on fruits that have no box
    assert float(str(row["count_error"])) < 0.08


def test_boxes_that_are_missing_lose_few_fruits(date: Date, tmp_path: Path) -> None:
    _, row = scanned(date, "20 % of boxes missing", tmp_path)
    assert abs(float(str(row["count_error"]))) < 0.08


@pytest.mark.parametrize("name", ["one step x 0.6", "one eye x 0.4"])
def test_exposure_changes_no_count(date: Date, tmp_path: Path, name: str) -> None:
    _, row = scanned(date, name, tmp_path)
    assert (row["parts"], row["false"]) == (1, 0)
    assert abs(float(str(row["count_error"]))) < 0.05


def test_bands_that_roll_down_the_picture_change_no_count(shared_data: Path, tmp_path: Path) -> None:
    _, row = scanned(Date(shared_data / "rendered_row" / DATES[1]), "bands of +-25 % that roll down", tmp_path)
    assert (row["parts"], row["false"]) == (1, 0)
    assert abs(float(str(row["count_error"]))) < 0.05


def test_parts_that_see_the_same_fruits_are_joined(date: Date, tmp_path: Path) -> None:
    _, row = scanned(date, "four frames dropped", tmp_path)
    assert row["parts"] == 1
    assert abs(float(str(row["count_error"]))) < 0.1
    assert float(str(row["p95_mm"])) < 40.0


def test_a_knocked_camera_is_corrected(date: Date, tmp_path: Path) -> None:
    _, row = scanned(date, "right picture 2 px lower", tmp_path)
    assert (row["parts"], row["told"]) == (1, 1)
    assert abs(float(str(row["count_error"]))) < 0.05
    assert float(str(row["p95_mm"])) < 20.0


def test_a_far_scene_is_told(date: Date, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pomona.survey.pose_source.FAR_PX", 60.0)
    few = replace(CASE["clean"], frames=lambda frames: frames[:4])
    found = date.scanned(few, 0, tmp_path / "row")
    assert found is not None
    assert found.told == 1
