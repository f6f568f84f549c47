"""What the core is called with is looked at where it comes in: a wrong argument is a ValueError, never a panic."""

from types import SimpleNamespace

import numpy as np
import pytest

from pomona import _core

HEIGHT, WIDTH = 48, 64
PICTURE = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
BOXES_PX = np.array([[10.0, 10.0, 30.0, 30.0], [40.0, 20.0, 60.0, 40.0]])


def camera(**changes):
    optics = {"fx": 60.0, "fy": 60.0, "cx": 32.0, "cy": 24.0, "baseline_m": 0.12}
    return SimpleNamespace(**{"width": WIDTH, "height": HEIGHT, **optics, **changes})


def read_pair(seen_by=None, nearest_m=0.3):
    shifted = np.ascontiguousarray(np.roll(PICTURE, -5, axis=1))
    return _core.read_pair(PICTURE, shifted, BOXES_PX, seen_by or camera(), nearest_m=nearest_m)


@pytest.mark.parametrize("number", [np.nan, np.inf, 0.0, -1.0])
def test_a_pair_needs_numbers_above_0(number):
    with pytest.raises(ValueError, match=r"nearest_m: found .*, expected a finite number above 0"):
        read_pair(nearest_m=number)
    with pytest.raises(ValueError, match=r"camera: found baseline_m .*, expected a finite number above 0"):
        read_pair(camera(baseline_m=number))
    for name in ("fx", "fy"):
        with pytest.raises(ValueError, match="camera: found"):
            read_pair(camera(**{name: number}))


@pytest.mark.parametrize(("baseline_m", "nearest_m"), [(1e298, 0.3), (1e7, 1e-9), (1e-11, 1e300), (0.12, 5e-324)])
def test_a_pair_of_an_absurd_baseline_is_searched_no_wider_than_its_pictures(baseline_m, nearest_m):
    depth_m, fruits = read_pair(camera(baseline_m=baseline_m), nearest_m)
    assert depth_m.shape == (HEIGHT, WIDTH)
    assert fruits.shape == (len(BOXES_PX), 3)


def test_a_camera_is_finite():
    depth_m, sources = np.full((HEIGHT, WIDTH), 1.5, np.float32), np.full((len(BOXES_PX), 3), np.nan)
    for name in ("fx", "cx", "cy"):
        with pytest.raises(ValueError, match="camera: found"):
            _core.lift(depth_m, BOXES_PX, sources, camera(**{name: np.nan}))


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_codes_are_of_finite_places(number):
    positions = np.random.default_rng(0).normal(size=(12, 3))
    positions[7, 1] = number
    with pytest.raises(ValueError, match="positions: row 7 is NaN or infinite"):
        _core.describe(positions, 4, 8)


def test_two_pictures_need_a_baseline():
    with pytest.raises(ValueError, match="camera: found no baseline_m, expected one of a stereo pair"):
        read_pair(camera(baseline_m=None))


SHEARED = np.eye(4) + np.eye(4, k=1)


@pytest.mark.parametrize("pose", [SHEARED, 1.1 * np.eye(4), np.full((4, 4), np.nan)], ids=["sheared", "scaled", "nan"])
def test_every_pose_is_looked_at_where_it_comes_in(pose):
    told = "session_from_camera: found a matrix that does not turn and move"
    with pytest.raises(ValueError, match=told):
        adjusted(pose[None])
    places = (np.zeros((0, 3)), np.zeros((0, 3, 3)))
    with pytest.raises(ValueError, match=told):
        _core.rejoin(places, places, last=pose, step=[1.0, 0.0, 0.0], first=np.eye(4))


NOTHING_SEEN = {
    "poses": np.zeros(0, np.int64),
    "points": np.zeros(0, np.int64),
    "values": np.zeros((0, 3)),
    "whitenings": np.zeros((0, 3, 3)),
}


def adjusted(poses):
    return _core.adjust(poses, np.ones(len(poses), bool), np.zeros((0, 3)), places=NOTHING_SEEN, relative_poses=None)


def test_a_pose_crosses_the_border_to_the_last_bit():
    turned = np.eye(4)
    turned[:2, :2], turned[:3, 3] = [[0.8, -0.6], [0.6, 0.8]], [0.1, 1 / 3, 1e-9]
    np.testing.assert_array_equal(adjusted(turned[None])[0][0], turned)
    with pytest.raises(ValueError, match=r"poses: found an array of shape \[1, 3, 4\], expected \(F, 4, 4\)"):
        adjusted(turned[None, :3])


GREY = np.ascontiguousarray(PICTURE[..., 0])
POINTS = np.array([[20.0, 20.0], [40.0, 30.0]])


