"""What the network is punished for."""

from __future__ import annotations

import torch
from torch.nn import functional

from pomona.detect.training.fruit_network import SIZE_PX

__all__ = ["edges_of", "loss_of", "unlike_teacher"]

BOXES = 2.0
SHARES = 0.2
"""Weights of boxes and of visible shares against centres."""


def edges_of(maps: torch.Tensor) -> torch.Tensor:
    """Left, top, right, bottom in pixels, (N, 4, h, w), out of maps."""
    return SIZE_PX * torch.exp(maps[:, 1:5].clamp(-4, 4))


def loss_of(maps: torch.Tensor, wanted: dict[str, torch.Tensor]) -> torch.Tensor:
    """Give the loss of maps (N, 6, h, w) against targets by name, (N, ...) each, for one fruit in the mean."""
    edges_px = edges_of(maps)
    n_fruits = (wanted["heat"] == 1).sum().clamp(min=1)
    centres = _centres(maps[:, 0], wanted) / n_fruits
    weights = wanted["weights"]
    total = weights.sum().clamp(min=1)
    boxes = (weights * _unlike(edges_px, wanted["edges_px"])).sum() / total
    known = torch.isfinite(wanted["visible"]) & (weights > 0)
    shares = functional.binary_cross_entropy_with_logits(maps[:, 5][known], wanted["visible"][known], reduction="sum")
    return centres + BOXES * boxes + SHARES * shares / total


def unlike_teacher(maps: torch.Tensor, told: torch.Tensor, wanted: dict[str, torch.Tensor]) -> torch.Tensor:
    """Give how far maps are from a teacher's, both (N, 6, h, w), for one fruit in the mean.

    Where it is sure and where it doubts tells more than centres that are there or not: the quality focal loss of Li et
    al. (2020, eq. 6) against its scores, and its boxes as far as it is sure of them.
    """
    scores = told[:, 0].sigmoid()
    off = (maps[:, 0].sigmoid() - scores) ** 2
    centres = (off * functional.binary_cross_entropy_with_logits(maps[:, 0], scores, reduction="none")).sum()
    n_fruits = (wanted["heat"] == 1).sum().clamp(min=1)
    boxes = (scores * _unlike(edges_of(maps), edges_of(told))).sum() / scores.sum().clamp(min=1)
    return centres / n_fruits + BOXES * boxes


def _centres(logits: torch.Tensor, wanted: dict[str, torch.Tensor]) -> torch.Tensor:
    """Give the focal loss of CornerNet (Law and Deng 2018, eq. 1), without what nobody can know to be wrong."""
    heat, scores = wanted["heat"], logits.sigmoid()
    missed = functional.softplus(-logits) * (1 - scores) ** 2
    false = functional.softplus(logits) * scores**2 * (1 - heat) ** 4 * wanted["punished"]
    return torch.where(heat == 1, missed, false).sum()


def _unlike(found: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
    """1 - GIoU of boxes that hold the same point, given as distances to their edges."""
    shared = torch.minimum(found, wanted)
    around = torch.maximum(found, wanted)
    both, one, other, hull = (
        (edges[:, 0] + edges[:, 2]) * (edges[:, 1] + edges[:, 3]) for edges in (shared, found, wanted, around)
    )
    union = one + other - both
    return 1 - both / union + (hull - union) / hull
