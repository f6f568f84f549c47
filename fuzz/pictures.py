"""Encoded pictures of all kinds that a recording may hold."""

from __future__ import annotations

import cv2
import numpy as np

from pomona.recording.pictures import decoded_picture

SUFFIXES = (".png", ".jpg", ".tiff", ".webp", ".bmp", ".ppm")


def seeds() -> list[bytes]:
    """One of each kind, and a picture of depth."""
    pixels = np.random.default_rng(0).integers(0, 256, (24, 32, 3), np.uint8)
    depth = np.random.default_rng(1).integers(0, 5000, (24, 32), np.uint16)
    coded = [cv2.imencode(suffix, pixels) for suffix in SUFFIXES]
    return [encoded.tobytes() for _, encoded in (*coded, cv2.imencode(".png", depth))]


def target(content: bytes) -> None:
    """Decode as colour and as it is."""
    encoded = np.frombuffer(content, np.uint8)
    decoded_picture("case", encoded, cv2.IMREAD_COLOR)
    decoded_picture("case", encoded, cv2.IMREAD_UNCHANGED, (32, 24))
