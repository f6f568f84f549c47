"""What became of every box, track and frame of a scan, and a word where little became a fruit."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.amounts import amount
from pomona.errors import PomonaWarning
from pomona.survey.believing import Believing
from pomona.survey.depth import Refusal
from pomona.survey.seeing import Look
from pomona.survey.tracking import Tracks

__all__ = ["BoxFate", "FrameFate", "Tally", "TrackFate", "often_enough", "tell_little", "track_fates"]

Rows = NDArray[np.int64]

FEW_BOXES = 5
"""Of several frames in all: no fruit is seen often enough then."""

FEW_IN_A_FRAME = 0.1
"""Boxes a frame: a row in fruit has ten and more."""

SMALL_SHARE = 0.1
"""Of boxes with a depth, or of tracks that are fruits: real detectors and cameras leave half and more."""

SEVERAL_TRACKS = 10
"""Fewer say nothing about shares."""


class BoxFate(StrEnum):
    """What became of a box whose depth was not refused; what was refused has its `Refusal`."""

    FRUIT = "of a fruit"
    NO_TRACK = "of no track"
    SECOND = "second box of a fruit in its frame"
    BEHIND = "of a fruit in a row behind"
    NO_FRUIT = "of a track that is no fruit"
    SKIPPED = "in a skipped frame"


class TrackFate(StrEnum):
    """What became of a track."""

    FRUIT = "a fruit"
    BEHIND = "in a row behind the one that was scanned"
    JOINED = "joined with another, the same fruit"
    FEW_VIEWS = "seen in too few frames"
    LEAVES = "coloured as leaves are, or larger than fruits"
    NO_PLACE = "never measured"


class FrameFate(StrEnum):
    """What a frame gave."""

    BOXES = "with boxes"
    NONE_FOUND = "without boxes: nothing was found there"
    NOT_LOOKED_AT = "without boxes in the file, taken as not looked at"


_CODES: dict[BoxFate | Refusal, int] = {fate: code for code, fate in enumerate((*BoxFate, *Refusal))}

ADVICE = {
    Refusal.CUT: "check that the boxes are of these pictures, in their pixels",
    Refusal.NO_DEPTH: "check the depth pictures and depth_unit_m with `pomona info`",
    Refusal.UNMATCHED: "check calibration, left and right with `pomona info --check`",
    TrackFate.BEHIND: "--all-rows counts them too",
    TrackFate.FEW_VIEWS: "film slower, take every frame, or lower tracking.min_views",
    TrackFate.LEAVES: "check that the boxes are around fruits, with --preview",
    TrackFate.NO_PLACE: "check calibration, left and right with `pomona info --check`",
    TrackFate.JOINED: "check the poses; --odometry finds others",
}
"""What to do where most of what is lost is lost for this reason."""


@dataclass(frozen=True)
class Tally:
    """Every box, every track and every frame, once each.

    Attributes
    ----------
    boxes : Counter of BoxFate or Refusal
    tracks : Counter of TrackFate
        Of boxes with names: the names.
    frames : Counter of FrameFate
    """

    boxes: Counter[BoxFate | Refusal] = field(default_factory=Counter)
    tracks: Counter[TrackFate] = field(default_factory=Counter)
    frames: Counter[FrameFate] = field(default_factory=Counter)

    @property
    def n_looked_at(self) -> int:
        """Boxes in frames that were not skipped."""
        return self.boxes.total() - self.boxes[BoxFate.SKIPPED]

    def __add__(self, other: Tally) -> Tally:
        return Tally(self.boxes + other.boxes, self.tracks + other.tracks, self.frames + other.frames)

    @classmethod
    def of(
        cls,
        looks: Sequence[Look],
        fruits: Rows,
        first: Rows,
        joined: Rows,
        tracks: Counter[TrackFate],
        is_behind: NDArray[np.bool_],
    ) -> Tally:
        """Count the boxes of some frames.

        Parameters
        ----------
        looks : sequence of Look
            The frames.
        fruits, first, joined : (B,) int64
            Row of the fruit of each box, of its track, and of what the track was joined to; -1 for none.
        tracks : Counter of TrackFate
            What became of the tracks.
        is_behind : (N,) bool
            Which of the joined tracks are in a row behind.
        """
        codes = np.full(len(fruits), _CODES[BoxFate.NO_FRUIT])
        codes[np.isin(joined, np.flatnonzero(is_behind))] = _CODES[BoxFate.BEHIND]
        codes[joined < 0] = _CODES[BoxFate.SECOND]
        codes[first < 0] = _CODES[BoxFate.NO_TRACK]
        offset = 0
        for look in looks:
            for row, reason in look.lifted.refused.items():
                codes[offset + row] = _CODES[reason]
            offset += len(look.detections)
        codes[fruits >= 0] = _CODES[BoxFate.FRUIT]
        counts = np.bincount(codes, minlength=len(_CODES)).tolist()
        return cls(+Counter(dict(zip(_CODES, counts, strict=True))), +tracks, Counter(map(_frame_fate, looks)))


def _frame_fate(look: Look) -> FrameFate:
    if len(look.detections):
        return FrameFate.BOXES
    return FrameFate.NONE_FOUND if look.detections.looked else FrameFate.NOT_LOOKED_AT


def track_fates(
    n_found: int,
    is_believed: NDArray[np.bool_],
    by_views: NDArray[np.bool_],
    is_behind: NDArray[np.bool_],
    n_fruits: int,
) -> Counter[TrackFate]:
    """Count what became of tracks.

    Parameters
    ----------
    n_found : int
        Tracks, before those of one fruit were joined.
    is_believed, by_views : (N,) bool
        Whether each of those that are left is believed to be a fruit, and whether it is seen often enough for one.
    is_behind : (N,) bool
        Whether each of the believed is in a row behind.
    n_fruits : int
        Those of the other believed that have a place.
    """
    n_believed, n_behind = int(is_believed.sum()), int(is_behind.sum())
    n_few = int((~is_believed & ~by_views).sum())
    return Counter(
        {
            TrackFate.FRUIT: n_fruits,
            TrackFate.BEHIND: n_behind,
            TrackFate.JOINED: n_found - len(is_believed),
            TrackFate.FEW_VIEWS: n_few,
            TrackFate.LEAVES: len(is_believed) - n_believed - n_few,
            TrackFate.NO_PLACE: n_believed - n_behind - n_fruits,
        }
    )


def often_enough(
    believing: Believing, tracks: Tracks, looks: Sequence[Look], poses: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Tell which tracks would be fruits if nothing was known of their colours and sizes, (N,)."""
    colourless = [replace(look, fruitness=None, elsewhere=None) for look in looks]
    return believing(tracks, colourless, poses, sized=False).is_believed


