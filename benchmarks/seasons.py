"""Identities over seasons of `pomona synth season`, visit by visit into one map.

P and R are over all pairs of visits; whole are the fruits seen at least twice that have one identity which has nothing
else. Of the fruits that were seen and have gone by the last visit: how many the map says are gone, in how many of those
of which it says so it is right, and of how many that hang it says so. Writes seasons.csv and seasons.md.
"""

import argparse
import dataclasses
import random
import sys
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from benchmarks.drawn_seasons import DrawnSeason, drawn_season
from benchmarks.identity_scores import IdentityScore, score_identities
from benchmarks.kept_rows import KeptRows
from benchmarks.results import markdown, share, write_rows, write_text
from pomona.orchard import OrchardMap, add_session
from pomona.synth.seasons import SEASONS

BARS = {"easy": ("0.990", "0.990", "0.980"), "hard": ("0.950", "0.930", "0.880")}
"""P, R and whole that are asked for; of what is gone 0.92 are to be found, and 0.02 of the living may be said gone."""


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks seasons", description=__doc__)
    parser.add_argument("--seasons", nargs="+", choices=list(SEASONS), default=list(SEASONS))
    parser.add_argument(
        "--seeds", type=int, default=20, help="seasons of each name; default: as in the committed table"
    )
    parser.add_argument("--drawn", type=Path, help="folder that keeps the drawn seasons; drawing one takes a minute")
    parser.add_argument("--kept", type=Path, help="file that keeps outcomes: an interrupted run goes on")
    parser.add_argument("--shuffled", action="store_true", help="add the visits in a random order; writes nothing")
    options = parser.parse_args(arguments)
    kept = KeptRows(options.kept)
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.drawn or Path(scratch)
        made = partial(outcome, folder, shuffled=options.shuffled)
        rows = [
            parted(kept.row({"season": name, "seed": seed, "shuffled": options.shuffled}, partial(made, name, seed)))
            for name in options.seasons
            for seed in range(options.seeds)
        ]
    if options.shuffled:
        sys.stdout.write(table(rows))
        return
    write_rows("seasons.csv", [{**row, **vars(score), **score.shares()} for row, score in rows])
    write_text("seasons.md", f"# Seasons\n\n{' '.join((__doc__ or '').split())}\n\n{table(rows)}")


def outcome(folder: Path, name: str, seed: int, *, shuffled: bool) -> dict[str, object]:
    row, score = row_of(drawn_season(folder, name, seed), shuffled=shuffled)
    return {**row, **dataclasses.asdict(score)}


def parted(outcome: dict[str, object]) -> tuple[dict[str, object], IdentityScore]:
    """Part an outcome into what it is of and its counts."""
    counts = {field.name: outcome.pop(field.name) for field in dataclasses.fields(IdentityScore)}
    return outcome, IdentityScore(**counts)


def row_of(season: DrawnSeason, *, shuffled: bool) -> tuple[dict[str, object], IdentityScore]:
    """Add all visits of a season to a map and compare."""
    order = list(range(len(season.visits)))
    if shuffled:
        random.Random(season.seed).shuffle(order)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "orchard.gpkg"
        begin = time.perf_counter()
        n_refused = sum(not add_session(path, season.visits[visit].session()).is_added for visit in order)
        seconds = time.perf_counter() - begin
        score = scored(season, OrchardMap(path))
    figures = ", ".join(f"{name} {share(value)}" for name, value in score.shares().items())
    sys.stderr.write(f"{season.name} {season.seed}: {figures}, {seconds:.1f} s\n")
    return {"season": season.name, "seed": season.seed, "refused": n_refused}, score


def scored(season: DrawnSeason, orchard: OrchardMap) -> IdentityScore:
    """Compare a map of a season with its truth; what was refused was not seen as anything."""
    seen = orchard.observations()
    fruits = orchard.fruits()
    rows_of = {visit.path.stem: {} for visit in season.visits}
    for identity, session, label in zip(seen.fruit_ids.tolist(), seen.sessions, seen.labels, strict=True):
        rows_of[session][int(str(label))] = identity
    visits = [
        [(rows_of[visit.path.stem].get(row, -row - 1), fruit) for row, fruit in enumerate(visit.fruits)]
        for visit in season.visits
    ]
    said = {
        int(identity)
        for identity, state in zip(fruits.ids or (), fruits.extras["state"], strict=True)
        if state == "gone"
    }
    return score_identities(visits, said, season.gone)


def table(rows: Sequence[tuple[dict[str, object], IdentityScore]]) -> str:
    header = (
        "season",
        "seasons",
        "refused",
        "P",
        "R",
        "whole",
        "gone found",
        "gone right",
        "living said gone",
        "bars P, R, whole",
    )
    lines = []
    for name in dict.fromkeys(str(row["season"]) for row, _ in rows):
        own = [(row, score) for row, score in rows if row["season"] == name]
        pooled = sum((score for _, score in own), IdentityScore())
        refused = sum(int(str(row["refused"])) for row, _ in own)
        figures = [share(value) for value in pooled.shares().values()]
        lines.append((name, str(len(own)), str(refused), *figures, ", ".join(BARS[name])))
    return markdown(header, lines)
