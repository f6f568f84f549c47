"""One video file: its times at once, its pictures one after the other."""

from __future__ import annotations

import datetime
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording.picture_size import MOST_PIXELS, require_size
from pomona.recording.video.video_runs import VideoPicture, key_row, wanted_pictures

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.video.frame import VideoFrame

__all__ = ["VideoFile", "missing_pyav"]

MOST_FRAMES = 10_000_000
"""A day at 100 Hz."""

CUT_OFF_FRAMES = 2
"""A header may promise the length in rounded time: a video is cut off when more than this is missing."""

ALONE = {"format_whitelist": "mov,mp4,m4a,matroska,webm,avi,mpegts,h264,hevc", "protocol_whitelist": "file"}
"""Of a video's own: a file that is a playlist, whatever its suffix, would have FFmpeg open others, by the net too."""


@dataclass(frozen=True, eq=False)
class VideoFile:
    """A video whose packets were listed, and not decoded.

    Attributes
    ----------
    stamps : tuple of int
        Presentation times in the file's own unit, ascending: exact, one for each picture.
    times_s : (F,) float64
        The same in seconds.
    keys : tuple of int
        Rows of the pictures that can be decoded without others, ascending.
    created : str or None
        When it was made, where the file says it.
    """

    path: Path
    size_px: tuple[int, int]
    stamps: tuple[int, ...]
    times_s: NDArray[np.float64]
    keys: tuple[int, ...]
    created: str | None

    @classmethod
    def open(cls, path: Path) -> VideoFile:
        """Read the header and the packets' times.

        Raises
        ------
        PomonaError
            When PyAV is not installed, the file is no video, holds no picture, or its times go back.
        """
        with _opened(path) as container:
            stream = container.streams.video[0]
            require_size(str(path), (stream.width, stream.height))
            stamps, keys = _stamps(path, container)
            seconds = float(stream.time_base or 0)
            times_s = np.array(stamps, np.float64) * seconds
            _warn_when_cut_off(path, container, times_s)
            return cls(path, (stream.width, stream.height), stamps, times_s, keys, _created(container))

    def pictures(self, rows: Sequence[int] | None = None) -> Iterator[VideoPicture]:
        """Decode picture by picture; those that cannot be decoded raise when they are read.

        Parameters
        ----------
        rows : sequence of int, optional
            Which of `stamps`, ascending; all where not given. Long stretches that nobody wants are jumped over.
        """
        chosen = range(len(self.stamps)) if rows is None else rows
        return wanted_pictures(chosen, self.keys, self._decoded, self._where, self.size_px)

    def _decoded(self, rows: Sequence[int]) -> Iterator[tuple[int, VideoFrame]]:
        """Decode from the key picture of the first row on; give (row, picture) in ascending order."""
        row_of = {stamp: row for row, stamp in enumerate(self.stamps)}
        wanted = frozenset(self.stamps[row] for row in rows)
        for key in sorted({0, key_row(self.keys, rows[0])}, reverse=True):
            latest = -1
            with _opened(self.path) as container:
                if key:
                    container.seek(self.stamps[key], stream=container.streams.video[0])
                for frame in _decoded(container, wanted):
                    row = row_of.get(frame.pts if frame.pts is not None else -1, -1)
                    if latest < 0 and key and row > rows[0]:
                        break  # Not every container jumps exactly: begin at its beginning instead.
                    if row > latest:
                        latest = row
                        yield row, frame
            if latest >= 0:
                return

    def _where(self, row: int) -> str:
        return f"{self.path}: frame {row} at {self.times_s[row]:.3f} s"


def missing_pyav(path: Path) -> PomonaError:
    """Say how to install what decodes videos."""
    return PomonaError(f"{path}: a video needs PyAV, which is not installed: pip install av")


def _opened(path: Path) -> InputContainer:
    try:
        import av
    except ImportError:
        raise missing_pyav(path) from None
    try:
        container = av.open(str(path.absolute()), options=ALONE, metadata_errors="replace")
    except (av.error.FFmpegError, OSError) as error:
        what = getattr(error, "strerror", None) or str(error)
        raise PomonaError(f"{path}: not a video, or one that was cut off before its index ({what})") from None
    if not container.streams.video or container.streams.video[0].codec_context is None:
        container.close()
        raise PomonaError(f"{path}: found no pictures in it that can be decoded, expected a video")
    return container


