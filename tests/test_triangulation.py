"""Fruits out of posed pictures of one camera: found once, where and as large as they are, without depth or metres."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pomona.reconstruction.picture_camera import PictureCamera
from pomona.triangulation import triangulated_fruits
from pomona.triangulation.box_evidence import BoxEvidence
from pomona.triangulation.hypotheses import Hypotheses
from pomona.triangulation.posed_boxes import PosedBoxes, PosedPictures
from posed_row import CENTRE_PX, FOCAL_PX, SIZE_PX, posed_row

CAMERA = PictureCamera(SIZE_PX, np.array([FOCAL_PX, FOCAL_PX]), CENTRE_PX, np.zeros(4))


def fruits_of(row, poses=None, ids=None):
    n = len(row.boxes_px)
    poses = row.camera_from_map if poses is None else poses
    return triangulated_fruits(poses, [CAMERA] * n, row.boxes_px, ids or [None] * n)


@pytest.fixture(scope="module")
def row():
    return posed_row(1)


@pytest.fixture(scope="module")
def tracked(row):
    return fruits_of(row)


def often_seen(row, least=5):
    counts = np.bincount(np.concatenate([np.array(one, int) for one in row.ids]), minlength=len(row.positions))
    return np.flatnonzero(counts >= least)


def test_every_fruit_that_is_seen_often_is_found_once_where_it_is(row, tracked):
    distances, rows = cKDTree(row.positions).query(tracked.cloud.positions)
    assert set(often_seen(row)) <= set(rows.tolist())
    assert len(set(rows.tolist())) == len(rows)
    assert np.median(distances) < 0.005
    assert distances.max() < 0.06


def test_each_box_goes_to_the_fruit_it_shows(row, tracked):
    _, rows = cKDTree(row.positions).query(tracked.cloud.positions)
    true = np.concatenate([np.array(one, int) for one in row.ids])
    given = tracked.fruits >= 0
    assert given.mean() > 0.95
    assert (rows[tracked.fruits[given]] == true[given]).mean() > 0.98


def test_sizes_and_covariances_are_those_of_the_errors(row, tracked):
    cloud = tracked.cloud
    _, rows = cKDTree(row.positions).query(cloud.positions)
    errors = cloud.positions - row.positions[rows]
    squared = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(cloud.covariances), errors)
    assert np.median(squared) < 2.4  # the median of chi-square with 3 degrees
    assert np.median(np.abs(cloud.diameters_m / row.diameters_m[rows] - 1)) < 0.06
    assert (cloud.n_views == np.bincount(tracked.fruits[tracked.fruits >= 0])).all()
    assert len(cloud.views) == cloud.n_views.sum()


def test_a_model_of_any_unit_and_frame_has_the_same_fruits(row, tracked):
    moved = fruits_of(row, row.camera_from_model)
    assert (moved.fruits == tracked.fruits).mean() > 0.99
    expected = tracked.cloud.transformed(row.model_from_map)
    _, rows = cKDTree(expected.positions).query(moved.cloud.positions)
    assert np.median(np.abs(moved.cloud.positions - expected.positions[rows])) < 1e-6
    assert np.median(np.abs(moved.cloud.diameters_m / expected.diameters_m[rows] - 1)) < 1e-6


def test_boxes_with_ids_are_the_fruits_they_name(row):
    named = fruits_of(row, ids=[tuple(f"apple {one}" for one in names) for names in row.ids])
    numbers = [int(name.split()[1]) for name in named.cloud.ids]
    off = np.linalg.norm(named.cloud.positions - row.positions[numbers], axis=1)
    assert set(often_seen(row, 3)) <= set(numbers)
    assert np.median(off) < 0.005


def test_directions_that_hardly_part_give_no_fruit(row):
    poses = np.repeat(row.camera_from_map[:1], 6, axis=0)
    poses[:, 0, 3] += 1e-4 * np.arange(6)
    still = triangulated_fruits(poses, [CAMERA] * 6, [row.boxes_px[0]] * 6, [None] * 6)
    assert len(still.cloud) == 0
    assert (still.fruits == -1).all()


def test_strangers_at_random_give_few_fruits():
    row = posed_row(2)
    rng = np.random.Generator(np.random.PCG64(3))
    corners = [rng.uniform((0, 0), (600, 440), (30, 2)) for _ in row.boxes_px]
    boxes = [np.concatenate([corner, corner + rng.uniform(20, 40, (30, 1))], axis=1) for corner in corners]
    found = triangulated_fruits(row.camera_from_map, [CAMERA] * len(boxes), boxes, [None] * len(boxes))
    assert len(found.cloud) < 10  # of 480 boxes


def test_no_boxes_give_no_fruits(row):
    n = len(row.boxes_px)
    found = triangulated_fruits(row.camera_from_map, [CAMERA] * n, [np.empty((0, 4))] * n, [None] * n)
    assert len(found.cloud) == 0


def said_of(place: np.ndarray, covariance: np.ndarray, diameter: float, boxes: PosedBoxes, area: float):
    """What each box of one picture says of a place, as the docs have it: one by one, without a search."""
    (x, y, z), sigma0, sigma1 = place, 0.25, 0.7
    slopes = np.array([[1 / z, 0, -x / z**2], [0, 1 / z, -y / z**2]])
    said = []
    for direction, half_sines, sigma in zip(boxes.directions, boxes.half_sines, boxes.sigmas, strict=True):
        spread = slopes @ covariance @ slopes.T + sigma**2 * np.eye(2)
        off = direction - np.array([x, y]) / z
        squared = off @ np.linalg.solve(spread, off)
        shown = 2 * max(np.hypot(x, z) * half_sines[0], np.hypot(y, z) * half_sines[1])
        ratio = np.log(shown / diameter)
        alike = np.log(sigma1 / sigma0) - ratio**2 / 2 * (1 / sigma0**2 - 1 / sigma1**2)
        near = -squared / 2 - np.log(2 * np.pi * np.sqrt(np.linalg.det(spread))) - np.log(len(boxes) / area)
        said.append(near + alike + np.log(0.6) if squared < 9 else -np.inf)
    return np.array(said)


def test_boxes_say_of_places_what_all_of_them_would_one_by_one(row):
    n = len(row.boxes_px)
    pictures, boxes = PosedPictures.of(row.camera_from_map, [CAMERA] * n), PosedBoxes.of(row.boxes_px, [CAMERA] * n)
    rng = np.random.Generator(np.random.PCG64(4))
    places = row.positions + rng.normal(0, 0.01, row.positions.shape)
    covariances = np.tile(np.diag([1e-4, 1e-4, 9e-4]), (len(places), 1, 1))
    asked = Hypotheses(
        np.zeros((len(places), 2), np.int64), places, covariances, row.diameters_m, np.zeros(len(places))
    )
    judge, rows, n_spoke = BoxEvidence(pictures, boxes), np.arange(len(places)), 0
    for picture in range(0, n, 5):
        heard = judge(asked, rows, np.full(len(rows), picture))
        own = np.flatnonzero(boxes.pictures == picture)
        low, high = np.split(pictures.corners[picture], 2)
        for place, gain, box in zip(rows, heard.gains, heard.boxes, strict=True):
            seen = pictures.rotations[picture] @ (places[place] - pictures.centres[picture])
            if not ((seen[:2] / seen[2] > low) & (seen[:2] / seen[2] < high)).all():
                assert (gain, box) == (0.0, -1)
                continue
            turned = pictures.rotations[picture] @ covariances[place] @ pictures.rotations[picture].T
            said = said_of(seen, turned, row.diameters_m[place], boxes.select(own), float(np.prod(high - low)))
            assert gain == pytest.approx(max(said.max(), np.log(0.4)), abs=1e-9)
            assert box == (own[said.argmax()] if said.max() > np.log(0.4) else -1)
            n_spoke += box >= 0
    assert n_spoke > 50


def test_boxes_where_a_lens_shows_nothing_are_of_no_fruit(row):
    wide = PictureCamera(SIZE_PX, np.array([FOCAL_PX, FOCAL_PX]), CENTRE_PX, np.array([-0.3, 0.0, 0.0, 0.0]))
    assert np.isnan(wide.directions(np.zeros((1, 2)))).all()
    assert np.isfinite(wide.edges()).all()
    n = len(row.boxes_px)
    corner = [np.vstack([boxes, [[1.0, 1.0, 30.0, 30.0]]]) for boxes in row.boxes_px]
    for names in (None, [tuple(map(str, [*ids, 999])) for ids in row.ids]):
        found = triangulated_fruits(row.camera_from_map, [wide] * n, corner, names or [None] * n)
        assert len(found.cloud) > 20
        assert np.isfinite(found.cloud.positions).all()
        assert (found.fruits[np.cumsum([len(boxes) for boxes in corner]) - 1] == -1).all()
        assert "999" not in (found.cloud.ids if names else ())
