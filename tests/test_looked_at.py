"""Frames without boxes in a file: nothing was found there, or nobody looked."""

import json

import pytest

from depth_scene import CAMERA
from pomona.detect.looked_at import looked_at
from pomona.detect.opening import open_detections
from pomona.recording import Frame, open_recording
from pomona.survey import Kept, scan
from recording_maker import make_recording


@pytest.mark.parametrize(
    ("counts", "dark"),
    [
        ([20, 0, 20, 0, 20, 0, 20, 0], {1, 3, 5, 7}),  # a detector at half the rate
        ([2, 0, 2, 0, 2, 0, 2, 0, 2, 0], {1, 3, 5, 7, 9}),  # of a row with few fruits
        ([0, 0, 0, 15, 0, 0, 0, 16, 0, 0], {0, 1, 2, 4, 5, 6, 8, 9}),  # labels of key frames
        ([30] * 10 + [0] * 10, set(range(10, 20))),  # of the first half
        ([38] * 8 + [0] + [36] * 8, {8}),  # one look that is missing
        ([9, 4, 1, 0, 0, 0, 2, 8, 9, 9], set()),  # no tree there
        ([3, 3, 2, 0, 3, 3, 2, 3, 3, 3, 3, 3], set()),  # missed, as others were
        ([0, 0, 1, 0, 0, 0, 0, 0, 1, 0], set()),  # a false box here and there
        ([0, 0, 0], set()),
    ],
)
def test_the_frames_beside_tell_who_looked(counts, dark):
    numbers = range(100, 100 + len(counts))
    found = looked_at(numbers, {100 + row: count for row, count in enumerate(counts) if count})
    assert found == set(numbers) - {100 + row for row in dark}


def test_coco_lists_what_was_looked_at(tmp_path):
    images = [{"id": number, "file_name": f"{number:04d}.png"} for number in (0, 1)]
    boxes = [{"image_id": 0, "bbox": [10 + 30 * row, 20, 20, 25]} for row in range(15)]
    (tmp_path / "boxes.json").write_text(json.dumps({"images": images, "annotations": boxes}))
    detector = open_detections(tmp_path / "boxes.json", CAMERA, (0, 1, 2))
    assert [detector(Frame(number)).looked for number in range(3)] == [True, True, False]


@pytest.fixture
def half(tmp_path):
    """Nine frames, 2 cm apart, of which every second one has boxes."""
    folder = make_recording(tmp_path / "row", tuple(0.02 * step for step in range(9)), ids=False)
    header, *boxes = (folder / "detections.csv").read_text().splitlines()
    kept = [line for line in boxes if int(line.split(",")[0]) % 2 == 0]
    (folder / "detections.csv").write_text("\n".join([header, *kept]) + "\n")
    return folder


def test_frames_that_nobody_looked_at_take_no_fruit_away(half):
    recording = open_recording(half)
    found = scan(recording, open_detections(half / "detections.csv", recording.calibration, recording.numbers))
    assert len(found.cloud) == 3
    assert len(found.trajectory) == 9
    # A fruit stays in view for all frames; those that count are five.
    assert found.parts[0].frames_in_view is None or found.parts[0].frames_in_view <= 5
    assert {fate.name: count for fate, count in found.tally.frames.items()} == {"BOXES": 5, "NOT_LOOKED_AT": 4}


def test_a_kept_look_keeps_that_nobody_looked(half, tmp_path):
    recording = open_recording(half)
    detector = open_detections(half / "detections.csv", recording.calibration, recording.numbers)
    first, again = (scan(recording, detector, keep=Kept(tmp_path / "kept", {})) for _ in range(2))
    assert first.tally == again.tally


def test_the_table_counts_frames(pomona, half, tmp_path):
    code, printed, _ = pomona("scan", half, "-o", tmp_path / "s.gpkg")
    assert code == 0
    assert "         4   without boxes in the file, taken as not looked at" in printed
    code, printed, _ = pomona("scan", half, "-o", tmp_path / "s.gpkg", "--json")
    assert json.loads(printed)["frames"] == {"boxes": 5, "not_looked_at": 4}
