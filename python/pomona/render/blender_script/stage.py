"""What the camera sees: meshes, grass, rows behind, the ground; and the camera."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from materials import material
from mathutils import Matrix

GROUND_HALF_M = 150.0


class Stage:
    """All that is shown, and the eye that looks at it."""

    def __init__(self, shown: Any, job: dict[str, Any], surfaces: dict[str, dict[str, Any]]) -> None:
        self._job = job
        meshes = {name: mesh(name, surface) for name, surface in surfaces.items()}
        for name, made in meshes.items():
            for x, y, turn_rad, height in job["places"][name]:
                place = Matrix.Translation((x, y, 0.0)) @ Matrix.Rotation(turn_rad, 4, "Z")
                _put(shown, made, place @ Matrix.Diagonal((1.0, 1.0, height, 1.0)))
        _put(shown, _plane(), Matrix.Identity(4))
        self.eye = _eye(job)
        shown.objects.link(self.eye)
        self._leaves = meshes["leaves"]
        self._still_m = np.empty((len(self._leaves.vertices), 3), dtype=np.float32)
        self._leaves.vertices.foreach_get("co", self._still_m.ravel())
        self._along = np.empty(len(self._still_m), dtype=np.float32)
        self._leaves.attributes["along"].data.foreach_get("value", self._along)

    def arrange(self, pair: int, *, right: bool) -> None:
        """Put the eye where it is in a pair, which Blender has look along -z, y up; move the leaves, alike for both."""
        pose = np.array(self._job["poses"][pair])
        pose[:3, 3] += pose[:3, 0] * (self._job["baseline_m"] if right else 0.0)
        self.eye.matrix_world = Matrix((pose @ np.diag([1.0, -1.0, -1.0, 1.0])).tolist())
        if self._job["weather"]["wind_m"] > 0 and not right:
            self._sway(pair)

    def _sway(self, pair: int) -> None:
        """Let the wind push each leaf, and its tip most."""
        first = np.flatnonzero(np.diff(self._along, prepend=1.0) < 0)
        leaf = np.repeat(np.arange(len(first)), np.diff(first, append=len(self._along)))
        rng = np.random.default_rng([self._job["seed"], pair])
        pushed_m = rng.normal(scale=self._job["weather"]["wind_m"], size=(len(first), 3))
        moved_m = self._still_m + pushed_m[leaf] * self._along[:, None]
        self._leaves.vertices.foreach_set("co", moved_m.astype(np.float32).ravel())
        self._leaves.update()


def mesh(name: str, surface: dict[str, Any]) -> Any:
    """Make a mesh with its material and the values at its vertices."""
    made = bpy.data.meshes.new(name)
    vertices, faces = surface.pop("vertices_m"), surface.pop("faces")
    made.vertices.add(len(vertices))
    made.vertices.foreach_set("co", vertices.ravel())
    made.loops.add(faces.size)
    made.loops.foreach_set("vertex_index", faces.ravel())
    made.polygons.add(len(faces))
    made.polygons.foreach_set("loop_start", np.arange(0, faces.size, 4, dtype=np.int32))
    made.update(calc_edges=True)
    made.polygons.foreach_set("use_smooth", np.ones(len(faces), dtype=bool))
    for value_name, values in surface.items():
        flat = values.ndim == 1
        held = made.attributes.new(value_name, "FLOAT" if flat else "FLOAT_VECTOR", "POINT")
        held.data.foreach_set("value" if flat else "vector", values.ravel())
    made.materials.append(material(name))
    return made


def _eye(job: dict[str, Any]) -> Any:
    """Make the pinhole of the calibration; picture coordinates begin at the top left corner."""
    width, height = job["width"], job["height"]
    made = bpy.data.cameras.new("eye")
    made.sensor_fit, made.sensor_width = "HORIZONTAL", 36.0
    made.lens = job["fx"] / width * 36.0
    made.shift_x = (width / 2 - job["cx"]) / width
    made.shift_y = (job["cy"] - height / 2) / width * job["fx"] / job["fy"]
    made.clip_start, made.clip_end = 0.01, 10 * GROUND_HALF_M
    return bpy.data.objects.new("eye", made)


def _put(shown: Any, held: Any, place: Any) -> None:
    made = bpy.data.objects.new(held.name, held)
    made.matrix_world = place
    shown.objects.link(made)


def _plane() -> Any:
    made = bpy.data.meshes.new("ground")
    half = GROUND_HALF_M
    corners = [(x * half, y * half, 0.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    made.from_pydata(corners, [], [(0, 1, 2, 3)])
    made.materials.append(material("ground"))
    return made
