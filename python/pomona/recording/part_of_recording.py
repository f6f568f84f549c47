"""What a part of a recording has from the whole."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pomona.recording.calibration import Calibration
from pomona.recording.card import RecordingCard
from pomona.recording.frame import Recording

__all__ = ["PartOfRecording"]


@dataclass(frozen=True, eq=False, repr=False)
class PartOfRecording(RecordingCard):
    """Some frames of a recording; who derives from it says which.

    Attributes
    ----------
    whole : Recording
        Of any kind.
    """

    whole: Recording

    @property
    def path(self) -> Path:
        """Where it came from."""
        return self.whole.path

    @property
    def name(self) -> str:
        """Name of the whole."""
        return self.whole.name

    @property
    def date(self) -> str | None:
        """Date of the whole."""
        return self.whole.date

    @property
    def recorded_numbers(self) -> tuple[int, ...]:
        """All frames that were recorded."""
        return self.whole.recorded_numbers

    @property
    def calibration(self) -> Calibration:
        """The rectified left camera."""
        return self.whole.calibration
