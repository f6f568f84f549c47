"""Detectors and stereo networks as ONNX files."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from fuzz.bundle import packed, packed_folder, unpacked
from pomona.detect.onnx import OnnxDetector
from pomona.detect.shipped import SHIPPED, model_named
from pomona.recording import Calibration
from pomona.stereo import OnnxStereo

CAMERA = Calibration(64, 64, 60.0, 60.0, 32.0, 32.0, 0.12)
ULTRALYTICS = {"names": "{0: 'apple', 1: 'pear'}", "task": "detect", "imgsz": "[64, 64]", "stride": "32"}


def seeds() -> list[bytes]:
    """The shipped model, small models of the families, and a network that matches blocks."""
    from onnx_maker import end_to_end, rfdetr, rtdetr, yolov5, yolov8, yolox
    from test_stereo_onnx import block_matcher

    own = {
        "pomona_detector": {"version": 1, "family": "yolov8", "names": ["a", "b"], "preparation": {"mean": [0, 0, 0]}}
    }
    makers = {
        "ultralytics": lambda path: yolov8(path, 64, 64, metadata=ULTRALYTICS),
        "own": lambda path: yolov8(path, 64, 64, metadata=own),
        "yolov5": lambda path: yolov5(path, 64, 64),
        "end": lambda path: end_to_end(path, 64, 64),
        "yolox": lambda path: yolox(path, 64, 64),
        "rtdetr": lambda path: rtdetr(path, 64, 64),
        "rfdetr": lambda path: rfdetr(path, 64, 64),
        "stereo": block_matcher,
    }
    found = [packed("shipped", {"model.onnx": model_named(SHIPPED).read_bytes()})]
    for kind, make in makers.items():
        with tempfile.TemporaryDirectory() as place:
            make(Path(place) / ("stereo.onnx" if kind == "stereo" else "model.onnx"))
            found.append(packed_folder(kind, Path(place)))
    return found


def target(content: bytes) -> None:
    """Open a model and run it on a picture."""
    with unpacked(content) as (_, folder):
        picture = np.full((64, 64, 3), 114, np.uint8)
        if (folder / "model.onnx").is_file():
            detector = OnnxDetector.open(folder / "model.onnx", threads=1)
            detector.detect(picture)
            assert detector.description
        if (folder / "stereo.onnx").is_file():
            OnnxStereo.open(folder / "stereo.onnx", CAMERA, threads=1)(picture, picture, np.array([[8.0, 8, 40, 40]]))