class Eyes:
    """Pictures in which nothing moves."""

    def __init__(self, follow=None, measure=None):
        self._follow, self._measure = follow, measure

    def follow(self, from_px, _):
        return (from_px, np.ones(len(from_px), bool)) if self._follow is None else self._follow

    def find_again(self):
        return np.zeros((0, 3)), np.zeros((0, 2))

    def measure(self, *_):
        if self._measure is not None:
            return self._measure
        x, y = np.meshgrid(np.arange(4.0, 60.0, 8.0), np.arange(4.0, 44.0, 8.0))
        return np.column_stack([x.ravel(), y.ravel(), 5.0 + 0.02 * x.ravel()])


def test_odometry_asks_eyes_and_believes_what_agrees():
    odometry = _core.Odometry(camera(), config="{}")
    pose, part, broken, lost, _, keyframe = odometry.take(Eyes())
    np.testing.assert_array_equal(pose, np.eye(4))
    assert (part, broken, lost, keyframe) == (0, None, None, True)
    pose, _, _, _, inliers, keyframe = odometry.take(Eyes())
    np.testing.assert_allclose(pose, np.eye(4), atol=1e-9)
    assert (inliers, keyframe) == (35, False)


def test_eyes_that_answer_something_else_are_a_value_error():
    odometry = _core.Odometry(camera(baseline_m=None), config="{}")
    with pytest.raises(ValueError, match="measure: found 2 columns, expected 3"):
        odometry.take(Eyes(measure=POINTS))
    odometry.take(Eyes())
    with pytest.raises(ValueError, match="follow: expected 35 places and whether each was found"):
        odometry.take(Eyes(follow=(POINTS, np.ones(2, bool))))
    with pytest.raises(AttributeError, match="find_again"):
        odometry.take(SimpleNamespace(follow=lambda start, _: (start, np.zeros(len(start), bool))))


def test_settings_of_odometry_are_looked_at():
    for kind in (lambda config: _core.Odometry(camera(), config=config), _core.Looking):
        with pytest.raises(ValueError, match=r"setting odometry\.pictures\.window_px: found 99, expected 3 to 15"):
            kind('{"odometry": {"pictures": {"window_px": 99}}}')


def test_points_are_followed_in_whole_pictures():
    looking = _core.Looking("{}")
    places, found = looking.follow([GREY], [GREY], POINTS, POINTS + 0.3)
    assert found.all()
    np.testing.assert_allclose(places, POINTS, atol=0.02)
    with pytest.raises(ValueError, match="expected: found 1 rows, expected 2"):
        looking.follow([GREY], [GREY], POINTS, POINTS[:1])
    nothing = np.zeros((0, 0), np.uint8)
    assert not looking.follow([nothing], [nothing], POINTS, POINTS)[1].any()
    assert not looking.follow([], [], POINTS, POINTS)[1].any()
    assert looking.corners([nothing], POINTS, 3).shape == (0, 2)
    assert looking.corners([], POINTS, 3).shape == (0, 2)


def test_disparities_are_looked_for_in_pairs_of_one_size():
    looking = _core.Looking("{}")
    found = looking.disparities([GREY], [np.roll(GREY, -4, axis=1)], POINTS, 9.0)
    np.testing.assert_array_equal(found, 4.0)
    assert np.isnan(looking.disparities([], [], POINTS, 9.0)).all()
    with pytest.raises(ValueError, match="left, right: expected pictures of the same sizes"):
        looking.disparities([GREY], [GREY[:, 1:].copy()], POINTS, 9.0)


def test_the_colour_of_a_box_is_the_median_of_its_middle():
    picture = np.random.default_rng(4).integers(0, 256, (40, 60, 3), np.uint8)
    colours, fruitness, fruit_px, _ = _core.look_of(
        picture, np.array([[10.0, 4.0, 30.0, 28.0], [-20.0, 36.0, 4.0, 50.0]])
    )
    expected = [np.median(picture[10:22, 15:25].reshape(-1, 3), axis=0), picture[39, 0]]
    np.testing.assert_array_equal(colours, np.array(expected).astype(np.uint8))
    assert fruitness.shape == fruit_px.shape == (2,)


def test_parts_need_a_covariance_for_each_place():
    pose = np.eye(4)
    with pytest.raises(ValueError, match="places: found another number of covariances"):
        _core.rejoin(
            (np.zeros((2, 3)), np.zeros((1, 3, 3))),
            (np.zeros((2, 3)), np.zeros((2, 3, 3))),
            last=pose,
            step=[1.0, 0.0, 0.0],
            first=pose,
        )
