"""What `pomona view` and `pomona report` are told besides the map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.cli.terminal import tell

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pomona.viewer.season_page import Wishes


def _is_day(text: str | None) -> str | None:
    from pomona.growth.harvest_day import harvest_day

    harvest_day(text)
    return text


def _are_classes(text: str | None) -> str | None:
    from pomona.growth.size_classes import parsed_classes

    if text is not None:
        parsed_classes(text)
    return text


OrchardMapFile = Annotated[Path, typer.Argument(metavar="ORCHARD", help="The map (.gpkg).")]

# Looked at with the flags themselves, so that a farm's plan is refused before anything is scanned for it.
Harvest = Annotated[
    str | None, typer.Option(metavar="DATE", help="Day to foretell sizes for, as 2024-09-10.", callback=_is_day)
]
Temperature = Annotated[
    Path | None, typer.Option(metavar="CSV", help="Daily temperatures, as `pomona growth` takes them.")
]
Calipers = Annotated[Path | None, typer.Option(metavar="CSV", help="Diameters by hand, as `pomona validate` takes.")]
Classes = Annotated[
    str | None,
    typer.Option(
        metavar="MM,MM,...", help="Limits of the size classes in mm, 60,65,70; else every 5 mm.", callback=_are_classes
    ),
]
Target = Annotated[
    int | None, typer.Option(min=0, metavar="FRUITS", help="That each tree shall keep; the page can change it.")
]
PackKg = Annotated[float, typer.Option(min=0.001, metavar="KG", help="Kilograms that a pack holds.")]
Up = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,Z", help="The vertical in the map; else its place on Earth, its cameras or a guess tell it."
    ),
]


def page_wishes(
    harvest: str | None,
    temperature: Path | None,
    calipers: Path | None,
    classes: str | None,
    target: int | None,
    pack_kg: float,
    up: str | None,
) -> Wishes:
    """Read the flags that both verbs have."""
    from pomona.growth.harvest_day import harvest_day
    from pomona.growth.size_classes import FIVE_MM, parsed_classes
    from pomona.viewer.season_page import Wishes

    return Wishes(
        harvest=harvest_day(harvest),
        temperature=temperature,
        calipers=calipers,
        limits_mm=FIVE_MM if classes is None else parsed_classes(classes),
        target=target,
        pack_kg=pack_kg,
        up=None if up is None else _upwards(up),
    )


def tell_guess(orchard: Path, wishes: Wishes) -> None:
    """Say so where nobody has told the vertical."""
    from pomona.viewer.row_frame import known_vertical

    if wishes.up is None and known_vertical(orchard) is None:
        tell(f"pomona: {orchard}: vertical guessed; give --up X,Y,Z")


def _upwards(text: str) -> NDArray[np.float64]:
    import numpy as np

    from pomona.cli.match_options import direction
    from pomona.errors import PomonaError

    found = np.array(direction(text))
    if not np.isfinite(found).all() or not found.any():
        raise PomonaError(f"--up: found {text!r}, expected a direction of some length")
    return np.asarray(found / np.abs(found).max())
