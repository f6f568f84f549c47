"""Folders of pictures: our own, KITTI, TUM RGB-D, EuRoC, with their lists and poses."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from fuzz.bundle import packed, unpacked
from pomona.recording import open_recording
from pomona.recording.checks.readable import checked

SIZE = (64, 48)
OWN = {"width": 64, "height": 48, "fx": 60.0, "fy": 60.0, "cx": 32.0, "cy": 24.0, "baseline_m": 0.12, "rectified": True}
POSES = b"# time tx ty tz qx qy qz qw\n0.0 0 0 0 0 0 0 1\n0.1 0.1 0 0 0 0 0 1\n"
KITTI_POSES = b"1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0.1 0 1 0 0 0 0 1 0\n"
CALIB = b"P0: 60 0 32 0 0 60 24 0 0 0 1 0\nP1: 60 0 32 -7.2 0 60 24 0 0 0 1 0\n"
STATE = b"#time\n1000000000,0,0,0,1,0,0,0,0,0\n1050000000,0.1,0,0,1,0,0,0,0,0\n1100000000,0.2,0,0,1,0,0,0,0,0\n"


def picture(seed: int, *, depth: bool = False) -> bytes:
    """Noise, as PNG."""
    draw = np.random.default_rng(seed)
    pixels = draw.integers(0, 5000, SIZE[::-1], np.uint16) if depth else draw.integers(0, 256, (48, 64, 3), np.uint8)
    return cv2.imencode(".png", pixels)[1].tobytes()


def seeds() -> list[bytes]:
    """One of each layout, two frames long."""
    from test_recording_layouts import SENSOR

    left, right, depth = picture(0), picture(1), picture(2, depth=True)
    own = {f"{side}/000{row}.png": each for side, each in (("left", left), ("right", right)) for row in (0, 1)}
    about = json.dumps({"name": "row", "date": "2024-08-09"}).encode()
    calibration = json.dumps(OWN).encode()
    kitti = {f"{side}/00000{row}.png": each for side, each in (("image_0", left), ("image_1", right)) for row in (0, 1)}
    tum = {f"{kind}/{row}.png": each for kind, each in (("rgb", left), ("depth", depth)) for row in (0, 1)}
    lists = {f"{kind}.txt": f"# time file\n0.0 {kind}/0.png\n0.1 {kind}/1.png\n".encode() for kind in ("rgb", "depth")}
    euroc = {f"mav0/{cam}/data/{at}.png": each for cam, each in (("cam0", left), ("cam1", right)) for at in (10, 11)}
    stamps = {
        f"mav0/cam{side}/data.csv": b"#timestamp [ns],filename\n1000000000,10.png\n1100000000,11.png\n"
        for side in (0, 1)
    }
    sensors = {f"mav0/cam{side}/sensor.yaml": SENSOR.format(x=0.1 * side, k1=-0.1).encode() for side in (0, 1)}
    return [
        packed("own", {"calibration.json": calibration, "poses_tum.txt": POSES, "recording.json": about, **own}),
        packed("posed", {"calibration.json": calibration, "given.txt": KITTI_POSES, **own}),
        packed("kitti", {"calib.txt": CALIB, "poses.txt": KITTI_POSES, "times.txt": b"0\n0.1\n", **kitti}),
        packed("tum", {"calibration.json": calibration, "groundtruth.txt": POSES, **lists, **tum}),
        packed("euroc", {"mav0/state_groundtruth_estimate0/data.csv": STATE, **stamps, **sensors, **euroc}),
    ]


def target(content: bytes) -> None:
    """Open the recording and look at every frame."""
    with unpacked(content) as (_, folder):
        given = folder / "given.txt"
        recording = open_recording(folder, poses=given if given.is_file() else None)
        recording.description()
        checked(recording)
        list(_hashed(recording.inputs()))


def _hashed(files: Iterator[Path]) -> Iterator[int]:
    return (len(file.read_bytes()) for file in files if file.exists())
