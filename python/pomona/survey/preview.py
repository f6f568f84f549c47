"""The recording with boxes, names and depths of its fruits drawn on it, as a video."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.errors import PomonaError
from pomona.likes import VIDEO_MARK
from pomona.recording import Frame, Recording
from pomona.recording.pictures import UnreadablePictureError
from pomona.survey.lettering import colour_of, lettering, write_on
from pomona.survey.part import Part
from pomona.survey.prefetch import prefetched
from pomona.survey.story import Survey

__all__ = ["require_preview", "write_preview"]

Picture = NDArray[np.uint8]

RATE_HZ = 10
"""Of a recording that tells no times."""

LEGIBLE_PX = 1280
"""Smaller pictures are drawn on enlarged, to this width or more."""

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
    times = -(-LEGIBLE_PX // recording.calibration.width)
    part_of = {frame: part for part in survey.parts for frame in part.trajectory.frames.tolist()}
    size_px = times * recording.calibration.width, times * recording.calibration.height
    with whole_file(path) as partial, _video(partial, size_px, _rate(survey)) as write:
        for done, frame in enumerate(prefetched(recording.frames(), ("left",)), start=1):
            if (part := part_of.get(frame.number)) is not None and (picture := _left(frame)) is not None:
                write(_drawn(picture, frame.number, part, times))
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
        raise PomonaError("a preview needs PyAV, which is not installed: pip install av")
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
def _video(path: Path, size_px: tuple[int, int], rate: Fraction) -> Iterator[Callable[[Picture], None]]:
    import av

    with av.open(str(path), "w", format="mp4") as container:
        container.metadata["comment"] = VIDEO_MARK
        stream = container.add_stream("libx264", rate=rate, options={"crf": "20", "preset": "veryfast"})
        # The common pixel format halves colour along both axes, which takes even sides.
        stream.width, stream.height = (side // 2 * 2 for side in size_px)
        stream.pix_fmt = "yuv420p"

        def write(picture: Picture) -> None:
            even = np.ascontiguousarray(picture[: stream.height, : stream.width])
            for packet in stream.encode(av.VideoFrame.from_ndarray(even, format="bgr24")):
                container.mux(packet)

        yield write
        for packet in stream.encode():
            container.mux(packet)


def _drawn(picture: Picture, frame: int, part: Part, times: int) -> Picture:
    """Draw the boxes of one frame: fruits in their own colour with name, diameter and depth; the rest grey."""
    import cv2

    size = lettering(times * len(picture))
    drawn = np.asarray(cv2.resize(picture, None, fx=times, fy=times, interpolation=cv2.INTER_CUBIC), np.uint8)
    rows = np.flatnonzero(part.boxes.frames == frame)
    depths_m = _depths(part, frame)
    for row in rows:
        low, high = (np.round(times * corner).astype(int) for corner in np.split(part.boxes.boxes_px[row], 2))
        fruit = int(part.boxes.fruits[row])
        colour = GREY if fruit < 0 else colour_of(fruit)
        cv2.rectangle(drawn, low.tolist(), high.tolist(), colour, max(1, round(size)), cv2.LINE_AA)
        if fruit >= 0:
            write_on(drawn, (low[0], low[1] - 4 * size), _label(part, fruit), colour, size)
            write_on(drawn, (low[0], high[1] + 13 * size), f"{depths_m[fruit]:.2f} m", colour, size)
    write_on(drawn, (8 * size, 18 * size), f"frame {frame}", (255, 255, 255), size)
    return drawn


def _depths(part: Part, frame: int) -> NDArray[np.float64]:
    """Depth of every fruit of the part in this frame, metres along the optical axis."""
    row = int(np.flatnonzero(part.trajectory.frames == frame)[0])
    pose = part.trajectory.session_from_camera[row]
    return np.asarray((part.cloud.positions - pose[:3, 3]) @ pose[:3, 2])


def _label(part: Part, fruit: int) -> str:
    name = part.cloud.label(fruit)
    return name if part.cloud.diameters_m is None else f"{name}: {1000 * part.cloud.diameters_m[fruit]:.0f} mm"
