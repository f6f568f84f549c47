"""ZED recordings, `.svo2`: an MCAP with H.264 or H.265 of both pictures side by side, read without the vendor's SDK.

The format is known from published descriptions of it (for example https://radarml.github.io/open-svo2/format), not from
its maker, and no recording was at hand. A message of the topic `Camera_SN<serial>/side_by_side` is

    u32 bytes after this field, u32 n, n bytes of video in Annex B, 56 bytes of footer:
    u32 width, u32 height, 4 x 4 bytes, u64 timestamp, u32 n, i32 kind of picture (3: key picture), ...
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.recording.bags.mcap_file import McapFile
from pomona.recording.bags.message_file import counted
from pomona.recording.calibration.rig_files import find_optics
from pomona.recording.dates import date_of_ns
from pomona.recording.picture_size import MOST_PIXELS, require_size
from pomona.recording.video.stereo_video import VideoRecording
from pomona.recording.video.video_file import missing_pyav
from pomona.recording.video.video_runs import VideoPicture, key_row, wanted_pictures

if TYPE_CHECKING:
    from av.video.frame import VideoFrame

__all__ = ["Svo2Video", "open_svo2"]

HEAD, FOOTER = struct.Struct("<2I"), struct.Struct("<2I16xQIi")

KEY_PICTURE = 3

PLAUSIBLE_STEP_NS = (10**6, 10**10)
"""Between two pictures there are a millisecond to ten seconds: else the footer's timestamps are not in nanoseconds."""

HEVC_BEGINS = {32, 33, 34, 35, 39}
"""NAL units that an H.265 stream begins with: parameter sets, delimiter, prefix SEI (ITU-T H.265, table 7-1)."""


@dataclass(frozen=True, eq=False)
class Svo2Video:
    """The pictures of one camera of an .svo2.

    Attributes
    ----------
    topic : str
        `Camera_SN<serial>/side_by_side`.
    codec : str
        `h264` or `hevc`.
    size_px : (width, height)
        Of both pictures together.
    logged_ns : (F,) int64
        When each was written, to jump there.
    keys : tuple of int
        Rows of the key pictures.
    """

    file: McapFile
    topic: str
    codec: str
    size_px: tuple[int, int]
    times_s: NDArray[np.float64]
    logged_ns: NDArray[np.int64]
    keys: tuple[int, ...]
    created: str | None

    @property
    def path(self) -> Path:
        """The .svo2."""
        return self.file.path

    @classmethod
    def open(cls, path: Path) -> Svo2Video:
        """Read heads and footers of all pictures.

        Raises
        ------
        PomonaError
            When it is no .svo2, has pictures of several cameras or of none, or its times go back.
        """
        file = McapFile.open(path)
        found = [name for name in file.topics if re.fullmatch(r"Camera_SN\d+/side_by_side", name)]
        if len(found) != 1:
            names = ", ".join(found or sorted(file.topics)) or "nothing"
            raise PomonaError(f"{path}: found {names}, expected pictures of one camera: Camera_SN<serial>/side_by_side")
        logged_ns, stamps_ns, keys, first, size_px = _listed(file, found[0])
        if first is None or size_px is None:
            raise PomonaError(f"{path}: {found[0]}: found no picture that is whole")
        require_size(f"{path}: {found[0]}", size_px)
        stamps_ns = _stamps(path, logged_ns, stamps_ns)
        codec = _codec(path, first)
        created = date_of_ns(int(stamps_ns[0]))
        return cls(file, found[0], codec, size_px, stamps_ns / 1e9, logged_ns, keys, created)

    @property
    def serial(self) -> str:
        """Number of the camera."""
        return self.topic.removeprefix("Camera_SN").partition("/")[0]

    def pictures(self, rows: Sequence[int] | None = None) -> Iterator[VideoPicture]:
        """Decode picture by picture, all or those of some rows; what cannot be decoded raises when it is read."""
        chosen = range(len(self.times_s)) if rows is None else rows
        return wanted_pictures(chosen, self.keys, self._decoded, self._where, self.size_px)

    def _decoded(self, rows: Sequence[int]) -> Iterator[tuple[int, VideoFrame]]:
        """Decode from the key picture of the first row on; give (row, picture) in ascending order."""
        import av

        key = key_row(self.keys, rows[0])
        decoder: Any = av.CodecContext.create(self.codec, "r")
        # With threads, or without this option, damage is filled in silently and differently from run to run.
        decoder.thread_count, decoder.options = 1, {"err_detect": "explode", "max_pixels": str(MOST_PIXELS)}
        messages = self.file.messages({self.topic}, int(self.logged_ns[key]))
        first = int(np.searchsorted(self.logged_ns, self.logged_ns[key]))
        for row, message in enumerate(messages, start=first):
            unit = _unit(message.body)
            if row < key or unit is None:
                continue
            packet: Any = av.Packet(unit[0])
            packet.pts = row
            yield from _frames(decoder, packet)
        yield from _frames(decoder, None)

    def _where(self, row: int) -> str:
        return f"{self.path}: frame {row} at {self.times_s[row]:.3f} s"


