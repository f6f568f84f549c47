"""`pomona.scan`: what the verb does, as a function; and instance masks as boxes."""

import datetime
from pathlib import Path

import cv2
import numpy as np
import pytest

import pomona
from depth_scene import picture
from pomona import FruitCloud, PomonaError, PomonaWarning
from pomona.detect import Detections
from pomona.detect.from_file import FileDetector
from pomona.detect.masks import MIN_SIDE_PX, boxes_of
from pomona.orchard import read_session
from pomona.recording import Frame, open_recording
from recording_maker import FRUITS, make_recording, moved

STEPS_M = (0.0, 0.1, 0.2)


@pytest.fixture
def row(tmp_path: Path) -> Path:
    return make_recording(tmp_path / "2024-08-09", STEPS_M)


def test_masks_that_a_scan_takes_are_told(row: Path) -> None:
    (row / "detections.csv").unlink()
    assert open_recording(row).description()["detections"] is False
    draw_masks(row)
    assert open_recording(row).description()["detections"] is True


def draw_masks(folder: Path) -> None:
    """Give each pixel of a fruit its number, from 301: more than 8 bits hold."""
    (folder / "ids").mkdir()
    for frame, step_m in enumerate(STEPS_M):
        mask = np.zeros((480, 640), np.uint16)
        for number, sphere in enumerate(FRUITS.values(), start=301):
            mask[picture([moved(sphere, -step_m)]) != picture([])] = number
        assert cv2.imwrite(str(folder / "ids" / f"{frame:04d}.png"), mask)


def test_gives_what_the_verb_writes(row: Path, tmp_path: Path) -> None:
    survey = pomona.scan(row, output=tmp_path / "row.gpkg", name="row 3", date=datetime.date(2024, 8, 10))
    assert survey.cloud.ids == tuple(FRUITS)
    np.testing.assert_allclose(survey.cloud.positions, [fruit.centre for fruit in FRUITS.values()], atol=0.001)
    session = read_session(tmp_path / "row.gpkg")
    assert (session.name, session.date) == ("row 3", "2024-08-10")
    np.testing.assert_array_equal(session.cloud.positions, survey.cloud.positions)
    assert session.configuration["scan"]["detector"] == {"detections": str(row / "detections.csv")}


def test_takes_recordings_that_are_open_and_parts_of_them(row: Path) -> None:
    survey = pomona.scan(open_recording(row), detections=row / "detections.csv", every=2)
    assert survey.trajectory.frames.tolist() == [0, 2]


def test_boxes_of_the_whole_serve_its_parts(row: Path) -> None:
    part = pomona.selected(open_recording(row), first=1)
    survey = pomona.scan(part, detections=row / "detections.csv")
    assert survey.trajectory.frames.tolist() == [1, 2]
    (row / "detections.csv").write_text("frame,xmin,ymin,xmax,ymax\n3,10,10,40,40\n")
    with pytest.raises(PomonaError, match=r"line 2: frame: found 3, expected a frame there is \(0 to 2\)"):
        pomona.scan(part)


def test_boxes_of_frames_whose_pictures_are_gone_are_left_out_and_told(row: Path) -> None:
    header, *lines = (row / "detections.csv").read_text().splitlines()
    middle = [line for line in lines if line.startswith("1,")]
    for file in row.glob("*/0001.png"):
        file.unlink()
    (row / "poses_tum.txt").unlink(missing_ok=True)
    others = [line for line in lines if not line.startswith("1,")]
    (row / "detections.csv").write_text("\n".join([header, *others, *middle]) + "\n")
    recording = open_recording(row)
    with pytest.warns(PomonaWarning, match=f"found 1, which has no picture: {len(middle)} boxes of 1 frame are left"):
        detector = FileDetector.read(row / "detections.csv", recording.calibration, recording.recorded_numbers)
    assert [len(detector(frame)) for frame in recording.frames()] == [3, 3]
    (row / "detections.csv").write_text("\n".join([header, others[0], *middle]) + "\n")
    with pytest.raises(PomonaError, match="which has no picture, as 3 of 4 boxes: of other frames"):
        FileDetector.read(row / "detections.csv", recording.calibration, recording.recorded_numbers)


