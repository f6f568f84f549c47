"""Numbers and matrices out of a calibration, with the field's name when they are not there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import MOST_NUMBER, shown
from pomona.recording.picture_size import require_size

__all__ = ["array_of", "checked_size", "distortion_of", "size_of"]

DISTORTIONS = {
    "plumb_bob": False,
    "rational_polynomial": False,
    "radtan": False,
    "radial-tangential": False,
    "none": False,
    "equidistant": True,
    "fisheye": True,
}
"""Name of the distortion in ROS, Kalibr and EuRoC: whether it is the fisheye one."""


def array_of(where: str, fields: Mapping[str, Any], name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Give a field as an array; -1 in `shape` is any length. ROS and OpenCV keep the numbers of a matrix in `data`."""
    value = fields.get(name)
    if value is None:
        raise PomonaError(f"{where}: {name}: missing, expected {_numbers(shape)}")
    cells = value.get("data") if isinstance(value, Mapping) else value
    try:
        array = np.array(cells, np.float64)
        array = array.reshape(shape)
    except (TypeError, ValueError, OverflowError):
        raise PomonaError(f"{where}: {name}: found {shown(cells)}, expected {_numbers(shape)}") from None
    if not (np.abs(array) <= MOST_NUMBER).all():
        raise PomonaError(f"{where}: {name}: found NaN or infinity, expected {_numbers(shape)}")
    return array


def _numbers(shape: tuple[int, ...]) -> str:
    return "a list of numbers" if -1 in shape else f"{'x'.join(map(str, shape))} numbers"


def size_of(where: str, fields: Mapping[str, Any], width: str, height: str) -> tuple[int, int]:
    """Width and height of the pictures from two fields."""
    return checked_size(where, [float(array_of(where, fields, name, ())) for name in (width, height)])


def checked_size(where: str, sides: Sequence[float]) -> tuple[int, int]:
    """Width and height of pictures, when they are those of any."""
    width, height = (int(side) for side in sides)
    return require_size(where, (width, height))


def distortion_of(where: str, model: object, coefficients: NDArray[np.float64]) -> tuple[NDArray[np.float64], bool]:
    """Check coefficients against the name of their model; tell whether it is the fisheye."""
    fisheye = DISTORTIONS.get(str(model or "none").lower())
    if fisheye is None:
        raise PomonaError(f"{where}: found the distortion {shown(model)}, expected one of {', '.join(DISTORTIONS)}")
    lengths = (4,) if fisheye else (0, 4, 5, 8, 12, 14)
    if len(coefficients) not in lengths:
        expected = " or ".join(map(str, lengths))
        raise PomonaError(f"{where}: found {len(coefficients)} coefficients of distortion, expected {expected}")
    return coefficients, fisheye
