"""Growth of fruits over drawn seasons whose true growth is known, and of twelve apples beside calipers.

Sizes of the fruits of `pomona.synth`'s rows on the visits of its seasons: 2 mm of noise on each, an error of 2 to 3 %
that all sizes of a visit share, fruits that are hidden on most visits or few, false points of a single visit;
identities are the true ones. Then the same in years that differ: 15 % in the rate of growth, 10 days in its onset. The
first 60 % of the season are measured, its last visit is foretold. Twelve Fuji of `season_apples`: the same from
calipers, and from boxes in the plane of the tennis balls. `kinect_apples`: diameters of scans against calipers. Writes
growth.csv, growth.md, growth_season_apples.png and growth_kinect_apples.png.
"""

import argparse
import sys

from benchmarks.growth_draw import Year, draw_sizes
from benchmarks.growth_real import kinect_apples, season_apples
from benchmarks.growth_scores import line, scores
from benchmarks.results import markdown, shared_data, write_rows, write_text
from pomona.growth.season_growth import growth_of
from pomona.synth.seasons import SEASONS

SEEDS = 20
DIFFERENT = "that differ"
YEARS = ("all the same", DIFFERENT)


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks growth", description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    options = parser.parse_args(arguments)
    rows = [score_season(name, seed, years) for name in SEASONS for years in YEARS for seed in range(options.seeds)]
    write_rows("growth.csv", rows)
    text = report(rows)
    data = shared_data()
    if data is None:
        sys.stderr.write("growth: real apples skipped, no folder of recordings (set POMONA_DATA)\n")
    else:
        text += season_apples(data / "season_apples") + kinect_apples(data)
    write_text("growth.md", text)


def score_season(name: str, seed: int, years: str) -> dict[str, object]:
    drawn = draw_sizes(SEASONS[name], seed, Year.draw(seed) if years == DIFFERENT else Year())
    found = growth_of(drawn.fruits, harvest=drawn.harvest.date())
    sys.stderr.write(f"growth: {name} {seed} done\n")
    return {
        "season": name,
        "years": years,
        "seed": seed,
        "curve": found.curve.fitted.family.name,
        **scores(found, drawn),
    }


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
