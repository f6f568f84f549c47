"""Growth of real apples: twelve Fuji over a season, and four captures of one day, beside calipers."""

import csv
import tempfile
from datetime import datetime
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks import kinect, season
from benchmarks.growth_draw import MEASURED_SHARE, as_fruits
from benchmarks.growth_scores import covers
from benchmarks.results import FOLDER, markdown
from pomona.growth.agreement import agreement_by_date, agreement_of, draw_agreement
from pomona.growth.caliper_file import read_calipers
from pomona.growth.caliper_pairs import pair_with_calipers
from pomona.growth.measured import measured_fruits
from pomona.growth.season_growth import SeasonGrowth, growth_of
from pomona.orchard import add_session, load_session
from pomona.plot import save_picture

Apples = dict[str, dict[int, float]]
"""Diameters in mm by apple and day."""


def season_apples(folder: Path) -> str:
    """Foretell the last day of twelve apples from the first dates, measured by calipers and by boxes."""
    by_hand = season.read_calipers(folder / "tree1_calipers_mm.csv")
    lines, curves = [], {}
    for name, sizes in (("calipers", by_hand), ("boxes", boxes_mm(folder))):
        for share in (1.0, MEASURED_SHARE):
            told, about = foretold_apples(name, sizes, by_hand, share)
            curves[name, share] = told
            lines.append(about)
    header = (
        "sizes from",
        "dates",
        "to",
        "curve",
        "bias, mm",
        "RMSE, mm",
        "apples in 90 %",
        "mean in 90 %",
        "rate error, mm a day",
    )
    save_picture(draw_apples(curves[("boxes", 1.0)], by_hand), FOLDER / "growth_season_apples.png")
    return (
        "\n## Twelve Fuji of `season_apples`\n\nForetold for 12 October 2022 against calipers of that day; rates at "
        "the last date used, against the calipers of three weeks around it. Boxes: diameters in the plane of the "
        "tennis balls, so each apple is off by its distance to that plane.\n\n"
        f"{markdown(header, lines)}\n![Curves from boxes beside the calipers](growth_season_apples.png)\n"
    )


def boxes_mm(folder: Path) -> dict[str, dict[int, float]]:
    """Diameters by apple and day, in the plane of the tennis balls."""
    apples: dict[str, dict[int, float]] = {}
    balls: dict[int, list[float]] = {}
    with (folder / "tree1_boxes.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    for box in lines:
        width_px = (float(box["xmax"]) - float(box["xmin"]) + float(box["ymax"]) - float(box["ymin"])) / 2
        day, name = datetime.fromisoformat(box["date"]).toordinal(), box["id"].rstrip("*")
        if name == "TB":
            balls.setdefault(day, []).append(width_px)
        else:
            apples.setdefault(name, {})[day] = width_px
    scale = {day: season.BALL_MM / float(np.median(widths)) for day, widths in balls.items()}
    return {name: {day: width * scale[day] for day, width in widths.items()} for name, widths in apples.items()}


def foretold_apples(
    name: str, sizes: Apples, by_hand: Apples, share: float
) -> tuple[tuple[list[str], SeasonGrowth], tuple[str, ...]]:
    names = sorted(set(sizes) & set(by_hand), key=int)
    days = sorted({day for series in sizes.values() for day in series})
    harvest = max(day for series in by_hand.values() for day in series)
    days = [day for day in days if day <= days[0] + share * (harvest - days[0])]
    table = np.array([[sizes[apple].get(day, np.nan) for day in days] for apple in names])
    fruits = as_fruits(
        table, np.zeros(len(names), np.int64), tuple(map(datetime.fromordinal, days)), np.ones(len(names), bool)
    )
    found = growth_of(fruits, harvest=datetime.fromordinal(harvest).date())
    true_mm = np.array([by_hand[apple][harvest] for apple in names])
    told = found.foretold
    errors = told.sizes_mm[:, -1] - true_mm
    inside = (told.lows_mm[:, -1] <= true_mm) & (true_mm <= told.highs_mm[:, -1])
    rates = np.array([caliper_rate(by_hand[apple], days[-1]) for apple in names])
    about = (
        f"{name}, {'all' if share == 1.0 else 'first 60 %'}",
        str(len(days)),
        datetime.fromordinal(days[-1]).date().isoformat(),
        found.curve.fitted.family.name,
        f"{errors.mean():+.2f}",
        f"{np.sqrt((errors**2).mean()):.2f}",
        f"{inside.sum()}/{len(names)}",
        "yes" if covers(found, 0, true_mm) else "no",
        f"{np.median(np.abs(told.rates_mm_per_day - rates)):.3f}",
    )
    return (names, found), about


def caliper_rate(series: dict[int, float], day: int) -> float:
    """Slope of the calipers within eleven days."""
    near = [at for at in series if abs(at - day) <= 11]
    return float(np.polyfit(near, [series[at] for at in near], 1)[0])


def draw_apples(told: tuple[list[str], SeasonGrowth], by_hand: Apples):
    names, found = told
    figure = Figure(figsize=(10.0, 6.5), dpi=90, layout="constrained")
    for row, (axes, name) in enumerate(zip(figure.subplots(3, 4, sharex=True, sharey=True).flat, names, strict=False)):
        at = np.array(found.days, dtype="datetime64[D]")
        axes.fill_between(at, found.foretold.lows_mm[row], found.foretold.highs_mm[row], color="#0072b2", alpha=0.2)
        axes.plot(at, found.foretold.sizes_mm[row], color="#0072b2", label="curve, 90 %")
        axes.plot(at[: len(found.fruits.days)], found.fruits.diameters_mm[row], ".", color="#3c3c3c", label="boxes")
        days = sorted(by_hand[name])
        axes.plot(
            [datetime.fromordinal(day) for day in days],
            [by_hand[name][day] for day in days],
            "x",
            color="#d55e00",
            markersize=4,
            label="calipers",
        )
        axes.set_title(f"apple {name}", fontsize="small")
        axes.tick_params(axis="x", rotation=60, labelsize="small")
    figure.axes[0].legend(fontsize="x-small", frameon=False)
    figure.supylabel("diameter, mm")
    return figure


def kinect_apples(data: Path) -> str:
    """Four scans of one day in one map, against calipers."""
    calipers = data / "kinect_apples" / "calipers.csv"
    with tempfile.TemporaryDirectory() as scratch:
        kinect.scanned(data, Path(scratch))
        orchard = Path(scratch) / "orchard.gpkg"
        for name in kinect.CAPTURES:
            moment = f"{kinect.DATE}T{name[:2]}:{name[2:4]}"
            add_session(orchard, load_session(Path(scratch) / f"{name}.gpkg", date=moment))
        fruits = measured_fruits(orchard)
        pairs, _ = pair_with_calipers(fruits, read_calipers(calipers), calipers)
    save_picture(draw_agreement(pairs), FOLDER / "growth_kinect_apples.png")
    found = {"all": agreement_of(pairs), **agreement_by_date(pairs)}
    lines = [
        (name, str(one.n), f"{one.bias_mm:+.2f}", f"{one.rmse_mm:.2f}", f"{one.low_mm:+.1f} to {one.high_mm:+.1f}")
        for name, one in found.items()
    ]
    header = ("capture", "pairs", "bias, mm", "RMSE, mm", "limits of agreement, mm")
    return (
        "\n## Scans of `kinect_apples` against calipers\n\nDiameters of `pomona scan` from depth and boxes; 25 or 26 "
        f"Fuji and two balls on each capture.\n\n{markdown(header, lines)}\n"
        "![Bland-Altman plot](growth_kinect_apples.png)\n"
    )
