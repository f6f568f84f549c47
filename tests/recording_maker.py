"""Small recording folders with known fruits, and the same folders broken in one place."""

import json
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from depth_scene import Sphere, box_of, picture

FRUITS = {
    "a": Sphere((0.10, -0.05, 1.30), 0.075),
    "b": Sphere((-0.20, 0.10, 1.45), 0.068),
    "c": Sphere((0.00, 0.20, 1.60), 0.082),
}
FIELDS = {"width": 640, "height": 480, "fx": 600.0, "fy": 600.0, "cx": 320.0, "cy": 240.0, "rectified": True}
HEADER = "frame,xmin,ymin,xmax,ymax,score,id"


def write_depth(path: Path, depth_m: NDArray[np.float32]) -> None:
    assert cv2.imwrite(str(path), np.round(depth_m * 1000).astype(np.uint16))


def make_recording(
    folder: Path,
    steps_m: tuple[float, ...] = (0.0,),
    *,
    ids: bool = True,
    poses: bool | None = None,
    fruits: Mapping[str, Sphere] = FRUITS,
) -> Path:
    """Make a folder with one frame for each step of the camera to the right, in a session whose frame is the first."""
    (folder / "depth").mkdir(parents=True)
    (folder / "calibration.json").write_text(json.dumps(FIELDS))
    lines = [HEADER if ids else HEADER.removesuffix(",id")]
    for frame, step_m in enumerate(steps_m):
        seen = {name: moved(sphere, -step_m) for name, sphere in fruits.items()}
        write_depth(folder / "depth" / f"{frame:04d}.png", picture(list(seen.values())))
        for name, sphere in seen.items():
            corners = ",".join(f"{edge:.3f}" for edge in box_of(sphere))
            lines.append(f"{frame},{corners},0.9" + (f",{name}" if ids else ""))
    (folder / "detections.csv").write_text("\n".join(lines) + "\n")
    if len(steps_m) > 1 if poses is None else poses:
        rows = [f"{0.1 * frame:.1f} {step_m} 0 0 0 0 0 1" for frame, step_m in enumerate(steps_m)]
        (folder / "poses_tum.txt").write_text("# time tx ty tz qx qy qz qw\n" + "\n".join(rows) + "\n")
    return folder


def moved(sphere: Sphere, x_m: float) -> Sphere:
    x, y, z = sphere.centre
    return Sphere((x + x_m, y, z), sphere.diameter_m)
