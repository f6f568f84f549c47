"""From a path to the recording in it; each kind of recording is imported when it is met."""

from __future__ import annotations

from pathlib import Path

from pomona.errors import PomonaError
from pomona.recording.frame import Recording

__all__ = ["open_recording"]


def open_recording(path: str | Path) -> Recording:
    """Open a recording and check what can be checked without decoding it.

    Parameters
    ----------
    path : str or Path
        A recording folder: `calibration.json` beside `depth/` or `left/`.

    Raises
    ------
    PomonaError
        When there is no recording at `path`, or it is not complete.
    """
    folder = Path(path)
    if not folder.exists():
        raise PomonaError(f"{path}: not found, expected a recording folder")
    if not folder.is_dir():
        raise PomonaError(f"{path}: found a file, expected a recording folder with calibration.json and depth/")
    from pomona.recording.folder import FolderRecording

    return FolderRecording.open(folder)
