"""Arrays as the types of the borders hold them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError

__all__ = ["checked_array", "definite_matrices", "kept_array", "rigid_matrices", "rigid_motions"]

RIGID = 1e-3
"""How far a rotation may be from one: its numbers may come from text, or from sums of many motions."""

FARTHEST_M = 1e6
"""No two frames of a recording are farther apart, metres; the core has the same bound."""

NO_NUMBERS = "bcmM"
"""Kinds of arrays that NumPy makes numbers of: truths, times, complex ones without their imaginary part."""

SYMMETRIC = 1e-6
"""The same of a symmetric matrix, relative to its largest number."""


def checked_array(name: str, values: Any, dtype: Any, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """Return `values` as a contiguous array of `dtype`; None in `shape` takes any length."""
    try:
        if isinstance(values, np.ndarray) and values.dtype.kind in NO_NUMBERS and np.dtype(dtype).kind in "fi":
            raise PomonaError(f"{name}: found {values.dtype.name}, expected an array of {np.dtype(dtype).name}")
        if np.ma.is_masked(values):
            raise PomonaError(f"{name}: found a masked array, expected one whose values are all known")
        array = np.ascontiguousarray(values, dtype=dtype)
    except (TypeError, ValueError, OverflowError):
        raise PomonaError(f"{name}: expected an array of {np.dtype(dtype).name}") from None
    if array.shape == (0,) and shape[0] is None and None not in shape[1:]:
        array = array.reshape(0, *shape[1:])  # an empty list says nothing of how long its rows are
    fits = array.ndim == len(shape) and all(
        want is None or found == want for found, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("N" if want is None else str(want) for want in shape)
        found = ", ".join(map(str, array.shape))
        raise PomonaError(f"{name}: found shape ({found}), expected ({wanted})")
    if array.dtype.kind == "i" and (given := np.asarray(values)).dtype.kind == "f" and (given != array).any():
        raise PomonaError(f"{name}: found {given[given != array][0]:g}, expected whole numbers")
    return array


def kept_array(name: str, values: Any, dtype: Any, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """Return `checked_array` as one that nobody writes into: what was checked stays so."""
    array = checked_array(name, values, dtype, shape)
    if array.flags.writeable:
        array = array.copy() if np.may_share_memory(array, np.asarray(values)) else array
        array.flags.writeable = False
    return array


def rigid_matrices(name: str, values: Any, shape: tuple[int | None, ...] = (4, 4)) -> NDArray[np.float64]:
    """Return rigid transforms, (4, 4) or (N, 4, 4).

    Raises
    ------
    PomonaError
        One of them does more than turn and move, or is not finite.
    """
    poses: NDArray[np.float64] = checked_array(name, values, np.float64, shape)
    turns = poses[..., :3, :3]
    is_rigid = np.isfinite(poses).all(axis=(-2, -1))
    with np.errstate(all="ignore"):
        is_rigid &= np.abs(turns @ np.swapaxes(turns, -1, -2) - np.eye(3)).max(axis=(-2, -1)) < RIGID
        is_rigid &= np.linalg.det(turns) > 0
        is_rigid &= np.abs(poses[..., 3, :] - (0, 0, 0, 1)).max(axis=-1) < RIGID
    if not is_rigid.all():
        raise PomonaError(f"{name}: {_which(is_rigid)}found a matrix that does not turn and move, expected a rigid one")
    return poses


def rigid_motions(name: str, values: Any, shape: tuple[int | None, ...] = (4, 4)) -> NDArray[np.float64]:
    """Return rigid transforms from one frame to another one, (4, 4) or (N, 4, 4).

    Raises
    ------
    PomonaError
        One of them is not rigid, or leads farther than any row is long.
    """
    motions = rigid_matrices(name, values, shape)
    is_near = np.abs(motions[..., :3, 3]).max(axis=-1) <= FARTHEST_M
    if not is_near.all():
        raise PomonaError(f"{name}: {_which(is_near)}found one beyond 1,000 km, expected metres between two frames")
    return motions


def definite_matrices(name: str, values: Any, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Return symmetric positive definite matrices, (M, M) or (N, M, M).

    Raises
    ------
    PomonaError
        One of them is none, or not finite.
    """
    matrices: NDArray[np.float64] = checked_array(name, values, np.float64, shape)
    is_finite = np.isfinite(matrices).all(axis=(-2, -1))
    known = np.where(np.isfinite(matrices).all(axis=(-2, -1), keepdims=True), matrices, np.eye(matrices.shape[-1]))
    largest = np.abs(known).max(axis=(-2, -1), initial=0.0)
    is_one = is_finite & (
        np.abs(known - np.swapaxes(known, -1, -2)).max(axis=(-2, -1), initial=0.0) <= SYMMETRIC * largest
    )
    is_one &= np.linalg.eigvalsh(known).min(axis=-1, initial=np.inf) > 0
    if not is_one.all():
        raise PomonaError(f"{name}: {_which(is_one)}found a matrix that is not symmetric positive definite")
    return matrices


def _which(is_right: Any) -> str:
    """Name the row of the first that is wrong; of one alone there is none."""
    return f"row {int(np.argmin(is_right))}: " if np.ndim(is_right) else ""
