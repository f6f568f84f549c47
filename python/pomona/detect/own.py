"""A detector of the caller's own, as a scan takes it: looked at for what it gives, named by what it is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pomona.detect.detections import Detections, Detector
from pomona.errors import PomonaError
from pomona.recording import Frame

__all__ = ["OwnDetector"]


@dataclass(frozen=True, eq=False)
class OwnDetector:
    """Boxes of any function.

    Attributes
    ----------
    detector : Detector
        Called with each frame, in another thread than the caller's, one frame at a time.
    """

    detector: Detector

    def __call__(self, frame: Frame) -> Detections:
        """Give its boxes of a frame.

        Raises
        ------
        PomonaError
            When it gives anything but `Detections`.
        """
        found = self.detector(frame)
        if not isinstance(found, Detections):
            kind = type(found).__name__
            raise PomonaError(
                f"{self.description}: frame {frame.number}: found {kind}, expected pomona.detect.Detections"
            )
        return found

    @property
    def with_ids(self) -> bool:
        """Whether it says that its boxes name their fruits."""
        return bool(getattr(self.detector, "with_ids", False))

    @property
    def inputs(self) -> list[Path]:
        """No files that anybody knows of."""
        return []

    @property
    def configuration(self) -> dict[str, Any]:
        """Its name, for a session's provenance."""
        return {"detector": self.description}

    @property
    def description(self) -> str:
        """Its name."""
        kind = type(self.detector)
        return str(getattr(self.detector, "__qualname__", kind.__qualname__))
