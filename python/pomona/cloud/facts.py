"""A cloud in a few words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pomona.cloud.fruit_cloud import FruitCloud

__all__ = ["facts"]


def facts(cloud: FruitCloud) -> dict[str, str]:
    """Say how many fruits there are, how far they reach, how large they are and what else is known of them."""
    found = {"fruits": str(len(cloud))}
    if len(cloud):
        found["extent"] = " x ".join(f"{side:.3g}" for side in np.ptp(cloud.positions, axis=0)) + " m"
    if cloud.diameters_m is not None and np.isfinite(cloud.diameters_m).any():
        found["diameter"] = f"{1000 * np.nanmedian(cloud.diameters_m):.0f} mm (median)"
    known = [name for name in ("ids", "covariances", "n_views", "views") if getattr(cloud, name) is not None]
    if known or cloud.extras:
        found["with"] = ", ".join([*known, *cloud.extras])
    return found
