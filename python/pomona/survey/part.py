"""A stretch of a recording with one frame of reference: what its frames saw becomes fruits, each once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.fruit_crop import FruitCrop
from pomona.survey.believing import Believing
from pomona.survey.best_shots import BestShots
from pomona.survey.pose_source import PoseSource
from pomona.survey.registration import Fruits
from pomona.survey.rows_behind import rows_behind
from pomona.survey.seeing import Look
from pomona.survey.sightings import Sightings, fruits_of, places_of
from pomona.survey.swinging import allowed_m, swing_m
from pomona.survey.tally import Tally, TrackFate, often_enough, track_fates
from pomona.survey.tracking import Tracker, Tracks
from pomona.trajectory import Trajectory

__all__ = ["Boxes", "OpenPart", "Part"]

SWINGS = 4
"""Times that a swing is measured at the most."""

ALLOWED_FOR = 1.25
"""A swing that asks for so much more than was allowed for is as good as allowed for."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """Every box of a part and the fruit in it, one row a box, in order of time.

    Attributes
    ----------
    frames : (B,) int64
        Frame number.
    boxes_px : (B, 4) float64
        xmin, ymin, xmax, ymax.
    scores : (B,) float64
        Confidence, 0 to 1.
    fruits : (B,) int64
        Row of the fruit in the part's cloud, -1 where the box is of none.
    """

    frames: NDArray[np.int64]
    boxes_px: NDArray[np.float64]
    scores: NDArray[np.float64]
    fruits: NDArray[np.int64]


@dataclass(frozen=True, eq=False, repr=False)
class Part:
    """Fruits of a stretch of the recording.

    Attributes
    ----------
    cloud : FruitCloud
        Every fruit once, in the part's frame of reference. `extras` has `diameter_sigma_m`, the standard deviation of
        the diameter in metres, of tracked fruits `probability`, that each is a fruit which shows clearly, and, of a
        recording with colour, `colour` as #rrggbb.
    trajectory : Trajectory
        Poses of the left camera.
    boxes : Boxes
        Which box is which fruit.
    began : str or None
        Why the part before it ended; None of the first.
    frames_in_view : float or None
        Frames for which a fruit stays in view; None where boxes were not tracked.
    tally : Tally
        What became of its boxes and tracks.
    crops : mapping of int to FruitCrop
        Of each fruit, by its row in the cloud, as far as there are any.
    swing_m : float
        By how much fruits that were tracked swing while they are filmed, standard deviation per axis, metres.
    """

    cloud: FruitCloud
    trajectory: Trajectory
    boxes: Boxes
    began: str | None = None
    frames_in_view: float | None = None
    tally: Tally = field(default_factory=Tally)
    crops: Mapping[int, FruitCrop] = field(default_factory=dict)
    swing_m: float = 0.0

    def __repr__(self) -> str:
        return f"Part({', '.join(f'{name}: {value}' for name, value in self.facts.items())})"

    @property
    def facts(self) -> dict[str, object]:
        """What it holds, in short."""
        frames, sizes_m = self.trajectory.frames, self.cloud.diameters_m
        known_m = np.empty(0) if sizes_m is None else sizes_m[~np.isnan(sizes_m)]
        return {
            "frames": f"{frames.min()} to {frames.max()}" if len(frames) else "none",
            "fruits": len(self.cloud),
            "median diameter": f"{1000 * np.median(known_m):.1f} mm" if len(known_m) else "-",
            "boxes": len(self.boxes.frames),
        }


class OpenPart:
    """A part that still grows, frame by frame.

    Parameters
    ----------
    number : int
        Which part of the recording.
    began : str or None
        Why it began.
    open_tracker : callable
        Opens what tells which boxes are one fruit, where it may be so many metres from where it was seen last; gives
        None where the boxes carry names, or there is one frame.
    believing : Believing
        Tells which tracks are fruits.
    with_crops : bool
        Whether to keep a small picture of each fruit.
    all_rows : bool
        Whether tracked fruits of rows behind the one that is scanned are fruits too.
    """

    def __init__(
        self,
        number: int,
        began: str | None,
        open_tracker: Callable[[float], Tracker | None],
        believing: Believing,
        *,
        with_crops: bool = True,
        all_rows: bool = False,
    ) -> None:
        self._number, self._began, self._open_tracker, self._believing = number, began, open_tracker, believing
        self._tracker, self._with_crops, self._shots = open_tracker(0.0), with_crops, BestShots()
        self._all_rows = all_rows
        self._looks: list[Look] = []
        self._times_s: list[float] = []
        self._seen: Counter[str | int] = Counter()

    def add(
        self,
        look: Look,
        time_s: float,
        session_from_camera: NDArray[np.float64],
        left: NDArray[np.uint8] | None = None,
    ) -> None:
        """Take the next frame; its left picture, where there is one, shows fruits that have no box."""
        self._looks.append(look)
        self._times_s.append(time_s)
        names: Sequence[str | int | None] = ()
        if self._tracker is None:
            names = _names(look)
        elif look.detections.looked:
            numbers = self._tracker.update(look.frame, session_from_camera, look.detections, look.lifted)
            names = [number if number >= 0 else None for number in numbers.tolist()]
            if left is not None:
                self._tracker.glimpse(left)
        self._seen.update(name for name in names if name is not None)
        if self._with_crops and left is not None:
            self._shots.offer(look, names, left)

    @property
    def n_fruits(self) -> int:
        """How many fruits there are so far, near enough to show while the work goes on."""
        least = 1 if self._tracker is None else self._tracker.min_views
        return sum(views >= least for views in self._seen.values())

    @property
    def began(self) -> str | None:
        """Why it began."""
        return self._began

    def refined(self, camera: PoseSource) -> NDArray[np.float64]:
        """Give the poses of its frames, (F, 4, 4), by all that is known at the end."""
        sightings = Sightings.of(self._looks)
        frames = [look.frame for look in self._looks]
        return camera.refined(self._number, frames, sightings, self._owners().of(sightings))

    def fruits_seen_in(self, frames: slice, poses: NDArray[np.float64]) -> Fruits:
        """Give the places of what some of its frames saw, believed to be a fruit or not; all frames say where."""
        measured = _Measured.of(Sightings.of(self._looks), self._owners())
        positions, covariances = places_of(measured.sightings, measured.fruits, poses)
        rows = np.unique(measured.fruits[np.isin(measured.sightings.rows, np.arange(len(self._looks))[frames])])
        return Fruits(positions[rows], covariances[rows])

    def continued(self, poses: NDArray[np.float64], other: OpenPart, other_poses: NDArray[np.float64]) -> OpenPart:
        """Give this part with the later frames of another one, whose poses are in the same frame of reference."""
        joined = OpenPart(self._number, self._began, self._open_tracker, self._believing, all_rows=self._all_rows)
        joined._shots = self._shots.with_those_of(other._shots)
        for part, known in ((self, poses), (other, other_poses)):
            for look, time_s, pose in zip(part._looks, part._times_s, known, strict=True):
                joined.add(look, time_s, pose)
        return joined

    def closed(self, poses: NDArray[np.float64]) -> Part:
        """Make the fruits of all the frames, at these poses (F, 4, 4)."""
        sightings = Sightings.of(self._looks)
        swing = 0.0 if self._tracker is None else self._track_swinging(sightings, poses)
        tracks = None if self._tracker is None else self._tracker.finish(min_views=1)
        first = joined = owners = self._named() if tracks is None else self._tracked(tracks)
        frames = [look.frame for look in self._looks]
        probability = frames_in_view = None
        is_behind = np.zeros(0, bool)
        if tracks is not None:
            # Fragments of one fruit that drift kept apart come together once poses and places are refined.
            tracks = _joined(tracks, _Measured.of(sightings, owners), poses)
            joined = self._tracked(tracks)
            belief = self._believing(tracks, self._looks, poses)
            is_behind = self._behind(tracks, belief.is_believed, poses)
            rows, frames_in_view = np.flatnonzero(belief.is_believed & ~is_behind), belief.frames_in_view
            owners, probability = self._tracked(tracks.select(rows)), belief.probability[rows]
        measured = _Measured.of(sightings, owners)
        cloud, row_of = (
            fruits_of(measured.sightings, measured.fruits, self._looks, poses, measured.names),
            measured.row_of,
        )
        if swing > 0.0 and cloud.covariances is not None:
            # Of a swing a fruit shows a part while it is in view: its middle lies anywhere in it.
            cloud = replace(cloud, covariances=cloud.covariances + swing**2 * np.eye(3))
        if probability is not None:
            of_cloud = np.argsort(row_of[:-1])[len(row_of) - 1 - len(cloud) :]
            cloud = _with_probability(cloud, probability[of_cloud])
        fates = Counter({TrackFate.FRUIT: len(cloud), TrackFate.NO_PLACE: len(owners.names) - len(cloud)})
        if tracks is not None:
            seen = often_enough(self._believing, tracks, self._looks, poses)
            fates = track_fates(len(first.names), belief.is_believed, seen, is_behind, len(cloud))
        trajectory = Trajectory(np.array(frames, np.int64), np.array(self._times_s), poses)
        boxes = _boxes(self._looks, row_of[owners.fruits])
        tally = Tally.of(self._looks, boxes.fruits, first.fruits, joined.fruits, fates, is_behind)
        crops = self._shots.crops(boxes.frames, boxes.fruits)
        return Part(cloud, trajectory, boxes, self._began, frames_in_view, tally, crops, swing)

    def _track_swinging(self, sightings: Sightings, poses: NDArray[np.float64]) -> float:
        """Track the boxes again as far as fruits are found to swing; return by how much, metres."""
        allowed = 0.0
        for _ in range(SWINGS):
            measured = _Measured.of(sightings, self._owners())
            centres, _ = places_of(measured.sightings, measured.fruits, poses)
            found_m = swing_m(measured.sightings, measured.fruits, poses, centres)
            if allowed_m(found_m) <= ALLOWED_FOR * allowed:
                break
            allowed = allowed_m(found_m)
            self._tracker = self._open_tracker(allowed)
            assert self._tracker is not None
            for look, pose in zip(self._looks, poses, strict=True):
                if look.detections.looked:
                    self._tracker.update(look.frame, pose, look.detections, look.lifted)
        return found_m

    def _behind(self, tracks: Tracks, is_fruit: NDArray[np.bool_], poses: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which of the tracks that are fruits hang in a row behind, (N,)."""
        is_behind = np.zeros(len(tracks), bool)
        if not self._all_rows:
            fruits = tracks.select(np.flatnonzero(is_fruit))
            frames = np.searchsorted([look.frame for look in self._looks], fruits.frames)
            is_behind[is_fruit] = rows_behind(fruits.centres, frames, fruits.fruits, poses)
        return is_behind

    def _owners(self) -> _Owners:
        return self._named() if self._tracker is None else self._tracked(self._tracker.finish(min_views=1))

    def _named(self) -> _Owners:
        """Take the names that the boxes carry; without any, of a single frame, each box is a fruit."""
        ids = [name for look in self._looks for name in _names(look)]
        row_of = {name: row for row, name in enumerate(dict.fromkeys(ids))}
        fruits = np.array([row_of[name] for name in ids], np.int64)
        return _Owners(fruits, np.ones(len(fruits), bool), list(row_of))

    def _tracked(self, tracks: Tracks) -> _Owners:
        """Take what the tracker says; a box around two fruits shows one of them, but not its place or size."""
        first_box = np.cumsum([0, *(len(look.detections) for look in self._looks)])
        row_of_frame = {look.frame: row for row, look in enumerate(self._looks)}
        boxes = first_box[[row_of_frame[frame] for frame in tracks.frames.tolist()]] + tracks.rows
        fruits, measures = np.full(first_box[-1], -1, np.int64), np.zeros(first_box[-1], bool)
        fruits[boxes], measures[boxes] = tracks.fruits, ~tracks.shared
        return _Owners(fruits, measures, [str(number) for number in range(1, len(tracks) + 1)])


