"""Whether a cloud fits another as its mirror image: then the axes of one of them are left-handed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pomona.amounts import amount
from pomona.cloud import FruitCloud
from pomona.matching import Match
from pomona.settings import Settings

__all__ = ["mirror_image", "mirror_told", "pairs_of_mirror_image"]

WHOLE = 0.5
"""An answer that finds so much of the smaller cloud is not doubted."""

FEW = 30
"""Fruits of a small cloud, whose mirror image is looked at in any case: a dozen can lie somewhat like their image."""

LEAST_PAIRS = 8
"""Fewer are found by chance: with two images the question is asked twice."""

BETTER = 1.3
"""Evidence of the image over that of the answer from which on it is told; of what is flat both have the same."""


def pairs_of_mirror_image(query: FruitCloud, map: FruitCloud, answer: Match, settings: Settings) -> int:
    """Count the pairs of a query's mirror image, where that fits better than the query; 0 where it does not.

    Parameters
    ----------
    query, map : FruitCloud
    answer : Match
        What they gave.
    settings : Settings
        That they were matched with.
    """
    found, smaller = answer.status == "Found", min(len(query), len(map))
    if answer.status == "TooFew" or (found and len(answer.pairs) > WHOLE * smaller and smaller > FEW):
        return 0
    # With a vertical it matters which axis was turned about: the image stands as its cloud, or on its head.
    ups = settings.call["up"]
    up = np.array(ups[0] if ups else (0.0, 0.0, 1.0), float)
    normals = [np.cross(up, np.eye(3)[np.abs(up).argmin()]), *([up] if ups else [])]
    images = [settings.match(mirror_image(query, normal), map) for normal in normals]
    least = BETTER * answer.log_odds if found else 0.0
    better = [
        len(image.pairs)
        for image in images
        if image.status == "Found" and len(image.pairs) >= LEAST_PAIRS and image.log_odds > least
    ]
    return max(better, default=0)


def mirror_told(pairs: int, query: str, map: str) -> str:
    """Say so, and what to do; `query` and `map` name the clouds."""
    left_handed = "the axes of one of them are left-handed: two columns are exchanged, or one has the wrong sign"
    return f"the mirror image of {query} fits {map}, with {amount(pairs, 'pair')}: {left_handed}"


def mirror_image(cloud: FruitCloud, normal: NDArray[np.float64]) -> FruitCloud:
    """Reflect a cloud at the plane through its middle with this normal (3,)."""
    normal = normal / np.linalg.norm(normal)
    reflection = np.eye(3) - 2 * np.outer(normal, normal)
    middle = cloud.positions.mean(axis=0)
    positions = middle + (cloud.positions - middle) @ reflection
    covariances = None if cloud.covariances is None else reflection @ cloud.covariances @ reflection
    return replace(cloud, positions=positions, covariances=covariances)
