"""Chance, a stream of its own for each concept: what one draws does not change another."""

from __future__ import annotations

import zlib

import numpy as np

__all__ = ["chance"]


def chance(seed: int, concept: str) -> np.random.Generator:
    """Give the generator of a concept, the same for the same seed."""
    return np.random.Generator(np.random.PCG64([zlib.crc32(concept.encode()), seed]))
