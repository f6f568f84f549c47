"""What a user of growth must know of the visits: those without sizes, those whose sizes are off together."""

from __future__ import annotations

from pomona.growth.measured import MeasuredFruits
from pomona.growth.season_growth import SeasonGrowth

__all__ = ["called", "of_late_visits", "of_visits"]


def of_visits(growth: SeasonGrowth) -> list[str]:
    """Say in a line each what is wrong with visits."""
    fruits = growth.fruits
    off = [
        f"sizes of {called(fruits, odd.visit)} are likely off together: {100 * (odd.scale - 1):+.0f} % against the "
        f"other visits (probability {odd.probability:.2f}); its unit, its camera?"
        for odd in growth.odd_visits
    ]
    return [*of_late_visits(fruits, "growth is told"), *off]


def of_late_visits(fruits: MeasuredFruits, told: str) -> list[str]:
    """Say that the last visits have no sizes, if so, and of which day something is `told`."""
    last = fruits.days[-1]
    later = [str(day) for day in fruits.days_without_sizes if day > last]
    return [f"no sizes on {', '.join(later)}, {told} of {last}"] if later else []


def called(fruits: MeasuredFruits, visit: int) -> str:
    """Call a visit by its day, and by its session where the day had several."""
    day = fruits.days[visit]
    return f"{day}" if fruits.days.count(day) == 1 else f"{day} {fruits.sessions[visit]}"
