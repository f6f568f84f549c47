"""Calibrations of other programs; one file for each kind."""

from pomona.recording.calibration.rig_files.opening import find_optics

__all__ = ["find_optics"]