def test_takes_a_detector_of_ones_own(row: Path, tmp_path: Path) -> None:
    recording = open_recording(row)
    known = FileDetector.read(row / "detections.csv", recording.calibration, recording.recorded_numbers)

    def nameless(frame: Frame) -> Detections:
        found = known(frame)
        return Detections(found.boxes_px, found.scores)

    def lists(_frame: Frame) -> list[list[int]]:
        return [[1, 2, 30, 40]]

    survey = pomona.scan(row, detections=nameless, output=tmp_path / "own.gpkg")
    assert len(survey.cloud) == 3
    name = "test_takes_a_detector_of_ones_own.<locals>.nameless"
    assert read_session(tmp_path / "own.gpkg").configuration["scan"]["detector"] == {"detector": name}
    named = pomona.scan(recording, detections=known)
    assert named.cloud.ids == tuple(FRUITS)
    with pytest.raises(PomonaError, match=r"lists: frame 0: found list, expected pomona\.detect\.Detections"):
        pomona.scan(row, detections=lists)  # type: ignore[arg-type]
    with pytest.raises(ZeroDivisionError):
        pomona.scan(row, detections=lambda frame: 1 // frame.number)  # type: ignore[arg-type, return-value]
    with pytest.raises(PomonaError, match="detections: found int, expected a file, a folder of masks or a detector"):
        pomona.scan(row, detections=5)  # type: ignore[arg-type]
    with pytest.raises(PomonaError, match="keep: found a detector of your own"):
        pomona.scan(row, detections=nameless, keep=tmp_path / "kept")
    assert not (tmp_path / "kept").exists()
    with pytest.raises(PomonaError, match="date: found the date 5, expected ISO 8601"):
        pomona.scan(row, date=5)  # type: ignore[arg-type]


def test_shows_itself_and_is_matched(row: Path) -> None:
    recording = open_recording(row)
    survey = pomona.scan(recording)
    assert repr(recording) == f"FolderRecording({str(row)!r}: 3 frames of 640x480, depth, with poses)"
    part = pomona.selected(recording, last=1)
    assert repr(part) == f"SelectedRecording({str(row)!r}: 2 frames of 640x480, depth, with poses)"
    assert repr(survey) == "Survey(3 fruits, from 9 boxes)"
    assert repr(survey.parts[0]).startswith("Part(frames: 0 to 2, fruits: 3, median diameter: 7")
    for answer in (recording, part, survey):
        html = answer._repr_html_()
        assert html.startswith("<table>")
        assert html.count("<tr>") == html.count("</tr>") >= 2
    assert pomona.match(survey, survey).n_map == 3


def test_destroys_nothing(row: Path, tmp_path: Path) -> None:
    boxes = tmp_path / "boxes.csv"
    boxes.write_text("frame,xmin,ymin,xmax,ymax\n0,10,10,40,40\n")
    before = boxes.read_bytes()
    with pytest.raises(PomonaError, match="is there already and is not what a scan writes"):
        pomona.scan(row, detections=boxes, output=boxes)
    assert boxes.read_bytes() == before
    (tmp_path / "notes.csv").write_text("mine\n")
    with pytest.raises(PomonaError, match="is there already and is not what a scan writes"):
        pomona.scan(row, output=tmp_path / "notes.csv")
    with pytest.raises(PomonaError, match=r"found suffix '\.txt'"):
        pomona.scan(row, output=tmp_path / "row.txt")
    assert (tmp_path / "notes.csv").read_text() == "mine\n"


def test_masks_are_boxes_where_there_are_no_others(row: Path) -> None:
    draw_masks(row)
    by_boxes = pomona.scan(row)
    (row / "detections.csv").unlink()
    by_masks = pomona.scan(row)
    assert by_masks.cloud.ids == ("301", "302", "303")
    np.testing.assert_allclose(by_masks.cloud.positions, by_boxes.cloud.positions, atol=0.002)
    np.testing.assert_allclose(by_masks.cloud.diameters_m, by_boxes.cloud.diameters_m, atol=0.003)
    assert pomona.scan(row, detections=row / "ids").cloud.ids == by_masks.cloud.ids


def test_masks_go_into_the_provenance_and_may_not_be_replaced(row: Path, tmp_path: Path) -> None:
    draw_masks(row)
    (row / "detections.csv").unlink()
    pomona.scan(row, output=tmp_path / "row.gpkg", keep=tmp_path / "kept")
    assert {"ids/0000.png", "ids/0001.png", "ids/0002.png"} <= read_session(tmp_path / "row.gpkg").input_hashes.keys()
    mask = row / "ids" / "0001.png"
    mask.write_bytes((row / "ids" / "0000.png").read_bytes())
    with pytest.raises(PomonaError, match=r"files\..*0001\.png\[0\]: found"):
        pomona.scan(row, keep=tmp_path / "kept")


def test_a_frame_without_its_mask_is_skipped_and_told(row: Path) -> None:
    draw_masks(row)
    (row / "ids" / "0001.png").unlink()
    with pytest.warns(pomona.PomonaWarning, match="skipped 1 of 3 frames, first .*ids: no mask of frame 1"):
        survey = pomona.scan(row, detections=row / "ids")
    assert survey.trajectory.frames.tolist() == [0, 2]


def test_a_colour_picture_is_no_mask(row: Path) -> None:
    (row / "ids").mkdir()
    for frame in range(3):
        cv2.imwrite(str(row / "ids" / f"{frame:04d}.png"), np.zeros((480, 640, 3), np.uint8))
    with pytest.raises(PomonaError, match="found 3 channels of 8 bits, expected one of 8 or 16 bits"):
        pomona.scan(row, detections=row / "ids")


def test_boxes_of_a_mask() -> None:
    mask = np.zeros((20, 30), np.uint16)
    mask[2:12, 3:13] = 500
    mask[4:9, 20:30] = 7  # to the edge
    mask[15 : 15 + MIN_SIDE_PX - 1, 0:20] = 9  # a sliver
    found = boxes_of(mask)
    assert found.ids == ("7", "500")
    np.testing.assert_array_equal(found.boxes_px, [[20, 4, 30, 9], [3, 2, 13, 12]])
    assert len(boxes_of(np.zeros((4, 4), np.uint8))) == 0


def test_the_rendered_row_is_counted_by_its_masks(shared_data: Path) -> None:
    source = shared_data / "rendered_row" / "2024-08-09"
    truth = FruitCloud.read(source / "fruits.csv")
    found = pomona.scan(source, every=2).cloud
    place = dict(zip(truth.ids or (), truth.positions, strict=True))
    errors_m = np.linalg.norm(found.positions - [place[name] for name in found.ids or ()], axis=1)
    assert len(found) > 0.7 * len(truth)  # the others show no more than slivers
    assert np.median(errors_m) < 0.01
