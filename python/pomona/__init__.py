"""Pomona finds the same fruits again."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pomona._core import __version__
from pomona.errors import PomonaError, PomonaWarning

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud, Views

__all__ = ["FruitCloud", "PomonaError", "PomonaWarning", "Views", "__version__"]

# Loaded at first use, so that `pomona --help` does not wait for numpy.
_MODULE_OF = {
    "FruitCloud": "pomona.cloud",
    "Views": "pomona.cloud",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'pomona' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
