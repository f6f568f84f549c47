"""Settings on their way to the core: the tables that a caller gives, as the JSON that it reads."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from pomona.errors import PomonaError
from pomona.reading import shown

__all__ = ["core_settings"]


def core_settings(config: Mapping[str, Any] | None) -> str:
    """Give the core's tables as JSON; what is in them the core looks at itself.

    Raises
    ------
    PomonaError
        When it is no mapping, for example the name of a file, or a value is none of JSON's.
    """
    if config is None:
        return "{}"
    if not isinstance(config, Mapping):
        found = shown(config) if isinstance(config, str) else f"a {type(config).__name__}"
        raise PomonaError(f"config: found {found}, expected tables, as `tomllib.load` gives them of a file")
    if (wrong := _not_finite("config", config)) is not None:
        raise PomonaError(f"{wrong}, expected a finite number")
    try:
        return json.dumps(dict(config))
    except (TypeError, ValueError) as error:
        raise PomonaError(f"config: {error}") from None


def _not_finite(name: str, value: Any) -> str | None:
    """Name the first number that JSON does not know."""
    if isinstance(value, Mapping):
        wrong = (_not_finite(f"{name}.{key}", below) for key, below in value.items())
        return next((one for one in wrong if one is not None), None)
    return f"{name}: found {value}" if isinstance(value, float) and not math.isfinite(value) else None
