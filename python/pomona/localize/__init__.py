"""Where the camera is: poses in the map from the fruits that it sees."""

from pomona.localize.localizer import Localization, Localizer
from pomona.localize.way import Step, Way

__all__ = ["Localization", "Localizer", "Step", "Way"]
