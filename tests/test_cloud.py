"""The struct of arrays itself: what it takes, how rows are picked, how it is moved."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pomona import FruitCloud, PomonaError, Views


def test_a_list_of_points_is_a_cloud() -> None:
    cloud = FruitCloud([[0, 1, 2], [3, 4, 5]])  # type: ignore[arg-type]
    assert len(cloud) == 2
    assert cloud.positions.dtype == np.float64
    assert cloud.label(1) == "1"


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ({"positions": np.zeros((3, 2))}, "positions: found shape (3, 2), expected (N, 3)"),
        ({"positions": [[0, 0, 0], [0, np.inf, 0]]}, "positions: row 1 is NaN or infinite, expected finite numbers"),
        ({"ids": ("a",)}, "ids: found 1 values, expected 2, one a fruit"),
        ({"ids": ("a", "a")}, "ids: rows 0 and 1 are both 'a', expected each id once"),
        ({"diameters_m": [0.07, -0.07]}, "diameters_m: row 1 is -0.07, expected positive metres or NaN"),
        ({"diameters_m": ["big", "small"]}, "diameters_m: expected an array of float64"),
        ({"diameters_m": np.array([True, False])}, "diameters_m: found bool, expected an array of float64"),
        (
            {"positions": np.zeros((2, 3), "datetime64[s]")},
            "positions: found datetime64[s], expected an array of float64",
        ),
        ({"covariances": np.zeros((2, 3))}, "covariances: found shape (2, 3), expected (2, 3, 3)"),
        ({"covariances": [np.eye(3), -np.eye(3)]}, "covariances: row 1 is not symmetric positive semi-definite"),
        ({"covariances": [np.eye(3), np.tri(3)]}, "covariances: row 1 is not symmetric positive semi-definite"),
        (
            {"covariances": [np.eye(3), [[1, 0.9, 0.9], [0.9, 1, -0.9], [0.9, -0.9, 1]]]},
            "covariances: row 1 is not symmetric positive semi-definite",
        ),
        ({"ids": ("a", "")}, "ids: row 1 is empty, expected a name for every fruit or no ids"),
        ({"ids": ("a", "\ud800")}, r"ids: row 1 is '\ud800', expected characters of Unicode"),
        ({"ids": 5}, "ids: found 5, expected 2 values, one a fruit"),
        ({"n_views": [1]}, "n_views: found shape (1), expected (2)"),
        ({"n_views": [1, -1]}, "n_views: row 1 is -1, expected a number of frames"),
        ({"n_views": [1, 2**60]}, f"n_views: row 1 is {2**60}, expected a number of frames"),
        ({"views": [1, 2]}, "views: found [1, 2], expected pomona.Views"),
        ({"views": Views(np.array([0]), np.array([2]))}, "views.fruits: a sighting names a row outside 0..1"),
        ({"extras": {"note": ("a",)}}, "note: found 1 values, expected 2, one a fruit"),
        ({"extras": {"note": ("\udcff", "a")}}, r"note: row 0 is '\udcff', expected characters of Unicode"),
        ({"extras": {"\ud800": "ab"}}, r"extras: found the name '\ud800', expected characters of Unicode"),
        ({"extras": {5: "ab"}}, "extras: found the name 5, expected text"),
        ({"extras": ["note"]}, "extras: found ['note'], expected a mapping of names to columns"),
    ],
)
def test_refuses_in_one_line(wrong: dict[str, object], line: str) -> None:
    with pytest.raises(PomonaError) as caught:
        FruitCloud(**{"positions": np.zeros((2, 3)), **wrong})  # type: ignore[arg-type]
    assert str(caught.value) == line


def test_covariances_may_be_flat() -> None:
    """Along one ray, in one plane, or none at all."""
    ray = np.array([0.6, 0.8, 0.0])
    flat = [np.outer(ray, ray), np.diag([1.0, 1.0, 0.0]), np.zeros((3, 3))]
    assert len(FruitCloud(np.zeros((3, 3)), covariances=np.array(flat))) == 3


def test_views_of_unequal_length_are_refused() -> None:
    with pytest.raises(PomonaError, match=r"views.fruits: found shape \(1\), expected \(2\)"):
        Views(frames=np.array([1, 2]), fruits=np.array([1]))


def test_select_takes_rows_in_order_with_their_sightings(full_cloud: FruitCloud) -> None:
    cloud = full_cloud
    picked = cloud.select([2, 0])
    assert picked.ids == ("apple 2", "apple 0")
    assert picked.extras["note"] == ("c", "a")
    np.testing.assert_array_equal(picked.positions, cloud.positions[[2, 0]])
    assert picked.views is not None
    np.testing.assert_array_equal(picked.views.frames, [4, 4, 9])
    np.testing.assert_array_equal(picked.views.fruits, [1, 0, 0])


def test_select_takes_a_mask_and_nothing(full_cloud: FruitCloud) -> None:
    cloud = full_cloud
    assert cloud.select(np.arange(6) > 3).ids == ("apple 4", "apple 5")
    assert len(cloud.select([])) == 0


def test_select_refuses_a_row_twice(full_cloud: FruitCloud) -> None:
    with pytest.raises(PomonaError, match="a row is named twice"):
        full_cloud.select([1, 1])


@pytest.mark.parametrize("rows", [[6], "a", None, 2, [0.5], [[0, 1]], [[0], [1, 2]], [True, False]])
def test_select_refuses_what_are_no_rows(full_cloud: FruitCloud, rows: object) -> None:
    with pytest.raises(PomonaError, match=r"^select: found .*, expected numbers of 6 rows, or a mask of them$"):
        full_cloud.select(rows)  # type: ignore[arg-type]


def test_halves_of_one_character_in_two_texts_are_no_character() -> None:
    with pytest.raises(PomonaError, match="ids: row 0 is"):
        FruitCloud(np.zeros((2, 3)), ids=("\ud83c", "\udf4e"))
    assert FruitCloud(np.zeros((1, 3)), ids=("\U0001f34e",)).ids == ("\U0001f34e",)


@pytest.mark.parametrize("name", [None, 5, ["fruits.csv"]])
def test_what_names_no_file_is_our_error(full_cloud: FruitCloud, name: object) -> None:
    for use in (FruitCloud.read, full_cloud.write):
        with pytest.raises(PomonaError, match=r"^path: found .*, expected the name of a file$"):
            use(name)  # type: ignore[operator]


@given(scale=st.floats(0.1, 10.0), angle_rad=st.floats(-3.1, 3.1))
def test_transformed_turns_scales_and_moves(full_cloud: FruitCloud, scale: float, angle_rad: float) -> None:
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    rotation = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    map_from_query = np.eye(4)
    map_from_query[:3, :3] = scale * rotation
    map_from_query[:3, 3] = (1, 2, 3)
    cloud = full_cloud
    moved = cloud.transformed(map_from_query)
    np.testing.assert_allclose(moved.positions, scale * cloud.positions @ rotation.T + (1, 2, 3), atol=1e-12)
    assert moved.covariances is not None
    assert cloud.covariances is not None
    # The volume of the error ellipsoid grows with the sixth power of the scale, whatever the rotation.
    np.testing.assert_allclose(np.linalg.det(moved.covariances), scale**6 * np.linalg.det(cloud.covariances), rtol=1e-6)
    assert moved.diameters_m is not None
    np.testing.assert_allclose(moved.diameters_m[0], scale * 0.07)
    back = moved.transformed(np.linalg.inv(map_from_query))
    np.testing.assert_allclose(back.positions, cloud.positions, atol=1e-9)


def test_what_was_checked_stays_so_whatever_becomes_of_the_arrays() -> None:
    """A robot reads every frame into the same memory."""
    given, sizes_m = np.arange(12.0).reshape(4, 3), np.full(4, 0.07)
    cloud = FruitCloud(given, diameters_m=sizes_m)
    part = FruitCloud(given[1:3])
    given[:], sizes_m[:] = np.nan, -1.0
    assert cloud.positions.tolist() == np.arange(12.0).reshape(4, 3).tolist()
    assert part.positions.tolist() == [[3, 4, 5], [6, 7, 8]]
    assert cloud.diameters_m is not None
    assert cloud.diameters_m.tolist() == [0.07] * 4
    with pytest.raises(ValueError, match="read-only"):
        cloud.positions[0] = 0.0


def test_an_empty_list_is_a_cloud_without_fruits() -> None:
    assert FruitCloud([]).positions.shape == (0, 3)  # type: ignore[arg-type]