@dataclass(frozen=True, eq=False)
class _Owners:
    """The fruit in each box of a part.

    Attributes
    ----------
    fruits : (B,) int64
        Row in `names`, -1 for none.
    measures : (B,) bool
        Whether the box is around that fruit alone.
    names : list of N str
    """

    fruits: NDArray[np.int64]
    measures: NDArray[np.bool_]
    names: list[str]

    def of(self, sightings: Sightings) -> NDArray[np.int64]:
        """Fruit that each sighting measures, (S,), -1 for none."""
        return np.where(self.measures[sightings.boxes], self.fruits[sightings.boxes], -1)


def _names(look: Look) -> Sequence[str]:
    ids = look.detections.ids
    return [str(row) for row in range(len(look.detections))] if ids is None else ids


def _with_probability(cloud: FruitCloud, probability: NDArray[np.float64]) -> FruitCloud:
    return replace(cloud, extras={**cloud.extras, "probability": tuple(f"{one:.4f}" for one in probability)})


@dataclass(frozen=True, eq=False)
class _Measured:
    """The fruits that have sightings, in the order in which they were first seen.

    Attributes
    ----------
    sightings : Sightings
        S of them, each of a fruit.
    fruits : (S,) int64
        Row in `names` of each.
    names : list of str
        Of the fruits.
    row_of : (N + 1,) int64
        New row of each owner, -1 of one never measured; the last is for boxes of no fruit.
    """

    sightings: Sightings
    fruits: NDArray[np.int64]
    names: list[str]
    row_of: NDArray[np.int64]

    @classmethod
    def of(cls, sightings: Sightings, owners: _Owners) -> _Measured:
        fruits = owners.of(sightings)
        rows = np.flatnonzero(fruits >= 0)
        found, first = np.unique(fruits[rows], return_index=True)
        found = found[np.argsort(first, kind="stable")]
        row_of = np.full(len(owners.names) + 1, -1, np.int64)
        row_of[found] = np.arange(len(found))
        return cls(sightings.select(rows), row_of[fruits[rows]], [owners.names[row] for row in found], row_of)


def _joined(tracks: Tracks, measured: _Measured, poses: NDArray[np.float64]) -> Tracks:
    """Join tracks of one fruit by the places of all their sightings; the rest stay where the tracker had them."""
    known = np.flatnonzero(measured.row_of[:-1] >= 0)
    centres, covariances = tracks.centres.copy(), tracks.covariances.copy()
    positions, of_positions = places_of(measured.sightings, measured.fruits, poses)
    centres[known], covariances[known] = positions[measured.row_of[known]], of_positions[measured.row_of[known]]
    return tracks.at(centres, covariances).joined()


def _boxes(looks: Sequence[Look], fruits: NDArray[np.int64]) -> Boxes:
    return Boxes(
        frames=np.repeat([look.frame for look in looks], [len(look.detections) for look in looks]).astype(np.int64),
        boxes_px=np.concatenate([np.empty((0, 4)), *(look.detections.boxes_px for look in looks)]),
        scores=np.concatenate([np.empty(0), *(look.detections.scores for look in looks)]),
        fruits=fruits,
    )
