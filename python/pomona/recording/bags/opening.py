"""From a bag to a recording: topics, cameras, pairs, poses."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError, PomonaWarning
from pomona.recording.bags.bag_recording import BagRecording
from pomona.recording.bags.camera_info import camera_of, rig_of, says_rectified
from pomona.recording.bags.contents import Contents, PictureTopic, read_contents
from pomona.recording.bags.frames_of_reference import path_between
from pomona.recording.bags.message_file import MessageFile, missing_extra
from pomona.recording.bags.poses import Known, camera_poses
from pomona.recording.bags.topics import Roles, chosen_topics
from pomona.recording.pairing import half_period, mutually_nearest
from pomona.recording.poses_in_time import LONGEST_GAP_S, posed_rows, poses_at
from pomona.recording.rectification import Optics, rectified
from pomona.recording.rig_files import find_optics
from pomona.trajectory import Trajectory

__all__ = ["BAG_SUFFIXES", "open_bag", "recognises"]

BAG_SUFFIXES = (".bag", ".mcap", ".db3", ".active")
"""`.bag.active` is the name of a ROS 1 bag as long as it is recorded."""

LOST_POSES, SLOWEST_GAP_S = 2.5, 0.5
"""Poses are taken across two that were lost, and no farther: a vehicle in a row moves half a metre in half a second."""


def recognises(place: Path) -> bool:
    """Whether a file or a folder is a bag."""
    if place.is_file():
        return place.suffix in BAG_SUFFIXES
    return (place / "metadata.yaml").is_file() or bool(_parts(place))


def open_bag(path: Path, calibration: Path | None = None, topics: Mapping[str, str] | None = None) -> BagRecording:
    """Open a bag: it is read once from beginning to end, and its pictures are not decoded.

    Parameters
    ----------
    path : Path
        A .bag, .mcap or .db3, or the folder of a ROS 2 bag.
    calibration : Path, optional
        Instead of the camera_info in it.
    topics : mapping, optional
        Topic of each role of `ROLES`, where they are not found by their names.

    Raises
    ------
    PomonaError
        When pictures or cameras are missing, not clear, or do not fit together.
    """
    try:
        import rosbags  # noqa: F401
    except ImportError:
        raise missing_extra(path) from None
    file = _open_file(path)
    roles = chosen_topics(path, file.topics, topics)
    contents = read_contents(file, roles)
    _require_kinds(path, contents)
    optics = _optics(path, roles, contents, calibration)
    rows = _simultaneous(path, contents.pictures)
    rows, trajectory = _posed(path, contents, rows, camera_poses(path, file, roles, contents), optics)
    return BagRecording(path, file, roles, optics, contents.pictures, rows, trajectory)


def _open_file(path: Path) -> MessageFile:
    from pomona.recording.bags.joined import JoinedBags
    from pomona.recording.bags.ros_bag import RosBag
    from pomona.recording.bags.sqlite_rest import is_cut_off

    parts = (path,) if path.is_file() else _parts(path)
    described = path.is_dir() and (path / "metadata.yaml").is_file()
    if described and not any(part.suffix == ".mcap" or is_cut_off(part) for part in parts):
        return RosBag.open(path, tuple(sorted(path.iterdir())))
    opened = tuple(map(_open_part, parts))
    return opened[0] if path.is_file() else JoinedBags(path, opened)


def _open_part(file: Path) -> MessageFile:
    from pomona.recording.bags.mcap_file import McapFile
    from pomona.recording.bags.ros1_rest import Ros1Rest, has_no_index
    from pomona.recording.bags.ros_bag import RosBag
    from pomona.recording.bags.sqlite_rest import SqliteRest, is_cut_off

    if file.suffix == ".mcap":
        return McapFile.open(file)
    if file.suffix == ".db3" and is_cut_off(file):
        return SqliteRest.open(file)
    if file.suffix == ".active" or (file.suffix == ".bag" and has_no_index(file)):
        return Ros1Rest.open(file)
    return RosBag.open(file, (file,))


def _parts(folder: Path) -> tuple[Path, ...]:
    """Files of a bag that was split, in the order of their numbers."""
    files = (file for file in folder.iterdir() if file.is_file() and file.suffix in (".mcap", ".db3"))
    return tuple(sorted(files, key=lambda file: [int(digits) for digits in re.findall(r"\d+", file.stem)]))


def _posed(
    path: Path, contents: Contents, rows: dict[str, NDArray[np.int64]], known: Known | None, optics: Optics
) -> tuple[dict[str, NDArray[np.int64]], Trajectory | None]:
    """Give the frames that have a pose, and their poses; all, and none, where the bag has no poses."""
    if known is None:
        return rows, None
    known_ns, session_from_left = known
    first = next(iter(contents.pictures))
    taken_ns = contents.pictures[first].stamps_ns[rows[first]]
    # Differences of nanoseconds are exact as integers, and only then.
    known_s = (known_ns - known_ns[0]) / 1e9
    longest_gap_s = float(np.clip(LOST_POSES * 2 * half_period(known_s), LONGEST_GAP_S, SLOWEST_GAP_S))
    poses, has_pose = poses_at((taken_ns - known_ns[0]) / 1e9, known_s, session_from_left, longest_gap_s)
    posed = posed_rows(path, has_pose, longest_gap_s)
    rows = {kind: of_kind[posed] for kind, of_kind in rows.items()}
    left_from_rectified = np.eye(4)
    left_from_rectified[:3, :3] = optics.rectified_from_left.T
    return rows, Trajectory(rows[first], taken_ns[posed] / 1e9, poses[posed] @ left_from_rectified)


def _require_kinds(path: Path, contents: Contents) -> None:
    pictures = contents.pictures
    left, right, depth = (pictures.get(kind) for kind in ("left", "right", "depth"))
    if depth is not None and not depth.depth:
        raise PomonaError(f"{path}: {depth.topic.name}: found colour or grey, expected depth")
    for other in (right, depth):
        if left is not None and other is not None and left.size_px != other.size_px:
            sizes = " and ".join("{}x{}".format(*each.size_px) for each in (left, other))
            names = f"{left.topic.name} and {other.topic.name}"
            raise PomonaError(f"{path}: {names}: found {sizes} pixels, expected equal sizes")


def _optics(path: Path, roles: Roles, contents: Contents, calibration: Path | None) -> Optics:
    """Rectify by what was given, else by the camera_info, else by a calibration beside the bag."""
    first = next(iter(contents.pictures.values()))
    stereo = "right" in contents.pictures
    infos = [roles.left_info or roles.depth_info, roles.right_info if stereo else None]
    if calibration is not None or not any(contents.infos.get(name or "") for name in infos):
        beside = path if path.is_dir() else path.parent
        try:
            return find_optics(beside, first.size_px, stereo=stereo, given=calibration)
        except PomonaError as error:
            if calibration is not None or "found none" not in str(error):
                raise
    expected = [roles.pictures.get("left") or roles.pictures["depth"], roles.right if stereo else None]
    cameras = []
    for info, picture in zip(infos, expected, strict=True):
        if picture is None:
            continue
        if info is None:
            wanted = f"{picture.rpartition('/')[0]}/camera_info"
            raise PomonaError(f"{path}: {picture}: found no camera_info for it, expected {wanted} or --calibration")
        cameras.append(camera_of(path, info, contents.infos[info], is_rectified=says_rectified(picture)))
    if not stereo:
        return rectified(rig_of((path,), cameras[0], None, None), first.size_px, stereo=False)
    right_from_left = path_between(contents.static, contents.pictures["right"].frame, first.frame)
    if right_from_left is not None and not right_from_left[:3, 3].any():
        right_from_left = None  # both pictures are said to be of one frame, as image_proc has it
    rig = rig_of((path,), cameras[0], cameras[1], right_from_left)
    return rectified(rig, first.size_px, stereo=True)


def _simultaneous(path: Path, pictures: dict[str, PictureTopic]) -> dict[str, NDArray[np.int64]]:
    """Rows of each topic that belong together: within half a frame of the first topic's; says what is left out."""
    kinds = list(pictures)
    first = pictures[kinds[0]]
    rows = {kinds[0]: np.arange(len(first.stamps_ns))}
    for kind in kinds[1:]:
        other = pictures[kind]
        farthest_ns = min(half_period(first.stamps_ns), half_period(other.stamps_ns), np.inf)
        pairs = mutually_nearest(first.stamps_ns[rows[kinds[0]]], other.stamps_ns, farthest_ns)
        if len(pairs) == 0:
            names = f"{first.topic.name} and {other.topic.name}"
            raise PomonaError(f"{path}: {names}: found no pictures within half a frame, expected one clock")
        rows = {known: of_known[pairs[:, 0]] for known, of_known in rows.items()} | {kind: pairs[:, 1]}
    counts = [len(pictures[kind].stamps_ns) for kind in kinds]
    if max(counts) > len(rows[kinds[0]]):
        found = ", ".join(f"{count} {kind}" for kind, count in zip(kinds, counts, strict=True))
        message = f"{path}: found {found} pictures, {len(rows[kinds[0]])} frames have all of them; others are left out"
        warnings.warn(message, PomonaWarning, stacklevel=4)
    return rows
