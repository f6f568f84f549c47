"""Reconstructions without a scale made metric by the fruits of a map."""

from pomona.free_scale.metric import Upgrade, metric
from pomona.free_scale.scaling import FreeScaling, scaling_of

__all__ = ["FreeScaling", "Upgrade", "metric", "scaling_of"]
