"""The videos of the experiments, and how they are rendered: what is there already is kept."""

from __future__ import annotations

import datetime
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

from pomona.render.camera_path import PATHS
from pomona.render.filming import Filming, film
from pomona.synth.living import RowDesign

SYNTHETIC_SEED, SAME_DAY_SEED, SEASON_SEED = 41, 42, 43
"""A row of its own for each of the paper's three sets."""

_DESIGN = RowDesign(n_trees=5, clear_of_posts=False)
_SYNTHETIC = Filming(_DESIGN, datetime.date(2024, 8, 9), SYNTHETIC_SEED)
_SAME_DAY = Filming(_DESIGN, datetime.date(2024, 8, 28), SAME_DAY_SEED)
_SEASON = Filming(replace(_DESIGN, late_drop_share=0.2), datetime.date(2024, 8, 9), SEASON_SEED)


def _later(day: int, softness: float) -> Filming:
    """Film the row on a later day of August, when its wood has crept: softer, it sinks further under the same fruits.

    So fruits move by 1.0 cm (median; 90 %: 2.5 cm) until the 21st, and by 1.9 cm (4.2 cm) until the 28th, as on trees.
    """
    crept = replace(_SEASON.design, softness=softness)
    return replace(_SEASON, design=crept, day=datetime.date(2024, 8, day), path="upside-down-back")


VIDEOS: Mapping[str, Filming] = {
    "synthetic-1": replace(_SYNTHETIC, path="tractor", weather="sun"),
    "synthetic-2": replace(_SYNTHETIC, path="angle", weather="sun"),
    "synthetic-3": replace(_SYNTHETIC, path="hand-held", weather="overcast"),
    "tractor-08-28": replace(_SAME_DAY, path="tractor", weather="sun"),
    "tractor-08-28-faster": replace(_SAME_DAY, path="fast", weather="sun"),
    "walking-08-28-darker-far": replace(_SAME_DAY, path="walking-far", weather="dusk"),
    "walking-08-09": replace(_SEASON, path="hand-held", weather="sun"),
    "tractor-08-21-inverse": replace(_later(21, 2.0), weather="overcast"),
    "tractor-08-28-inverse": replace(_later(28, 3.0), weather="hazy"),
}
"""By name, in the order of the paper's tables."""


@cache
def rendered(name: str, folder: Path) -> Path:
    """Render what is not there yet of a video, and give its folder; one of other settings is refused."""
    place = folder / "videos" / name
    film(VIDEOS[name], place, tell=partial(_tell, name))
    return place


def _tell(name: str, done: int, total: int) -> None:
    if done < total:
        sys.stderr.write(f"{name}: {done} of {total} pairs\n")


def distance_m(name: str) -> float:
    """From the camera to the trunks."""
    return PATHS[VIDEOS[name].path].distance_m
