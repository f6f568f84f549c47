"""Fruits followed through the frames of one visit: which box of which frame shows which fruit.

How it decides, with the equations: `docs/tracking.md`. The algorithm is the core's, `crates/pomona/src/tracking`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pomona import _core
from pomona.core_settings import core_settings
from pomona.detect import Detections
from pomona.errors import PomonaError
from pomona.reading import shown
from pomona.recording.calibration import Calibration
from pomona.survey.depth import Lifted

__all__ = ["Belief", "TrackViews", "Tracker", "Tracks", "believed"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Tracks:
    """The fruits of a visit and the boxes that show them.

    Attributes
    ----------
    numbers : (N,) int64
        Track number of each fruit, as `Tracker.update` gave it; of merged tracks the oldest.
    centres : (N, 3) float64
        Centres in the session's frame as tracked, metres: as the fruits correct the poses. The session's own come from
        the fusion of its sightings.
    covariances : (N, 3, 3) float64
        Their covariances, square metres.
    radii_m, radius_sigmas_m : (N,) float64
        Radii and their standard deviations, metres.
    n_views : (N,) int64
        Number of frames that saw the fruit.
    n_glimpses : (N,) int64
        Number of further frames whose pictures show it where the detector gave no box.
    evidence : (N,) float64
        Log-odds that it is a fruit and no false box, nats.
    frames, rows, fruits : (S,) int64
        Sightings: the frame's number, the row of the box in its frame, the row of the fruit here. In order of frames
        and rows; a box shows one fruit, a fruit has one box in a frame.
    shared : (S,) bool
        Whether the box is around another fruit too. It shows that the fruit is there, but not its place or size.
    missed_boxes : float
        Boxes that the detector missed, as pictures of fruits without one tell.
    """

    numbers: NDArray[np.int64]
    centres: Array
    covariances: Array
    radii_m: Array
    radius_sigmas_m: Array
    n_views: NDArray[np.int64]
    n_glimpses: NDArray[np.int64]
    evidence: Array
    frames: NDArray[np.int64]
    rows: NDArray[np.int64]
    fruits: NDArray[np.int64]
    shared: NDArray[np.bool_]
    missed_boxes: float = 0.0

    def __len__(self) -> int:
        return len(self.numbers)

    def at(self, centres: Array, covariances: Array) -> Tracks:
        """Give the same fruits at other places, refined ones."""
        return replace(self, centres=np.asarray(centres), covariances=np.asarray(covariances))

    def joined(self, *, place_sigma_m: float = 0.0, config: Mapping[str, Any] | None = None) -> Tracks:
        """Join fruits that are at one place, as `Tracker.finish` does, where better places are known.

        Parameters
        ----------
        place_sigma_m : float
            By how much places from different times may differ beyond `covariances`: the drift of poses; 0 once the
            poses are refined.
        config : mapping, optional
            Values of the core's tables that differ from `pomona.default_config()`.
        """
        try:
            labels = _core.one_fruit_each(
                centres=np.ascontiguousarray(self.centres, np.float64),
                covariances=np.ascontiguousarray(self.covariances, np.float64),
                radii_m=np.ascontiguousarray(self.radii_m, np.float64),
                frames=self.frames,
                fruits=self.fruits,
                place_sigma_m=place_sigma_m,
                config=core_settings(config),
            )
        except ValueError as error:
            raise PomonaError(f"tracks: {error}") from None
        return self._grouped(labels)

    def select(self, rows: NDArray[np.int64]) -> Tracks:
        """Give some of the fruits, by row."""
        return self._only(rows)

    def _grouped(self, labels: NDArray[np.int64]) -> Tracks:
        """Fuse fruits of one label into the first of them."""
        information = np.linalg.inv(self.covariances)
        total, weighted = np.zeros_like(information), np.zeros_like(self.centres)
        np.add.at(total, labels, information)
        np.add.at(weighted, labels, np.einsum("nij,nj->ni", information, self.centres))
        evidence, n_glimpses = np.zeros_like(self.evidence), np.zeros_like(self.n_glimpses)
        np.add.at(evidence, labels, self.evidence)
        np.add.at(n_glimpses, labels, self.n_glimpses)
        roots = np.flatnonzero(labels == np.arange(len(labels)))
        covariances, centres = self.covariances.copy(), self.centres.copy()
        covariances[roots] = np.linalg.inv(total[roots])
        centres[roots] = np.einsum("nij,nj->ni", covariances[roots], weighted[roots])
        fruits = labels[self.fruits]
        # Of two boxes of one fruit in a frame the first stays, one of its own before a shared one.
        order = np.lexsort((self.rows, self.shared, fruits, self.frames))
        keys = np.stack([self.frames, fruits], axis=1)[order]
        first = np.ones(len(order), bool)
        first[1:] = (keys[1:] != keys[:-1]).any(axis=1)
        kept = np.sort(order[first])
        grouped = replace(
            self,
            centres=centres,
            covariances=covariances,
            evidence=evidence,
            n_glimpses=n_glimpses,
            n_views=np.bincount(fruits[kept], minlength=len(labels)),
            frames=self.frames[kept],
            rows=self.rows[kept],
            fruits=fruits[kept],
            shared=self.shared[kept],
        )
        return grouped._only(roots)

    def _only(self, chosen: NDArray[np.int64]) -> Tracks:
        row_of = np.full(len(self), -1, np.int64)
        row_of[chosen] = np.arange(len(chosen))
        kept = row_of[self.fruits] >= 0
        return Tracks(
            numbers=self.numbers[chosen],
            centres=self.centres[chosen],
            covariances=self.covariances[chosen],
            radii_m=self.radii_m[chosen],
            radius_sigmas_m=self.radius_sigmas_m[chosen],
            n_views=self.n_views[chosen],
            n_glimpses=self.n_glimpses[chosen],
            evidence=self.evidence[chosen],
            frames=self.frames[kept],
            rows=self.rows[kept],
            fruits=row_of[self.fruits[kept]],
            shared=self.shared[kept],
            missed_boxes=self.missed_boxes,
        )


@dataclass(frozen=True, eq=False)
class TrackViews:
    """What speaks for tracks, one row each; NaN where nobody knows.

    Attributes
    ----------
    centres : (N, 3) float64
        In the session's frame, metres.
    depths_m : (N,) float64
        Depth from which they were seen, metres.
    n_views, n_glimpses : (N,) int64
        As in `Tracks`.
    shown_m2 : (N,) float64
        Mean area that their boxes show, square metres at that depth.
    fruitness : (N,) float64
        Mean fruitness of their boxes.
    diameters_m, diameter_sigmas_m : (N,) float64
        As all their sightings have them.
    missed_boxes : float
        As in `Tracks`.
    """

    centres: Array
    depths_m: Array
    n_views: NDArray[np.int64]
    n_glimpses: NDArray[np.int64]
    shown_m2: Array
    fruitness: Array
    diameters_m: Array
    diameter_sigmas_m: Array
    missed_boxes: float = 0.0


@dataclass(frozen=True, eq=False)
class Belief:
    """How far tracks are fruits.

    Attributes
    ----------
    probability : (N,) float64
        That each is a fruit which shows clearly.
    is_believed : (N,) bool
        Whether it was seen often enough, and looks like a fruit rather than a leaf.
    frames_in_view : float
        Frames for which a fruit stays in view, from its coming to its going.
    """

    probability: Array
    is_believed: NDArray[np.bool_]
    frames_in_view: float


def believed(
    tracks: TrackViews,
    session_from_camera: Array,
    calibration: Calibration,
    *,
    box_fruitness: Array,
    elsewhere: Array,
    config: Mapping[str, Any] | None = None,
) -> Belief:
    """Weigh which tracks are fruits (`docs/tracking.md` has the equations).

    Parameters
    ----------
    tracks : TrackViews
    session_from_camera : (F, 4, 4) float64
        Poses of all frames.
    calibration : Calibration
        The camera.
    box_fruitness, elsewhere : (B,), (E,) float64
        Fruitness of all boxes, and of places without one.
    config : mapping, optional
        Values of the core's tables that differ from `pomona.default_config()`.

    Raises
    ------
    PomonaError
        A setting is outside its range, or arrays do not fit together.
    """
    try:
        probability, is_believed, frames_in_view = _core.believed(
            {
                "centres": np.ascontiguousarray(tracks.centres, np.float64),
                "depths_m": np.ascontiguousarray(tracks.depths_m, np.float64),
                "views": np.ascontiguousarray(tracks.n_views, np.int64),
                "glimpses": np.ascontiguousarray(tracks.n_glimpses, np.int64),
                "shown_m2": np.ascontiguousarray(tracks.shown_m2, np.float64),
                "fruitness": np.ascontiguousarray(tracks.fruitness, np.float64),
                "diameters_m": np.ascontiguousarray(tracks.diameters_m, np.float64),
                "diameter_sigmas_m": np.ascontiguousarray(tracks.diameter_sigmas_m, np.float64),
                "missed_boxes": tracks.missed_boxes,
            },
            box_fruitness=np.ascontiguousarray(box_fruitness, np.float64),
            elsewhere=np.ascontiguousarray(elsewhere, np.float64),
            camera=calibration,
            poses=np.ascontiguousarray(session_from_camera, np.float64),
            config=core_settings(config),
        )
    except ValueError as error:
        raise PomonaError(f"tracks: {error}") from None
    return Belief(probability, is_believed, frames_in_view)


class Tracker:
    """Follows fruits frame by frame.

    One pass, online. What is kept grows with the fruits and their sightings, and a frame costs what it shows, not what
    was seen before.

    Parameters
    ----------
    calibration : Calibration
        The camera that the boxes are of.
    config : mapping, optional
        Values of the core's tables that differ from `pomona.default_config()`; the tracker's is `tracking`.

    Raises
    ------
    PomonaError
        A setting is unknown or outside its range.
    """

    def __init__(self, calibration: Calibration, config: Mapping[str, Any] | None = None) -> None:
        try:
            self._core = _core.Tracker(calibration, config=core_settings(config))
        except ValueError as error:
            raise PomonaError(str(error)) from None

    def update(
        self, frame_number: int, session_from_camera: ArrayLike, detections: Detections, lifted: Lifted
    ) -> NDArray[np.int64]:
        """Take up the next frame.

        Parameters
        ----------
        frame_number : int
            Larger than the one before.
        session_from_camera : (4, 4)
            Pose of the camera; one frame of reference for all frames of a tracker. It may drift: fruits in view correct
            it.
        detections : Detections
            D boxes.
        lifted : Lifted
            Those of them that have a depth.

        Returns
        -------
        (D,) int64
            Track number of each box, -1 where it shows no fruit that can be placed. A number is used again whenever
            the fruit shows again; `finish` knows later which tracks turned out to be one fruit.

        Raises
        ------
        PomonaError
            Arrays do not fit together, a covariance is none, the pose is not rigid, or the frame does not follow the
            last one. A depth that is no number, or lies behind the camera, is none: then its box counts alone.
        """
        pose = np.asarray(session_from_camera, np.float64)
        if pose.shape != (4, 4):
            raise PomonaError(f"session_from_camera: found an array of shape {pose.shape}, expected (4, 4)")
        if not isinstance(frame_number, int | np.integer):
            raise PomonaError(f"frame_number: found {shown(str(frame_number))}, expected a whole number")
        # A depth guessed from the size tells the tracker nothing that it does not know of sizes itself.
        measured = lifted.measured
        arrays: _core._Lifted = {
            "rows": np.ascontiguousarray(lifted.rows[measured], np.int64),
            "centres_in_camera": np.ascontiguousarray(lifted.centres_in_camera[measured], np.float64),
            "covariances": np.ascontiguousarray(lifted.covariances[measured], np.float64),
            "diameters_m": np.ascontiguousarray(lifted.diameters_m[measured], np.float64),
            "diameter_sigmas_m": np.ascontiguousarray(lifted.diameter_sigmas_m[measured], np.float64),
            "support": np.ascontiguousarray(lifted.support[measured], np.float64),
        }
        try:
            return self._core.update(frame_number, pose, detections.boxes_px, detections.scores, arrays)
        except ValueError as error:
            # That frames come out of order says which it is by itself.
            where = f"frame {frame_number}: "
            raise PomonaError(f"{where}{str(error).removeprefix(where)}") from None

    def glimpse(self, picture: NDArray[np.uint8]) -> None:
        """Look in the colour picture of the last frame, (H, W, 3), for fruits that the detector gave no box."""
        self._core.glimpse(np.ascontiguousarray(picture, np.uint8))

    @property
    def min_views(self) -> int:
        """Frames that must have seen a fruit: the setting `tracking.min_views`."""
        return self._core.min_views

    def finish(self, min_views: int | None = None) -> Tracks:
        """Give the fruits seen so far, duplicates joined; the tracker can go on afterwards.

        Parameters
        ----------
        min_views : int, optional
            Frames that must have seen a fruit; None: the setting `tracking.min_views`.
        """
        found = self._core.finish(min_views)
        return Tracks(
            numbers=found.numbers,
            centres=found.centres,
            covariances=found.covariances,
            radii_m=found.radii_m,
            radius_sigmas_m=found.radius_sigmas_m,
            n_views=found.n_views,
            n_glimpses=found.n_glimpses,
            evidence=found.evidence,
            frames=found.frames,
            rows=found.rows,
            fruits=found.fruits,
            shared=found.shared,
            missed_boxes=found.missed_boxes,
        )
