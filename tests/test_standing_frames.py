"""Frames that show again what one before showed: they are no views."""

import shutil
from pathlib import Path

import numpy as np
import pytest

import pomona
from pomona.detect import Detections
from pomona.recording import Frame
from pomona.recording.pictures import UnreadablePictureError
from pomona.survey.depth import Lifted
from pomona.survey.seeing import Look
from pomona.survey.standing import Standing

RNG = np.random.default_rng(0)
PICTURES = [RNG.integers(0, 256, (90, 160, 3), np.uint8) for _ in range(12)]


def frame(number: int, left: int, right: int | None = None, noise: float = 0.0) -> Frame:
    """A frame with the pictures of these numbers."""

    def reader(which: int) -> object:
        off = np.random.default_rng(number).normal(0.0, noise, PICTURES[which].shape)
        return lambda: np.clip(PICTURES[which] + off, 0, 255).astype(np.uint8)

    return Frame(number, read_left=reader(left), read_right=None if right is None else reader(right))


def looks(*frames: Frame, needs: tuple[str, ...] = ("left", "right")) -> list[str | None]:
    """What is said of each frame; None where it is looked at."""
    standing = Standing(lambda each: Look(each.number, Detections.none(), Lifted.none()), needs)
    return [standing(each).unusable for each in frames]


def test_a_picture_that_comes_again_is_no_view() -> None:
    said = looks(frame(0, 0, 1), frame(1, 0, 1), frame(2, 2, 3), frame(3, 0, 1), frame(4, 4, 5))
    assert said == [
        None,
        "frame 1: the picture is that of frame 0",
        None,
        "frame 3: the picture is that of frame 1",
        None,
    ]


def test_an_eye_that_stands_still_is_told() -> None:
    assert looks(frame(0, 0, 1), frame(1, 2, 1))[1] == "frame 1: the right picture alone is that of frame 0"
    assert looks(frame(0, 0, 1), frame(1, 0, 3))[1] == "frame 1: the left picture alone is that of frame 0"


def test_a_camera_that_stands_has_noise_and_frames_of_their_own() -> None:
    assert looks(frame(0, 0, 1, noise=2.0), frame(1, 0, 1, noise=2.0)) == [None, None]


def test_pictures_that_nobody_asks_for_are_not_read() -> None:
    def never() -> None:
        raise AssertionError

    assert looks(*(Frame(number, read_left=never) for number in range(2)), needs=("depth",)) == [None, None]


def test_a_picture_that_cannot_be_read_is_left_to_whoever_looks() -> None:
    def broken() -> None:
        raise UnreadablePictureError("cut off")

    assert looks(frame(0, 0, 1), Frame(1, read_left=broken, read_right=broken), frame(2, 2, 3)) == [None] * 3


def row_of(source: Path, folder: Path, frames: list[int]) -> Path:
    """Pictures of a recording, given out in this order; neither poses nor boxes."""
    for kind in ("left", "right"):
        (folder / kind).mkdir(parents=True)
        pictures = sorted((source / kind).iterdir())
        for number, which in enumerate(frames):
            (folder / kind / f"{number:04d}{pictures[which].suffix}").symlink_to(pictures[which].resolve())
    shutil.copy(source / "calibration.json", folder)
    return folder


@pytest.mark.filterwarnings("ignore::pomona.errors.PomonaWarning")
def test_a_scan_counts_as_without_them(shared_data: Path, tmp_path: Path) -> None:
    """With every second frame given out thrice there were more views of each fruit, and more fruits."""
    source = shared_data / "rendered_row" / "2024-08-28"
    once = list(range(12))
    again = [frame for each in once for frame in [each] * (3 if each % 2 else 1)]
    counts = []
    for name, frames in (("once", once), ("again", again)):
        survey = pomona.scan(pomona.open_recording(row_of(source, tmp_path / name, frames)))
        counts.append(len(survey.cloud))
        assert len(survey.skipped) == len(frames) - len(once)
    assert counts[0] > 0
    assert counts[1] == counts[0]
