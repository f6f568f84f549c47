"""Pomona finds the same fruits again."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pomona._core import __version__
from pomona.errors import PomonaError, PomonaWarning

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud, Views
    from pomona.matching import Index, Match, Verdict, default_config, match

__all__ = [
    "FruitCloud",
    "Index",
    "Match",
    "PomonaError",
    "PomonaWarning",
    "Verdict",
    "Views",
    "__version__",
    "default_config",
    "match",
]

# Loaded at first use, so that `pomona --help` does not wait for numpy.
_MODULE_OF = {
    "FruitCloud": "pomona.cloud",
    "Views": "pomona.cloud",
    "Index": "pomona.matching",
    "Match": "pomona.matching",
    "Verdict": "pomona.matching",
    "default_config": "pomona.matching",
    "match": "pomona.matching",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'pomona' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
