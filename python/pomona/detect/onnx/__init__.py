"""Detectors as ONNX files, run by ONNX Runtime, which is imported when a model is opened."""

from pomona.detect.onnx.detector import OnnxDetector
from pomona.detect.onnx.families import FAMILIES

__all__ = ["FAMILIES", "OnnxDetector"]
