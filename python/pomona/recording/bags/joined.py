"""Bags that the recorder split into several files, read as one."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from pomona.recording.bags.message_file import Message, MessageFile, Topic

__all__ = ["JoinedBags"]


@dataclass(frozen=True, eq=False)
class JoinedBags:
    """See `MessageFile`; the parts follow one another in time."""

    path: Path
    parts: tuple[MessageFile, ...]

    kind = "ROS 2 bag"

    @property
    def topics(self) -> dict[str, Topic]:
        """Of all parts."""
        return {name: topic for part in self.parts for name, topic in part.topics.items()}

    @property
    def files(self) -> tuple[Path, ...]:
        """Of all parts."""
        return tuple(file for part in self.parts for file in part.files)

    def messages(self, topics: Collection[str], start_ns: int | None = None) -> Iterator[Message]:
        """Read part after part."""
        for part in self.parts:
            yield from part.messages(topics, start_ns)
