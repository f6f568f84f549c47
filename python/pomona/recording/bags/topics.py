"""Which topics are the left and the right pictures, the depth and the cameras."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pomona.errors import PomonaError
from pomona.recording.bags.message_file import PICTURES, Topic

__all__ = ["ROLES", "Roles", "chosen_topics", "image_topics", "parsed_topics"]

ROLES = ("left", "right", "depth", "left_info", "right_info", "depth_info", "poses")
"""What a topic can be; `poses=none` leaves out those that are there."""

SIDES = (
    ("left", "right"),
    ("infra1", "infra2"),  # RealSense, ROS
    ("infrared_1", "infrared_2"),  # RealSense, its own recorder
    ("cam0", "cam1"),
    ("camera0", "camera1"),
    ("cam_left", "cam_right"),
)
"""Names of the two cameras of a pair, as parts of the names of their topics."""

COLOUR = re.compile(r"(?:^|[/_])(?:color|colour|rgb)(?:[/_]|$|_?\d)", re.IGNORECASE)
DEPTH = re.compile(r"depth", re.IGNORECASE)
ALIGNED = re.compile(r"registered|aligned|to_colou?r|to_rgb", re.IGNORECASE)
SHOWN = 5
"""Topics that a message names at most."""

NO_PICTURE = re.compile(r"confidence|disparity|mask|theora|ffmpeg|thermal", re.IGNORECASE)


@dataclass(frozen=True)
class Roles:
    """Names of topics; None where there is none."""

    left: str | None = None
    right: str | None = None
    depth: str | None = None
    left_info: str | None = None
    right_info: str | None = None
    depth_info: str | None = None
    poses: str | None = None

    @property
    def pictures(self) -> dict[str, str]:
        """Topic of each kind of picture that there is."""
        sides = {"left": self.left, "right": self.right, "depth": self.depth}
        return {kind: topic for kind, topic in sides.items() if topic is not None}

    def __str__(self) -> str:
        return ",".join(f"{role}={getattr(self, role)}" for role in ROLES if getattr(self, role) is not None)


def parsed_topics(text: str) -> dict[str, str]:
    """Read `left=/a,right=/b`, as `--topics` takes it and `pomona info` prints it.

    Raises
    ------
    PomonaError
        When a part is no role with a topic.
    """
    parts = [part.partition("=") for part in text.split(",") if part.strip()]
    for role, _, topic in parts:
        if role.strip() not in ROLES or not topic.strip():
            raise PomonaError(f"topics: found {role + '=' + topic!r}, expected ROLE=/topic with {', '.join(ROLES)}")
    return {role.strip(): topic.strip() for role, _, topic in parts}


def chosen_topics(path: Path, topics: Mapping[str, Topic], given: Mapping[str, str] | None) -> Roles:
    """Take the topics that were given, else a pair by its names, else colour and depth.

    Raises
    ------
    PomonaError
        When a topic that was given is not there, or there is not exactly one camera.
    """
    given = dict(given or {})
    for role, name in given.items():
        if name not in topics and not (role == "poses" and name == "none"):
            found = ", ".join(sorted(topics)) or "none"
            raise PomonaError(f"{path}: {role}: found no topic {name}, expected one of {found}")
    if "left" not in given and "depth" not in given:
        names = image_topics(topics)
        if not names:
            others = ", ".join(f"{name} ({topic.type})" for name, topic in sorted(topics.items())[:SHOWN])
            more = " ..." if len(topics) > SHOWN else ""
            expected = " or ".join(PICTURES)
            raise PomonaError(f"{path}: found no pictures, but {others or 'nothing'}{more}, expected {expected}")
        given = {**_found(path, names), **given}
    for kind in ("left", "right", "depth"):
        info = _info_topic(given[kind], topics) if kind in given else None
        if info is not None:
            given.setdefault(f"{kind}_info", info)
    return Roles(**given)


def image_topics(topics: Mapping[str, Topic]) -> list[str]:
    """Names of all topics of pictures; of those that are there raw and compressed, the raw ones."""
    names = [name for name, topic in topics.items() if topic.type in PICTURES and not NO_PICTURE.search(name)]
    return sorted(name for name in names if _base(name) == name or _base(name) not in names)


def _found(path: Path, names: list[str]) -> dict[str, str]:
    depths = [name for name in names if DEPTH.search(name)]
    pairs = _pairs([name for name in names if name not in depths])
    paired = {name for pair in pairs for name in pair[1:]}
    colours = [name for name in names if COLOUR.search(name) and name not in paired and name not in depths]
    aligned = [name for name in depths if ALIGNED.search(name)]
    cameras = {pair[0]: pair for pair in pairs}
    if len(cameras) == 1 and not (any("infra" in name for name in pairs[0][1:]) and aligned and colours):
        _, left, right = pairs[0]
        depth = _best_depth(left, depths)
        return {"left": left, "right": right} | ({} if depth is None else {"depth": depth})
    singles = colours or [name for name in names if name not in depths]
    if len(cameras) <= 1 and len(singles) == 1 and depths:
        return {"left": singles[0], "depth": _best_depth(singles[0], depths) or depths[0]}
    found = ", ".join(names)
    raise PomonaError(
        f"{path}: found {found}, expected one camera with left and right, or with colour and depth: "
        "choose with --topics left=/...,right=/..."
    )


def _pairs(names: list[str]) -> list[tuple[str, str, str]]:
    """Give (camera, left, right) of the best pair of each camera: rectified before raw, colour before grey."""
    best: dict[str, tuple[tuple[bool, ...], str, str]] = {}
    for left_name, right_name in SIDES:
        word = re.compile(rf"(?<=[/_]){left_name}(?=[/_]|$)", re.IGNORECASE)
        for left in names:
            place = word.search(left)
            if place is None:
                continue
            replacement = right_name.title() if place[0][0].isupper() else right_name
            right = left[: place.start()] + replacement + left[place.end() :]
            if right in names:
                worse = ("rect" not in _words(left), not COLOUR.search(left), "compressed" in left)
                entry = (worse, left, right)
                best[left[: place.start()]] = min(best.get(left[: place.start()], entry), entry)
    return [(camera, left, right) for camera, (_, left, right) in best.items()]


def _best_depth(left: str, depths: list[str]) -> str | None:
    """Depth in the picture of colour is said to be aligned; that of a pair lies in its left picture as it is."""
    colour = COLOUR.search(left) is not None and not re.search(r"(?<=[/_])left(?=[/_])", left)
    ranked = sorted(depths, key=lambda name: ((ALIGNED.search(name) is None) == colour, "compressed" in name, name))
    return ranked[0] if ranked else None


def _info_topic(image: str, topics: Mapping[str, Topic]) -> str | None:
    """Find the camera_info beside a picture's topic."""
    base = _base(image)
    parent = base.rpartition("/")[0]
    grandparent = parent.rpartition("/")[0]
    candidates = (f"{parent}/camera_info", f"{base}/camera_info", f"{grandparent}/info/camera_info")
    infos = {name for name, topic in topics.items() if topic.type == "sensor_msgs/msg/CameraInfo"}
    return next((name for name in candidates if name in infos), None)


def _base(name: str) -> str:
    """Name of the topic that was compressed."""
    return re.sub(r"/compressed(?:Depth)?$", "", name)


def _words(name: str) -> list[str]:
    return re.split(r"[/_]", name.lower())
