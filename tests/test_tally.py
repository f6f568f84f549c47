"""What became of every box and every track, and what is said where little became a fruit."""

import warnings
from collections import Counter

import numpy as np
import pytest

from pomona.detect import Detections
from pomona.errors import PomonaWarning
from pomona.survey.depth import Lifted, Refusal
from pomona.survey.seeing import Look
from pomona.survey.tally import BoxFate, Tally, TrackFate, tell_little, track_fates


def one_look(frame: int, n_boxes: int, refused: dict[int, Refusal]) -> Look:
    rows = np.array([row for row in range(n_boxes) if row not in refused])
    n, places = len(rows), np.tile(np.eye(3), (len(rows), 1, 1))
    lifted = Lifted(rows, np.ones((n, 3)), places, *(np.ones(n) for _ in range(4)), refused)
    return Look(frame, Detections(np.tile([0.0, 0, 9, 9], (n_boxes, 1)), np.ones(n_boxes)), lifted)


def test_every_box_and_every_track_has_one_fate():
    looks = [one_look(0, 4, {1: Refusal.CUT}), one_look(1, 4, {0: Refusal.UNMATCHED})]
    first = np.array([0, -1, -1, 1, 0, 1, 2, 3])
    joined = np.array([0, -1, -1, 1, 0, 1, -1, 2])
    fruits = np.array([0, -1, -1, -1, 0, -1, -1, -1])
    is_believed, by_views = np.array([True, False, False]), np.array([True, True, False])
    tracks = track_fates(4, is_believed, by_views, np.zeros(3, bool), 1)
    assert +tracks == {TrackFate.FRUIT: 1, TrackFate.JOINED: 1, TrackFate.LEAVES: 1, TrackFate.FEW_VIEWS: 1}
    tally = Tally.of(looks, fruits, first, joined, tracks, np.zeros(3, bool))
    assert tally.boxes == {
        BoxFate.FRUIT: 2,  # of them one whose own depth was refused
        Refusal.CUT: 1,
        BoxFate.NO_TRACK: 1,
        BoxFate.NO_FRUIT: 3,
        BoxFate.SECOND: 1,
    }
    assert (tally + tally).boxes.total() == 16


def test_what_is_behind_is_neither_a_fruit_nor_none():
    looks, rows = [one_look(0, 4, {})], np.arange(4)
    is_behind = np.array([False, True, True, False])
    tracks = track_fates(4, np.array([True, True, True, False]), np.ones(4, bool), is_behind, 1)
    assert +tracks == {TrackFate.FRUIT: 1, TrackFate.BEHIND: 2, TrackFate.LEAVES: 1}
    tally = Tally.of(looks, np.array([0, -1, -1, -1]), rows, rows, tracks, is_behind)
    assert tally.boxes == {BoxFate.FRUIT: 1, BoxFate.BEHIND: 2, BoxFate.NO_FRUIT: 1}


@pytest.mark.parametrize(
    ("boxes", "tracks", "n_frames", "told"),
    [
        ({}, {}, 40, "found no boxes in 40 frames, so no fruits: check the file of the boxes"),
        ({BoxFate.NO_TRACK: 2}, {}, 40, "found 2 boxes in 40 frames, too few for fruits: check the file of the boxes"),
        ({BoxFate.FRUIT: 2}, {TrackFate.FRUIT: 2}, 1, None),
        ({BoxFate.SKIPPED: 900, BoxFate.NO_TRACK: 2}, {}, 40, "found 2 boxes in 40 frames, too few for fruits"),
        (
            {Refusal.UNMATCHED: 190, Refusal.CUT: 5, BoxFate.NO_TRACK: 5},
            {},
            40,
            "195 of 200 boxes have no depth, most because no sure match in the right picture: check calibration",
        ),
        (
            {BoxFate.NO_FRUIT: 200},
            {TrackFate.FEW_VIEWS: 60, TrackFate.JOINED: 2, TrackFate.FRUIT: 1},
            40,
            "1 of 63 tracks are fruits, most others were seen in too few frames: film slower",
        ),
        ({BoxFate.FRUIT: 100, BoxFate.NO_FRUIT: 100}, {TrackFate.FRUIT: 20, TrackFate.LEAVES: 20}, 40, None),
    ],
)
def test_little_is_told_with_what_to_do(tmp_path, boxes, tracks, n_frames, told):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        tell_little(tmp_path, n_frames, Tally(Counter(boxes), Counter(tracks)))
    assert [str(one.message).split(": ", 1)[1].startswith(told) for one in caught] == [True] * (told is not None)


def test_slower_filming_is_no_advice_where_something_else_was_told(tmp_path):
    tracks = Counter({TrackFate.FEW_VIEWS: 60, TrackFate.FRUIT: 1})
    with pytest.warns(PomonaWarning, match="1 of 61 tracks are fruits, .*: mend first what is told above"):
        tell_little(tmp_path, 40, Tally(Counter({BoxFate.NO_FRUIT: 200}), tracks), explained=True)
