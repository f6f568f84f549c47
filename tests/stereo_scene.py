"""Stereo pairs of textured spheres, leaves and a wall of leaves, exact to the rounding of colours."""

from dataclasses import dataclass, replace

import numpy as np

from depth_scene import Sphere
from pomona.recording import Calibration

PAIR = Calibration(width=320, height=240, fx=420.0, fy=420.0, cx=160.0, cy=120.0, baseline_m=0.12)

RED, GREEN = np.array([40.0, 50.0, 190.0]), np.array([70.0, 140.0, 90.0])
"""Blue, green, red."""


@dataclass(frozen=True)
class Leaf:
    """An upright rectangle across the optical axis: x and y from, x and y to, depth."""

    low_m: tuple[float, float]
    high_m: tuple[float, float]
    depth_m: float


def pair(spheres, leaves=(), wall_m=2.5, camera=PAIR):
    """Left and right picture (H, W, 3) uint8, and the depth of the left."""
    left, depth_m = _view(spheres, leaves, wall_m, camera, 0.0)
    right, _ = _view(spheres, leaves, wall_m, camera, camera.baseline_m)
    return left, right, depth_m


def _view(spheres, leaves, wall_m, camera, eye_m):
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    rays = camera.rays(np.stack([x, y], axis=-1))
    depth = np.full(x.shape, float(wall_m))
    base = np.broadcast_to(GREEN, (*x.shape, 3)).copy()
    for leaf in leaves:
        at = rays[..., :2] * leaf.depth_m + np.array([eye_m, 0.0])
        hit = np.all((at > leaf.low_m) & (at < leaf.high_m), axis=-1) & (leaf.depth_m < depth)
        depth[hit], base[hit] = leaf.depth_m, GREEN
    for sphere in spheres:
        centre = np.array(sphere.centre) - np.array([eye_m, 0.0, 0.0])
        along, length2 = rays @ centre, (rays**2).sum(axis=-1)
        root2 = along**2 - length2 * (centre @ centre - sphere.diameter_m**2 / 4)
        front = (along - np.sqrt(np.maximum(root2, 0))) / length2
        hit = (root2 > 0) & (front < depth)
        depth[hit], base[hit] = front[hit], RED
    points = rays * depth[..., None] + np.array([eye_m, 0.0, 0.0])
    shade = 1.0 + 0.25 * _texture(points)
    return np.clip(np.round(base * shade[..., None]), 0, 255).astype(np.uint8), depth.astype(np.float32)


def _texture(points):
    """Waves of 1 to 4 cm in all directions through space, so that surfaces carry a pattern that moves with them."""
    rng = np.random.default_rng(7)
    total = np.zeros(points.shape[:-1])
    for _ in range(12):
        direction = rng.normal(size=3)
        direction *= 2 * np.pi / rng.uniform(0.01, 0.04) / np.linalg.norm(direction)
        total += np.sin(points @ direction + rng.uniform(0, 2 * np.pi))
    return total / np.sqrt(6)


def apple(x, y, z, diameter_m=0.075):
    return Sphere((x * z, y * z, z), diameter_m)


def without_baseline():
    return replace(PAIR, baseline_m=None)
