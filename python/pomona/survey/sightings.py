"""Fruits as single frames saw them, and one fruit out of many sightings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona import _core
from pomona.cloud import FruitCloud, Views
from pomona.survey.seeing import Look

__all__ = ["Sightings", "fruits_of", "places_of", "sizes_of"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Sightings:
    """One row for each box that was lifted, in order of time.

    Attributes
    ----------
    rows : (S,) int64
        Row of the frame in its part.
    boxes : (S,) int64
        Row of the box among all boxes of the part.
    centres_in_camera : (S, 3) float64
        In the frame of that camera, metres.
    covariances : (S, 3, 3) float64
        Square metres.
    diameters_m, diameter_sigmas_m, hidden : (S,) float64
        As in `Lifted`.
    """

    rows: Rows
    boxes: Rows
    centres_in_camera: Array
    covariances: Array
    diameters_m: Array
    diameter_sigmas_m: Array
    hidden: Array

    @classmethod
    def of(cls, looks: Sequence[Look]) -> Sightings:
        """Put the sightings of the frames of a part one after the other."""
        lifted = [look.lifted for look in looks]
        first_box = np.cumsum([0, *(len(look.detections) for look in looks)])[:-1]

        def joined(arrays: list[NDArray[Any]], *shape: int) -> Array:
            return np.concatenate([np.empty((0, *shape)), *arrays])

        return cls(
            rows=np.repeat(np.arange(len(looks)), [len(found) for found in lifted]),
            boxes=joined([found.rows + first for found, first in zip(lifted, first_box, strict=True)]).astype(np.int64),
            centres_in_camera=joined([found.centres_in_camera for found in lifted], 3),
            covariances=joined([found.covariances for found in lifted], 3, 3),
            diameters_m=joined([found.diameters_m for found in lifted]),
            diameter_sigmas_m=joined([found.diameter_sigmas_m for found in lifted]),
            hidden=joined([found.hidden for found in lifted]),
        )

    def select(self, rows: Rows) -> Sightings:
        """Keep these sightings."""
        return Sightings(**{name: values[rows] for name, values in vars(self).items()})


def fruits_of(
    sightings: Sightings, fruits: Rows, looks: Sequence[Look], session_from_camera: Array, names: Sequence[str]
) -> FruitCloud:
    """Fuse the sightings of each fruit.

    Parameters
    ----------
    sightings : Sightings
        Each of a fruit.
    fruits : (S,) int64
        Row in `names` of each; every fruit has a sighting.
    looks : sequence of Look
        The frames of the part.
    session_from_camera : (F, 4, 4) float64
        Their poses.
    names : sequence of N str
        Names of the fruits, the ids of the cloud.
    """
    positions, covariances, diameters_m, sigmas_m = _fused(sightings, fruits, session_from_camera)
    groups = _groups(fruits, len(names))
    extras = {"diameter_sigma_m": tuple(f"{sigma_m:.6f}" for sigma_m in sigmas_m)}
    if (colours := _colours(sightings, groups, looks)) is not None:
        extras["colour"] = colours
    return FruitCloud(
        positions=positions,
        ids=tuple(names),
        diameters_m=diameters_m,
        covariances=covariances,
        n_views=np.array([len(group) for group in groups], np.int64),
        views=Views(frames=np.array([look.frame for look in looks], np.int64)[sightings.rows], fruits=fruits),
        extras=extras,
    )


def places_of(sightings: Sightings, fruits: Rows, session_from_camera: Array) -> tuple[Array, Array]:
    """Give only the centres (N, 3) and covariances (N, 3, 3) of the fruits; parameters as in `fruits_of`."""
    positions, covariances, _, _ = _fused(sightings, fruits, session_from_camera)
    return positions, covariances


def sizes_of(sightings: Sightings, fruits: Rows, session_from_camera: Array, n: int) -> tuple[Array, Array]:
    """Give only diameters (N,) and their sigmas of `n` fruits, NaN for one without a sighting; -1 is of no fruit."""
    rows = np.flatnonzero(fruits >= 0)
    found, owners = np.unique(fruits[rows], return_inverse=True)
    diameters_m, sigmas_m = np.full(n, np.nan), np.full(n, np.nan)
    _, _, diameters_m[found], sigmas_m[found] = _fused(sightings.select(rows), owners, session_from_camera)
    return diameters_m, sigmas_m


def _fused(sightings: Sightings, fruits: Rows, session_from_camera: Array) -> tuple[Array, Array, Array, Array]:
    """Centres (N, 3), covariances (N, 3, 3), diameters and their sigmas (N,): the core's, in one call."""
    return _core.fuse_fruits(
        {
            "frames": np.ascontiguousarray(sightings.rows, np.int64),
            "fruits": np.ascontiguousarray(fruits, np.int64),
            "centres_in_camera": np.ascontiguousarray(sightings.centres_in_camera, np.float64),
            "covariances": np.ascontiguousarray(sightings.covariances, np.float64),
            "diameters_m": np.ascontiguousarray(sightings.diameters_m, np.float64),
            "diameter_sigmas_m": np.ascontiguousarray(sightings.diameter_sigmas_m, np.float64),
            "hidden": np.ascontiguousarray(sightings.hidden, np.float64),
        },
        np.ascontiguousarray(session_from_camera, np.float64),
    )


def _groups(fruits: Rows, n: int) -> list[Rows]:
    order = np.argsort(fruits, kind="stable")
    return np.split(order, np.searchsorted(fruits[order], np.arange(1, n))) if n else []


def _colours(sightings: Sightings, groups: list[Rows], looks: Sequence[Look]) -> tuple[str, ...] | None:
    """Median colour of each fruit as #rrggbb, None of a recording without colour."""
    if not looks or any(look.colours is None for look in looks):
        return None
    bgr = np.concatenate([look.colours for look in looks])[sightings.boxes]
    medians = [np.median(bgr[group], axis=0).round().astype(int) for group in groups]
    return tuple(f"#{red:02x}{green:02x}{blue:02x}" for blue, green, red in medians)
