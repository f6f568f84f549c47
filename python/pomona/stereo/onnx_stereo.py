"""Depth of the whole picture by a stereo network: an ONNX file that takes two pictures and gives disparities."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from pomona.detect.onnx.network import input_size, open_session, reason_of
from pomona.errors import PomonaError
from pomona.reading import shown
from pomona.recording.calibration import Calibration
from pomona.stereo.fruit_depth import FruitDepth
from pomona.stereo.pair import Picture, depth_of_disparity, focal_baseline_px_m, in_colour

__all__ = ["OnnxStereo", "Values"]

Values = Literal["0-255", "0-1"]
"""Range of the colours that a network was trained on: RAFT-Stereo and CREStereo take 0 to 255, HITNet 0 to 1."""

MULTIPLE_PX = 32
"""Networks that take any size halve it five times: pictures are padded to a multiple of this."""

DISPARITY_SIGMA_PX = 0.5
"""Standard deviation of a fruit's disparity, where nobody measured that of the network."""

NEEDED = "two pictures (1, 3, height, width) of float32, left and right"


@dataclass(frozen=True, eq=False)
class OnnxStereo:
    """A stereo network; `open` makes one. Fruits are found by the votes of their pixels."""

    path: Path
    calibration: Calibration
    values: Values
    disparity_sigma_px: float
    _session: Any
    _inputs: tuple[str, str]
    _size_px: tuple[int, int] | None

    @classmethod
    def open(
        cls,
        path: str | Path,
        calibration: Calibration,
        *,
        values: Values = "0-255",
        disparity_sigma_px: float = DISPARITY_SIGMA_PX,
        threads: int | None = None,
    ) -> OnnxStereo:
        """Open a model.

        Parameters
        ----------
        path : str or Path
            The ONNX file: inputs left and right, in this order unless their names say otherwise, RGB; the first output
            holds the disparities of the left picture, (1, 1, H, W) or (1, H, W), of either sign.
        calibration : Calibration
            The rectified left camera, with a baseline.
        values : {"0-255", "0-1"}
            Range of the colours that it was trained on.
        disparity_sigma_px : float
            Standard deviation of a fruit's disparity.
        threads : int, optional
            For ONNX Runtime; one a core where it is None.

        Raises
        ------
        PomonaError
            When the camera has no baseline, or the file cannot be run or wants other inputs.
        """
        focal_baseline_px_m(calibration)
        path = Path(path)
        session = open_session(path, threads)
        inputs = session.get_inputs()
        if len(inputs) != 2 or any(len(one.shape) != 4 or one.type != "tensor(float)" for one in inputs):
            found = ", ".join(f"{one.name} {one.shape} {one.type}" for one in inputs)
            raise PomonaError(f"{path}: inputs: found {found}, expected {NEEDED}")
        if "right" in inputs[0].name.lower():
            inputs = inputs[::-1]
        height, width = inputs[0].shape[2:]
        size_px = input_size(path, width, height)
        names = (inputs[0].name, inputs[1].name)
        return cls(path, calibration, values, disparity_sigma_px, session, names, size_px)

    def __call__(self, left: Picture, right: Picture, boxes_px: NDArray[np.float64]) -> FruitDepth:
        """Measure the depth of the whole picture; see `StereoDepth` for the arguments and errors."""
        pair = [in_colour(one, self.calibration) for one in (left, right)]
        fed = dict(zip(self._inputs, map(self._prepared, pair), strict=True))
        try:
            output = self._session.run(None, fed)[0]
        except Exception as error:  # ONNX Runtime's errors have no base of their own
            raise PomonaError(f"{self.path}: cannot be run: {reason_of(error)}") from None
        disparity_px = self._disparity_px(_numbers(self.path, output))
        sigma_px = np.full(len(boxes_px), self.disparity_sigma_px)
        return FruitDepth(depth_of_disparity(disparity_px, self.calibration), sigma_px)

    def _prepared(self, picture: Picture) -> NDArray[np.float32]:
        """Resize to the network's size, or pad on the right and below where it takes any."""
        if self._size_px is not None:
            sized = cv2.resize(picture, self._size_px, interpolation=cv2.INTER_AREA)
        else:
            below, beside = (-side % MULTIPLE_PX for side in picture.shape[:2])
            sized = cv2.copyMakeBorder(picture, 0, below, 0, beside, cv2.BORDER_REPLICATE)
        rgb = np.ascontiguousarray(sized[..., ::-1].transpose(2, 0, 1)[None], np.float32)
        return rgb / np.float32(255) if self.values == "0-1" else rgb

    def _disparity_px(self, output: NDArray[np.float32]) -> NDArray[np.float32]:
        """Bring an output to the pictures' size and pixels."""
        width, height = self.calibration.size_px
        found = np.squeeze(output)
        if found.ndim != 2 or (self._size_px is None and (found.shape[0] < height or found.shape[1] < width)):
            raise PomonaError(f"{self.path}: output: found shape {output.shape}, expected (1, 1, {height}, {width})")
        # Networks of optical flow give the motion to the left as negative; what is no number is no disparity.
        found = np.nan_to_num(np.abs(found), nan=0.0, posinf=0.0)
        if self._size_px is None:
            return np.ascontiguousarray(found[:height, :width])
        sized = np.asarray(cv2.resize(found, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)
        return sized * np.float32(width / found.shape[1])


def _numbers(path: Path, output: Any) -> NDArray[np.float32]:
    if not isinstance(output, np.ndarray) or output.dtype.kind not in "fiu" or not output.size:
        raise PomonaError(f"{path}: output: found {shown(output)}, expected disparities")
    return np.asarray(output, np.float32)
