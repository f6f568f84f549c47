"""From a path to the recording in it; the libraries of a kind are imported when they are needed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pomona.errors import PomonaError
from pomona.reading import require_file
from pomona.recording.frame import Recording

if TYPE_CHECKING:
    from pomona.recording.posed import RectifiedRecording

__all__ = ["ACCEPTED", "open_recording"]

ACCEPTED = (
    "a recording folder (left/ or depth/ with calibration.json), a KITTI, TUM RGB-D or EuRoC folder, "
    "a side-by-side video, a folder with left.mp4 and right.mp4, a ROS 1 bag, a ROS 2 bag, "
    "an MCAP or a ZED .svo2"
)
"""For messages and the help."""


def open_recording(
    path: str | Path,
    *,
    calibration: str | Path | None = None,
    topics: Mapping[str, str] | None = None,
    poses: str | Path | None = None,
    own_poses: bool = True,
) -> Recording:
    """Open a recording and check what can be checked without decoding it.

    Parameters
    ----------
    path : str or Path
        One of `ACCEPTED`; the kind is recognised by its files.
    calibration : str or Path, optional
        File or folder with the calibration, where it does not lie beside the pictures.
    topics : mapping, optional
        Of a bag: the topic of `left`, `right`, `depth`, `left_info`, `right_info`, `depth_info` or `poses`, where it is
        not found by its name.
    poses : str or Path, optional
        TUM or KITTI text to take the poses of the left camera from, instead of those of the recording, which are then
        not read.
    own_poses : bool
        Whether poses that came with the recording are read. Without them its frames are all there, and broken ones
        stop nothing.

    Raises
    ------
    PomonaError
        When there is no recording at `path`, or it is not complete.
    """
    place, given = Path(path), None if calibration is None else Path(calibration)
    try:
        recording = _open(place, given, topics, own_poses and poses is None)
    except OSError as error:
        raise PomonaError(f"{error.filename or place}: cannot be read: {error.strerror or error}") from None
    if poses is None:
        return recording
    from pomona.recording.posed import with_poses

    return with_poses(recording, Path(poses))


def _open(place: Path, given: Path | None, topics: Mapping[str, str] | None, own_poses: bool) -> RectifiedRecording:
    if not place.is_dir():
        require_file(place, ACCEPTED)
    from pomona.recording import bags
    from pomona.recording.video.stereo_video import VIDEO_SUFFIXES, left_and_right, open_video

    if bags.recognises(place):
        return bags.open_bag(place, given, topics, own_poses=own_poses)
    if topics:
        raise PomonaError(f"{place}: topics: found no bag, expected one for --topics")
    if not place.is_dir():
        if place.suffix.lower() == ".svo2":
            from pomona.recording.formats.svo2 import open_svo2

            return open_svo2(place, given)
        if place.suffix.lower() == ".svo":
            raise PomonaError(f"{place}: only its maker can read an .svo: convert it to .svo2 with ZED_SVO_Editor")
        if place.suffix.lower() not in VIDEO_SUFFIXES:
            raise PomonaError(f"{place}: found a file, expected {ACCEPTED}")
        return open_video(place, given)
    layout = _open_layout(place, given, own_poses)
    return layout or (open_video(place, given) if left_and_right(place) else _refuse(place))


def _open_layout(folder: Path, calibration: Path | None, own_poses: bool) -> RectifiedRecording | None:
    """Open a folder of pictures, None where it is none."""
    from pomona.recording.formats import euroc, kitti, tum_rgbd
    from pomona.recording.formats.folder import FolderRecording

    if euroc.recognises(folder):
        return euroc.open_euroc(folder, calibration, own_poses=own_poses)
    if tum_rgbd.recognises(folder):
        return tum_rgbd.open_tum_rgbd(folder, calibration, own_poses=own_poses)
    if kitti.recognises(folder):
        return kitti.open_kitti(folder, calibration, own_poses=own_poses)
    if any((folder / kind).is_dir() for kind in ("left", "right", "depth")):
        return FolderRecording.open(folder, calibration, own_poses=own_poses)
    return None


def _refuse(folder: Path) -> RectifiedRecording:
    inside = sorted(entry.name + "/" * entry.is_dir() for entry in folder.iterdir() if not entry.name.startswith("."))
    found = ", ".join(inside[:5]) + (" ..." if len(inside) > 5 else "") or "nothing"
    raise PomonaError(f"{folder}: no pictures found: found {found}, expected {ACCEPTED}")
