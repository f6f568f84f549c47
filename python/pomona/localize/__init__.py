"""Where the camera is: poses in the map from the fruits that it sees."""

from pomona.localize.course import Step, Way
from pomona.localize.localizer import Localization, Localizer

__all__ = ["Localization", "Localizer", "Step", "Way"]
