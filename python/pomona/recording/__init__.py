"""What people record: pictures, depth, calibration and poses, read frame by frame."""

from pomona.recording.calibration import Calibration
from pomona.recording.frame import Frame, Recording
from pomona.recording.opening import open_recording
from pomona.recording.selection import selected

__all__ = ["Calibration", "Frame", "Recording", "open_recording", "selected"]
