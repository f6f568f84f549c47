"""The graphics card that traces the paths, where the job asks for one."""

from __future__ import annotations

import bpy

KINDS = ("OPTIX", "CUDA", "HIP", "ONEAPI", "METAL")
"""What Cycles may run on, the fastest first."""


def use_graphics_card() -> None:
    """Let Cycles run on the first kind of card that is there, and on nothing else; without one, end."""
    settings = bpy.context.preferences.addons["cycles"].preferences
    offered = {kind for kind, *_ in settings.get_device_types(bpy.context)}
    for kind in KINDS:
        cards = settings.get_devices_for_type(kind) if kind in offered else []
        if cards:
            settings.compute_device_type = kind
            for device in settings.devices:
                device.use = device.type == kind
            return
    raise SystemExit("no graphics card that Blender can render with")
