"""Blur of what moves in the picture while it is exposed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.recording.calibration import Calibration
    from pomona.trajectory import Trajectory

__all__ = ["blurred", "moved_while_open", "right_depth_m"]

LEAST_PX = 0.3
"""A shorter way blurs nothing that a lens does not blur already."""

MOST_STEPS = 15

FAR_M = 1e4
"""In place of infinity: there a picture moves as the camera turns, whatever its way."""


def moved_while_open(trajectory: Trajectory, row: int, shutter_s: float) -> NDArray[np.float64]:
    """Give (4, 4) `end_from_start`: how places in the camera move while one picture is exposed."""
    from scipy.spatial.transform import Rotation

    before, after = max(row - 1, 0), min(row + 1, len(trajectory) - 1)
    if before == after:
        return np.eye(4)
    share = shutter_s / (trajectory.times_s[after] - trajectory.times_s[before])
    way = np.linalg.inv(trajectory.session_from_camera[after]) @ trajectory.session_from_camera[before]
    moved = np.eye(4)
    moved[:3, :3] = Rotation.from_rotvec(share * Rotation.from_matrix(way[:3, :3]).as_rotvec()).as_matrix()
    moved[:3, 3] = share * way[:3, 3]
    return moved


def blurred(
    light: NDArray[np.float32], depth_m: NDArray[np.float32], camera: Calibration, moved: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Average a picture (H, W, 3) along the way of each pixel; half of the way lies before the picture's moment."""
    x, y = np.meshgrid(np.arange(camera.width, dtype=np.float32), np.arange(camera.height, dtype=np.float32))
    way_x, way_y = _way_px(x, y, depth_m, camera, moved)
    longest_px = float(np.percentile(np.hypot(way_x, way_y), 99))
    if longest_px < LEAST_PX:
        return light
    shares = np.linspace(-0.5, 0.5, min(MOST_STEPS, 2 + int(np.ceil(longest_px))))
    steps = (
        cv2.remap(light, x + share * way_x, y + share * way_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        for share in shares.astype(np.float32)
    )
    return np.asarray(sum(steps) / np.float32(len(shares)), np.float32)


def _way_px(
    x: NDArray[np.float32],
    y: NDArray[np.float32],
    depth_m: NDArray[np.float32],
    camera: Calibration,
    moved: NDArray[np.float64],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """How far pixels move along the columns and the rows."""
    points_px = np.stack([x, y], axis=-1) + 0.5
    places = camera.rays(points_px.astype(np.float64)) * np.minimum(depth_m, FAR_M)[..., None]
    ends = places @ moved[:3, :3].T + moved[:3, 3]
    end_x = camera.fx * ends[..., 0] / ends[..., 2] + camera.cx
    end_y = camera.fy * ends[..., 1] / ends[..., 2] + camera.cy
    return (end_x - points_px[..., 0]).astype(np.float32), (end_y - points_px[..., 1]).astype(np.float32)


def right_depth_m(depth_m: NDArray[np.float32], camera: Calibration) -> NDArray[np.float32]:
    """Carry the left picture's depth to the right one: the nearest wins, what the left did not see is as far as beside.

    Good to a pixel: enough to say how pixels move.
    """
    rows, columns = np.indices(depth_m.shape)
    reach_px_m = camera.fx * (camera.baseline_m or 0.0)
    target = np.round(columns - reach_px_m / depth_m).astype(np.int64)
    inside = (target >= 0).ravel()
    farthest_first = np.argsort(-depth_m.ravel()[inside], kind="stable")
    carried = np.zeros_like(depth_m)
    chosen = rows.ravel()[inside][farthest_first], target.ravel()[inside][farthest_first]
    carried[chosen] = depth_m.ravel()[inside][farthest_first]
    return _filled(carried)


def _filled(depth_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """Give pixels without depth (0) the farther of the next to the left and right: it comes out from behind."""
    height, width = depth_m.shape
    known, columns = depth_m > 0.0, np.arange(width)
    before = np.maximum.accumulate(np.where(known, columns, -1), axis=1)
    after = np.minimum.accumulate(np.where(known, columns, width)[:, ::-1], axis=1)[:, ::-1]
    edged, rows = np.pad(depth_m, ((0, 0), (1, 1))), np.arange(height)[:, None]
    beside = np.maximum(edged[rows, before + 1], edged[rows, after + 1])
    return np.where(known, depth_m, np.where(beside > 0.0, beside, np.float32(FAR_M)))
