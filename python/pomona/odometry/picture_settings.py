"""What is looked for in pictures: of the core's table `odometry.pictures` what is used on this side."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields

__all__ = ["PictureSettings"]


@dataclass(frozen=True)
class PictureSettings:
    """Values of the table; the core has their defaults, meanings and reasons (`pomona config`)."""

    flat_contrast: float
    levels: int
    max_row_error_px: float
    min_disparity_px: float
    depth_edge: float
    dense_per_cell: int
    patch_samples: int
    patch_step_px: int
    patch_blur_px: float
    min_similarity: float
    distinct: float
    reach_across: float
    reach_down: float

    @classmethod
    def of(cls, table: str) -> PictureSettings:
        """Take them from the whole table as JSON."""
        values = json.loads(table)
        return cls(**{field.name: values[field.name] for field in fields(cls)})
