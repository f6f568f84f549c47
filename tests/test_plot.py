"""The picture of a match: the view, what is drawn, the file."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.matching import Match, Verdict
from pomona.plot import draw_match, save_picture, view_from_above

# A row along y, 6 m long, 1 m deep, 3 m high, far from the origin.
ROW = np.random.default_rng(5).uniform([100.0, 0.0, 7.0], [101.0, 6.0, 10.0], (60, 3))


def a_match(status: Verdict, n_pairs: int, map_from_query: np.ndarray | None) -> Match:
    return Match(
        status=status,
        map_from_query=map_from_query,
        scale=None if map_from_query is None else 1.0,
        log_odds=100.0,
        pairs=np.repeat(np.arange(n_pairs), 2).reshape(-1, 2),
        probabilities=np.linspace(0.1, 0.9, n_pairs),
        distances_m=np.full(n_pairs, 0.02),
        support=np.ones(n_pairs),
        alternatives=(),
        noise_m=0.02,
        stages=(),
        n_query=len(ROW),
        n_map=len(ROW),
        elapsed_s=0.01,
    )


def test_from_above_the_row_lies_to_the_right() -> None:
    view = view_from_above(ROW, up=[0.0, 0.0, 2.0])
    assert np.allclose(view.axes @ view.axes.T, np.eye(2))
    assert np.allclose(view.axes @ [0.0, 0.0, 1.0], 0.0)
    along, across = np.ptp(view.project(ROW), axis=0)
    assert along > 5.0 > 2.0 > across
    # Looking down: right times up in the picture points towards the eye.
    assert np.cross(*view.axes)[2] == pytest.approx(1.0)


def test_without_a_vertical_the_two_largest_extents_are_drawn_and_said() -> None:
    view = view_from_above(ROW)
    assert np.allclose(np.abs(view.axes @ [1.0, 0.0, 0.0]), 0.0, atol=0.2)
    assert "vertical unknown" in view.labels[1]
    assert "vertical unknown" not in view_from_above(ROW, up=[0, 0, 1]).labels[1]


@pytest.mark.parametrize("positions", [np.empty((0, 3)), ROW[:1], np.outer(np.arange(5.0), [0, 0, 1])])
def test_a_view_of_degenerate_clouds_is_still_a_plane(positions: np.ndarray) -> None:
    for up in (None, [0.0, 0.0, 1.0]):
        axes = view_from_above(positions, up).axes
        assert np.allclose(axes @ axes.T, np.eye(2))


def lines_of(figure: Figure) -> list[LineCollection]:
    return [artist for artist in figure.axes[0].collections if isinstance(artist, LineCollection)]


def test_draws_a_line_for_every_pair_and_says_the_verdict() -> None:
    transform = np.eye(4)
    transform[:3, 3] = [100.0, 0.0, 7.0]
    figure = draw_match(FruitCloud(ROW - transform[:3, 3]), FruitCloud(ROW), a_match(Verdict.FOUND, 40, transform))
    (lines,) = lines_of(figure)
    segments = np.array(lines.get_segments())
    assert segments.shape == (40, 2, 2)
    # The clouds are the same, so every line is the shift by which the query is drawn aside.
    aside = segments[:, 0] - segments[:, 1]
    assert np.allclose(aside[:, 0], 0.0)
    assert np.allclose(aside[:, 1], aside[0, 1])
    assert f"{aside[0, 1]:.1f} m aside" in figure.axes[0].get_ylabel()
    assert figure.get_suptitle().startswith("Found: ")
    assert figure.axes[0].get_aspect() == 1.0


def test_draws_both_clouds_where_nothing_was_found() -> None:
    figure = draw_match(FruitCloud(ROW), FruitCloud(ROW + 5.0), a_match(Verdict.NO_MATCH, 0, None))
    assert lines_of(figure) == []
    assert figure.get_suptitle().startswith("NoMatch: ")


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf", ".PNG"])
def test_writes_what_the_name_says(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"match{suffix}"
    save_picture(Figure(), path)
    starts = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}
    assert path.read_bytes().startswith(starts[suffix.lower()])


def test_refuses_a_name_that_is_no_picture(tmp_path: Path) -> None:
    with pytest.raises(PomonaError, match=r"match\.txt: found \.txt, expected a picture named \.png"):
        save_picture(Figure(), tmp_path / "match.txt")
    assert list(tmp_path.iterdir()) == []
