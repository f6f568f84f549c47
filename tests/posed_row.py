"""A row of round fruits before a camera that drives along it, with exact boxes; no depth, and units of any length."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from model_maker import Model

Array = NDArray[np.float64]

SIZE_PX, FOCAL_PX, CENTRE_PX, NOISE_PX = (640, 480), 520.0, np.array([322.0, 238.0]), 0.7


@dataclass
class PosedRow:
    """Fruits in a map, metres, and what pictures show of them; `model_from_map` is a similarity."""

    positions: Array
    diameters_m: Array
    camera_from_map: Array
    boxes_px: list[Array]
    ids: list[list[int]]
    model_from_map: Array

    @property
    def scale(self) -> float:
        """Metres a unit of the model."""
        return float(1 / np.cbrt(np.linalg.det(self.model_from_map[:3, :3])))

    @property
    def camera_from_model(self) -> Array:
        turn = self.model_from_map[:3, :3] * self.scale
        poses = np.tile(np.eye(4), (len(self.camera_from_map), 1, 1))
        poses[:, :3, :3] = self.camera_from_map[:, :3, :3] @ turn.T
        shift = poses[:, :3, :3] @ self.model_from_map[:3, 3]
        poses[:, :3, 3] = self.camera_from_map[:, :3, 3] / self.scale - shift
        return poses

    @property
    def model(self) -> Model:
        names = [f"cam/{row:04d}.png" for row in range(len(self.boxes_px))]
        return Model(names, self.camera_from_model, "SIMPLE_PINHOLE", SIZE_PX, (FOCAL_PX, *CENTRE_PX.tolist()))

    def write_boxes(self, path: Path, by: str = "frame", ids: bool = False) -> Path:
        with path.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow([by, "xmin", "ymin", "xmax", "ymax", *(["id"] if ids else [])])
            for row, (boxes, names) in enumerate(zip(self.boxes_px, self.ids, strict=True)):
                key = row if by == "frame" else self.model.names[row]
                for box, name in zip(boxes.tolist(), names, strict=True):
                    writer.writerow([key, *box, *([f"fruit{name}"] if ids else [])])
        return path

    def write_map(self, path: Path) -> Path:
        rows = np.column_stack([self.positions, self.diameters_m]).tolist()
        path.write_text("x,y,z,diameter_m\n" + "".join(",".join(map(str, row)) + "\n" for row in rows))
        return path


def posed_row(seed: int, *, n_fruits: int = 50, n_pictures: int = 16, seen: float = 0.8) -> PosedRow:
    """Draw fruits on both sides of a plane, pictures 15 cm apart, and a frame of the model."""
    rng = np.random.Generator(np.random.PCG64(seed))
    low, high = (-1.6, -0.8, 1.3), (1.6, 0.8, 2.0)
    positions, diameters_m = rng.uniform(low, high, (n_fruits, 3)), rng.normal(0.075, 0.006, n_fruits)
    cameras = np.tile(np.eye(4), (n_pictures, 1, 1))
    cameras[:, :3, :3] = Rotation.from_rotvec(rng.normal(0, 0.03, (n_pictures, 3))).as_matrix()
    centres = np.column_stack([0.15 * (np.arange(n_pictures) - n_pictures / 2), *rng.normal(0, 0.02, (2, n_pictures))])
    cameras[:, :3, 3] = -np.einsum("pij,pj->pi", cameras[:, :3, :3], centres)
    frames = [boxes_of(positions, diameters_m, camera, rng, seen) for camera in cameras]
    turn = np.eye(4)
    turn[:3, :3] = rng.uniform(2.0, 9.0) * Rotation.random(random_state=rng).as_matrix()
    turn[:3, 3] = rng.uniform(-20, 20, 3)
    return PosedRow(positions, diameters_m, cameras, [one[0] for one in frames], [one[1] for one in frames], turn)


def boxes_of(
    positions: Array, diameters_m: Array, camera: Array, rng: np.random.Generator, seen: float
) -> tuple[Array, list[int]]:
    """Give the boxes between the planes that touch each fruit, in a random order, without some of them."""
    places = positions @ camera[:3, :3].T + camera[:3, 3]
    edges = []
    for axis in (0, 1):
        middle = np.arctan2(places[:, axis], places[:, 2])
        half = np.arcsin(diameters_m / 2 / np.hypot(places[:, axis], places[:, 2]))
        edges.append(np.tan(np.stack([middle - half, middle + half])) * FOCAL_PX + CENTRE_PX[axis])
    boxes = np.stack([edges[0][0], edges[1][0], edges[0][1], edges[1][1]], axis=1)
    inside = (boxes[:, :2] > 0).all(axis=1) & (boxes[:, 2:] < np.array(SIZE_PX)).all(axis=1)
    rows = rng.permutation(np.flatnonzero(inside & (rng.random(len(boxes)) < seen)))
    return boxes[rows] + rng.normal(0, NOISE_PX, (len(rows), 4)), rows.tolist()