def open_svo2(path: Path, calibration: Path | None = None) -> VideoRecording:
    """Open an .svo2 with the camera's factory calibration, `SN<serial>.conf` in the same folder or given.

    Raises
    ------
    PomonaError
        When PyAV or mcap, the pictures or the calibration are missing.
    """
    try:
        import av  # noqa: F401
    except ImportError:
        raise missing_pyav(path) from None
    video = Svo2Video.open(path)
    size_px = (video.size_px[0] // 2, video.size_px[1])
    own = path.with_name(f"SN{video.serial}.conf")
    try:
        optics = find_optics(path.parent, size_px, stereo=True, given=calibration or (own if own.is_file() else None))
    except PomonaError as error:
        hint = f"; the camera's own is {own.name}, from its maker" if "found none" in str(error) else ""
        raise PomonaError(f"{error}{hint}") from None
    pairs = np.arange(len(video.times_s)).repeat(2).reshape(-1, 2)
    return VideoRecording(path, "ZED .svo2", optics, video, video, pairs)


def _listed(
    file: McapFile, topic: str
) -> tuple[NDArray[np.int64], NDArray[np.int64], tuple[int, ...], bytes | None, tuple[int, int] | None]:
    """Give times of logging, timestamps, key rows, the first access unit and the size."""
    logged_ns: list[int] = []
    stamps_ns: list[int] = []
    keys: list[int] = []
    first: bytes | None = None
    size_px: tuple[int, int] | None = None
    for row, message in enumerate(counted(file.path, file.messages({topic}))):
        unit = _unit(message.body)
        logged_ns.append(message.logged_ns)
        stamps_ns.append(0 if unit is None else unit[2])
        if unit is not None and first is None:
            first, size_px = unit[0], unit[1]
        if unit is not None and unit[3] == KEY_PICTURE:
            keys.append(row)
    return np.array(logged_ns, np.int64), np.array(stamps_ns, np.int64), tuple(keys), first, size_px


def _unit(body: bytes) -> tuple[bytes, tuple[int, int], int, int] | None:
    """Give access unit, size, timestamp and kind of picture; None for a message that is cut off or something else."""
    if len(body) < HEAD.size:
        return None
    _, length = HEAD.unpack_from(body)
    if len(body) < HEAD.size + length + FOOTER.size:
        return None
    width, height, stamp, _, kind = FOOTER.unpack_from(body, HEAD.size + length)
    return body[HEAD.size : HEAD.size + length], (width, height), min(stamp, 2**63 - 1), kind


def _stamps(path: Path, logged_ns: NDArray[np.int64], stamps_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Take the timestamps where they are nanoseconds, else the times of logging; refuse those that go back."""
    steps_ns = np.diff(stamps_ns)
    low_ns, high_ns = PLAUSIBLE_STEP_NS
    if len(steps_ns) and stamps_ns.all() and low_ns <= np.median(steps_ns) <= high_ns:
        times_ns = stamps_ns
    else:
        times_ns = logged_ns
    back = np.flatnonzero(np.diff(times_ns) <= 0)
    if len(back):
        later, earlier = (times_ns[int(back[0]) + step] / 1e9 for step in (0, 1))
        raise PomonaError(f"{path}: frame {int(back[0]) + 1}: time goes back from {later:.3f} s to {earlier:.3f} s")
    return times_ns


def _codec(path: Path, unit: bytes) -> str:
    """Tell H.264 from H.265 by the first NAL unit; the first bit of both is 0, and of H.265's layer number too."""
    start = re.match(rb"\x00{2,3}\x01(.)", unit, re.DOTALL)
    if start is None:
        raise PomonaError(f"{path}: found pictures that begin with {unit[:4].hex()}, expected H.264 or H.265 (Annex B)")
    head = start[1][0]
    return "hevc" if not head & 1 and head >> 1 in HEVC_BEGINS else "h264"


def _frames(decoder: Any, packet: Any) -> Iterator[tuple[int, VideoFrame]]:
    import av

    try:
        yield from ((frame.pts, frame) for frame in decoder.decode(packet))
    except av.error.FFmpegError:
        return
