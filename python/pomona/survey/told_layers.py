"""A word where most fruits of a scan are in a layer behind others that are too few to be a row by themselves."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from pomona.amounts import amount
from pomona.errors import PomonaWarning
from pomona.survey.farther_layer import farther_layer
from pomona.survey.part import Part
from pomona.survey.rows_behind import nearest_m

__all__ = ["tell_farther_layer"]

LEAST, LEAST_SHARE = 5, 0.05
"""Fruits of either layer: fewer are strays, or leaves that were taken for fruits."""


def tell_farther_layer(path: Path, parts: Iterable[Part]) -> None:
    """Warn where fruits of tracked boxes hang in two layers, one behind the other, and both were kept."""
    for part in parts:
        told = None if part.frames_in_view is None else _two_layers(part)
        if told is not None:
            warnings.warn(f"{path}: {told}", PomonaWarning, stacklevel=3)


def _two_layers(part: Part) -> str | None:
    seen = part.boxes.fruits >= 0
    frames = np.searchsorted(part.trajectory.frames, part.boxes.frames[seen])
    poses = part.trajectory.session_from_camera
    away_m = nearest_m(part.cloud.positions, frames, part.boxes.fruits[seen], poses)
    is_far = farther_layer(away_m)
    n_far, n = int(is_far.sum()), len(is_far)
    if min(n_far, n - n_far) < max(LEAST, LEAST_SHARE * n):
        return None
    farther_m = float(np.median(away_m[is_far]) - np.median(away_m[~is_far]))
    return (
        f"{n_far} of {amount(n, 'fruit')} hang {farther_m:.1f} m farther away than the others: a row behind, with too "
        "few fruits before it to tell? Leave out its boxes if so; all are counted"
    )
