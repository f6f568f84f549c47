"""ROS 1 and ROS 2 bags and MCAP files, packed and not."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from fuzz.bundle import packed_folder, unpacked
from pomona.recording import open_recording
from pomona.recording.checks.readable import checked


def seeds() -> list[bytes]:
    """A pair in each form, with odometry and transforms, and depth that was compressed."""
    from bag_maker import START_NS, STEP_NS, compressed_depth, image, info, odometry, picture, stereo, tf, write_bag

    forms = ("ros1", "ros1 lz4", "sqlite3", "sqlite3 zstd message", "sqlite3 zstd file", "mcap", "mcap lz4")
    turned = np.eye(4)
    poses = [odometry("/odom", START_NS + row * STEP_NS, np.eye(4)) for row in range(2)]
    rgbd = [info("/color/camera_info", START_NS), info("/depth/camera_info", START_NS)]
    rgbd += [image("/color/image_raw", START_NS, picture(1), "bgr8")]
    rgbd += [
        compressed_depth("/depth/image_rect_raw/compressedDepth", START_NS, picture(2, channels=1, dtype=np.uint16))
    ]
    pair = [*stereo(2), *poses, tf("/tf_static", START_NS, ("base_link", "cam", turned))]
    found = []
    for form, entries in (*((form, pair) for form in forms), ("mcap", rgbd)):
        with tempfile.TemporaryDirectory() as place:
            write_bag(Path(place) / "bag", entries, form)
            found.append(packed_folder(form, Path(place)))
    return found


def target(content: bytes) -> None:
    """Open the bag and look at every frame."""
    with unpacked(content) as (_, folder):
        for place in sorted(folder.iterdir()):
            recording = open_recording(place)
            recording.description()
            checked(recording)
