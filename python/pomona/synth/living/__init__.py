"""A seeded row of apple trees with time in it: wood, spurs, fruits and leaves, and what stands there on any day."""

from pomona.synth.living.design import RowDesign
from pomona.synth.living.living_row import LivingRow, grow
from pomona.synth.living.wind import Wind

__all__ = ["LivingRow", "RowDesign", "Wind", "grow"]
