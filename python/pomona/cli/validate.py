"""`pomona validate`: diameters of a map against calipers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.amounts import amount
from pomona.cli.terminal import say, say_json, tell
from pomona.cli.verbs import Writes
from pomona.likes import CALIPER_PAIRS, PICTURE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pomona.growth.agreement import Agreement
    from pomona.growth.caliper_pairs import CaliperPair


def validate(
    orchard: Path = typer.Argument(metavar="ORCHARD", help="The map (.gpkg)."),
    calipers: Path = typer.Option(
        ..., metavar="CSV", help="label or fruit_id, date, diameter_mm; or label or fruit_id and a column a day."
    ),
    output: Annotated[Path | None, Writes(CALIPER_PAIRS)] = typer.Option(
        None, "-o", "--output", help="CSV for the pairs: fruit_id,label,session,date,measured_mm,caliper_mm."
    ),
    plot: Annotated[Path | None, Writes(PICTURE)] = typer.Option(
        None, metavar="PICTURE", help="Bland-Altman plot (.png, .svg, .pdf)."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Compare diameters with calipers: bias, RMSE and limits of agreement, of all and visit by visit.

    A column `label` or `id` has the names that the sessions gave, `fruit_id` the map's numbers. Between two days by
    hand, at most 21 apart, the diameter is a line; else the nearest within 3 days is taken.
    """
    from pomona.growth.agreement import agreement_by_date, agreement_of, draw_agreement
    from pomona.growth.caliper_doubts import doubts_of
    from pomona.growth.caliper_file import read_calipers
    from pomona.growth.caliper_pairs import pair_with_calipers
    from pomona.growth.measured import measured_fruits
    from pomona.plot.files import require_picture_name, save_picture

    if plot is not None:
        require_picture_name(plot)
    fruits = measured_fruits(orchard)
    pairs, unseen = pair_with_calipers(fruits, read_calipers(calipers), calipers)
    if unseen:
        names = ", ".join(unseen[:5]) + (", ..." if len(unseen) > 5 else "")
        tell(f"pomona: warning: {calipers}: {amount(len(unseen), 'fruit')} measured by no visit near: {names}")
    for doubt in doubts_of(pairs):
        tell(f"pomona: warning: {calipers}: {doubt}")
    if output is not None:
        _write_pairs(output, pairs)
    if plot is not None:
        save_picture(draw_agreement(pairs), plot)
    found = {"all": agreement_of(pairs), **agreement_by_date(pairs)}
    if json:
        say_json({"unseen": unseen, "agreement": {name: _as_json(one) for name, one in found.items()}})
    else:
        say(*_as_lines(found))


def _write_pairs(path: Path, pairs: Sequence[CaliperPair]) -> None:
    from pomona.growth.growth_tables import write_table

    lines = [(one.fruit_id, one.name, one.session, one.day, one.measured_mm, one.caliper_mm) for one in pairs]
    write_table(path, ("fruit_id", "label", "session", "date", "measured_mm", "caliper_mm"), lines)


def _as_json(found: Agreement) -> dict[str, float | int | None]:
    from dataclasses import asdict

    return {name: None if value != value else value for name, value in asdict(found).items()}  # nan is not itself


def _as_lines(found: dict[str, Agreement]) -> list[str]:
    width = max(len("visit"), *(len(name) for name in found))
    lines = [f"{'visit':<{width}}  pairs    bias    RMSE  limits of agreement, mm"]
    for name, one in found.items():
        limits = f"{one.low_mm:+6.1f} to {one.high_mm:+.1f}" if one.n > 1 else "-"
        lines.append(f"{name:<{width}}  {one.n:>5}  {one.bias_mm:>+6.2f}  {one.rmse_mm:>6.2f}  {limits}")
    return lines
