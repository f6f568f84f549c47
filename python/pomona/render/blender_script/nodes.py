"""Nodes of Blender's shaders, written as expressions."""

from __future__ import annotations

from typing import Any

import bpy

Socket = Any
Value = Any


class Shader:
    """The node tree of one material or of the world."""

    def __init__(self, owner: Any) -> None:
        self.tree = owner.node_tree
        self.tree.nodes.clear()

    def node(self, kind: str, inputs: dict[Any, Value] | None = None, **settings: Any) -> Any:
        """Add a node; `inputs` are numbers, colours or sockets of others, by name or position."""
        made = self.tree.nodes.new(kind)
        for name, setting in settings.items():
            setattr(made, name, setting)
        for name, value in (inputs or {}).items():
            self._set(made.inputs[name], value)
        return made

    def _set(self, socket: Any, value: Value) -> None:
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        elif isinstance(value, tuple) and len(value) == 3 and socket.type == "RGBA":
            socket.default_value = (*value, 1.0)
        else:
            socket.default_value = value

    def attribute(self, name: str) -> Any:
        """Value of the mesh at the vertex: outputs Color, Vector, Fac."""
        return self.node("ShaderNodeAttribute", attribute_name=name)

    def math(self, operation: str, *values: Value) -> Socket:
        """Compute with numbers."""
        return self.node("ShaderNodeMath", dict(enumerate(values)), operation=operation).outputs[0]

    def mix(self, share: Value, first: Value, second: Value, blend: str = "MIX") -> Socket:
        """Mix two colours: `share` of the second."""
        inputs = {0: share, 6: first, 7: second}
        return self.node("ShaderNodeMix", inputs, data_type="RGBA", blend_type=blend).outputs[2]

    def step(self, value: Value, low: float, high: float) -> Socket:
        """0 below `low`, 1 above `high`, smooth between."""
        inputs = {0: value, 1: low, 2: high}
        return self.node("ShaderNodeMapRange", inputs, interpolation_type="SMOOTHSTEP").outputs[0]

    def noise(self, place: Value, scale: float, detail: float = 2.0) -> Socket:
        """Noise about 0.5 with `scale` bumps a unit."""
        return self.node("ShaderNodeTexNoise", {"Vector": place, "Scale": scale, "Detail": detail}).outputs[0]

    def scaled(self, vector: Value, factors: tuple[float, float, float]) -> Socket:
        """Stretch a vector."""
        return self.node("ShaderNodeVectorMath", {0: vector, 1: factors}, operation="MULTIPLY").outputs[0]

    def added(self, vector: Value, other: Value) -> Socket:
        """Add vectors."""
        return self.node("ShaderNodeVectorMath", {0: vector, 1: other}, operation="ADD").outputs[0]

    def bump(self, height: Value, strength: float, distance_m: float) -> Socket:
        """Tilt normals as a relief does."""
        inputs = {"Height": height, "Strength": strength, "Distance": distance_m}
        return self.node("ShaderNodeBump", inputs).outputs[0]

    def surface(self, shader: Value) -> None:
        """End the tree."""
        self.node("ShaderNodeOutputMaterial", {"Surface": shader})
