"""A bag as a recording: pictures of several topics, put together by their times."""

from __future__ import annotations

import functools
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.recording.bags.contents import PictureTopic
from pomona.recording.bags.depth_registration import Registration
from pomona.recording.bags.message_file import Message, MessageFile, decoded
from pomona.recording.bags.picture_messages import colour_of, depth_of
from pomona.recording.bags.topics import Roles
from pomona.recording.calibration import Calibration
from pomona.recording.calibration.rectification import Optics
from pomona.recording.card import RecordingCard
from pomona.recording.dates import date_in_name, date_of_ns
from pomona.recording.description import describe
from pomona.recording.frame import Frame, chosen_rows
from pomona.recording.pictures import UnreadablePictureError
from pomona.trajectory import Trajectory

__all__ = ["BagRecording"]

JUMP_MESSAGES = 50
"""Fewer pictures than these are passed over rather than looked up: a jump opens the file anew."""


@dataclass(frozen=True, eq=False, repr=False)
class BagRecording(RecordingCard):
    """Frames by row; see `Recording` for what it gives.

    Attributes
    ----------
    pictures : dict
        For `left`, `right`, `depth`, as there are.
    rows : dict
        For each of them the (F,) rows of its topic that make up the frames, ascending.
    registration : Registration or None
        For depth of another camera than the left one.
    """

    path: Path
    file: MessageFile
    roles: Roles
    optics: Optics
    pictures: dict[str, PictureTopic]
    rows: dict[str, NDArray[np.int64]]
    trajectory: Trajectory | None
    registration: Registration | None = None

    @property
    def calibration(self) -> Calibration:
        """The rectified left camera."""
        return self.optics.calibration

    @property
    def name(self) -> str:
        """Name of the file or folder."""
        return self.path.resolve().name if self.path.is_dir() else self.path.resolve().stem

    @property
    def date(self) -> str | None:
        """The date in the name, else that of the first picture, UTC."""
        return date_in_name(self.name) or date_of_ns(int(self._first.stamps_ns[0]))

    @property
    def numbers(self) -> tuple[int, ...]:
        """Rows of the left pictures' topic, from 0."""
        return tuple(next(iter(self.rows.values())).tolist())

    @property
    def recorded_numbers(self) -> tuple[int, ...]:
        """Rows of all left pictures."""
        return tuple(range(len(self._first.stamps_ns)))

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Time of each frame's left picture."""
        return self._first.stamps_ns[next(iter(self.rows.values()))] / 1e9

    @property
    def _first(self) -> PictureTopic:
        return next(iter(self.pictures.values()))

    def __len__(self) -> int:
        return len(next(iter(self.rows.values())))

    def frames(self, numbers: Collection[int] | None = None) -> Iterator[Frame]:
        """Read frame by frame; a picture is decoded when it is asked for."""
        times_s, all_numbers = self.times_s, self.numbers
        chosen = [row for row, _ in chosen_rows(all_numbers, numbers)]
        streams = [self._messages(kind, self.rows[kind][chosen].tolist()) for kind in self.pictures]
        for row, messages in zip(chosen, zip(*streams, strict=True), strict=True):
            readers = {
                f"read_{kind}": functools.partial(self._read, kind, int(self.rows[kind][row]), message)
                for kind, message in zip(self.pictures, messages, strict=True)
            }
            yield Frame(
                number=all_numbers[row],
                time_s=float(times_s[row]),
                session_from_camera=None if self.trajectory is None else self.trajectory.session_from_camera[row],
                **readers,
            )

    def inputs(self) -> Iterator[Path]:
        """Give the files of the bag and the calibration."""
        yield from dict.fromkeys((*self.file.files, *(path for path in self.optics.inputs if path.is_file())))

    def description(self) -> dict[str, Any]:
        """Say what was found."""
        counts = {kind: len(self) for kind in self.pictures}
        found = describe(self, self.file.kind, self.times_s.tolist(), counts)
        return {**found, "topics": str(self.roles)}

    def _messages(self, kind: str, wanted: Sequence[int]) -> Iterator[Message | None]:
        """Give the messages of some rows of a topic; None for one that is no longer there."""
        pictures = self.pictures[kind]
        in_order = bool((np.diff(pictures.logged_ns) >= 0).all())
        cuts = [place for place in range(1, len(wanted)) if wanted[place] - wanted[place - 1] > JUMP_MESSAGES]
        for start, end in zip([0, *cuts], [*cuts, len(wanted)], strict=True):
            run = wanted[start:end] if in_order else wanted
            start_ns = int(pictures.logged_ns[run[0]]) if in_order and run else None
            # Several may have been logged at one time: then reading begins at the first of them.
            row = 0 if start_ns is None else int(np.searchsorted(pictures.logged_ns, start_ns))
            messages = self.file.messages({pictures.topic.name}, start_ns)
            for at in run:
                message = None
                while row <= at:
                    message, row = next(messages, None), row + 1
                yield message
            if not in_order:
                return

    def _read(self, kind: str, row: int, message: Message | None) -> Any:
        pictures = self.pictures[kind]
        where = f"{self.path}: {pictures.topic.name}: picture {row}"
        if message is None:
            raise UnreadablePictureError(f"{where}: no longer there")
        try:
            content = decoded(message)
        except PomonaError:
            raise UnreadablePictureError(f"{where}: the message is corrupt") from None
        if kind == "depth":
            depth_m = depth_of(where, content, pictures.size_px, self.calibration.depth_unit_m)
            return self.optics.depth(depth_m) if self.registration is None else self.registration(depth_m)
        return getattr(self.optics, kind)(colour_of(where, content, pictures.size_px))
