"""Fruits as single frames saw them, and one fruit out of many sightings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud, Views
from pomona.survey.fusion import fuse_centres, fuse_diameters
from pomona.survey.seeing import Look

__all__ = ["Sightings", "fruits_of"]

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

    def with_depths(self, depths_m: Array) -> Sightings:
        """Give the diameters that the outlines have at these depths (S,), and what the outlines alone err by.

        A diameter is the outline's ratio 2 R / Z times the depth Z. The error of a depth that all sightings of a fruit
        share is not in these.
        """
        stretch = depths_m / self.centres_in_camera[:, 2]
        of_outline = self.diameter_sigmas_m**2 - self.ratios**2 * self.covariances[:, 2, 2]
        return replace(self, diameters_m=stretch * self.diameters_m, diameter_sigmas_m=stretch * np.sqrt(of_outline))

    @property
    def ratios(self) -> Array:
        """Diameter over depth, (S,): what the outline says."""
        return self.diameters_m / self.centres_in_camera[:, 2]

    def with_diameters(self, diameters_m: Array, outlined_m: Array) -> Sightings:
        """Move the centres to where they are if fruits have these diameters, (S,), and not those of their outlines.

        A centre lies behind the surface by half of what its own outline says. A better diameter moves it along its ray
        by half the difference.
        """
        rays = self.centres_in_camera / np.linalg.norm(self.centres_in_camera, axis=1, keepdims=True)
        return replace(self, centres_in_camera=self.centres_in_camera + (diameters_m - outlined_m)[:, None] / 2 * rays)


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
    groups = _groups(fruits, len(names))
    place = partial(_places, groups=groups, session_from_camera=session_from_camera)
    # The place gives each sighting a better depth, that a better diameter, and that moves the centre it lies behind.
    rough = place(sightings)
    depths_m, depth_variances = _depths(sightings, rough[0][fruits], rough[1][fruits], session_from_camera)
    placed = sightings.with_depths(depths_m)
    sizes = _diameters(placed, placed.ratios**2 * depth_variances, groups)
    positions, covariances = place(sightings.with_diameters(sizes[fruits, 0], placed.diameters_m))
    extras = {"diameter_sigma_m": tuple(f"{sigma_m:.6f}" for sigma_m in sizes[:, 1])}
    if (colours := _colours(sightings, groups, looks)) is not None:
        extras["colour"] = colours
    return FruitCloud(
        positions=positions,
        ids=tuple(names),
        diameters_m=sizes[:, 0],
        covariances=covariances,
        n_views=np.array([len(group) for group in groups], np.int64),
        views=Views(frames=np.array([look.frame for look in looks], np.int64)[sightings.rows], fruits=fruits),
        extras=extras,
    )


def _places(sightings: Sightings, groups: list[Rows], session_from_camera: Array) -> tuple[Array, Array]:
    """Centres (N, 3) and covariances (N, 3, 3) of the fruits in the session."""
    poses = session_from_camera[sightings.rows]
    rotations = poses[:, :3, :3]
    rays = np.einsum("sij,sj->si", rotations, sightings.centres_in_camera)
    centres = rays + poses[:, :3, 3]
    covariances = rotations @ sightings.covariances @ rotations.transpose(0, 2, 1)
    found = [fuse_centres(centres[group], covariances[group], rays[group]) for group in groups]
    places = np.array([centre for centre, _ in found]).reshape(-1, 3)
    return places, np.array([covariance for _, covariance in found]).reshape(-1, 3, 3)


def _groups(fruits: Rows, n: int) -> list[Rows]:
    order = np.argsort(fruits, kind="stable")
    return np.split(order, np.searchsorted(fruits[order], np.arange(1, n))) if n else []


def _depths(
    sightings: Sightings, centres: Array, covariances: Array, session_from_camera: Array
) -> tuple[Array, Array]:
    """Depth (S,) of each sighting's fruit, at centre (S, 3) with covariance (S, 3, 3), and its variance."""
    poses = session_from_camera[sightings.rows]
    axes = poses[:, :3, 2]
    depths_m = np.einsum("si,si->s", centres - poses[:, :3, 3], axes)
    variances = np.einsum("si,sij,sj->s", axes, covariances, axes)
    # A place behind the camera is no place: that sighting keeps its own.
    ahead = depths_m > 0
    own_m, own_variances = sightings.centres_in_camera[:, 2], sightings.covariances[:, 2, 2]
    return np.where(ahead, depths_m, own_m), np.where(ahead, variances, own_variances)


def _diameters(sightings: Sightings, depth_variances: Array, groups: list[Rows]) -> Array:
    """Diameter and its sigma of each fruit, (N, 2); the depth errs for all sightings of a fruit together."""
    measured = sightings.diameters_m, sightings.diameter_sigmas_m, sightings.hidden
    sizes = np.array([fuse_diameters(*(values[group] for values in measured)) for group in groups]).reshape(-1, 2)
    shared = np.array([depth_variances[group].mean() for group in groups])
    sizes[:, 1] = np.sqrt(sizes[:, 1] ** 2 + shared)
    return sizes


def _colours(sightings: Sightings, groups: list[Rows], looks: Sequence[Look]) -> tuple[str, ...] | None:
    """Median colour of each fruit as #rrggbb, None of a recording without colour."""
    if not looks or any(look.colours is None for look in looks):
        return None
    bgr = np.concatenate([look.colours for look in looks])[sightings.boxes]
    medians = [np.median(bgr[group], axis=0).round().astype(int) for group in groups]
    return tuple(f"#{red:02x}{green:02x}{blue:02x}" for blue, green, red in medians)
