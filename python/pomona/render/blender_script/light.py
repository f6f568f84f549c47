"""The sky and the sun of one visit."""

from __future__ import annotations

import math
from typing import Any

import bpy
from nodes import Shader

SUN_ANGLE_RAD = math.radians(0.6)
"""Width of the sun, a little more than 0.53 degrees for haze."""


def light(scene: Any, weather: dict[str, Any]) -> None:
    """Give the scene its world and, unless it is overcast, its sun."""
    scene.world = bpy.data.worlds.new("sky")
    _sky(Shader(scene.world), weather)
    scene.world.cycles.sampling_method = "MANUAL"
    scene.world.cycles.sample_map_resolution = 256
    if weather["sun_strength"] > 0:
        scene.collection.objects.link(_sun(weather))


def _sun(weather: dict[str, Any]) -> Any:
    lamp = bpy.data.lights.new("sun", "SUN")
    # A white sky all around gives the irradiance pi.
    lamp.energy = math.pi * weather["sun_strength"]
    lamp.color = weather["sun_colour"]
    lamp.angle = SUN_ANGLE_RAD
    sun = bpy.data.objects.new("sun", lamp)
    # A lamp shines along its -z.
    sun.rotation_euler = (0.0, math.pi / 2 - weather["sun_elevation_rad"], weather["sun_azimuth_rad"])
    return sun


def _sky(tree: Shader, weather: dict[str, Any]) -> None:
    up = tree.node("ShaderNodeTexCoord").outputs["Generated"]
    parts = tree.node("ShaderNodeSeparateXYZ", {0: up}).outputs
    height = tree.math("POWER", tree.math("MAXIMUM", parts[2], 0.0), 0.45)
    sky = tree.mix(height, tuple(weather["horizon_colour"]), tuple(weather["sky_colour"]))
    sky = tree.mix(_clouds(tree, up, parts[2]), sky, tuple(weather["horizon_colour"]))
    if weather["sun_strength"] > 0:
        sky = tree.mix(_glow(tree, up, weather), sky, tuple(weather["sun_colour"]), "ADD")
    background = tree.node("ShaderNodeBackground", {"Color": sky, "Strength": 1.0})
    tree.node("ShaderNodeOutputWorld", {"Surface": background.outputs[0]})


def _clouds(tree: Shader, up: Any, height: Any) -> Any:
    """Thin clouds of the horizon's colour, on a flat layer above."""
    layer = tree.node("ShaderNodeVectorMath", {0: up, 3: 1.0}, operation="SCALE")
    tree._set(layer.inputs["Scale"], tree.math("DIVIDE", 1.0, tree.math("MAXIMUM", height, 0.06)))
    return tree.math("MULTIPLY", tree.step(tree.noise(layer.outputs[0], 0.9, 5.0), 0.48, 0.72), 0.6)


def _glow(tree: Shader, up: Any, weather: dict[str, Any]) -> Any:
    """Light scattered about the sun."""
    elevation, azimuth = weather["sun_elevation_rad"], weather["sun_azimuth_rad"]
    sun = (math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation))
    cosine = tree.node("ShaderNodeVectorMath", {0: up, 1: sun}, operation="DOT_PRODUCT").outputs["Value"]
    return tree.math("MULTIPLY", tree.math("POWER", tree.math("MAXIMUM", cosine, 0.0), 24.0), 0.5)
