"""What a match is told besides the clouds, looked at where it is given: the core would not name the argument."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

import numpy as np

from pomona.arrays import checked_array
from pomona.errors import PomonaError
from pomona.reading import shown

__all__ = ["Method", "Scale", "Up", "core_vertical", "given_flag", "given_noise", "given_pose"]

Method: TypeAlias = Literal["paper", "verified"]
Scale: TypeAlias = Literal["metric", "free"]
Up: TypeAlias = Sequence[Sequence[float]]


def given_noise(noise_m: Any) -> float | None:
    """Take a standard deviation per axis, metres, or None; how large it may be the core says.

    Raises
    ------
    PomonaError
        When it is no number.
    """
    if noise_m is None:
        return None
    try:
        return float("" if isinstance(noise_m, str | bytes | bool) else noise_m)
    except (TypeError, ValueError, OverflowError):
        raise PomonaError(f"noise_m: found {shown(noise_m)}, expected metres per axis, or None") from None


def given_flag(name: str, flag: Any) -> bool:
    """Take True or False.

    Raises
    ------
    PomonaError
        When it is neither.
    """
    if not isinstance(flag, bool | np.bool_):
        raise PomonaError(f"{name}: found {shown(flag)}, expected True or False")
    return bool(flag)


def given_pose(map_from_query: Any) -> list[list[float]]:
    """Take a transform, (4, 4), as the core reads it, which says whether it is one.

    Raises
    ------
    PomonaError
        When it is no such array.
    """
    pose: list[list[float]] = checked_array("map_from_query", map_from_query, np.float64, (4, 4)).tolist()
    return pose


def core_vertical(up: Up | None) -> tuple[list[float], list[float]] | None:
    """Return the vertical in the query and in the map as the core reads it; one direction holds for both."""
    if up is None:
        return None
    if np.ma.is_masked(up):
        raise PomonaError("up: found a masked array, expected one whose values are all known")
    try:
        vectors = np.asarray(up, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise PomonaError("up: expected one direction, (3,), or two, (2, 3)") from None
    if vectors.shape == (3,):
        vectors = np.stack((vectors, vectors))
    if vectors.shape != (2, 3):
        raise PomonaError(f"up: found an array of shape {vectors.shape}, expected (3,) or (2, 3)")
    return vectors[0].tolist(), vectors[1].tolist()
