"""Whether a cloud fits another as its mirror image: then the axes of one of them are left-handed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.matching import Match
from pomona.settings import Settings

__all__ = ["mirror_image", "pairs_of_mirror_image"]

FEW = 0.2
"""Of a mirror image up to this share of the fruits is found, by the halves of crowns that are like their own image;
more is not looked into."""


def pairs_of_mirror_image(query: FruitCloud, map: FruitCloud, answer: Match, settings: Settings) -> int:
    """Count the pairs of the mirror image of a query of which little or nothing was found; 0 where it fits no better.

    Parameters
    ----------
    query, map : FruitCloud
    answer : Match
        What they gave.
    settings : Settings
        That they were matched with.
    """
    found = len(answer.pairs) if answer.status == "Found" else 0
    if answer.status == "TooFew" or found > FEW * min(len(query), len(map)):
        return 0
    ups = settings.call["up"]
    mirrored = settings.match(mirror_image(query, np.array(ups[0] if ups else (0.0, 0.0, 1.0))), map)
    better = mirrored.status == "Found" and len(mirrored.pairs) > 2 * found
    return len(mirrored.pairs) if better else 0


def mirror_image(cloud: FruitCloud, up: NDArray[np.float64]) -> FruitCloud:
    """Reflect a cloud at a plane through its middle that the direction `up` (3,) lies in."""
    across = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    across /= np.linalg.norm(across)
    reflection = np.eye(3) - 2 * np.outer(across, across)
    middle = cloud.positions.mean(axis=0)
    positions = middle + (cloud.positions - middle) @ reflection
    covariances = None if cloud.covariances is None else reflection @ cloud.covariances @ reflection
    return replace(cloud, positions=positions, covariances=covariances)
