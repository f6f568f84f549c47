"""How the fruits of a map grow, and what to decide: forecasts, size classes, thinning, agreement with calipers."""

from pomona.growth.season_growth import SeasonGrowth, grow_season

__all__ = ["SeasonGrowth", "grow_season"]
