"""A season as files: one fruit cloud a visit, and all truth in one."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pomona.atomic import whole_file
from pomona.likes import visits_of_season
from pomona.synth.living.fruit_lives import STATES

if TYPE_CHECKING:
    from pomona.synth.seasons.season import Season, SeasonVisit

__all__ = ["season_truth", "write_season"]

_PLACES = 5
"""Decimals of true metres: 10 micrometres."""


def write_season(season: Season, folder: Path) -> None:
    """Write `YYYY-MM-DD.csv` for every visit and `truth.json`; visits of an earlier season in the folder go.

    Raises
    ------
    PomonaError
        When a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    before = visits_of_season(folder)
    for visit in season.visits:
        visit.cloud.write(folder / f"{visit.day.isoformat()}.csv")
    with whole_file(folder / "truth.json") as partial:
        partial.write_text(json.dumps(season_truth(season)) + "\n", encoding="utf-8")
    for stale in before - {f"{visit.day.isoformat()}.csv" for visit in season.visits}:
        (folder / stale).unlink(missing_ok=True)


def season_truth(season: Season) -> dict[str, Any]:
    """Give the truth of a season as it stands in `truth.json`."""
    crop = season.row.crop
    return {
        "season": season.plan.name,
        "seed": season.seed,
        "plan": _plain(asdict(season.plan)),
        "states": list(STATES),
        "fruits": {
            "id": list(range(1, len(crop) + 1)),
            "tree": crop.trees.tolist(),
            "cluster": crop.spurs.tolist(),
        },
        "visits": [_visit_truth(season, visit) for visit in season.visits],
    }


def _visit_truth(season: Season, visit: SeasonVisit) -> dict[str, Any]:
    """Tables by column: of the rows of the cloud, and of all fruits of the season in the order of their ids."""
    n = len(season.row.crop)
    hanging = visit.truth.ids - 1
    places: list[list[float] | None] = [None] * n
    diameters: list[float | None] = [None] * n
    shown: list[float | None] = [None] * n
    for row, fruit in enumerate(hanging.tolist()):
        places[fruit] = np.round(visit.truth.centres_m[row], _PLACES).tolist()
        diameters[fruit] = round(float(visit.truth.diameters_m[row]), _PLACES)
        shown[fruit] = None if np.isnan(visit.shown[row]) else round(float(visit.shown[row]), 3)
    return {
        "date": visit.day.isoformat(),
        "file": f"{visit.day.isoformat()}.csv",
        "side": visit.drive.side,
        "backwards": visit.drive.backwards,
        "map_from_session": visit.map_from_session.tolist(),
        "size_scale": visit.size_scale,
        "rows": [int(fruit) or None for fruit in visit.fruits],
        "positions_in_map_m": places,
        "diameters_m": diameters,
        "states": [STATES[state] for state in season.row.states_on(visit.day)],
        "seen": np.isin(np.arange(1, n + 1), visit.fruits).tolist(),
        "shown": shown,
    }


def _plain(value: Any) -> Any:
    """Write dates of a plan as text."""
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return value.isoformat() if hasattr(value, "isoformat") else value
