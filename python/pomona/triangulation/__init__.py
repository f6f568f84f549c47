"""Fruits out of posed pictures of one camera: boxes to tracks by geometry alone, tracks to places and sizes."""

from pomona.triangulation.fruits_in_view import TriangulatedFruits, triangulated_fruits

__all__ = ["TriangulatedFruits", "triangulated_fruits"]
