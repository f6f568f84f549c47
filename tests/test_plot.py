"""The picture of a match: the view, what is drawn, the file."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver, QuiverKey

from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.matching import Match, Verdict
from pomona.plot import draw_match, save_picture, view_from_above
from pomona.plot.fates import Fates
from pomona.plot.trees import Trees

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
        part_of_pairs=np.zeros(n_pairs, np.int64),
        parts=() if map_from_query is None else (map_from_query,),
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
    query, map = FruitCloud(ROW - transform[:3, 3]), FruitCloud(ROW)
    figure = draw_match(query, map, a_match(Verdict.FOUND, 40, transform), view="lines")
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
    for view in ("row", "lines"):
        figure = draw_match(FruitCloud(ROW), FruitCloud(ROW + 5.0), a_match(Verdict.NO_MATCH, 0, None), view=view)
        assert lines_of(figure) == []
        assert figure.get_suptitle().startswith("NoMatch: ")
        assert sum(len(points) for points in points_of(figure).values()) == 2 * len(ROW)


def points_of(figure: Figure) -> dict[str, np.ndarray]:
    """What is drawn, by its name in the legend, from the side alone where both are."""
    names = {}
    for axes in reversed(figure.axes):
        for artist in axes.collections:
            if not artist.get_label().startswith("_"):
                names[artist.get_label()] = np.asarray(artist.get_offsets())
    return names


def moved_row() -> tuple[FruitCloud, FruitCloud, Match]:
    """Of 60 fruits 40 are found again 2 cm higher; the query sees nothing of the map beyond 4 m."""
    transform = np.eye(4)
    transform[:3, 3] = [100.0, 0.0, 7.0]
    order = np.argsort(ROW[:, 1])
    in_map = ROW[order]
    in_query = in_map[:50] + np.array([0.0, 0.0, 0.02]) - transform[:3, 3]
    in_query[40:] += 0.3
    match = dataclasses.replace(a_match(Verdict.FOUND, 40, transform), n_query=50)
    return FruitCloud(in_query), FruitCloud(in_map), match


def test_tells_found_new_missed_and_out_of_view_apart() -> None:
    query, map, match = moved_row()
    fates = Fates.of(query, map, match)
    assert (len(fates.found), len(fates.new)) == (40, 10)
    assert len(fates.missed) + len(fates.elsewhere) == 20
    # What hangs far from everything that was seen was not in view.
    assert fates.elsewhere[:, 1].max() == map.positions[:, 1].max()
    np.testing.assert_allclose(fates.found - fates.was, np.tile([0.0, 0.0, 0.02], (40, 1)), atol=1e-9)


def test_draws_both_visits_in_one_frame_from_the_side_and_from_above() -> None:
    query, map, match = moved_row()
    fates = Fates.of(query, map, match)
    figure = draw_match(query, map, match, up_in_map=[0, 0, 1])
    side, plan = figure.axes
    drawn = points_of(figure)
    counts = {"found again": 40, "new": 10, "missed": len(fates.missed), "not in view": len(fates.elsewhere)}
    assert {name: len(points) for name, points in drawn.items()} == {f"{n} {name}": n for name, n in counts.items()}
    assert figure.get_suptitle() == "Found: 40 of 50 fruits seen again"
    assert [axes.get_ylabel() for axes in (side, plan)] == ["height (m)", "across the row (m)"]
    np.testing.assert_allclose(np.ptp(drawn["40 found again"][:, 1]), np.ptp(fates.was[:, 2]))
    assert side.get_aspect() == plan.get_aspect() == 1.0
    # Told apart without colours too.
    shapes = [artist.get_paths()[0].vertices.tobytes() for artist in side.collections if artist.get_label() in drawn]
    filled = [len(artist.get_facecolors()) for artist in side.collections if artist.get_label() in drawn]
    assert len(set(zip(shapes, filled, strict=True))) >= 3


def test_arrows_say_by_how_much_they_are_magnified() -> None:
    query, map, match = moved_row()
    side = draw_match(query, map, match, up_in_map=[0, 0, 1]).axes[0]
    (arrows,) = (artist for artist in side.collections if isinstance(artist, Quiver))
    (key,) = (artist for artist in side.get_children() if isinstance(artist, QuiverKey))
    (times,) = re.findall(r"drawn (\d+) times", key.label)
    np.testing.assert_allclose(arrows.U, 0.0, atol=1e-9)
    np.testing.assert_allclose(arrows.V, int(times) * 0.02, atol=1e-9)
    (length_cm,) = re.findall(r"moved by (\d+) cm", key.label)
    assert pytest.approx(int(times) * int(length_cm) / 100) == key.U


def test_arrows_end_inside_their_panels() -> None:
    query, map, match = moved_row()
    highest = int(query.positions[:40, 2].argmax())
    places = query.positions.copy()
    places[highest, 2] += 0.15  # and its arrow is longer than the margin
    figure = draw_match(FruitCloud(places), map, match, up_in_map=[0, 0, 1])
    for axes in figure.axes:
        for arrows in (artist for artist in axes.collections if isinstance(artist, Quiver)):
            ends = arrows.XY + np.stack([arrows.U, arrows.V], axis=1)
            for along, (low, high) in enumerate((axes.get_xlim(), axes.get_ylim())):
                assert low < ends[:, along].min()
                assert ends[:, along].max() < high


def test_trees_are_taken_from_the_map_or_found_and_said_to_be() -> None:
    query, map, match = moved_row()
    named = dataclasses.replace(map, extras={"tree": ("A",) * 30 + ("B",) * 29 + ("",)})
    texts = [text.get_text() for text in draw_match(query, named, match).axes[0].texts]
    assert texts == ["tree A", "tree B"]
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.normal(place, 0.25, 40) for place in (0.0, 2.0, 4.0)])
    row = np.column_stack([x, rng.uniform(0.0, 2.0, 120), rng.uniform(-0.4, 0.4, 120)])
    guessed = Trees.along(np.array([1.0, 0.0, 0.0]), FruitCloud(row), row)
    assert guessed.names is None
    np.testing.assert_allclose(guessed.places, [0.0, 2.0, 4.0], atol=0.2)
    hedge = np.column_stack([np.linspace(0, 8, 200), rng.uniform(0.0, 2.0, 200), rng.uniform(-0.4, 0.4, 200)])
    assert len(Trees.along(np.array([1.0, 0.0, 0.0]), FruitCloud(hedge), hedge).places) == 0


@pytest.mark.parametrize("n", [0, 1, 2])
def test_few_fruits_are_a_picture_too(n: int, tmp_path: Path) -> None:
    none = dataclasses.replace(a_match(Verdict.TOO_FEW, 0, None), n_query=n, n_map=n)
    save_picture(draw_match(np.zeros((n, 3)), np.zeros((n, 3)), none), tmp_path / "few.png")
    alone = dataclasses.replace(a_match(Verdict.FOUND, n, np.eye(4)), n_query=n, n_map=n)
    save_picture(draw_match(np.zeros((n, 3)), np.zeros((n, 3)), alone), tmp_path / "same.png")
    assert (tmp_path / "few.png").stat().st_size > 0


def test_only_the_clouds_that_were_matched_are_drawn() -> None:
    query, map, match = moved_row()
    for view in ("row", "lines"):
        with pytest.raises(PomonaError, match=r"^query: found 1 fruit, expected the 50 that were matched$"):
            draw_match(query.select([0]), map, match, view=view)
        with pytest.raises(PomonaError, match=r"^map: found 59 fruits, expected the 60 that were matched$"):
            draw_match(query, map.select(range(59)), match, view=view)


@pytest.mark.parametrize("up", ["a", 5, [0, 1], [0, 0, 0], [np.nan, 0, 1], np.eye(3)])
def test_a_vertical_that_is_no_direction_is_refused(up: object) -> None:
    with pytest.raises(PomonaError, match=r"^up_in_map: "):
        draw_match(*moved_row(), up_in_map=up)


def test_an_unknown_view_is_refused() -> None:
    with pytest.raises(PomonaError, match="view: found 'maze', expected one of row, lines"):
        draw_match(*moved_row(), view="maze")


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf", ".PNG"])
def test_writes_what_the_name_says(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"match{suffix}"
    save_picture(Figure(), str(path))
    starts = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}
    assert path.read_bytes().startswith(starts[suffix.lower()])


def test_refuses_a_name_that_is_no_picture(tmp_path: Path) -> None:
    with pytest.raises(PomonaError, match=r"match\.txt: found \.txt, expected a picture named \.png"):
        save_picture(Figure(), tmp_path / "match.txt")
    with pytest.raises(PomonaError, match="path: found None, expected the name of a file"):
        save_picture(Figure(), None)
    with pytest.raises(PomonaError, match="figure: found None, expected one of matplotlib"):
        save_picture(None, tmp_path / "none.png")
    assert list(tmp_path.iterdir()) == []
