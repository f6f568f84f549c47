"""What things are made of; the values that they ask for are those of pomona.render.surfaces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
from nodes import Shader


def material(name: str) -> Any:
    """Make the material of a surface by its name."""
    made = bpy.data.materials.new(name)
    MATERIALS[name](Shader(made))
    return made


def _skin(tree: Shader) -> None:
    place, chance = tree.attribute("place").outputs["Vector"], tree.attribute("chance").outputs["Fac"]
    apart = tree.math("MULTIPLY", chance, 57.0)
    here = tree.added(place, tree.node("ShaderNodeCombineXYZ", {0: apart, 1: apart, 2: apart}).outputs[0])
    streaks = tree.noise(tree.scaled(here, (7.0, 7.0, 0.9)), 1.6, 3.0)
    cloudy = tree.noise(here, 2.2, 2.0)
    red = _blush_share(tree, streaks, cloudy)
    ground = tree.mix(tree.step(cloudy, 0.35, 0.75), tree.attribute("ground").outputs["Color"], (0.52, 0.46, 0.10))
    ground = tree.mix(0.3, tree.attribute("ground").outputs["Color"], ground)
    blush = tree.attribute("blush").outputs["Color"]
    deep = tree.mix(0.55, blush, (0.16, 0.008, 0.012), "MULTIPLY")
    blush = tree.mix(tree.step(streaks, 0.42, 0.62), blush, tree.mix(0.7, blush, deep))
    skin = tree.mix(red, ground, blush)
    skin = tree.mix(_lenticels(tree, here), skin, (0.55, 0.45, 0.22))
    skin = _hollows(tree, place, skin)
    shader = tree.node(
        "ShaderNodeBsdfPrincipled",
        {
            "Base Color": skin,
            "Roughness": 0.42,
            "Specular IOR Level": 0.45,
            "Coat Weight": 0.25,
            "Coat Roughness": 0.18,
            "Subsurface Weight": 0.08,
            "Subsurface Radius": (0.006, 0.003, 0.0015),
            "Subsurface Scale": 1.0,
            "Normal": tree.bump(tree.noise(here, 9.0, 1.0), 0.12, 0.004),
        },
    )
    tree.surface(shader.outputs[0])


def _blush_share(tree: Shader, streaks: Any, cloudy: Any) -> Any:
    """How red the skin is: from the side that had the sun as far round as the share says, frayed by streaks."""
    sunny = tree.attribute("sunny").outputs["Fac"]
    share = tree.attribute("share").outputs["Fac"]
    frayed = tree.math("MULTIPLY_ADD", tree.math("SUBTRACT", streaks, 0.5), 2.4, sunny)
    frayed = tree.math("MULTIPLY_ADD", tree.math("SUBTRACT", cloudy, 0.5), 1.1, frayed)
    # A cap of a sphere with the cosine c at its edge covers (1 - c) / 2 of it.
    edge = tree.math("MULTIPLY_ADD", share, -2.0, 1.0)
    beyond = tree.math("SUBTRACT", frayed, edge)
    red = tree.step(beyond, -0.45, 0.35)
    return tree.math("MULTIPLY", red, tree.step(share, 0.0, 0.12))


def _lenticels(tree: Shader, here: Any) -> Any:
    spots = tree.node("ShaderNodeTexVoronoi", {"Vector": here, "Scale": 11.0}, feature="F1").outputs["Distance"]
    return tree.math("MULTIPLY", tree.step(spots, 0.13, 0.05), 0.45)


def _hollows(tree: Shader, place: Any, skin: Any) -> Any:
    """Russet the hollow at the stalk; dry the calyx to brown."""
    parts = tree.node("ShaderNodeSeparateXYZ", {0: place}).outputs
    across = tree.math("SQRT", tree.math("ADD", tree.math("POWER", parts[0], 2.0), tree.math("POWER", parts[1], 2.0)))
    above = tree.step(parts[2], 0.0, 0.1)
    russet = tree.math("MULTIPLY", tree.step(across, 0.34, 0.10), above)
    skin = tree.mix(tree.math("MULTIPLY", russet, 0.7), skin, (0.21, 0.15, 0.045))
    dry = tree.math("MULTIPLY", tree.step(across, 0.15, 0.07), tree.math("SUBTRACT", 1.0, above))
    return tree.mix(dry, skin, (0.035, 0.022, 0.012))


def _leaf(tree: Shader) -> None:
    colour = tree.attribute("colour").outputs["Color"]
    chance = tree.attribute("chance").outputs["Fac"]
    veins = _veins(tree)
    where = tree.node("ShaderNodeNewGeometry").outputs
    mottled = tree.noise(where["Position"], 55.0, 2.0)
    light = tree.math("MULTIPLY_ADD", chance, 0.5, tree.math("MULTIPLY_ADD", mottled, 0.5, 0.5))
    upper = tree.node("ShaderNodeHueSaturation", {"Value": light, "Color": colour}).outputs[0]
    upper = tree.mix(tree.math("MULTIPLY", veins, 0.30), upper, (0.20, 0.26, 0.07))
    lower = tree.mix(0.55, upper, (0.20, 0.25, 0.15))
    lower = tree.mix(tree.math("MULTIPLY", veins, 0.4), lower, (0.30, 0.34, 0.20))
    blade = tree.mix(where["Backfacing"], upper, lower)
    through = tree.node("ShaderNodeHueSaturation", {"Hue": 0.475, "Saturation": 1.05, "Value": 1.25, "Color": upper})
    relief = tree.bump(tree.math("SUBTRACT", 1.0, veins), 0.35, 0.002)
    dull = tree.math("MULTIPLY_ADD", where["Backfacing"], 0.30, 0.40)
    face = tree.node(
        "ShaderNodeBsdfPrincipled",
        {"Base Color": blade, "Roughness": dull, "Specular IOR Level": 0.32, "Normal": relief},
    )
    glow = tree.node("ShaderNodeBsdfTranslucent", {"Color": through.outputs[0]})
    tree.surface(tree.node("ShaderNodeMixShader", {0: 0.24, 1: face.outputs[0], 2: glow.outputs[0]}).outputs[0])


def _veins(tree: Shader) -> Any:
    """Draw the middle rib and side veins that leave it towards the tip."""
    along, across = (tree.attribute(name).outputs["Fac"] for name in ("along", "across"))
    aside = tree.math("ABSOLUTE", across)
    rib = tree.step(aside, 0.10, 0.03)
    phase = tree.math("FRACT", tree.math("MULTIPLY", tree.math("MULTIPLY_ADD", aside, -0.22, along), 8.0))
    side = tree.step(tree.math("ABSOLUTE", tree.math("SUBTRACT", phase, 0.5)), 0.12, 0.03)
    side = tree.math("MULTIPLY", side, tree.step(aside, 1.0, 0.6))
    return tree.math("MAXIMUM", rib, tree.math("MULTIPLY", side, 0.6))


def _bark(tree: Shader) -> None:
    colour = tree.attribute("colour").outputs["Color"]
    place = tree.node("ShaderNodeNewGeometry").outputs["Position"]
    rough = tree.noise(tree.scaled(place, (1.0, 1.0, 0.35)), 90.0, 4.0)
    patches = tree.noise(place, 14.0, 3.0)
    bark = tree.mix(tree.step(rough, 0.62, 0.36), colour, (0.45, 0.42, 0.40), "MULTIPLY")
    bark = tree.mix(tree.math("MULTIPLY", tree.step(patches, 0.55, 0.72), 0.45), bark, (0.60, 0.62, 0.52), "MULTIPLY")
    inputs = {
        "Base Color": bark,
        "Roughness": 0.8,
        "Specular IOR Level": 0.25,
        "Normal": tree.bump(rough, 0.6, 0.006),
    }
    tree.surface(tree.node("ShaderNodeBsdfPrincipled", inputs).outputs[0])


def _grass(tree: Shader) -> None:
    colour, along = tree.attribute("colour").outputs["Color"], tree.attribute("along").outputs["Fac"]
    patches = tree.noise(tree.node("ShaderNodeNewGeometry").outputs["Position"], 1.7, 2.0)
    colour = tree.mix(tree.math("MULTIPLY", tree.step(patches, 0.45, 0.7), 0.55), colour, (0.17, 0.16, 0.045))
    colour = tree.mix(tree.math("MULTIPLY", along, 0.35), colour, (0.16, 0.20, 0.05))
    face = tree.node("ShaderNodeBsdfPrincipled", {"Base Color": colour, "Roughness": 0.55, "Specular IOR Level": 0.25})
    glow = tree.node("ShaderNodeBsdfTranslucent", {"Color": colour})
    tree.surface(tree.node("ShaderNodeMixShader", {0: 0.25, 1: face.outputs[0], 2: glow.outputs[0]}).outputs[0])


def _ground(tree: Shader) -> None:
    place = tree.node("ShaderNodeNewGeometry").outputs["Position"]
    soil = tree.mix(tree.noise(place, 38.0, 5.0), (0.040, 0.027, 0.017), (0.105, 0.076, 0.050))
    damp = tree.step(tree.noise(place, 1.3, 3.0), 0.40, 0.62)
    soil = tree.mix(tree.math("MULTIPLY", damp, 0.5), soil, (0.05, 0.075, 0.02))
    inputs = {
        "Base Color": soil,
        "Roughness": 0.95,
        "Specular IOR Level": 0.1,
        "Normal": tree.bump(tree.noise(place, 60.0, 4.0), 0.7, 0.02),
    }
    tree.surface(tree.node("ShaderNodeBsdfPrincipled", inputs).outputs[0])


def _truth(tree: Shader) -> None:
    """Shine with the id and the depth along the optical axis."""
    depth = tree.node("ShaderNodeCameraData").outputs["View Z Depth"]
    both = tree.node("ShaderNodeCombineColor", {0: tree.attribute("id").outputs["Fac"], 1: depth, 2: 1.0})
    tree.surface(tree.node("ShaderNodeEmission", {"Color": both.outputs[0], "Strength": 1.0}).outputs[0])


MATERIALS: dict[str, Callable[[Shader], None]] = {
    "fruits": _skin,
    "leaves": _leaf,
    "limbs": _bark,
    "grass": _grass,
    "weeds": _grass,
    "ground": _ground,
    "truth": _truth,
}
