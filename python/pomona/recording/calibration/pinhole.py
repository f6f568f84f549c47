"""The camera: a rectified pinhole, in the pixels of the pictures."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.errors import PomonaError
from pomona.reading import MOST_NUMBER, parsed_json, read_text, shown
from pomona.recording.picture_size import require_size

__all__ = ["Calibration", "checked_baseline_m"]

FOCAL_RANGE_WIDTHS = (0.2, 20.0)
"""Focal length in picture widths: 0.2 is a field of view of 136 degrees, 20 one of 3; outside, the unit is wrong."""

BASELINE_RANGE_M = (0.005, 3.0)
"""Stereo cameras of an orchard are 5 mm to 3 m wide; 120 is a baseline in millimetres."""

DEPTH_UNIT_RANGE_M = (1e-5, 1e-2)
"""A step of a 16-bit depth picture; with 10 mm it would reach 655 m, with 0.01 mm 65 cm."""


@dataclass(frozen=True)
class Calibration:
    """The left camera and the distance to the right one.

    Picture coordinates have their origin at the **top left corner of the top left pixel**, so the centre of pixel
    (column i, row j) is (i + 1/2, j + 1/2), and boxes and the principal point use the same coordinates. OpenCV, ROS and
    Kalibr put the origin at the centre of that pixel: add 1/2 to their cx, cy.

    Attributes
    ----------
    width, height : int
        Size of the pictures, pixels.
    fx, fy, cx, cy : float
        Focal lengths and principal point, pixels.
    baseline_m : float or None
        Distance from the left to the right camera, None for a camera with depth and no second picture.
    depth_unit_m : float
        Metres per step of the depth pictures.

    Raises
    ------
    PomonaError
        A number is none that a camera can have, whoever made it; files are held to narrower bounds.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    baseline_m: float | None = None
    depth_unit_m: float = 0.001

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            _require(name, getattr(self, name), "a whole number of pixels", lambda size: size >= 1 and size % 1 == 0)
        for name in ("fx", "fy"):
            _require(name, getattr(self, name), "pixels above 0", lambda focal_px: focal_px > 0)
        for name in ("cx", "cy"):
            _require(name, getattr(self, name), "pixels", lambda _: True)
        if self.baseline_m is not None:
            _require("baseline_m", self.baseline_m, "metres above 0, or None", lambda baseline_m: baseline_m > 0)
        _require("depth_unit_m", self.depth_unit_m, "metres above 0", lambda unit_m: unit_m > 0)

    @classmethod
    def read(cls, path: str | Path, *, depth_unit_m: float = 0.001) -> Calibration:
        """Read `calibration.json`; `depth_unit_m` counts where the file does not say it.

        Raises
        ------
        PomonaError
            One line with the file, the field, what was found and what was expected.
        """
        fields = _read_object(Path(path))
        try:
            return _checked({"depth_unit_m": depth_unit_m, **fields})
        except PomonaError as error:
            raise PomonaError(f"{path}: {error}") from None

    def write(self, path: str | Path) -> None:
        """Write `calibration.json`."""
        fields: dict[str, Any] = {
            "width": self.width,
            "height": self.height,
            "fx": self.fx,
            "fy": self.fy,
            "cx": self.cx,
            "cy": self.cy,
            "baseline_m": self.baseline_m,
            "rectified": True,
            "depth_unit_m": self.depth_unit_m,
        }
        with whole_file(path) as partial:
            partial.write_text(json.dumps(fields, indent=1) + "\n", encoding="utf-8")

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.width, self.height

    def depth_error_m(self, depth_m: float, disparity_error_px: float) -> float | None:
        """Error of a stereo depth: Z^2 / (f B) times the error of the disparity; None without a baseline."""
        if self.baseline_m is None:
            return None
        return depth_m**2 / (self.fx * self.baseline_m) * disparity_error_px

    def rays(self, points_px: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give the directions (x, y, 1) in the camera of picture points (..., 2)."""
        x = (points_px[..., 0] - self.cx) / self.fx
        y = (points_px[..., 1] - self.cy) / self.fy
        return np.stack([x, y, np.ones_like(x)], axis=-1)


def _require(name: str, value: Any, expected: str, is_right: Callable[[float], bool]) -> None:
    """Refuse what is no finite number, or not a right one."""
    try:
        number = float(value) if isinstance(value, Real) else math.nan
    except OverflowError:
        number = math.nan
    if not (math.isfinite(number) and is_right(number)):
        raise PomonaError(f"{name}: found {shown(value)}, expected {expected}")


def checked_baseline_m(where: str, baseline_m: float) -> float:
    """Refuse a baseline that is missing, turned round or in millimetres, and say which.

    Raises
    ------
    PomonaError
        One line that begins with `where`.
    """
    low_m, high_m = BASELINE_RANGE_M
    expected = f"expected {low_m:g} to {high_m:g} (metres)"
    if baseline_m == 0:
        raise PomonaError(f"{where}: no baseline: found 0, {expected}")
    if low_m <= -baseline_m <= high_m:
        raise PomonaError(f"{where}: found the right camera on the left: swap left and right")
    if low_m <= abs(baseline_m) / 1000 <= high_m:
        raise PomonaError(f"{where}: found a baseline of {abs(baseline_m):g}, {expected}: it looks like millimetres")
    if not low_m <= baseline_m <= high_m:
        raise PomonaError(f"{where}: found a baseline of {baseline_m:g}, {expected}")
    return baseline_m


def _read_object(path: Path) -> dict[str, Any]:
    expected = "the camera's width, height, fx, fy, cx, cy in JSON"
    fields = parsed_json(str(path), read_text(path, expected), expected)
    if not isinstance(fields, dict):
        raise PomonaError(
            f"{path}: found a JSON {type(fields).__name__}, expected an object with width, height, fx ..."
        )
    return fields


def _checked(fields: dict[str, Any]) -> Calibration:
    width, height = _whole(fields, "width"), _whole(fields, "height")
    require_size("width, height", (width, height))
    shortest, longest = (factor * width for factor in FOCAL_RANGE_WIDTHS)
    focal_unit = f"pixels, for a picture {width} wide"
    if fields.get("rectified", True) is not True:
        raise PomonaError(f"rectified: found {shown(fields['rectified'])}, expected true: rectify the pictures first")
    if fields.get("baseline_m") is not None:
        _baseline_m(fields)
    if fields.get("depth_unit_m") is not None:
        _within(fields, "depth_unit_m", *DEPTH_UNIT_RANGE_M, "metres per step")
    return Calibration(
        width=width,
        height=height,
        fx=_within(fields, "fx", shortest, longest, focal_unit),
        fy=_within(fields, "fy", shortest, longest, focal_unit),
        cx=_within(fields, "cx", 0.0, float(width), "pixels"),
        cy=_within(fields, "cy", 0.0, float(height), "pixels"),
        baseline_m=fields.get("baseline_m"),
        depth_unit_m=fields.get("depth_unit_m") or 0.001,
    )


def _baseline_m(fields: dict[str, Any]) -> None:
    low_m, high_m = BASELINE_RANGE_M
    found = _number(fields, "baseline_m")
    hint = ": it looks like millimetres" if low_m <= found / 1000 <= high_m else ""
    if not low_m <= found <= high_m:
        raise PomonaError(f"baseline_m: found {found:g}, expected {low_m:g} to {high_m:g} (metres){hint}")


def _number(fields: dict[str, Any], name: str) -> float:
    if name not in fields:
        raise PomonaError(f"{name}: missing, expected a number")
    value = fields[name]
    if type(value) not in (int, float) or not abs(value) <= MOST_NUMBER:
        raise PomonaError(f"{name}: found {shown(value)}, expected a number")
    return float(value)


def _whole(fields: dict[str, Any], name: str) -> int:
    value = _number(fields, name)
    if value != int(value) or value < 1:
        raise PomonaError(f"{name}: found {value:g}, expected a whole number of pixels")
    return int(value)


def _within(fields: dict[str, Any], name: str, low: float, high: float, unit: str) -> float:
    value = _number(fields, name)
    if not low <= value <= high:
        raise PomonaError(f"{name}: found {value:g}, expected {low:g} to {high:g} ({unit})")
    return value
