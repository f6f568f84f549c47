"""ROS 2 bags whose recorder compressed each message or each file by itself (`--compression-mode`), in zstd."""

from __future__ import annotations

import dataclasses
import re
import shutil
import tempfile
import weakref
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from pomona.errors import PomonaError
from pomona.reading import read_text
from pomona.recording.bags.message_file import Message, MessageFile, Topic
from pomona.recording.bags.unpacked import UnpackError, unpack_file, unpacked

__all__ = ["CompressedBag", "compression_mode", "unpacked_files"]

PACKED_SUFFIX = ".zstd"


def compression_mode(metadata: Path) -> str:
    """`message` or `file`, nothing where neither was compressed by itself; chunks of MCAP are another matter."""
    text = read_text(metadata, "what rosbag2 writes about a bag")
    mode = re.search(r"^\s*compression_mode:\s*[\"']?(\w+)", text, re.MULTILINE)
    return mode[1].lower() if mode is not None and mode[1].lower() in ("message", "file") else ""


@dataclasses.dataclass(frozen=True, eq=False)
class CompressedBag:
    """See `MessageFile`.

    Attributes
    ----------
    inner : MessageFile
        What was unpacked, or what holds messages that are packed.
    files : tuple of Path
        As they were recorded.
    per_message : bool
        Whether each message is packed.
    """

    path: Path
    inner: MessageFile
    files: tuple[Path, ...]
    per_message: bool

    kind = "ROS 2 bag"

    @property
    def topics(self) -> dict[str, Topic]:
        """Of the bag within."""
        return self.inner.topics

    def messages(self, topics: Collection[str], start_ns: int | None = None) -> Iterator[Message]:
        """Read the messages; one that is damaged is empty, and so cannot be decoded."""
        for message in self.inner.messages(topics, start_ns):
            yield dataclasses.replace(message, body=_plain(message.body)) if self.per_message else message


def _plain(body: bytes) -> bytes:
    try:
        return unpacked("zstd", body)
    except UnpackError:
        return b""


def unpacked_files(path: Path, open_parts: Callable[[Path], MessageFile]) -> CompressedBag:
    """Unpack the files of a folder beside each other into a temporary one, which goes when the bag does.

    Raises
    ------
    PomonaError
        When there is none, or one is damaged or would fill the disk.
    """
    packed = tuple(sorted(file for file in path.iterdir() if file.is_file() and file.suffix == PACKED_SUFFIX))
    if not packed:
        raise PomonaError(f"{path}: found no files in {PACKED_SUFFIX}, expected some as metadata.yaml says")
    folder = Path(tempfile.mkdtemp(prefix="pomona-"))
    try:
        for file in packed:
            unpack_file(file, folder / file.stem)
        opened = CompressedBag(path, open_parts(folder), packed, per_message=False)
    except BaseException as error:
        shutil.rmtree(folder, ignore_errors=True)
        if isinstance(error, UnpackError):
            raise PomonaError(f"{path}: {error}") from None
        raise
    weakref.finalize(opened, shutil.rmtree, folder, ignore_errors=True)
    return opened
