"""The fruits of one visit, and the files they live in."""

from pomona.cloud.fruit_cloud import FruitCloud, Unit, Views

__all__ = ["FruitCloud", "Unit", "Views"]
