"""What a user of growth must know of the visits: those without sizes, those whose sizes are off together."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pomona.cli.terminal import tell

if TYPE_CHECKING:
    from pomona.growth.measured import MeasuredFruits
    from pomona.growth.season_growth import SeasonGrowth


def warn_of_visits(orchard: Path, grown: SeasonGrowth) -> None:
    """Tell of visits on the standard error."""
    last = grown.fruits.days[-1]
    later = [day for day in grown.fruits.days_without_sizes if day > last]
    if later:
        tell(f"pomona: warning: {orchard}: no sizes on {', '.join(map(str, later))}, growth is told of {last}")
    for odd in grown.odd_visits:
        tell(
            f"pomona: warning: {orchard}: sizes of {called(grown.fruits, odd.visit)} are likely off together: "
            f"{100 * (odd.scale - 1):+.0f} % against the other visits (probability {odd.probability:.2f}); "
            "its unit, its camera?"
        )


def called(fruits: MeasuredFruits, visit: int) -> str:
    """Call a visit by its day, and by its session where the day had several."""
    day = fruits.days[visit]
    return f"{day}" if fruits.days.count(day) == 1 else f"{day} {fruits.sessions[visit]}"
