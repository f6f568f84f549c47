"""Settings on their way to the core: the tables that a caller gives, as the JSON that it reads."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import cache
from typing import Any

from pomona import _core
from pomona.errors import PomonaError
from pomona.reading import shown

__all__ = ["core_settings", "require_kinds"]

MOST_WHOLE = 2**64 - 1
"""Of whole numbers in the core, none of which is below zero."""


def core_settings(config: Mapping[str, Any] | None) -> str:
    """Give the core's tables as JSON; what is in them the core looks at itself.

    Raises
    ------
    PomonaError
        When it is no mapping, for example the name of a file, or a value is of another kind than its default.
    """
    if config is None:
        return "{}"
    if not isinstance(config, Mapping):
        found = shown(config) if isinstance(config, str) else f"a {type(config).__name__}"
        raise PomonaError(f"config: found {found}, expected tables, as `tomllib.load` gives them of a file")
    if (wrong := _not_finite("config", config)) is not None:
        raise PomonaError(f"{wrong}, expected a finite number")
    require_kinds(config, "config: ")
    try:
        return json.dumps(dict(config))
    except (TypeError, ValueError) as error:
        raise PomonaError(f"config: {error}") from None


def require_kinds(tables: Mapping[str, Any], place: str) -> None:
    """Refuse values of another kind than their defaults; what the core does not know it says itself.

    Parameters
    ----------
    tables : mapping
        As `core_settings` takes them.
    place : str
        What to put before the name of a setting, such as the file that it is from.

    Raises
    ------
    PomonaError
        One line: the setting, what was found and what was expected.
    """
    _require_kinds(tables, _defaults(), place)


def _require_kinds(tables: Mapping[str, Any], defaults: Mapping[str, Any], place: str) -> None:
    for name, value in tables.items():
        if name not in defaults:
            continue
        match defaults[name]:
            case dict() as table:
                if isinstance(value, Mapping):
                    _require_kinds(value, table, f"{place}{name}.")
                    continue
                expected, fits = "a table", False
            case int():
                fits = isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MOST_WHOLE
                expected = "a whole number from 0"
            case default:
                # What is not set unless it is given is a number as well.
                fits = (isinstance(value, int | float) and not isinstance(value, bool)) or (default is value is None)
                expected = "a number"
        if not fits:
            raise PomonaError(f"{place}{name}: found {shown(value)}, expected {expected}")


@cache
def _defaults() -> Mapping[str, Any]:
    defaults: Mapping[str, Any] = json.loads(_core.default_config())
    return defaults


def _not_finite(name: str, value: Any) -> str | None:
    """Name the first number that JSON does not know."""
    if isinstance(value, Mapping):
        wrong = (_not_finite(f"{name}.{key}", below) for key, below in value.items())
        return next((one for one in wrong if one is not None), None)
    return f"{name}: found {value}" if isinstance(value, float) and not math.isfinite(value) else None
