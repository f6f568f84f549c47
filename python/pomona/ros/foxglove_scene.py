"""Fruits and the robot as scenes that Foxglove draws: `foxglove_msgs/SceneUpdate`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.ros.message_types import MessageTypes
from pomona.ros.robot_frames import RobotPose
from pomona.ros.stamped import plain_pose, time_of, vector_of
from pomona.store.layer_styles import STATES

__all__ = ["fruits_scene", "robot_scene"]

Colour = tuple[float, float, float, float]

USUAL_DIAMETER_M = 0.07
"""Drawn where a fruit's own is not known."""

PLAIN: Colour = (0.84, 0.37, 0.0, 1.0)
"""Of fruits of which nothing is known but the place."""

ROBOT: Colour = (0.0, 0.62, 0.45, 1.0)

ARROW_M = 0.5
"""Length of the arrow that shows where the robot heads."""

RATE = "rate_mm_per_day"
"""Column of growth, by which fruits are coloured where it is there."""

NOTES = ("state", "last_seen", "tree", RATE)
"""Columns that are told of a fruit that is clicked on."""

PARTS = ("metadata", "arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")


def fruits_scene(types: MessageTypes, stamp_ns: int, frame: str, fruits: FruitCloud) -> Any:
    """Draw fruits as spheres of their size, an entity each: by their growth where that is told, else by their state.

    Parameters
    ----------
    types : MessageTypes
    stamp_ns : int
        From when on they are there; they stay.
    frame : str
        The frame that they are in.
    fruits : FruitCloud
        With the columns `state` and `rate_mm_per_day` as far as they are known.
    """
    colours = _colours(fruits)
    diameters_m = np.full(len(fruits), np.nan) if fruits.diameters_m is None else fruits.diameters_m
    entities = [
        _entity(
            types,
            stamp_ns,
            frame,
            str(row) if fruits.ids is None else fruits.ids[row],
            metadata=_notes(types, fruits, row),
            spheres=[_sphere(types, fruits.positions[row], float(diameters_m[row]), colours[row])],
        )
        for row in range(len(fruits))
    ]
    return types("foxglove_msgs/msg/SceneUpdate")(deletions=[], entities=entities)


def robot_scene(types: MessageTypes, frame: str, pose: RobotPose) -> Any:
    """Draw the robot as an arrow the way it heads, in place of the one before."""
    arrow = types("foxglove_msgs/msg/ArrowPrimitive")(
        pose=plain_pose(types, pose.map_from_base),
        shaft_length=0.7 * ARROW_M,
        shaft_diameter=0.1 * ARROW_M,
        head_length=0.3 * ARROW_M,
        head_diameter=0.2 * ARROW_M,
        color=_colour(types, ROBOT),
    )
    entity = _entity(types, pose.stamp_ns, frame, "robot", arrows=[arrow])
    return types("foxglove_msgs/msg/SceneUpdate")(deletions=[], entities=[entity])


def _entity(types: MessageTypes, stamp_ns: int, frame: str, name: str, **parts: list[Any]) -> Any:
    return types("foxglove_msgs/msg/SceneEntity")(
        timestamp=time_of(types, stamp_ns),
        frame_id=frame,
        id=name,
        lifetime=types("builtin_interfaces/msg/Duration")(sec=0, nanosec=0),
        frame_locked=False,
        **{part: parts.get(part, []) for part in PARTS},
    )


def _sphere(types: MessageTypes, position: NDArray[np.float64], diameter_m: float, colour: Colour) -> Any:
    place = np.eye(4)
    place[:3, 3] = position
    size = vector_of(types, np.full(3, diameter_m if diameter_m > 0 else USUAL_DIAMETER_M))
    kind = types("foxglove_msgs/msg/SpherePrimitive")
    return kind(pose=plain_pose(types, place), size=size, color=_colour(types, colour))


def _notes(types: MessageTypes, fruits: FruitCloud, row: int) -> list[Any]:
    kind = types("foxglove_msgs/msg/KeyValuePair")
    found = {name: fruits.extras[name][row] for name in NOTES if name in fruits.extras}
    if fruits.diameters_m is not None and fruits.diameters_m[row] > 0:
        found["diameter_mm"] = f"{1000 * fruits.diameters_m[row]:.1f}"
    return [kind(key=key, value=value) for key, value in found.items() if value]


def _colour(types: MessageTypes, colour: Colour) -> Any:
    return types("foxglove_msgs/msg/Color")(**dict(zip("rgba", map(float, colour), strict=True)))


def _colours(fruits: FruitCloud) -> Sequence[Colour]:
    if RATE in fruits.extras:
        return _by_rate(np.array([float(cell or "nan") for cell in fruits.extras[RATE]]))
    states = fruits.extras.get("state")
    if states is None:
        return [PLAIN] * len(fruits)
    return [_of_state(state) for state in states]


def _of_state(state: str) -> Colour:
    if state not in STATES:
        return PLAIN
    red, green, blue, alpha = (int(number) / 255 for number in STATES[state].split(","))
    return red, green, blue, alpha


def _by_rate(rates: NDArray[np.float64]) -> list[Colour]:
    """Slow is violet, fast is yellow, from the fifth to the last but fifth of a hundred; unknown is grey."""
    from matplotlib import colormaps

    known = np.isfinite(rates)
    low, high = np.percentile(rates[known], (5, 95)) if known.any() else (0.0, 1.0)
    shades = colormaps["viridis"](np.clip((rates - low) / max(high - low, 1e-9), 0, 1))
    return [
        tuple(shade) if is_known else (0.6, 0.6, 0.6, 1.0)
        for shade, is_known in zip(shades.tolist(), known, strict=True)
    ]
