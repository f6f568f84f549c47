"""From a path to what reads the bag there; each kind is imported when it is met."""

from __future__ import annotations

import re
from pathlib import Path

from pomona.errors import PomonaError
from pomona.recording.bags.message_file import MessageFile

__all__ = ["BAG_SUFFIXES", "open_messages", "recognises", "rest_of"]

BAG_SUFFIXES = (".bag", ".mcap", ".db3", ".active")
"""`.bag.active` is the name of a ROS 1 bag as long as it is recorded."""


def recognises(place: Path) -> bool:
    """Whether a file or a folder is a bag."""
    if place.is_file():
        return place.suffix in BAG_SUFFIXES
    if not place.is_dir():
        return False
    return (place / "metadata.yaml").is_file() or bool(_parts(place))


def open_messages(path: Path) -> MessageFile:
    """Open a file, or the folder of a ROS 2 bag, whole or cut off.

    Raises
    ------
    PomonaError
        When it is no bag.
    """
    from pomona.recording.bags.compressed import CompressedBag, compression_mode, unpacked_files
    from pomona.recording.bags.joined import JoinedBags
    from pomona.recording.bags.sqlite_rest import is_cut_off

    parts = (path,) if path.is_file() else _parts(path)
    described = path.is_dir() and (path / "metadata.yaml").is_file()
    mode = compression_mode(path / "metadata.yaml") if described else ""
    if mode == "file":
        return unpacked_files(path, open_messages)
    if mode == "message":
        joined = JoinedBags(path, tuple(map(_open_part, parts)))
        return CompressedBag(path, joined, joined.files, per_message=True)
    if described and all(part.suffix == ".db3" and not is_cut_off(part) for part in parts):
        return _ros_bag(path, tuple(sorted(path.iterdir())))
    if not described and len({re.sub(r"_\d+$", "", part.stem) for part in parts}) > 1:
        found = ", ".join(part.name for part in parts)
        raise PomonaError(f"{path}: found {found}, expected one bag, or the parts of one: row_0.mcap, row_1.mcap ...")
    opened = tuple(map(_open_part, parts))
    return opened[0] if path.is_file() else JoinedBags(path, opened)


def rest_of(path: Path) -> MessageFile:
    """Open what can be read of a damaged ROS bag.

    Raises
    ------
    PomonaError
        When nothing can.
    """
    from pomona.recording.bags.joined import JoinedBags
    from pomona.recording.bags.ros1_rest import Ros1Rest
    from pomona.recording.bags.sqlite_rest import SqliteRest

    if path.is_file():
        return SqliteRest.open(path) if path.suffix == ".db3" else Ros1Rest.open(path)
    return JoinedBags(path, tuple(map(SqliteRest.open, _parts(path))))


def _open_part(file: Path) -> MessageFile:
    from pomona.recording.bags.mcap_file import McapFile
    from pomona.recording.bags.ros1_rest import Ros1Rest, has_no_index
    from pomona.recording.bags.sqlite_rest import SqliteRest, is_cut_off

    if file.suffix == ".mcap":
        return McapFile.open(file)
    if file.suffix == ".db3" and is_cut_off(file):
        return SqliteRest.open(file)
    if file.suffix == ".active" or (file.suffix == ".bag" and has_no_index(file)):
        return Ros1Rest.open(file)
    return _ros_bag(file, (file,))


def _ros_bag(path: Path, files: tuple[Path, ...]) -> MessageFile:
    from pomona.recording.bags.ros_bag import DamagedBagError, RosBag

    try:
        return RosBag.open(path, files)
    except DamagedBagError:
        if path.is_dir() and not _parts(path):
            raise
        return rest_of(path)


def _parts(folder: Path) -> tuple[Path, ...]:
    """Files of a bag that was split, in the order of their numbers."""
    files = (file for file in folder.iterdir() if file.is_file() and file.suffix in (".mcap", ".db3"))
    return tuple(sorted(files, key=lambda file: [int(digits) for digits in re.findall(r"[0-9]{1,18}", file.stem)]))
