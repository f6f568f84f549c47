"""Seasons of `pomona synth season` with their truth, drawn once into a folder and read from there."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pomona.orchard import Session, load_session
from pomona.synth.seasons import SEASONS, draw_season
from pomona.synth.seasons.season_files import write_season


@dataclass(frozen=True)
class DrawnVisit:
    """What one visit saw, and which fruit each row of it is: 0 for a false point."""

    date: str
    path: Path
    fruits: Sequence[int]

    def session(self) -> Session:
        """Return the visit as the map takes it; row numbers are the names of its fruits."""
        session = load_session(self.path, date=self.date)
        return replace(session, cloud=replace(session.cloud, ids=tuple(map(str, range(len(session.cloud))))))


@dataclass(frozen=True)
class DrawnSeason:
    """Visits in the order of their dates, and the fruits that no longer hang on the last of them."""

    name: str
    seed: int
    visits: tuple[DrawnVisit, ...]
    gone: frozenset[int]


def drawn_season(folder: Path, name: str, seed: int) -> DrawnSeason:
    """Read a season; draw it first where it is not in the folder yet."""
    home = folder / f"{name}-{seed}"
    if not (home / "truth.json").exists():
        write_season(draw_season(SEASONS[name], seed), home)
    truth = json.loads((home / "truth.json").read_text(encoding="utf-8"))
    visits = tuple(
        DrawnVisit(visit["date"], home / visit["file"], [fruit or 0 for fruit in visit["rows"]])
        for visit in truth["visits"]
    )
    states = zip(truth["fruits"]["id"], truth["visits"][-1]["states"], strict=True)
    return DrawnSeason(name, seed, visits, frozenset(fruit for fruit, state in states if state != "alive"))
