"""The map with z up (REP 103), as far as anybody has said where up is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import Cloud
from pomona.match_arguments import Up, core_vertical
from pomona.orchard import OrchardMap
from pomona.ros.robot_frames import levelling

__all__ = ["map_axes"]


def map_axes(orchard: Cloud, up: Up | None) -> NDArray[np.float64]:
    """Give the transform (4, 4) of the fruits' map into one with x east, y north, z up, or z up at least.

    Parameters
    ----------
    orchard : FruitCloud, OrchardMap, Session, array_like, str or Path
        An orchard map with a georeference is turned by it.
    up : optional
        The vertical in the camera's and in the map's frame. Without it and a georeference the axes stay as they are:
        those of the first camera of the first session, unless its poses had others.
    """
    anchor = _enu_from_map(orchard)
    if anchor is not None:
        return anchor
    vertical = core_vertical(up)
    return np.eye(4) if vertical is None else levelling(np.array(vertical[1]))


def _enu_from_map(orchard: Cloud) -> NDArray[np.float64] | None:
    if isinstance(orchard, str | Path):
        orchard = OrchardMap(orchard) if Path(orchard).suffix.lower() == ".gpkg" else ()
    anchor = orchard.anchor() if isinstance(orchard, OrchardMap) else None
    return None if anchor is None else anchor.enu_from_map
