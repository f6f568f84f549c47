"""The two ways to look at a stage: as light arrives, and what is there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from materials import material

INDIRECT_LIMIT = 4.0
"""Brightest indirect light of a sample, against white: what is above are fireflies at few samples."""


def light_pass(scene: Any, job: dict[str, Any]) -> None:
    """Trace paths, few of them, and remove the noise."""
    _common(scene, job, job["samples"])
    cycles = scene.cycles
    cycles.use_denoising, cycles.denoiser = True, "OPENIMAGEDENOISE"
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


def render(scene: Any, path: Path) -> Any:
    """Render the scene to linear values, (H, W, 3) float32, by way of a file at `path`."""
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    values = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    path.unlink()
    return values.reshape(height, width, 4)[::-1, :, :3].copy()


def _common(scene: Any, job: dict[str, Any], samples: int) -> None:
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples, scene.cycles.use_adaptive_sampling = samples, False
    scene.render.use_persistent_data = True
    scene.render.threads_mode, scene.render.threads = "FIXED", job["threads"]
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.exr_codec = "NONE"
