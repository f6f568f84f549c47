"""The scores that the benchmark `tracking` gives to runs whose scores can be counted by hand."""

import numpy as np
import pytest
from benchmarks.tracking_scores import Count, count, mot_scores, often


def run(*frames: str) -> tuple[list[tuple[str, ...]], list[np.ndarray]]:
    """Frames like "a1 b- _3": fruit a in track 1, fruit b in none, no fruit in track 3."""
    pairs = [
        [(pair[0].replace("_", ""), int(pair[1:].replace("-", "-1"))) for pair in frame.split()] for frame in frames
    ]
    names = [tuple(name for name, _ in frame) for frame in pairs]
    return names, [np.array([number for _, number in frame], np.int64) for frame in pairs]


def test_a_perfect_run() -> None:
    names, numbers = run(*["a1 b2"] * 5, "a1")
    assert count(names, numbers) == Count(true=2, reported=2, split=0, false=0)
    assert mot_scores(names, numbers) == pytest.approx({"mota": 1, "hota": 1, "idf1": 1, "switches": 0})


def test_a_fruit_in_two_tracks_is_split() -> None:
    names, numbers = run(*["a1"] * 5, *["a2"] * 5)
    assert count(names, numbers) == Count(true=1, reported=2, split=1, false=0)
    assert count(names, numbers).error == 1.0
    scores = mot_scores(names, numbers)
    assert scores["switches"] == 1
    assert scores["mota"] == pytest.approx(0.9)
    assert scores["idf1"] == pytest.approx(2 * 5 / (10 + 10))


def test_boxes_that_show_no_fruit_count_as_false() -> None:
    names, numbers = run(*["a1 _2"] * 5)
    assert count(names, numbers) == Count(true=1, reported=2, split=0, false=1)
    assert mot_scores(names, numbers)["mota"] == pytest.approx(0.0)  # five false ones on five boxes


def test_often_leaves_out_what_is_rare_on_either_side() -> None:
    names, numbers = run(*["a1 b2"] * 4, "a1 c2", "a3")
    kept_names, kept_numbers = often(names, numbers)
    assert kept_names == [("a", "")] * 5 + [("a",)]
    assert [told.tolist() for told in kept_numbers] == [[1, 2]] * 5 + [[-1]]
    assert count(names, numbers) == Count(true=1, reported=2, split=0, false=0)
    assert mot_scores(kept_names, kept_numbers)["mota"] == pytest.approx(1 - (1 + 5) / 6)
