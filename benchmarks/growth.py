"""Growth of fruits over drawn seasons whose true growth is known, and of twelve apples beside calipers.

Sizes of the fruits of `pomona.synth`'s rows on the visits of its seasons: 2 mm of noise on each, an error of 2 to 3 %
that all sizes of a visit share, fruits that are hidden on most visits or few, false points of a single visit;
identities are the true ones. Then the same in years that differ: 15 % in the rate of growth, 10 days in its onset; with
one camera for all visits, which is off by 3 %; and in years that no curve of the model describes: a dry spell of two to
four weeks, growth that slows down towards the harvest, stone fruits, growth that falls from the first day, growth in a
straight line. The first 60 % of the season are measured, its last visit is foretold. Twelve Fuji of `season_apples`:
the same from calipers, and from boxes in the plane of the tennis balls. `kinect_apples`: diameters of scans against
calipers. Writes growth.csv, growth.md, growth_season_apples.png and
growth_kinect_apples.png.
"""

import argparse
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.growth_draw import DrawnSizes, Year, draw_sizes
from benchmarks.growth_outside import OUTSIDE, Course, course_outside
from benchmarks.growth_real import kinect_apples, season_apples
from benchmarks.growth_scores import line, scores
from benchmarks.kept_rows import KeptRows
from benchmarks.results import markdown, shared_data, write_rows, write_text
from pomona.growth.season_growth import growth_of
from pomona.synth.seasons import SEASONS

SEEDS, SEEDS_OUTSIDE = 20, 10
SAME, DIFFERENT, CAMERA = "all the same", "that differ", "all the same, one camera"
YEARS = (SAME, DIFFERENT, CAMERA, *OUTSIDE)
CAMERA_SIGMA = 0.03
"""Of the logarithm of the scale that all visits of a season share."""


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks growth", description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS, help="of years that the model's curves describe")
    parser.add_argument("--seeds-outside", type=int, default=SEEDS_OUTSIDE, help="of each kind of the others")
    parser.add_argument("--kept", type=Path, help="file that keeps outcomes: an interrupted run goes on")
    options = parser.parse_args(arguments)
    seeds = {years: options.seeds_outside if years in OUTSIDE else options.seeds for years in YEARS}
    kept = KeptRows(options.kept)
    rows = [
        kept.row({"season": name, "years": years, "seed": seed}, partial(score_season, name, seed, years))
        for seed in range(max(seeds.values()))
        for years in YEARS
        for name in SEASONS
        if seed < seeds[years]
    ]
    rows.sort(key=lambda row: (list(SEASONS).index(str(row["season"])), YEARS.index(str(row["years"]))))
    write_rows("growth.csv", rows)
    text = report(rows)
    if (data := shared_data("growth: real apples")) is not None:
        text += season_apples(data / "season_apples") + kinect_apples(data)
    write_text("growth.md", text)


def score_season(name: str, seed: int, years: str) -> dict[str, object]:
    drawn = draw_sizes(SEASONS[name], seed, course_of(years, seed))
    if years == CAMERA:
        drawn = by_one_camera(drawn, seed)
    found = growth_of(drawn.fruits, harvest=drawn.harvest.date())
    sys.stderr.write(f"growth: {name}, {years}, {seed} done\n")
    return {
        "season": name,
        "years": years,
        "seed": seed,
        "curve": found.curve.fitted.family.name,
        **scores(found, drawn),
    }


def by_one_camera(drawn: DrawnSizes, seed: int) -> DrawnSizes:
    """Measure all visits with a camera whose scale is off."""
    scale = np.exp(CAMERA_SIGMA * np.random.Generator(np.random.PCG64([seed, 63])).normal())
    return replace(drawn, fruits=replace(drawn.fruits, diameters_mm=scale * drawn.fruits.diameters_mm))


def course_of(years: str, seed: int) -> Course:
    if years in OUTSIDE:
        return course_outside(years, seed)
    return (Year.draw(seed) if years == DIFFERENT else Year()).diameters_m


def report(rows: list[dict[str, object]]) -> str:
    header = (
        "season",
        "years",
        "seeds",
        "rate error, mm a day",
        "bias, mm",
        "worst bias",
        "RMSE a fruit, mm",
        "fruits",
        "blocks",
        "trees",
    )
    named = [
        (name, years, [row for row in rows if row["years"] == years and name in ("both", row["season"])])
        for years in YEARS
        for name in (*SEASONS, "both")
    ]
    lines = [(name, years, *line(some)) for name, years, some in named]
    about = " ".join((__doc__ or "").split())
    return (
        f"# Growth\n\n{about}\n\nRate error: median over fruits, then over seeds. The three columns at the end: share "
        f"of the 90 % intervals that hold the truth.\n\n{markdown(header, lines)}"
    )
