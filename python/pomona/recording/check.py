"""Whether every picture of a recording can be read."""

from __future__ import annotations

from collections.abc import Callable

from pomona.recording.frame import Recording
from pomona.recording.pictures import UnreadablePictureError

__all__ = ["unreadable_frames"]


def unreadable_frames(recording: Recording, progress: Callable[[int, int], None] | None = None) -> dict[int, str]:
    """Decode all pictures, one frame after the other.

    Parameters
    ----------
    recording : Recording
        Any kind.
    progress : callable, optional
        Called after each frame with frames done and frames in all.

    Returns
    -------
    dict
        Number of each frame with a picture that cannot be read, and why, in one line.
    """
    found: dict[int, str] = {}
    for done, frame in enumerate(recording.frames(), start=1):
        for read in (frame.read_left, frame.read_right, frame.read_depth):
            try:
                if read is not None:
                    read()
            except UnreadablePictureError as error:
                found.setdefault(frame.number, str(error))
        if progress is not None:
            progress(done, len(recording))
    return found
