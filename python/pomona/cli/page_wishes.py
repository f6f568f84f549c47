"""What `pomona view` and `pomona report` are told besides the map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pomona.viewer.season_page import Wishes

OrchardMapFile = Annotated[Path, typer.Argument(metavar="ORCHARD", help="The map (.gpkg).")]
Harvest = Annotated[str | None, typer.Option(metavar="DATE", help="Day to foretell sizes for, as 2024-09-10.")]
Temperature = Annotated[
    Path | None, typer.Option(metavar="CSV", help="Daily temperatures, as `pomona growth` takes them.")
]
Calipers = Annotated[Path | None, typer.Option(metavar="CSV", help="Diameters by hand, as `pomona validate` takes.")]
Classes = Annotated[
    str | None, typer.Option(metavar="MM,MM,...", help="Limits of the size classes in mm; else every 5 mm.")
]
Target = Annotated[
    int | None, typer.Option(min=0, metavar="FRUITS", help="That each tree shall keep; the page can change it.")
]
PackKg = Annotated[float, typer.Option(min=0.001, metavar="KG", help="Kilograms that a pack holds.")]
Up = Annotated[
    str | None, typer.Option(metavar="X,Y,Z", help="The vertical in the map; else its cameras or its shape tell it.")
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


def _upwards(text: str) -> NDArray[np.float64]:
    import numpy as np

    from pomona.cli.match_options import direction
    from pomona.errors import PomonaError

    found = np.array(direction(text))
    if not np.isfinite(found).all() or not found.any():
        raise PomonaError(f"--up: found {text!r}, expected a direction of some length")
    return np.asarray(found / np.abs(found).max())
