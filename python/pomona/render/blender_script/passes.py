"""The two ways to look at a stage: as light arrives, and what is there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
from linear_file import read_linear
from materials import material

Arrange = Callable[[int], None]
"""Arranges the stage for the frame of a number."""

Take = Callable[[int, Any], None]
"""Takes the picture of a frame, (H, W, 3)."""

INDIRECT_LIMIT = 4.0
"""Brightest indirect light of a sample, against white: what is above are fireflies at few samples."""


def light_pass(scene: Any, job: dict[str, Any]) -> None:
    """Trace paths, few of them, and remove the noise."""
    _common(scene, job, job["samples"])
    cycles = scene.cycles
    cycles.seed, cycles.use_animated_seed = job["seed"] % 2**31, True
    cycles.use_denoising, cycles.denoiser, cycles.denoising_use_gpu = True, "OPENIMAGEDENOISE", job["gpu"]
    cycles.denoising_input_passes, cycles.denoising_prefilter = "RGB_ALBEDO_NORMAL", "ACCURATE"
    cycles.max_bounces, cycles.diffuse_bounces, cycles.transmission_bounces = 5, 4, 4
    cycles.glossy_bounces, cycles.transparent_max_bounces = 2, 2
    cycles.sample_clamp_indirect = INDIRECT_LIMIT
    cycles.caustics_reflective = cycles.caustics_refractive = False


def truth_pass(job: dict[str, Any], shown: Any) -> Any:
    """Make a scene of the same objects that shine with their id and depth, seen at the pixels' centres."""
    scene = bpy.data.scenes.new("truth")
    scene.collection.children.link(shown)
    _common(scene, job, 1)
    scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    scene.cycles.max_bounces = 0
    shining = material("truth")
    shining.cycles.emission_sampling = "NONE"  # else every triangle is a lamp, in a tree that takes a minute to build
    scene.view_layers[0].material_override = shining
    scene.world = bpy.data.worlds.new("nothing")
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    return scene


def animate(scene: Any, frames: range, path: Path, arrange: Arrange, take: Take) -> None:
    """Render frames in one go, which keeps the stage between them: arrange each, hand on each picture."""
    width, height = scene.render.resolution_x, scene.render.resolution_y

    def begin(scene_now: Any, _graph: Any = None) -> None:
        if scene_now.frame_current in frames:  # at the end Blender goes back to where it was
            arrange(scene_now.frame_current)

    def written(scene_now: Any, _graph: Any = None) -> None:
        file = Path(scene_now.render.frame_path(frame=scene_now.frame_current))
        take(scene_now.frame_current, read_linear(file, width, height))
        file.unlink()

    scene.render.filepath = f"{path}.######.exr"
    scene.frame_start, scene.frame_end = frames.start, frames.stop - 1
    bpy.app.handlers.frame_change_pre[:] = [begin]
    bpy.app.handlers.render_write[:] = [written]
    bpy.ops.render.render(animation=True, scene=scene.name)


def _common(scene: Any, job: dict[str, Any], samples: int) -> None:
    scene.render.engine = "CYCLES"
    scene.cycles.device = "GPU" if job["gpu"] else "CPU"
    scene.cycles.samples, scene.cycles.use_adaptive_sampling = samples, False
    scene.render.use_persistent_data = True
    scene.render.threads_mode, scene.render.threads = "FIXED", job["threads"]
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.exr_codec = "NONE"
    taller = job["fx"] / job["fy"]
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = max(1.0, 1 / taller), max(1.0, taller)
    scene.render.resolution_x, scene.render.resolution_y = job["width"], job["height"]
    scene.render.resolution_percentage = 100
