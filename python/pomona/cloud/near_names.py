"""Columns that are kept as text though their names nearly are those of columns that would count."""

from __future__ import annotations

import re
from collections.abc import Iterator
from difflib import SequenceMatcher
from typing import TYPE_CHECKING

from pomona.cloud.columns import NUMBERS, split

if TYPE_CHECKING:
    from pomona.cloud.fruit_cloud import FruitCloud

__all__ = ["DIAMETER", "near_names"]

DIAMETER = "diameter_m"

_SHORT = re.compile(r"dia(m(eter)?)?(m|cm|mm|in|inch)?")
"""How else a column of diameters may be called, without its signs."""

_SLIP = 0.85
"""Names that are so alike differ by a slip: diameter_mm is, diameter_sigma_m is not."""


def near_names(cloud: FruitCloud) -> Iterator[tuple[str, str]]:
    """Give each such column, and the name by which it would count and no other column goes."""
    missing = {_bare(name): name for name in sorted({*NUMBERS, "id"} - split(cloud).keys())}
    for name in cloud.extras:
        bare = _bare(name)
        if bare in missing:
            yield name, missing[bare]
        elif DIAMETER in missing.values() and _is_diameter(bare):
            yield name, DIAMETER


def _is_diameter(bare: str) -> bool:
    return _SHORT.fullmatch(bare) is not None or SequenceMatcher(None, bare, _bare(DIAMETER)).ratio() >= _SLIP


def _bare(name: str) -> str:
    return re.sub(r"[\W_]", "", name).casefold()
