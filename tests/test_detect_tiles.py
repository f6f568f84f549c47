"""Large pictures in overlapping tiles: every fruit once, whole."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import onnx_maker
from pomona import PomonaError
from pomona.detect.onnx import OnnxDetector
from pomona.detect.onnx.tiles import MAX_SHRINK, OVERLAP, lay_tiles, merge_tiles, read_tiling

INPUT = (64, 48)
PICTURE = (166, 86)
"""Three columns and two rows of tiles as large as the input: 64 (3 - 2 / 5) and 48 (2 - 1 / 5)."""

FRUITS = {
    "whole in one tile": (5, 5, 17, 16),
    "across the first border": (48, 12, 70, 30),
    "in four tiles": (98, 30, 122, 52),
    "inside a strip": (52, 34, 61, 42),
    "beside it, over the edge of the strip": (61, 34, 67, 42),
    "wider than a tile": (10, 55, 120, 66),
    "at the edge of the picture": (150, 70, 166, 86),
    "in the strip of the rows": (3, 39, 15, 47),
}
LEVELS = [20 * (row + 2) for row in range(len(FRUITS))]


def picture_of(fruits):
    picture = np.zeros((PICTURE[1], PICTURE[0], 3), np.uint8)
    for level, (xmin, ymin, xmax, ymax) in zip(LEVELS, fruits, strict=False):
        picture[ymin:ymax, xmin:xmax] = level
    return picture


def found_in(detector, picture):
    found = detector.detect(picture)
    assert np.allclose(found.scores, 0.9)
    return {tuple(box) for box in found.boxes_px.tolist()}, len(found)


@pytest.fixture
def model(tmp_path):
    return onnx_maker.grey_levels(tmp_path / "model.onnx", *INPUT, LEVELS)


def test_every_fruit_is_found_once_and_whole(model):
    detector = OnnxDetector.open(model, tiles="3x2")
    assert lay_tiles(PICTURE, INPUT, (3, 2))[0].corners_px == (0, 0, *INPUT)
    assert found_in(detector, picture_of(FRUITS.values())) == (set(FRUITS.values()), len(FRUITS))


@pytest.mark.parametrize("name", FRUITS)
def test_each_fruit_alone(model, name):
    detector = OnnxDetector.open(model, tiles="3x2")
    assert found_in(detector, picture_of([FRUITS[name]])) == ({FRUITS[name]}, 1)


def test_part_of_a_fruit_that_no_other_tile_confirms_is_dropped():
    tiles = np.array([[0, 0, 100, 80], [80, 0, 180, 80]], float)
    half, whole = [90.0, 10, 100, 30], [20.0, 10, 40, 30]
    boxes_px, scores = merge_tiles(
        np.array([half, whole]), np.array([0.9, 0.4]), tiles[[0, 0]], (180, 80), margin_px=2.0
    )
    assert boxes_px.tolist() == [whole]
    assert scores.tolist() == [0.4]
    # At the picture's own edge there is nothing more to see.
    at_edge = [0.0, 10, 15, 30]
    assert merge_tiles(np.array([at_edge]), np.array([0.9]), tiles[:1], (180, 80), 2.0)[0].tolist() == [at_edge]


def test_the_whole_box_counts_and_not_the_higher_score():
    tiles = np.array([[0, 0, 100, 80], [80, 0, 180, 80]], float)
    whole, part = [84.0, 10, 112, 30], [84.0, 10, 100, 30]
    boxes_px, scores = merge_tiles(np.array([part, whole]), np.array([0.9, 0.6]), tiles, (180, 80), 2.0)
    assert boxes_px.tolist() == [whole]
    assert scores.tolist() == [0.6]


def test_thousands_of_boxes_come_out_each_once():
    """As noise has them: compared one by one, box with box, they took minutes."""
    x, y = (40.0 * side.ravel() for side in np.meshgrid(np.arange(200), np.arange(50)))
    whole = np.column_stack([x, y, x + 30, y + 30])
    tiles = np.array([[0, 0, 4800, 2000], [3200, 0, 8000, 2000]], float)
    seen = [(whole[:, 0] >= tile[0]) & (whole[:, 2] <= tile[2]) for tile in tiles]
    boxes_px, parts = (
        np.concatenate([np.broadcast_to(side[n], whole.shape)[seen[n]] for n in (0, 1)])
        for side in ((whole, whole), tiles)
    )
    merged_px, _ = merge_tiles(boxes_px, np.full(len(boxes_px), 0.5), parts, (8000, 2000), margin_px=2.0)
    assert sorted(map(tuple, merged_px.tolist())) == sorted(map(tuple, whole.tolist()))


def test_two_boxes_of_one_tile_stay_two():
    tile = np.array([[0, 0, 100, 80]] * 2, float)
    pair = np.array([[10.0, 10, 40, 40], [12.0, 10, 42, 40]])
    assert len(merge_tiles(pair, np.array([0.9, 0.8]), tile, (180, 80), 2.0)[0]) == 2


@given(
    cells=st.sets(st.tuples(st.integers(0, 11), st.integers(0, 7)), min_size=1, max_size=30),
    tiling=st.tuples(st.integers(1, 4), st.integers(1, 3)),
    data=st.data(),
)
def test_a_perfect_detector_in_tiles_is_perfect(cells, tiling, data):
    """Fruits that do not overlap, seen by each tile as far as it reaches: all of them come out, each once, exact."""
    sides = st.integers(8, 40)
    fruits = []
    for column, row in sorted(cells):
        x, y = 40 * column, 40 * row
        width, height = data.draw(sides), data.draw(sides)
        fruits.append((x, y, x + width, y + height))
    size_px, tiles = (480, 320), lay_tiles((480, 320), (100, 100), tiling)
    seen = [
        (np.clip(fruit, [t.xmin, t.ymin] * 2, [t.xmax, t.ymax] * 2), t.corners_px)
        for t in tiles
        for fruit in fruits
        if fruit[0] < t.xmax and fruit[2] > t.xmin and fruit[1] < t.ymax and fruit[3] > t.ymin
    ]
    boxes_px, parts = (np.array(side, float) for side in zip(*seen, strict=True))
    merged_px, scores = merge_tiles(boxes_px, np.full(len(seen), 0.5), parts, size_px, margin_px=2.0)
    assert sorted(map(tuple, merged_px.tolist())) == sorted(fruits)
    assert len(scores) == len(fruits)


@given(
    width=st.integers(1, 5000),
    height=st.integers(1, 5000),
    tiling=st.none() | st.tuples(st.integers(1, 6), st.integers(1, 6)),
)
def test_tiles_cover_the_picture_and_overlap(width, height, tiling):
    tiles = lay_tiles((width, height), (640, 480), tiling)
    columns = sorted({(tile.xmin, tile.xmax) for tile in tiles})
    assert columns[0][0] == 0
    assert columns[-1][1] == width
    side = columns[0][1]
    assert all(high - low == side for low, high in columns)
    overlaps = [high - low for (_, high), (low, _) in pairwise(columns)]
    assert all(overlap >= OVERLAP * side - 2 for overlap in overlaps)  # to whole pixels
    assert tiling is None or len(columns) <= tiling[0]
    if tiling is None:
        assert side <= MAX_SHRINK * 640
        assert len(tiles) == 1 or max(width / 640, height / 480) > MAX_SHRINK


def test_tiles_when_the_network_would_see_too_little(model):
    # Full HD in a network of 640x640: two tiles of 1067x1080, each at 0.59 of its size; in one of 1280x1280 none.
    assert [tile.corners_px for tile in lay_tiles((1920, 1080), (640, 640), None)] == [
        (0, 0, 1067, 1080),
        (853, 0, 1920, 1080),
    ]
    assert len(lay_tiles((1920, 1080), (1280, 1280), None)) == 1
    assert len(lay_tiles((1280, 720), (640, 640), None)) == 1
    assert len(lay_tiles((3840, 2160), (640, 640), None)) == 8
    assert OnnxDetector.open(model).tiling is None


def test_settings_for_tiles():
    assert read_tiling("auto") is None
    assert read_tiling("off") == (1, 1)
    assert read_tiling("3x2") == (3, 2)
    for wrong in ("", "3", "0x2", "3x", "on", "1000x1"):
        with pytest.raises(PomonaError, match=r"expected auto, off, or columns x rows, 1 to 99 each, as 3x2"):
            read_tiling(wrong)
