"""The agreement with calipers as the page is told of it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pomona.growth.agreement import Agreement, agreement_by_date, agreement_of
from pomona.growth.caliper_file import read_calipers
from pomona.growth.caliper_pairs import pair_with_calipers
from pomona.growth.measured import measured_fruits
from pomona.viewer.told_fruits import FruitsTold

__all__ = ["calipers_told"]


def calipers_told(path: Path, calipers: Path | None, fruits: FruitsTold) -> dict[str, Any] | None:
    """Tell pairs, bias, RMSE and limits of agreement as `pomona validate` has them; None without calipers.

    Raises
    ------
    PomonaError
        When the table is wrong, or no visit near measured any of its fruits.
    """
    if calipers is None:
        return None
    pairs, unseen = pair_with_calipers(measured_fruits(path), read_calipers(calipers), calipers)
    rows = fruits.rows_of(np.array([pair.fruit_id for pair in pairs], dtype=np.int64)).tolist()
    visits = list(agreement_by_date(pairs).items())
    return {
        "file": calipers.name,
        "unseen": unseen,
        "all": _plain(agreement_of(pairs)),
        "visits": [{"name": name, **_plain(found)} for name, found in visits],
        "pairs": [
            {
                "fruit": row,
                "name": pair.name,
                "date": pair.day.isoformat(),
                "measured_mm": round(pair.measured_mm, 2),
                "caliper_mm": round(pair.caliper_mm, 2),
            }
            for row, pair in zip(rows, pairs, strict=True)
        ],
    }


def _plain(found: Agreement) -> dict[str, float | None]:
    return {name: None if value != value else value for name, value in asdict(found).items()}  # nan is not itself
