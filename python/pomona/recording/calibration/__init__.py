"""The camera: as its calibration says, from the files of other programs, rectified."""

from pomona.recording.calibration.pinhole import Calibration

__all__ = ["Calibration"]
