"""Depth pictures of spheres, leaves and a wall, exact to the float: what a depth camera would see without errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pomona.recording import Calibration

CAMERA = Calibration(width=640, height=480, fx=600.0, fy=600.0, cx=320.0, cy=240.0)


@dataclass(frozen=True)
class Sphere:
    centre: tuple[float, float, float]
    diameter_m: float = 0.07


def picture(spheres: list[Sphere], wall_m: float = 3.0, camera: Calibration = CAMERA) -> NDArray[np.float32]:
    """Depth along the optical axis of spheres in front of a wall."""
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    rays = camera.rays(np.stack([x, y], axis=-1))
    depth = np.full(x.shape, wall_m)
    for sphere in spheres:
        centre = np.array(sphere.centre)
        along, length2 = rays @ centre, (rays**2).sum(axis=-1)
        root2 = along**2 - length2 * (centre @ centre - sphere.diameter_m**2 / 4)
        front = (along - np.sqrt(np.maximum(root2, 0))) / length2
        depth = np.where((root2 > 0) & (front < depth), front, depth)
    return depth.astype(np.float32)


def box_of(sphere: Sphere, camera: Calibration = CAMERA) -> NDArray[np.float64]:
    """Smallest box around the outline of a sphere, by dense sampling of the circle where rays touch it."""
    centre = np.array(sphere.centre)
    distance2 = float(centre @ centre)
    radius2 = sphere.diameter_m**2 / 4
    # The rays from the origin touch the sphere on a circle about this point, in the plane across the ray.
    middle = centre * (1 - radius2 / distance2)
    radius_of_circle = np.sqrt(radius2 * (1 - radius2 / distance2))
    across = np.linalg.svd(centre[None])[2][1:]
    angle = np.linspace(0, 2 * np.pi, 20001)
    circle = middle + radius_of_circle * (np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1])
    x = camera.fx * circle[:, 0] / circle[:, 2] + camera.cx
    y = camera.fy * circle[:, 1] / circle[:, 2] + camera.cy
    return np.array([x.min(), y.min(), x.max(), y.max()])
