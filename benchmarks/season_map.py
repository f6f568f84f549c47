"""Twelve tagged apples of one tree in one map: ten dates, 20 July to 12 October, added one by one.

Identities as `map add` gives them, by either method, against the tags. The apples lie in the plane of the tennis balls,
with the diameters of their boxes there; or lifted by their calipers. Then with a fifth of the apples of each date
hidden and a false point added, over ten seeds. Each date comes in a frame of its own. What the map of the plane knows
of growth stands beside the calipers. Writes season_map.csv, season_map.md and docs/images/season-apples.png.
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from benchmarks.disturb import hidden, moved, with_false_points
from benchmarks.growth_real import boxes_mm, draw_apples
from benchmarks.identity_scores import IdentityScore, score_identities
from benchmarks.kinect import identity_counts
from benchmarks.results import FOLDER, markdown, share, shared_data, write_rows, write_text
from benchmarks.season import METHODS, read_calipers, read_dates
from pomona.cloud import FruitCloud
from pomona.growth.agreement import agreement_by_date, agreement_of
from pomona.growth.caliper_file import read_calipers as calipers_of_file
from pomona.growth.caliper_pairs import pair_with_calipers
from pomona.growth.season_growth import grow_season
from pomona.orchard import OrchardMap, Session, add_session
from pomona.plot import save_picture
from pomona.settings import Settings

TREE = "tree1"
PICTURE = FOLDER.parents[1] / "docs" / "images" / "season-apples.png"


@dataclass(frozen=True)
class Condition:
    """What is done to each date, and how often it is drawn."""

    name: str
    hidden: float
    false_points: int
    seeds: int


CONDITIONS = (Condition("undisturbed", 0.0, 0, 1), Condition("20 % hidden, 1 false", 0.2, 1, 10))

Dates = dict[str, FruitCloud]


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks season_map", description=__doc__)
    parser.add_argument("--seeds", type=int, help="of the disturbed dates")
    options = parser.parse_args(arguments)
    data = shared_data("season_map")
    if data is None:
        return
    folder = data / "season_apples"
    views = {"in the plane of the balls": dated(folder, flat=True), "lifted": dated(folder, flat=False)}
    rows = [
        {
            "fruits": view,
            "method": method,
            "condition": condition.name,
            **pooled(dates, condition, method, options.seeds),
        }
        for view, dates in views.items()
        for method in METHODS
        for condition in CONDITIONS
    ]
    write_rows("season_map.csv", rows)
    write_text("season_map.md", report(rows) + growth(views["in the plane of the balls"], folder))


def dated(folder: Path, *, flat: bool) -> Dates:
    """Read the apples of each date with the diameters of their boxes, metres."""
    sizes_mm = boxes_mm(folder)
    clouds = read_dates(folder, TREE, flat=flat)
    return {
        day: FruitCloud(
            clouds[day].positions,
            ids=clouds[day].ids,
            diameters_m=np.array([sizes_mm[name][datetime.fromisoformat(day).toordinal()] for name in clouds[day].ids])
            / 1000.0,
        )
        for day in sorted(clouds)
    }


def pooled(dates: Dates, condition: Condition, method: str, seeds: int | None) -> dict[str, object]:
    """Add up the seeds of a condition."""
    score, counts = IdentityScore(), dict.fromkeys(("refused", "splits", "merges"), 0)
    n_seeds = condition.seeds if seeds is None else min(seeds, condition.seeds)
    for seed in range(n_seeds):
        with tempfile.TemporaryDirectory() as scratch:
            orchard = Path(scratch) / "orchard.gpkg"
            counts["refused"] += added(orchard, list(disturbed(dates, condition, seed)), method)
            seen = OrchardMap(orchard).observations()
        found = identity_counts(list(zip(seen.labels, seen.fruit_ids.tolist(), strict=True)))
        for name in ("splits", "merges"):
            counts[name] += found[name]
        tag_of = {label: number for number, label in enumerate(sorted(set(seen.labels)), start=1)}
        sights = zip(seen.sessions, seen.fruit_ids.tolist(), seen.labels, strict=True)
        by_day: dict[str, list[tuple[int, int]]] = {}
        for day, identity, label in sights:
            by_day.setdefault(day, []).append((identity, 0 if label.startswith("false") else tag_of[label]))
        score += score_identities([by_day[day] for day in sorted(by_day)])
    shares = {name: score.shares()[name] for name in ("P", "R", "whole_of_tracked")}
    return {"seasons": n_seeds, "dates": n_seeds * len(dates), **counts, **shares}


def disturbed(dates: Dates, condition: Condition, seed: int) -> Iterator[Session]:
    """Give the dates as sessions, each turned and moved at random."""
    for number, (day, cloud) in enumerate(dates.items()):
        rng = np.random.Generator(np.random.PCG64([seed, number]))
        left = hidden(rng, cloud, condition.hidden)
        points = with_false_points(rng, left, condition.false_points, f"false {day} ")
        sizes_m = np.concatenate([left.diameters_m, rng.choice(cloud.diameters_m, condition.false_points)])
        shown = FruitCloud(points.positions, ids=points.ids, diameters_m=sizes_m)
        yield Session(day, day, f"season_apples, {TREE}", shown if number == 0 else moved(rng, shown)[0])


def added(orchard: Path, sessions: list[Session], method: str) -> int:
    """Add sessions to a map; return how many were not found there."""
    settings = Settings.load(None, {"method": method})
    return sum(not add_session(orchard, session, settings=settings).is_added for session in sessions)


def report(rows: list[dict[str, object]]) -> str:
    header = ("fruits", "method", "condition", "dates not found", "splits", "merges", "P", "R", "whole")
    lines = [
        (
            row["fruits"],
            row["method"],
            row["condition"],
            f"{row['refused']}/{row['dates']}",
            row["splits"],
            row["merges"],
            *(share(row[name]) for name in ("P", "R", "whole_of_tracked")),
        )
        for row in rows
    ]
    return (
        f"# One tree, twelve weeks, one map\n\n{' '.join((__doc__ or '').split())}\n\nA split is an identity too many "
        "for one apple, a merge an apple, or a false point, too many in one identity. P and R over all pairs of dates; "
        "whole: apples with one identity that has nothing else.\n\n"
        f"{markdown(header, lines)}"
    )


def growth(dates: Dates, folder: Path) -> str:
    """Growth as the map knows it, beside the calipers; draws the picture."""
    calipers = folder / f"{TREE}_calipers_mm.csv"
    with tempfile.TemporaryDirectory() as scratch:
        orchard = Path(scratch) / "orchard.gpkg"
        added(orchard, list(disturbed(dates, CONDITIONS[0], 0)), "verified")
        grown = grow_season(orchard)
        pairs, _ = pair_with_calipers(grown.fruits, calipers_of_file(calipers), calipers)
    names = [next(filter(None, labels)) for labels in grown.fruits.labels]
    save_picture(draw_apples((names, grown), read_calipers(calipers)), PICTURE)
    lines = [
        (day, one.n, f"{one.bias_mm:+.2f}", f"{one.rmse_mm:.2f}", f"{one.low_mm:+.1f} to {one.high_mm:+.1f}")
        for day, one in {"all": agreement_of(pairs), **agreement_by_date(pairs)}.items()
    ]
    header = ("date", "pairs", "bias, mm", "RMSE, mm", "limits of agreement, mm")
    return (
        "\n## Sizes of the map beside the calipers\n\nDiameters of boxes in the plane of the tennis balls, as `pomona "
        "validate` compares them. An apple before that plane is measured too large, one behind it too small, on every "
        f"date.\n\n{markdown(header, lines)}\n"
        "![Twelve apples by the map and by calipers](../../docs/images/season-apples.png)\n"
    )
