"""A season of a whole farm: all rows and dates of a plan, each step done once, whatever is killed in between."""

from pomona.farm.farm_plan import FarmPlan, read_plan
from pomona.farm.farm_run import FarmRun, Fate
from pomona.farm.running import run_farm
from pomona.farm.steps import FarmStep, steps_of

__all__ = ["FarmPlan", "FarmRun", "FarmStep", "Fate", "read_plan", "run_farm", "steps_of"]
