"""Pomona finds the same fruits again."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pomona._core import __version__
from pomona.errors import PomonaError, PomonaWarning

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud, Views
    from pomona.growth.season_growth import SeasonGrowth, grow_season
    from pomona.localize import Localization, Localizer
    from pomona.matching import Index, Match, ReadyCloud, Verdict, default_config, match, match_expected
    from pomona.orchard import Observations, OrchardMap, Session, Visit, add_session, load_session, write_session
    from pomona.plot import draw_match, save_picture
    from pomona.recording import Calibration, Frame, Recording, open_recording
    from pomona.recording.selection import selected
    from pomona.scanning import scan
    from pomona.survey import Survey
    from pomona.survey.depth import Lifted, lift
    from pomona.survey.refinement import Motions, Refined, SeenFruits, refine
    from pomona.survey.tracking import Tracker, Tracks
    from pomona.torn_rows import laid_in_parts

# Loaded at first use, so that `pomona --help` does not wait for numpy.
_MODULE_OF = {
    "Calibration": "pomona.recording",
    "Frame": "pomona.recording",
    "FruitCloud": "pomona.cloud",
    "Index": "pomona.matching",
    "Lifted": "pomona.survey.depth",
    "Localization": "pomona.localize",
    "Localizer": "pomona.localize",
    "Match": "pomona.matching",
    "Motions": "pomona.survey.refinement",
    "Observations": "pomona.orchard",
    "OrchardMap": "pomona.orchard",
    "ReadyCloud": "pomona.matching",
    "Recording": "pomona.recording",
    "Refined": "pomona.survey.refinement",
    "SeasonGrowth": "pomona.growth.season_growth",
    "SeenFruits": "pomona.survey.refinement",
    "Session": "pomona.orchard",
    "Survey": "pomona.survey",
    "Tracker": "pomona.survey.tracking",
    "Tracks": "pomona.survey.tracking",
    "Verdict": "pomona.matching",
    "Views": "pomona.cloud",
    "Visit": "pomona.orchard",
    "add_session": "pomona.orchard",
    "default_config": "pomona.matching",
    "draw_match": "pomona.plot",
    "grow_season": "pomona.growth.season_growth",
    "laid_in_parts": "pomona.torn_rows",
    "lift": "pomona.survey.depth",
    "load_session": "pomona.orchard",
    "match": "pomona.matching",
    "match_expected": "pomona.matching",
    "open_recording": "pomona.recording",
    "refine": "pomona.survey.refinement",
    "save_picture": "pomona.plot",
    "scan": "pomona.scanning",
    "selected": "pomona.recording.selection",
    "write_session": "pomona.orchard",
}

__all__ = [
    "Calibration",
    "Frame",
    "FruitCloud",
    "Index",
    "Lifted",
    "Localization",
    "Localizer",
    "Match",
    "Motions",
    "Observations",
    "OrchardMap",
    "PomonaError",
    "PomonaWarning",
    "ReadyCloud",
    "Recording",
    "Refined",
    "SeasonGrowth",
    "SeenFruits",
    "Session",
    "Survey",
    "Tracker",
    "Tracks",
    "Verdict",
    "Views",
    "Visit",
    "__version__",
    "add_session",
    "default_config",
    "draw_match",
    "grow_season",
    "laid_in_parts",
    "lift",
    "load_session",
    "match",
    "match_expected",
    "open_recording",
    "refine",
    "save_picture",
    "scan",
    "selected",
    "write_session",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'pomona' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
