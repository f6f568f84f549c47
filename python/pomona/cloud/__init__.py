"""The fruits of one visit, and the files they live in."""

from pomona.cloud.fruit_cloud import FruitCloud, Unit, Views
from pomona.cloud.given import Cloud, as_cloud

__all__ = ["Cloud", "FruitCloud", "Unit", "Views", "as_cloud"]
