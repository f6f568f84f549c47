"""Arrows from where a fruit hung towards where it hangs, magnified by a whole number that is told."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pomona.plot.sheet import INK, Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.quiver import Quiver
    from numpy.typing import NDArray

    from pomona.plot.projections import Projection

__all__ = ["Arrows"]

COLOUR = "#6f9fc0"

USUAL_IN, KEY_IN, KEY_ABOVE_IN = 0.16, 0.5, 0.56
"""Most that the usual arrow is long, and the one that tells the scale; how far that is above its panel."""

MAGNIFICATIONS = (1, 2, 5, 10, 20, 50)
KEYS_M = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


@dataclass(frozen=True, eq=False)
class Arrows:
    """Where fruits hung and where they hang, (M, 3) metres in one frame, and how the arrows are magnified."""

    was: NDArray[np.float64]
    found: NDArray[np.float64]
    times: int
    in_per_m: float

    @classmethod
    def on(cls, sheet: Sheet, was: NDArray[np.float64], found: NDArray[np.float64]) -> Arrows:
        """Magnify so that arrows can be seen and do not cover each other."""
        usual_m = float(np.median(np.linalg.norm(found - was, axis=1))) if len(was) else 0.0
        fitting = [times for times in MAGNIFICATIONS if times * usual_m * sheet.in_per_m <= USUAL_IN]
        return cls(was, found, max(fitting, default=1), sheet.in_per_m)

    def ends(self, view: Projection) -> NDArray[np.float64]:
        """Where their tips are in a panel, (M, 2)."""
        start, end = view.project(self.was), view.project(self.found)
        return np.asarray(start + self.times * (end - start))

    def on_another(self, sheet: Sheet) -> Arrows:
        """Give the same, as long in metres, for another page."""
        return replace(self, in_per_m=sheet.in_per_m)

    def draw(self, axes: Axes, view: Projection) -> Quiver | None:
        """Draw them in a panel; None where nothing moved."""
        start, end = view.project(self.was), view.project(self.found)
        if np.array_equal(start, end):
            return None
        return axes.quiver(
            *start.T,
            *(self.ends(view) - start).T,
            angles="xy",
            scale_units="xy",
            scale=1,
            color=COLOUR,
            units="inches",
            width=0.012,
            zorder=2.5,
        )

    def tell(self, axes: Axes, drawn: Quiver) -> None:
        """Say how long an arrow is, on the line of the title, at the right end."""
        length_m = max((each for each in KEYS_M if each * self.times * self.in_per_m <= KEY_IN), default=KEYS_M[0])
        width_m, height_m = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
        magnified = f", drawn {self.times} times as long" if self.times > 1 else ""
        axes.quiverkey(
            drawn,
            1 - self.times * length_m / width_m,
            1 + KEY_ABOVE_IN / self.in_per_m / height_m,
            U=self.times * length_m,
            label=f"moved by {100 * length_m:g} cm{magnified}  ",
            labelpos="W",
            labelcolor=INK,
            fontproperties={"size": "small"},
        )
