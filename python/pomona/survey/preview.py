"""The recording with boxes, names and depths of its fruits drawn on it, as a video."""

from __future__ import annotations

import colorsys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.errors import PomonaError
from pomona.recording import Frame, Recording
from pomona.recording.pictures import UnreadablePictureError
from pomona.survey.part import Boxes, Part
from pomona.survey.prefetch import prefetched
from pomona.survey.story import Survey

__all__ = ["require_preview", "write_preview"]

Picture = NDArray[np.uint8]

RATE_HZ = 10
"""Of a recording that tells no times."""

GOLDEN = 0.618034
"""Step of the hue from one fruit to the next: neighbours in number never look alike."""

GREY = (160, 160, 160)
"""Boxes that became no fruit."""


def write_preview(
    path: Path, recording: Recording, survey: Survey, progress: Callable[[int, int], None] | None = None
) -> None:
    """Draw every box with its fruit's name, depth and diameter, and write an H.264 video.

    Parameters
    ----------
    path : Path
        The .mp4 file; it appears whole or not at all.
    recording : Recording
        With left pictures. It is read once more, so that names are those of the finished survey.
    survey : Survey
        What was found in it.
    progress : callable, optional
        Called after each frame with frames done and frames in all.

    Raises
    ------
    PomonaError
        As `require_preview`.
    """
    require_preview(recording)
    part_of = {frame: part for part in survey.parts for frame in part.trajectory.frames.tolist()}
    with whole_file(path) as partial, _video(partial, recording, _rate(survey)) as write:
        for done, frame in enumerate(prefetched(recording.frames(), ("left",)), start=1):
            if (part := part_of.get(frame.number)) is not None and (picture := _left(frame)) is not None:
                write(_drawn(picture, frame.number, part))
            if progress is not None:
                progress(done, len(recording))


def require_preview(recording: Recording) -> None:
    """Refuse before the work what cannot be drawn.

    Raises
    ------
    PomonaError
        When PyAV is missing or the recording has no left pictures.
    """
    if find_spec("av") is None:
        raise PomonaError("a preview needs PyAV: install pomona[video]")
    if "left" not in recording.description()["pictures"]:
        raise PomonaError(f"{recording.path}: no left pictures, a preview is drawn on them")


def _rate(survey: Survey) -> Fraction:
    """Frames a second, by the median step of time; frame numbers stand for times where nobody noted them."""
    steps_s = np.concatenate([np.diff(part.trajectory.times_s) for part in survey.parts])
    step_s = float(np.median(steps_s)) if len(steps_s) else 0.0
    return Fraction(round(1 / step_s)) if 0.004 < step_s < 0.5 else Fraction(RATE_HZ)


def _left(frame: Frame) -> Picture | None:
    try:
        return None if frame.read_left is None else frame.read_left()
    except UnreadablePictureError:
        return None


@contextmanager
def _video(path: Path, recording: Recording, rate: Fraction) -> Iterator[Callable[[Picture], None]]:
    import av

    calibration = recording.calibration
    with av.open(str(path), "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=rate, options={"crf": "20", "preset": "veryfast"})
        # The common pixel format halves colour along both axes, which takes even sides.
        stream.width, stream.height = calibration.width // 2 * 2, calibration.height // 2 * 2
        stream.pix_fmt = "yuv420p"

        def write(picture: Picture) -> None:
            even = np.ascontiguousarray(picture[: stream.height, : stream.width])
            for packet in stream.encode(av.VideoFrame.from_ndarray(even, format="bgr24")):
                container.mux(packet)

        yield write
        for packet in stream.encode():
            container.mux(packet)


def _drawn(picture: Picture, frame: int, part: Part) -> Picture:
    """Draw the boxes of one frame: fruits in their own colour with name, depth and diameter; the rest grey."""
    import cv2

    drawn, boxes = picture.copy(), part.boxes
    for row in np.flatnonzero(boxes.frames == frame):
        low, high = (tuple(np.round(corner).astype(int).tolist()) for corner in np.split(boxes.boxes_px[row], 2))
        fruit = int(boxes.fruits[row])
        colour = GREY if fruit < 0 else _colour(fruit)
        cv2.rectangle(drawn, low, high, colour, 1, cv2.LINE_AA)
        if fruit >= 0:
            for line, text in enumerate(_labels(part, boxes, int(row), fruit)):
                place = (low[0], low[1] - 3 - 9 * line)
                cv2.putText(drawn, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.3, (0, 0, 0), 2, cv2.LINE_AA)
                cv2.putText(drawn, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.3, colour, 1, cv2.LINE_AA)
    cv2.putText(drawn, f"frame {frame}", (6, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (255, 255, 255), 1, cv2.LINE_AA)
    return drawn


def _labels(part: Part, boxes: Boxes, row: int, fruit: int) -> Iterator[str]:
    """Lines of text from the box upwards."""
    depth_m = boxes.depths_m[row]
    if np.isfinite(depth_m):
        yield f"{depth_m:.2f} m"
    name = (part.cloud.ids or ())[fruit]
    yield name if part.cloud.diameters_m is None else f"{name}  {1000 * part.cloud.diameters_m[fruit]:.0f} mm"


def _colour(fruit: int) -> tuple[int, int, int]:
    red, green, blue = colorsys.hsv_to_rgb(fruit * GOLDEN % 1.0, 0.75, 1.0)
    return int(255 * blue), int(255 * green), int(255 * red)
