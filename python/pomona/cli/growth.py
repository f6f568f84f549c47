"""`pomona growth`: how every fruit grows, how big it will be, and how many of each size."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.amounts import amount
from pomona.cli.page_wishes import Classes, Harvest
from pomona.cli.terminal import say, say_json
from pomona.cli.verbs import Writes
from pomona.cli.visit_warnings import warn_of_visits
from pomona.likes import GROWN

if TYPE_CHECKING:
    from typing import Any

    from pomona.growth.season_growth import SeasonGrowth


def growth(
    orchard: Path = typer.Argument(metavar="ORCHARD", help="The map (.gpkg), with visits on two days or more."),
    output: Annotated[Path, Writes(GROWN)] = typer.Option(
        ..., "-o", "--output", help="Folder for tables and pictures; made where it does not exist."
    ),
    harvest: Harvest = None,
    temperature: Path | None = typer.Option(
        None, metavar="CSV", help="Daily temperatures (date,mean_c or date,min_c,max_c): degree days are tried too."
    ),
    classes: Classes = None,
    pack_kg: float = typer.Option(13.0, min=0.001, metavar="KG", help="Kilograms that a pack holds."),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Tell how every fruit grows, with 90 % intervals: tables and pictures of fruits, trees and size classes."""
    from pomona.atomic import filled_folder
    from pomona.growth.growth_pictures import write_pictures
    from pomona.growth.growth_tables import write_tables
    from pomona.growth.harvest_day import harvest_day
    from pomona.growth.season_growth import grow_season
    from pomona.growth.size_classes import FIVE_MM, parsed_classes
    from pomona.growth.visit_warnings import of_visits

    limits_mm = FIVE_MM if classes is None else parsed_classes(classes)
    grown = grow_season(orchard, harvest=harvest_day(harvest), temperature=temperature, limits_mm=limits_mm)
    warn_of_visits(orchard, of_visits(grown))
    with filled_folder(output) as partial:
        files = (*write_tables(partial, grown, pack_kg=pack_kg), *write_pictures(partial, grown))
    written = [output / file.name for file in files]
    if json:
        say_json({"output": [str(path) for path in written], **_summary(grown)})
    else:
        say(*_as_lines(output, grown))


def _summary(grown: SeasonGrowth) -> dict[str, Any]:
    """Put what was found in numbers: the curve, and all blocks."""
    from dataclasses import asdict

    import numpy as np

    from pomona.growth.growth_tables import count_intervals

    drawn = grown.foretold.summaries["blocks"]
    mean, (low, high) = drawn.mean(axis=0), np.quantile(drawn, (0.05, 0.95), axis=0)
    now, counts = len(grown.fruits.days) - 1, count_intervals(grown)
    blocks = [
        {
            "block": block.kind,
            "name": block.name or None,
            "n_fruits": block.n_fruits,
            "n_fruits_low": counts[row][0],
            "n_fruits_high": counts[row][1],
            "mean_mm": float(mean[row, now]),
            "rate_mm_per_day": float(mean[row, -1]),
            "forecast_mm": float(mean[row, -2]) if grown.harvest else None,
            "forecast_low_mm": float(low[row, -2]) if grown.harvest else None,
            "forecast_high_mm": float(high[row, -2]) if grown.harvest else None,
        }
        for row, block in enumerate(grown.blocks)
    ]
    shape, told, sessions = grown.curve.fitted.likeliest, grown.foretold, grown.fruits.sessions
    intervals = np.column_stack([told.scale_lows, told.scale_highs])
    return {
        "curve": grown.curve.fitted.family.name,
        "time": grown.curve.clock.name,
        "held_out_log_likelihood": {curve.name: curve.held_out for curve in grown.curves},
        "weights": {curve.name: curve.weight for curve in grown.curves},
        "noise_mm": shape.noise_mm,
        "visit_scales": dict(zip(sessions, told.scales.tolist(), strict=True)),
        "visit_scale_intervals": dict(zip(sessions, intervals.tolist(), strict=True)),
        "odd_visits": {sessions[odd.visit]: asdict(odd) | {"visit": odd.visit + 1} for odd in grown.odd_visits},
        "harvest": None if grown.harvest is None else grown.harvest.isoformat(),
        "n_outliers": int(grown.odd.sum()),
        "n_unmeasured": grown.fruits.n_unmeasured,
        "blocks": blocks,
    }


def _as_lines(output: Path, grown: SeasonGrowth) -> list[str]:
    from pomona.growth.drawn_fruits import CAMERA_SPREAD

    found = _summary(grown)
    lines = [
        f"{output}: {amount(len(grown.fruits.ids), 'fruit')} on {amount(len(grown.fruits.days), 'visit')}, "
        f"{grown.fruits.days[0]} to {grown.fruits.days[-1]}",
        f"  curve: {found['curve']} over {found['time']}; a size is sure to {found['noise_mm']:.1f} mm",
        f"  scales of visits: {_most_off(grown)}; what all share, some {100 * CAMERA_SPREAD:.0f} %, only calipers tell",
    ]
    if found["n_outliers"]:
        lines.append(f"  outliers: {amount(found['n_outliers'], 'fruit')}, see fruits.csv")
    forecast = f"  on {grown.harvest} (90 %)" if grown.harvest else ""
    lines.append(f"  {'':>18} {'fruits':>7} {'(90 %)':>14} {'mm now':>7} {'mm a day':>9}{forecast}")
    titles = [block.title for block in grown.blocks]
    lines += [_line_of_block(*each) for each in zip(titles, found["blocks"], strict=True)]
    unmeasured = grown.fruits.n_unmeasured
    return [*lines, f"  {amount(unmeasured, 'fruit')} that no visit measured: in no table"] if unmeasured else lines


def _most_off(grown: SeasonGrowth) -> str:
    """Say which visit is farthest from the others as far as can be told, and how far with 90 %."""
    import numpy as np

    from pomona.growth.visit_warnings import called

    told = grown.foretold
    odd = max(grown.odd_visits, key=lambda odd: odd.probability, default=None)
    visit = odd.visit if odd else int(np.abs(np.log(told.scales)).argmax())
    most, low, high = (100 * (float(scale[visit]) - 1) for scale in (told.scales, told.scale_lows, told.scale_highs))
    return f"{called(grown.fruits, visit)} is off most, {most:+.1f} % ({low:+.1f} to {high:+.1f})"


def _line_of_block(title: str, block: dict[str, Any]) -> str:
    between = f"({block['n_fruits_low']} to {block['n_fruits_high']})"
    line = f"  {title[:18]:>18} {block['n_fruits']:>7} {between:>14} {block['mean_mm']:>7.1f} "
    line += f"{block['rate_mm_per_day']:>9.2f}"
    if block["forecast_mm"] is None:
        return line
    return f"{line}  {block['forecast_mm']:.1f} mm ({block['forecast_low_mm']:.1f} to {block['forecast_high_mm']:.1f})"
