"""The fruits of one visit, and the files they live in."""

from pomona.cloud.fruit_cloud import FruitCloud
from pomona.cloud.given import Cloud, as_cloud
from pomona.cloud.units import Unit
from pomona.views import Views

__all__ = ["Cloud", "FruitCloud", "Unit", "Views", "as_cloud"]
