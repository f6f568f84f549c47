"""What people put beside the trees: posts and wires."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pomona.synth.row_geometry import Limbs

if TYPE_CHECKING:
    from pomona.synth.living.training_systems import TrainingSystem

__all__ = ["posts_and_wires"]

_POST_RADIUS_M, _WIRE_RADIUS_M = 0.04, 0.0013
_POST_COLOUR, _WIRE_COLOUR = (0.36, 0.34, 0.31), (0.30, 0.30, 0.31)


def posts_and_wires(n_trees: int, system: TrainingSystem) -> Limbs:
    """Set posts halfway between trees, at both ends and every few trees; wires from post to post."""
    between = np.arange(0, n_trees, system.post_every_trees)
    along = np.append(between, n_trees) * system.spacing_m - system.spacing_m / 2.0
    top = max((*system.wires_m, system.height_m - 0.3)) + 0.1
    feet = np.stack([along, np.zeros(len(along)), np.zeros(len(along))], axis=1)
    # Wires run beside the trunks, or these would stand in them.
    side = _POST_RADIUS_M + _WIRE_RADIUS_M
    heights = np.repeat(system.wires_m, len(along) - 1)
    starts, ends = (np.tile(part, len(system.wires_m)) for part in (along[:-1], along[1:]))
    level = np.full(len(starts), side)
    n = (len(feet), len(starts))
    radii = np.repeat([_POST_RADIUS_M, _WIRE_RADIUS_M], n)
    return Limbs(
        np.concatenate([feet, np.stack([starts, level, heights], axis=1)]),
        np.concatenate([feet + np.array([0.0, 0.0, top]), np.stack([ends, level, heights], axis=1)]),
        radii,
        radii,
        np.repeat([_POST_COLOUR, _WIRE_COLOUR], n, axis=0),
    )