def _stamps(path: Path, container: InputContainer) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Presentation times of all packets, ascending, and the rows of key pictures; packets come as they are decoded."""
    import av

    stamps: list[int] = []
    keys: set[int] = set()
    decoded_at: list[int] = []
    packets = container.demux(container.streams.video[0])
    while True:
        try:
            packet = next(packets, None)
        except av.error.FFmpegError:
            break
        if packet is None:
            break
        stamp = packet.pts if packet.pts is not None else packet.dts
        if len(stamps) >= MOST_FRAMES:
            raise PomonaError(f"{path}: found more than {MOST_FRAMES} frames, expected a video of a day at most")
        if packet.size and not packet.is_discard and stamp is not None:
            stamps.append(stamp)
            if packet.is_keyframe:
                keys.add(stamp)
            if packet.dts is not None:  # Matroska does not note them where pictures are reordered
                decoded_at.append(packet.dts)
    if not stamps:
        raise PomonaError(f"{path}: found no picture with a time, expected a video that is not cut off")
    back = np.flatnonzero(np.diff(decoded_at) < 0)
    if len(back):
        unit_s = float(container.streams.video[0].time_base or 0)
        later, earlier = (decoded_at[int(back[0]) + step] * unit_s for step in (0, 1))
        raise PomonaError(f"{path}: packet {int(back[0]) + 1}: time goes back from {later:.3f} s to {earlier:.3f} s")
    if len(set(stamps)) < len(stamps):
        raise PomonaError(f"{path}: found two frames of the same time, expected ascending times")
    stamps.sort()
    return tuple(stamps), tuple(row for row, stamp in enumerate(stamps) if stamp in keys)


def _decoded(container: InputContainer, wanted: frozenset[int]) -> Iterator[Any]:
    """Pictures in order of time; packets that the decoder refuses are passed over.

    Where no picture needs another, only those of the wanted times are decoded.
    """
    import av

    stream = container.streams.video[0]
    # With threads a damaged stream gives other pictures from run to run.
    stream.codec_context.thread_count = 1
    # Without it H.264 fills what is lost from other pictures, and does not say so.
    stream.codec_context.options = {"err_detect": "explode", "max_pixels": str(MOST_PIXELS)}
    alone = stream.codec_context.codec.intra_only
    packets = container.demux(stream)
    while True:
        try:
            packet = next(packets, None)
        except av.error.FFmpegError:
            return
        if packet is None:
            return
        if alone and packet.size and packet.pts is not None and packet.pts not in wanted:
            continue
        try:
            yield from packet.decode()
        except av.error.FFmpegError:
            continue


def _warn_when_cut_off(path: Path, container: InputContainer, times_s: NDArray[np.float64]) -> None:
    """Compare with the length that the header promises."""
    found = len(times_s)
    stream = container.streams.video[0]
    counted, end_s = int(stream.frames or 0), None
    if container.format.name == "avi":
        # AVI counts ticks of its clock as frames; of a file that is cut off FFmpeg guesses the length from its bytes.
        end_s, counted = counted * float(stream.time_base or 0), 0
    elif container.duration:
        end_s = ((container.start_time or 0) + container.duration) / 1e6
    promises = [counted]
    if end_s and found > 1:
        promises.append(found - 1 + round((end_s - times_s[-1]) / float(np.median(np.diff(times_s)))))
    promised = min((promise for promise in promises if promise), default=0)
    if promised - found > CUT_OFF_FRAMES:
        message = f"{path}: cut off: found {found} of {promised} frames; what is there is used"
        warnings.warn(message, PomonaWarning, stacklevel=4)


def _created(container: InputContainer) -> str | None:
    noted = container.metadata.get("creation_time")
    try:
        return None if noted is None else datetime.datetime.fromisoformat(noted).replace(tzinfo=None).isoformat()
    except ValueError:
        return None
