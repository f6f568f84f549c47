"""Pomona finds the same fruits again."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pomona._core import __version__
from pomona.errors import PomonaError, PomonaWarning

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud, Views
    from pomona.matching import Index, Match, Verdict, default_config, match
    from pomona.orchard import Observations, OrchardMap, Session, Visit, add_session, load_session, write_session
    from pomona.plot import draw_match, save_picture
    from pomona.scanning import scan
    from pomona.survey import Survey

# Loaded at first use, so that `pomona --help` does not wait for numpy.
_MODULE_OF = {
    "FruitCloud": "pomona.cloud",
    "Index": "pomona.matching",
    "Match": "pomona.matching",
    "Observations": "pomona.orchard",
    "OrchardMap": "pomona.orchard",
    "Session": "pomona.orchard",
    "Survey": "pomona.survey",
    "Verdict": "pomona.matching",
    "Views": "pomona.cloud",
    "Visit": "pomona.orchard",
    "add_session": "pomona.orchard",
    "default_config": "pomona.matching",
    "draw_match": "pomona.plot",
    "load_session": "pomona.orchard",
    "match": "pomona.matching",
    "save_picture": "pomona.plot",
    "scan": "pomona.scanning",
    "write_session": "pomona.orchard",
}

__all__ = [
    "FruitCloud",
    "Index",
    "Match",
    "Observations",
    "OrchardMap",
    "PomonaError",
    "PomonaWarning",
    "Session",
    "Survey",
    "Verdict",
    "Views",
    "Visit",
    "__version__",
    "add_session",
    "default_config",
    "draw_match",
    "load_session",
    "match",
    "save_picture",
    "scan",
    "write_session",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'pomona' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
