"""Which tracks of a part are fruits: what its frames say of each, put before the core's judgement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.recording import Calibration
from pomona.survey.seeing import Look
from pomona.survey.sightings import Sightings, sizes_of
from pomona.survey.tracking import Belief, Tracks, TrackViews, believed

__all__ = ["Believing"]

Array = NDArray[np.float64]

SEEN_AGAIN = 2
"""Frames that must show a fruit, however few it stays in view for: a single box is a claim that nothing bears out."""


@dataclass(frozen=True)
class Believing:
    """Weighs the tracks of a part.

    Attributes
    ----------
    calibration : Calibration
        The left camera.
    config : mapping
        Values of the core's tables that differ from the defaults.
    """

    calibration: Calibration
    config: Mapping[str, Any]

    def __call__(
        self, tracks: Tracks, looks: Sequence[Look], session_from_camera: Array, *, sized: bool = True
    ) -> Belief:
        """Weigh tracks that these frames, from these poses (F, 4, 4), saw; where nobody looked does not count.

        Their sizes are asked too where `sized` says so.
        """
        row_of_frame = {look.frame: row for row, look in enumerate(looks)}
        frames = np.array([row_of_frame[frame] for frame in tracks.frames.tolist()], np.int64)
        poses = session_from_camera[frames]
        depths_m = np.einsum("si,si->s", tracks.centres[tracks.fruits] - poses[:, :3, 3], poses[:, :3, 2])
        boxes = np.cumsum([0, *(len(look.detections) for look in looks)])[frames] + tracks.rows
        fruitness, fruit_px = (_of_boxes(looks, name) for name in ("fruitness", "fruit_px"))
        shown_m2 = fruit_px[boxes] * depths_m**2 / (self.calibration.fx * self.calibration.fy)
        unknown = np.full(len(tracks), np.nan)
        sizes = _sizes(tracks, boxes, looks, session_from_camera) if sized else (unknown, unknown)
        belief = believed(
            TrackViews(
                centres=tracks.centres,
                depths_m=_means(depths_m, tracks),
                n_views=tracks.n_views,
                n_glimpses=tracks.n_glimpses,
                shown_m2=_means(shown_m2, tracks),
                fruitness=_means(fruitness[boxes], tracks),
                diameters_m=sizes[0],
                diameter_sigmas_m=sizes[1],
                missed_boxes=tracks.missed_boxes,
            ),
            session_from_camera[[look.detections.looked for look in looks]],
            self.calibration,
            box_fruitness=fruitness[np.isfinite(fruitness)],
            elsewhere=np.concatenate([np.empty(0), *(look.elsewhere for look in looks if look.elsewhere is not None)]),
            config=self.config,
        )
        seen_again = tracks.n_views + tracks.n_glimpses >= SEEN_AGAIN
        return replace(belief, is_believed=belief.is_believed & seen_again)


def _sizes(
    tracks: Tracks, boxes: NDArray[np.int64], looks: Sequence[Look], session_from_camera: Array
) -> tuple[Array, Array]:
    """Give diameters of the tracks and their sigmas; `boxes` has the box of each of their sightings."""
    track_of = np.full(sum(len(look.detections) for look in looks), -1, np.int64)
    track_of[boxes[~tracks.shared]] = tracks.fruits[~tracks.shared]
    sightings = Sightings.of(looks)
    return sizes_of(sightings, track_of[sightings.boxes], session_from_camera, len(tracks))


def _of_boxes(looks: Sequence[Look], name: str) -> Array:
    """Give a number of every box of the frames, NaN where there is none."""
    columns = (getattr(look, name) for look in looks)
    return np.concatenate(
        [
            np.empty(0),
            *(
                np.full(len(look.detections), np.nan) if column is None else column
                for look, column in zip(looks, columns, strict=True)
            ),
        ]
    )


def _means(values: Array, tracks: Tracks) -> Array:
    """Mean of each track's sightings, (N,)."""
    sums = np.bincount(tracks.fruits, weights=values, minlength=len(tracks))
    return np.asarray(sums / np.bincount(tracks.fruits, minlength=len(tracks)))
