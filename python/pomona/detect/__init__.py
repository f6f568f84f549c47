"""Fruits in pictures: what a detector gives, and what a detector is."""

from pomona.detect.detections import Detections, Detector

__all__ = ["Detections", "Detector"]
