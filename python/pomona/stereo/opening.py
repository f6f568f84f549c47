"""From a word or a file to what measures depth in a stereo pair."""

from __future__ import annotations

from pathlib import Path

from pomona.errors import PomonaError
from pomona.recording.calibration import Calibration
from pomona.stereo.pair import Stereo

__all__ = ["open_stereo"]


def open_stereo(how: str, calibration: Calibration) -> Stereo:
    """Open a way to measure depth.

    Parameters
    ----------
    how : str
        ``stereo``: at the fruits alone; ``dense``: all over the picture; else a stereo network, an ONNX file.
    calibration : Calibration
        The rectified left camera, with a baseline.

    Raises
    ------
    PomonaError
        When the camera has no baseline, or there is no such way or file.
    """
    if how == "stereo":
        from pomona.stereo.fruits import StereoDepth

        return StereoDepth(calibration)
    if how == "dense":
        from pomona.stereo.dense import DenseStereo

        return DenseStereo(calibration)
    if Path(how).suffix.lower() != ".onnx":
        raise PomonaError(f"depth: found {how!r}, expected stereo, dense or a stereo network, NAME.onnx")
    from pomona.stereo.onnx_stereo import OnnxStereo

    return OnnxStereo.open(how, calibration)
