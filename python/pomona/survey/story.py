"""The story of a scan: recording -> boxes, depth and poses, frame by frame -> tracks -> fruits, each once."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from pomona.amounts import amount
from pomona.cards import as_table
from pomona.cloud import FruitCloud
from pomona.detect import Detector
from pomona.errors import PomonaError, PomonaWarning
from pomona.recording import Frame, Recording
from pomona.recording.alignment import straightened
from pomona.recording.pictures import UnreadablePictureError
from pomona.survey.believing import Believing
from pomona.survey.box_check import check_boxes, check_long_boxes, check_places_of_boxes, check_small_boxes
from pomona.survey.box_edges import check_size_of_boxes
from pomona.survey.box_times import check_box_times
from pomona.survey.depth import Refusal
from pomona.survey.depth_check import check_depth_pictures
from pomona.survey.depth_metres import MEDIAN_M
from pomona.survey.kept import Kept
from pomona.survey.mapped_way import mapped_way
from pomona.survey.part import OpenPart, Part
from pomona.survey.pose_check import check_poses
from pomona.survey.pose_source import Place, PoseSource, pose_source_of
from pomona.survey.prefetch import prefetched
from pomona.survey.rejoining import rejoined
from pomona.survey.seeing import Look, Seeing, looked_ahead
from pomona.survey.standing import Standing
from pomona.survey.swinging import allowing, tell_swing
from pomona.survey.tally import BoxFate, Tally, tell_little
from pomona.survey.told_layers import tell_farther_layer
from pomona.survey.tracking import Tracker
from pomona.trajectory import Trajectory

__all__ = ["Progress", "Survey", "scan"]

Progress = Callable[[int, int, int], None]
"""Called after each frame with frames done, frames in all, fruits so far."""

UNSQUARE = 0.1
"""Part by which fx and fy may differ: pixels are square, and rectified pictures are as wide as high."""

OFF_CENTRE = 0.25
"""Part of a side of the pictures by which the principal point may lie off their middle."""

FEW_FRAMES = 5
"""Frames in view below which a count errs by more than a tenth: half as many boxes make a fruit, and one misses."""


@dataclass(frozen=True, eq=False, repr=False)
class Survey:
    """What a scan found.

    Attributes
    ----------
    parts : tuple of Part
        One where the camera was followed all the way; more where its track broke. At least one, maybe without fruits.
    detections : int
        Boxes in all frames that were come to, also in those that were skipped, as far as those are known.
    refused : Counter of Refusal
        Boxes whose depth was not measured, by reason.
    skipped : dict
        Number of each frame that could not be used, and why.
    skipped_boxes : int
        Boxes of those.
    stopped : int or None
        Frame after which `stop` said yes.
    """

    parts: tuple[Part, ...]
    detections: int
    refused: Counter[Refusal]
    skipped: dict[int, str] = field(default_factory=dict)
    skipped_boxes: int = 0
    stopped: int | None = None

    def __repr__(self) -> str:
        where = f" in the longest of {len(self.parts)} parts" if len(self.parts) > 1 else ""
        skipped = f", {amount(len(self.skipped), 'frame')} skipped" if self.skipped else ""
        return f"Survey({amount(len(self.cloud), 'fruit')}{where}, from {amount(self.detections, 'box')}{skipped})"

    def _repr_html_(self) -> str:
        rows = [(number, *part.facts.values()) for number, part in enumerate(self.parts, start=1)]
        return as_table(repr(self), ("part", *self.parts[0].facts), rows)

    @property
    def longest(self) -> int:
        """Number of the part with the most frames, from 0: of those with fruits, if any has; then of most fruits."""
        sizes = [(len(part.cloud) > 0, len(part.trajectory), len(part.cloud)) for part in self.parts]
        return sizes.index(max(sizes))

    @property
    def tally(self) -> Tally:
        """What became of all boxes, and of the tracks of all parts."""
        skipped = Tally(+Counter[BoxFate | Refusal]({BoxFate.SKIPPED: self.skipped_boxes}))
        return sum((part.tally for part in self.parts), skipped)

    @property
    def cloud(self) -> FruitCloud:
        """Fruits of the longest part."""
        return self.parts[self.longest].cloud

    @property
    def trajectory(self) -> Trajectory:
        """Poses of the longest part."""
        return self.parts[self.longest].trajectory


def scan(
    recording: Recording,
    detector: Detector,
    *,
    depth: str = "auto",
    odometry: bool = False,
    slam: bool = False,
    retrack: bool = False,
    all_rows: bool = False,
    crops: bool = True,
    config: Mapping[str, Any] | None = None,
    keep: Kept | None = None,
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
) -> Survey:
    """Find every fruit of a recording once.

    Parameters
    ----------
    recording : Recording
        With depth, or left and right, pictures.
    detector : Detector
        Gives boxes. Where they have ids, those say which boxes are one fruit; else the boxes are tracked.
    depth : str
        ``auto``: depth pictures, else from left and right at the fruits; or as in `pomona.stereo.open_stereo`.
    odometry : bool
        Find the poses even where the recording has some.
    slam : bool
        Find the poses by the constellations of the fruits in all frames, with odometry where it holds, even where the
        recording has some; loops are closed.
    retrack : bool
        Track the boxes even where they have ids.
    all_rows : bool
        Keep the fruits of rows behind the one that is scanned, where boxes are tracked.
    crops : bool
        Keep a small picture of each fruit, of a recording with colour.
    config : mapping, optional
        Values of the core's tables that differ from `pomona.default_config()`; `tracking` and `odometry` are used here.
    keep : Kept, optional
        Where what single frames show is kept, so that a scan that is started again need not look twice.
    progress : callable, optional
        Called after each frame.
    stop : callable, optional
        Asked after each frame; once it says yes, the survey of the frames so far is made.

    Raises
    ------
    PomonaError
        When pictures that are needed are not there, or no frame can be used. Single ones that cannot are skipped and
        told.
    """
    if not (depth == "auto" and "depth" in recording.description()["pictures"]):
        recording = straightened(recording)
    explained = not (odometry or slam) and check_poses(recording)
    _check_camera(recording)
    seeing = Seeing(recording, detector, depth=depth)
    look_at: Callable[[Frame], Look] = keep.remembering(seeing) if keep is not None else seeing
    look_at = Standing(look_at, seeing.needs)
    camera: PoseSource
    n_before = 0
    if slam:
        n_before = len(recording)
        camera = way = mapped_way(recording, look_at, seeing.needs, config=config, progress=progress, stop=stop)
        look_at, stop = way.look, way.stop_after(stop)
    else:
        camera = pose_source_of(recording, odometry=odometry, config=config)
    # In a single frame nothing can be seen twice: each box is a fruit.
    named = len(recording) == 1 or (not retrack and bool(getattr(detector, "with_ids", False)))
    findings = _Findings(partial(_open_part, recording, None if named else config or {}, crops, all_rows))
    frames = prefetched(recording.frames(), (*seeing.needs, *camera.needs))
    with closing(frames), ThreadPoolExecutor(1, "pomona-look") as looker:
        for done, (frame, look) in enumerate(looked_ahead(frames, look_at, looker), start=1):
            findings.add(frame, _placed(camera, frame), look)
            if progress is not None:
                progress(n_before + done, n_before + len(recording), findings.n_fruits)
            if stop is not None and stop():
                findings.stopped = frame.number
                break
    _tell_skipped(recording, findings.skipped)
    survey = findings.survey(camera)
    boxes = [part.boxes for part in survey.parts]
    check_boxes(recording.path, boxes)
    if (least_px := getattr(detector, "least_px", None)) is not None:
        check_small_boxes(recording.path, boxes, least_px)
    explained |= check_box_times(recording, boxes)
    depth_told = depth == "auto" and check_depth_pictures(recording, boxes)
    explained |= depth_told
    check_long_boxes(recording.path, recording.calibration, survey.parts)
    explained |= check_places_of_boxes(recording.path, recording.calibration, survey.parts)
    check_size_of_boxes(recording, boxes)
    if not depth_told:
        _check_sizes(recording, survey)
    if not explained:
        tell_swing(recording.path, [part.swing_m for part in survey.parts])
        _check_pace(recording, survey)
    n_frames = sum(len(part.trajectory) for part in survey.parts)
    tell_little(recording.path, n_frames, survey.tally, explained=explained)
    if not all_rows:
        tell_farther_layer(recording.path, survey.parts)
    return survey


def _placed(camera: PoseSource, frame: Frame) -> Place:
    try:
        return camera(frame)
    except UnreadablePictureError as error:
        return Place(None, broken=str(error))


def _open_part(
    recording: Recording, config: Mapping[str, Any] | None, crops: bool, all_rows: bool, number: int, began: str | None
) -> OpenPart:
    """Open a part whose boxes are tracked, or, without a configuration, go by their names."""

    def open_tracker(allowed_m: float) -> Tracker | None:
        return None if config is None else Tracker(recording.calibration, allowing(config, allowed_m))

    believing = Believing(recording.calibration, config or {})
    return OpenPart(number, began, open_tracker, believing, with_crops=crops, all_rows=all_rows)


class _Findings:
    """What there is so far: the closed frames of each part, and the frames that could not be used."""

    def __init__(self, open_part: Callable[[int, str | None], OpenPart]) -> None:
        self._open_part = open_part
        self._parts: dict[int, OpenPart] = {}
        self._detections = 0
        self._refused = Counter[Refusal]()
        self._skipped_boxes = 0
        self.skipped: dict[int, str] = {}
        self.stopped: int | None = None

    @property
    def n_fruits(self) -> int:
        return sum(part.n_fruits for part in self._parts.values())

    def add(self, frame: Frame, place: Place, coming: Future[Look]) -> None:
        """Take a frame, or note why it cannot be used."""
        look = coming.result()
        self._detections += len(look.detections)
        if look.unusable is not None or place.session_from_camera is None:
            self.skipped[frame.number] = look.unusable or f"frame {frame.number}: {place.broken}"
            self._skipped_boxes += len(look.detections)
            return
        left = frame.read_left() if look.colours is not None and frame.read_left is not None else None
        if place.part not in self._parts:
            self._parts[place.part] = self._open_part(place.part, place.broken)
        # Where nobody noted the time, frames are numbered: order is all that is known.
        time_s = float(frame.number if frame.time_s is None else frame.time_s)
        self._parts[place.part].add(look, time_s, place.session_from_camera, left)
        self._refused.update(look.lifted.refused.values())

    def survey(self, camera: PoseSource) -> Survey:
        if not self._parts:
            raise PomonaError("stopped before a frame could be used")
        placed = [(part, part.refined(camera)) for part in self._parts.values()]
        parts = tuple(part.closed(poses) for part, poses in rejoined(placed))
        return Survey(parts, self._detections, self._refused, self.skipped, self._skipped_boxes, self.stopped)


def _tell_skipped(recording: Recording, skipped: Mapping[int, str]) -> None:
    """Say how many frames could not be used, and the first of them; a scan of nothing is no scan."""
    if not skipped:
        return
    first = next(iter(skipped.values()))
    if len(skipped) == len(recording):
        raise PomonaError(f"{recording.path}: none of {amount(len(recording), 'frame')} can be used, first {first}")
    message = f"{recording.path}: skipped {len(skipped)} of {amount(len(recording), 'frame')}, first {first}"
    warnings.warn(message, PomonaWarning, stacklevel=3)


def _check_pace(recording: Recording, survey: Survey) -> None:
    """Warn where the camera passes fruits in few frames: then which of them count is half a guess."""
    for part in survey.parts:
        frames = part.frames_in_view
        if frames is not None and 0 < frames < FEW_FRAMES <= len(part.trajectory) / 2:
            found = f"found fruits that stay in view for {frames:.1f} frames, expected {FEW_FRAMES} or more"
            warnings.warn(f"{recording.path}: {found}: film slower", PomonaWarning, stacklevel=3)
            return


def _check_camera(recording: Recording) -> None:
    """Warn where pixels are not square, or the principal point is far from the middle of the pictures.

    Sizes are wrong by the one, and all places are turned aside by the other.
    """
    calibration = recording.calibration
    if not 1 - UNSQUARE < calibration.fx / calibration.fy < 1 + UNSQUARE:
        found = f"found {calibration.fy:g} beside fx {calibration.fx:g}, expected about as much"
        warnings.warn(f"{recording.path}: fy: {found}", PomonaWarning, stacklevel=3)
    sides = {"cx": (calibration.cx, calibration.width), "cy": (calibration.cy, calibration.height)}
    for name, (found_px, size_px) in sides.items():
        if abs(found_px / size_px - 0.5) > OFF_CENTRE:
            expected = f"about the middle of {size_px} pixels, unless the pictures are cut out of larger ones"
            warnings.warn(
                f"{recording.path}: {name}: found {found_px:g}, expected {expected}", PomonaWarning, stacklevel=3
            )


def _check_sizes(recording: Recording, survey: Survey) -> None:
    """Warn when the fruits cannot be fruits: then a unit is wrong, mostly that of depth or baseline."""
    low_m, high_m = MEDIAN_M
    diameters_m = np.concatenate([part.cloud.diameters_m for part in survey.parts])
    if len(diameters_m) and not low_m <= (median_m := float(np.median(diameters_m))) <= high_m:
        expected = f"{1000 * low_m:g} to {1000 * high_m:g} mm"
        unit = f"depth_unit_m {recording.calibration.depth_unit_m:g}, fx {recording.calibration.fx:g} px"
        message = (
            f"{recording.path}: the median diameter is {1000 * median_m:.3g} mm, expected {expected}: check {unit}"
        )
        warnings.warn(message, PomonaWarning, stacklevel=3)
