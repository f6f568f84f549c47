"""Seasons of a living row as several visits would see it: sparse clouds with truth, without pictures."""

from pomona.synth.seasons.season import Season, SeasonVisit, draw_season
from pomona.synth.seasons.season_plan import SEASONS, SeasonPlan

__all__ = ["SEASONS", "Season", "SeasonPlan", "SeasonVisit", "draw_season"]
