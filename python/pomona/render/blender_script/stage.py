"""What the camera sees: meshes, grass, rows behind, the ground; and the camera."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from materials import material
from mathutils import Matrix

GROUND_HALF_M = 150.0


def set_up(shown: Any, job: dict[str, Any], surfaces: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Put everything on the stage; give the meshes by name."""
    meshes = {name: mesh(name, surface) for name, surface in surfaces.items()}
    for name, made in meshes.items():
        for x, y, turn_rad, height in job["places"][name]:
            place = Matrix.Translation((x, y, 0.0)) @ Matrix.Rotation(turn_rad, 4, "Z")
            _put(shown, made, place @ Matrix.Diagonal((1.0, 1.0, height, 1.0)))
    _put(shown, _plane(), Matrix.Identity(4))
    return meshes


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


def camera(scene: Any, job: dict[str, Any]) -> Any:
    """Make the pinhole of the calibration; picture coordinates begin at the top left corner."""
    width, height = job["width"], job["height"]
    made = bpy.data.cameras.new("camera")
    made.sensor_fit, made.sensor_width = "HORIZONTAL", 36.0
    made.lens = job["fx"] / width * 36.0
    made.shift_x = (width / 2 - job["cx"]) / width
    made.shift_y = (job["cy"] - height / 2) / width * job["fx"] / job["fy"]
    made.clip_start, made.clip_end = 0.01, 10 * GROUND_HALF_M
    taller = job["fx"] / job["fy"]
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = max(1.0, 1 / taller), max(1.0, taller)
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    return bpy.data.objects.new("camera", made)


def look(camera_object: Any, session_from_camera: Any, aside_m: float) -> None:
    """Put the camera at a pose in OpenCV's axes, `aside_m` along its x: Blender's looks along -z, y up."""
    pose = np.array(session_from_camera)
    pose[:3, 3] += aside_m * pose[:3, 0]
    camera_object.matrix_world = Matrix((pose @ np.diag([1.0, -1.0, -1.0, 1.0])).tolist())


def sway(leaves: Any, still: Any, job: dict[str, Any], pair: int) -> None:
    """Let the wind move each leaf, more at its tip; both eyes see it so."""
    rng = np.random.default_rng([job["seed"], pair])
    along = np.empty(len(still), dtype=np.float32)
    leaves.attributes["along"].data.foreach_get("value", along)
    corners = job["leaf_vertices"]
    pushed = rng.normal(scale=job["weather"]["wind_m"], size=(len(still) // corners, 3))
    moved = still + np.repeat(pushed, corners, axis=0) * along[:, None]
    leaves.vertices.foreach_set("co", moved.astype(np.float32).ravel())
    leaves.update()


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