def tell_little(path: Path, n_frames: int, tally: Tally, *, explained: bool = False) -> None:
    """Warn where nothing or little of a recording became fruits, and say what to do, unless what was told before does.

    Wrong poses, boxes or depth lose fruits, too, and slower filming mends nothing then: `explained`.
    """
    told = _few_boxes(n_frames, tally.n_looked_at) or _few_depths(tally) or _few_fruits(tally, explained)
    if told is not None:
        warnings.warn(f"{path}: {told}", PomonaWarning, stacklevel=3)


def _few_boxes(n_frames: int, n_boxes: int) -> str | None:
    what_to_do = "check the file of the boxes, or the model's --min-score and --classes"
    if n_boxes == 0:
        return f"found no boxes in {amount(n_frames, 'frame')}, so no fruits: {what_to_do}"
    if n_frames > 1 and n_boxes < max(FEW_BOXES, FEW_IN_A_FRAME * n_frames):
        return f"found {amount(n_boxes, 'box')} in {amount(n_frames, 'frame')}, too few for fruits: {what_to_do}"
    return None


def _few_depths(tally: Tally) -> str | None:
    refused = Counter({reason: tally.boxes[reason] for reason in Refusal})
    n_boxes, n_refused = tally.n_looked_at, refused.total()
    if n_refused <= (1 - SMALL_SHARE) * n_boxes:
        return None
    reason = refused.most_common(1)[0][0]
    return f"{n_refused} of {amount(n_boxes, 'box')} have no depth, most because {reason}: {ADVICE[reason]}"


def _few_fruits(tally: Tally, explained: bool) -> str | None:
    n_tracks, n_fruits = tally.tracks.total(), tally.tracks[TrackFate.FRUIT]
    if n_tracks < SEVERAL_TRACKS or n_fruits >= SMALL_SHARE * n_tracks:
        return None
    lost = tally.tracks - Counter({TrackFate.FRUIT: n_fruits})
    reason = lost.most_common(1)[0][0]
    advice = "mend first what is told above" if explained else ADVICE[reason]
    return f"{n_fruits} of {n_tracks} tracks are fruits, most others were {reason}: {advice}"
