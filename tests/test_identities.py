"""Who is who from all visits at once: evidence for and against, and what visits do not see."""

from dataclasses import replace
from datetime import date, timedelta
from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pomona import _core
from pomona.identity import Conclusion, SeenVisit, VisitPair, conclude
from pomona.identity.links import links_of
from pomona.identity.lives import SHARE_FALSE
from pomona.identity.looks import quantile_of_rows
from pomona.identity.near_fruits import AskedPlaces, NearFruits
from pomona.identity.places import looked_at_by_cameras, towards_camera
from pomona.identity.sizes import size_log_odds
from pomona.identity.visits import all_sights
from pomona.orchard.fruit_ids import Change, changes_between, ids_of_clusters

SURE, DOUBTED = 0.9999, 0.9


def visit(number: int, positions: np.ndarray, **about: object) -> SeenVisit:
    day = date(2024, 6, 1) + timedelta(days=14 * number)
    unknown = np.full(len(positions), np.nan)
    return SeenVisit((day.isoformat(), ""), float(day.toordinal()), positions, unknown, **about)  # type: ignore[arg-type]


def pair(first: int, second: int, rows: list[tuple[int, int]], probability: float = SURE) -> VisitPair:
    return VisitPair(
        first, second, np.eye(4), 100.0, np.array(rows, np.int64).reshape(-1, 2), np.full(len(rows), probability)
    )


def clusters(counts: list[int], pairs: list[VisitPair]) -> list[int]:
    visits = [visit(number, np.zeros((count, 3))) for number, count in enumerate(counts)]
    sights = all_sights(visits)
    links = links_of(sights, pairs)
    return _core.contracted(
        sights.visits, len(visits), links.sights, links.log_odds, links.matched, links.against
    ).tolist()


def test_links_join_through_all_visits() -> None:
    assert clusters([1, 1, 1], [pair(0, 1, [(0, 0)]), pair(1, 2, [(0, 0)])]) == [0, 0, 0]


def test_two_of_one_visit_never_join() -> None:
    pairs = [pair(0, 1, [(0, 0)]), pair(1, 2, [(0, 0)], DOUBTED), pair(0, 2, [(1, 0)])]
    labels = clusters([2, 1, 1], pairs)
    assert labels[0] != labels[1]
    assert labels[0] == labels[2]
    # Visits 0 and 2 left the first of the one and that of the other apart.
    assert labels[1] == labels[3]


def test_a_pair_that_is_hardly_likelier_than_a_neighbour_is_none() -> None:
    assert clusters([1, 1], [pair(0, 1, [(0, 0)], 0.55)]) == [0, 1]
    assert clusters([1, 1], [pair(0, 1, [(0, 0)], 0.65)]) == [0, 0]


def test_what_matched_visits_leave_unpaired_speaks_against() -> None:
    doubted = [pair(0, 1, [(0, 0)]), pair(1, 2, [(0, 0)], DOUBTED)]
    assert clusters([1, 1, 1], doubted) == [0, 0, 0]
    # Visits 0 and 2 were found in one another, and did not pair the two.
    assert clusters([1, 1, 1], [*doubted, pair(0, 2, [])]) == [0, 0, 1]


@pytest.mark.parametrize(("left_out", "apart"), [(1, True), (30, False)])
def test_a_match_that_leaves_out_much_of_what_others_pair_speaks_little_against(left_out: int, apart: bool) -> None:
    """As of visits from two sides of a row; who is the last of forty its match with a third visit doubts."""
    rows = [(row, row) for row in range(40)]
    probabilities = np.where(np.arange(40) == 39, DOUBTED, SURE)
    doubted = replace(pair(1, 2, rows), probabilities=probabilities)
    labels = np.reshape(clusters([40] * 3, [pair(0, 1, rows), doubted, pair(0, 2, rows[: 40 - left_out])]), (3, 40))
    assert (labels[:, :39] == np.arange(39)).all()
    assert labels[0, 39] == labels[1, 39]
    assert (labels[2, 39] != labels[1, 39]) == apart


def test_sizes_that_grew_as_all_did_speak_for_one_fruit() -> None:
    rng = np.random.default_rng(1)
    sizes = rng.normal(np.log(0.04), 0.08, 60)
    later = sizes + np.log(1.5) + rng.normal(0, 0.02, 60)
    later[0], later[1] = sizes[0] + np.log(1.5) + 0.3, np.nan
    log_odds = size_log_odds((sizes, later), (sizes, later), np.full(60, SURE))
    assert log_odds[0] == -4.0
    assert log_odds[1] == 0.0
    assert np.median(log_odds[2:]) > 1.0


@pytest.mark.parametrize("share", [0.1, 0.33])
def test_fruitlets_that_will_drop_are_the_same_though_they_hardly_grow(share: float) -> None:
    """Sizes are not to part what grows slower than the others, where some do; what shrank is still no fruit of them."""
    rng = np.random.default_rng(2)
    slow = np.arange(200) < 200 * share
    sizes = rng.normal(np.log(0.02), 0.1, 200)
    later = sizes + np.where(slow, rng.uniform(0.0, 0.2, 200), 0.4) + rng.normal(0, 0.02, 200)
    later[-1] = sizes[-1] - 0.2
    log_odds = size_log_odds((sizes, later), (sizes, later), np.full(200, SURE))
    assert log_odds[slow].mean() > -1.5
    assert np.median(log_odds[~slow]) > 1.0
    assert log_odds[-1] == -4.0


def test_where_all_grow_alike_a_slow_one_is_none_of_them() -> None:
    rng = np.random.default_rng(2)
    sizes = rng.normal(np.log(0.02), 0.1, 200)
    later = sizes + 0.4 + rng.normal(0, 0.02, 200)
    later[0] = sizes[0] + 0.1
    assert size_log_odds((sizes, later), (sizes, later), np.full(200, SURE))[0] < -3.0
    # Sizes in another unit, by mistake, are no growth of any.
    assert np.isfinite(size_log_odds((sizes, later), (sizes, later + np.eye(200)[0] * 6.9), np.full(200, SURE))).all()


def test_an_id_goes_with_most_of_its_sights_and_none_is_given_twice() -> None:
    labels = np.array([0, 0, 1, 2, 2, 3])
    before = np.array([5, 5, 5, 7, 8, 0])
    ids = ids_of_clusters(labels, before, last_id=9)
    assert ids.tolist() == [5, 10, 7, 11]
    assert changes_between(before, ids[labels], last_id=9) == [Change("split", 5, 10, 1), Change("joined", 8, 7, 1)]
    swapped = changes_between(np.array([1, 1, 2, 2]), np.array([1, 2, 2, 2]), last_id=2)
    assert swapped == [Change("moved", 1, 2, 1)]


# What visits do not see.


def row(n_fruits: int) -> np.ndarray:
    return np.random.default_rng(3).uniform((0, 0, 0.5), (6, 0.8, 2.5), (n_fruits, 3))


def season(shows: np.ndarray, **about: object) -> Conclusion:
    """Fruits that visits see as `shows` says, (fruits, visits), all of them recognised."""
    places = row(len(shows))
    rows = [np.flatnonzero(seen) for seen in shows.T]
    visits = [visit(number, places[own], **about) for number, own in enumerate(rows)]
    pairs = []
    for first in range(len(rows)):
        for second in range(first + 1, len(rows)):
            _, one, other = np.intersect1d(rows[first], rows[second], return_indices=True)
            pairs.append(pair(first, second, list(zip(one.tolist(), other.tolist(), strict=True))))
    return conclude(visits, pairs, np.tile(np.eye(4), (len(visits), 1, 1)), range(len(visits)))


def of_fruits(shows: np.ndarray, conclusion: Conclusion) -> list[int]:
    """The conclusion's number of each fruit that was seen."""
    number_of = np.full(len(shows), -1)
    for own, labels in zip(shows.T, np.split(conclusion.labels, conclusion.sights.starts[1:]), strict=True):
        number_of[own] = labels
    return number_of.tolist()


def test_what_was_thinned_is_gone_and_what_leaves_hide_is_not() -> None:
    rng = np.random.default_rng(5)
    shows = rng.random((300, 6)) < np.where(np.arange(300) % 10 == 0, 0.5, 0.97)[:, None]
    thinned = np.arange(300) % 3 == 1
    shows[thinned, 2:] = False
    conclusion = season(shows)
    states = [conclusion.states[fruit] if fruit >= 0 else "never" for fruit in of_fruits(shows, conclusion)]
    said = np.array([state == "gone" for state in states])
    known = np.array([state != "never" for state in states])
    assert said[thinned & known].mean() > 0.92
    assert said[~thinned & known].mean() < 0.02
    # Whatever was hidden before, what the last visit sees hangs there.
    assert {states[fruit] for fruit in np.flatnonzero(shows[:, 5])} <= {"seen", "new"}


def test_a_false_point_ages_out() -> None:
    shows = np.random.default_rng(7).random((200, 6)) < 0.95
    shows[0] = [False, True, False, False, False, False]
    shows[1] = [False, False, False, False, False, True]
    conclusion = season(shows)
    number_of = of_fruits(shows, conclusion)
    assert conclusion.states[number_of[0]] in ("missed", "gone")
    # Not surer than that: a fruit deep in the leaves may be seen once and missed four times, too.
    assert conclusion.lives.false[number_of[0]] > 8 * SHARE_FALSE
    assert conclusion.states[number_of[1]] == "new"
    assert conclusion.lives.false[number_of[2]] == 0.0


def test_a_fruit_is_not_missed_where_nobody_looked() -> None:
    shows = np.ones((300, 4), bool)
    far = row(300)[:, 0] > 4.0
    shows[far, 1:] = False
    conclusion = season(shows)
    numbers = np.array(of_fruits(shows, conclusion))
    assert not conclusion.looks.in_view[numbers[row(300)[:, 0] > 4.6], 1:].any()
    assert "gone" not in {conclusion.states[fruit] for fruit in numbers[row(300)[:, 0] > 4.6]}


def test_the_order_of_visits_in_the_map_changes_no_frame_but_the_first() -> None:
    shows = np.random.default_rng(9).random((60, 3)) < 0.9
    places = row(60)
    rows = [np.flatnonzero(seen) for seen in shows.T]
    visits = [visit(number, places[own]) for number, own in enumerate(rows)]
    shift = np.eye(4)
    shift[0, 3] = 0.25
    pairs = [replace(pair(0, 1, [(0, 0)]), first_from_second=shift), replace(pair(1, 2, []), first_from_second=shift)]
    for keepers in permutations(range(3)):
        frames = conclude(visits, pairs, np.tile(np.eye(4), (3, 1, 1)), keepers).frames
        np.testing.assert_array_equal(frames[keepers[0]], np.eye(4))
        np.testing.assert_allclose(frames[1, 0, 3] - frames[0, 0, 3], 0.25)
        np.testing.assert_allclose(frames[2, 0, 3] - frames[1, 0, 3], 0.25)


def looking_along_y(x: float) -> np.ndarray:
    """A camera at -2 m that looks across the row."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)
    pose[:3, 3] = (x, -2.0, 1.5)
    return pose


def test_cameras_tell_where_a_visit_looked_and_from_where() -> None:
    places = row(200)
    cameras = np.array([looking_along_y(x) for x in np.arange(0.0, 3.0, 0.25)])
    own = places[places[:, 0] < 3.0]
    seeing = visit(0, own, cameras=cameras)
    asked = np.array([[1.5, 0.4, 1.5], [5.5, 0.4, 1.5], [1.5, -2.5, 1.5]])
    of_visit = AskedPlaces(asked, NearFruits(own), np.full(3, -1))
    by_cameras = looked_at_by_cameras(seeing, of_visit)
    assert by_cameras is not None
    assert by_cameras.tolist() == [True, False, False]
    towards = towards_camera(seeing, of_visit, np.eye(3))
    np.testing.assert_allclose(towards[0], (0, -1, 0), atol=1e-9)


@pytest.mark.parametrize("roll", [0.0, 90.0], ids=["lying", "standing"])
def test_fruits_high_and_low_say_nothing_of_what_lies_beyond_the_end_of_a_drive(roll: float) -> None:
    places = row(400)
    cameras = np.array([looking_along_y(x) for x in np.arange(0.0, 3.01, 0.12)])
    cameras[:, :3, :3] = cameras[:, :3, :3] @ Rotation.from_euler("z", roll, degrees=True).as_matrix()
    own = places[places[:, 0] < 3.3]
    assert np.abs(own[:, 2] - 1.5).max() > 0.9
    beyond = np.array([[x, 0.2, 1.5] for x in (2.9, 3.2, 3.6, 4.2)])
    of_visit = AskedPlaces(beyond, NearFruits(own), np.full(4, -1))
    by_cameras = looked_at_by_cameras(visit(0, own, cameras=cameras), of_visit)
    assert by_cameras is not None
    assert by_cameras.tolist() == [True, True, False, False]


def test_lines_of_sight_tell_the_side_where_there_are_no_cameras() -> None:
    places = row(200)
    rays = places - [0, -2.0, 1.5] - places * [1, 0, 0]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    covariances = 1e-4 * (np.eye(3) + 3.0 * rays[:, :, None] * rays[:, None])
    seeing = visit(0, places, covariances=covariances)
    of_visit = AskedPlaces(places[:20], NearFruits(places), np.arange(20))
    towards = towards_camera(seeing, of_visit, np.eye(3))
    assert (towards[:, 1] < -0.7).all()
    blind = visit(0, places, covariances=np.tile(1e-4 * np.eye(3), (200, 1, 1)))
    assert np.isnan(towards_camera(blind, of_visit, np.eye(3))).all()


def test_places_of_own_fruits_are_asked_as_all_others() -> None:
    fruits = NearFruits(row(60))
    places = np.concatenate([fruits.positions[[4, 9]], fruits.positions[:3] + 0.07])
    told = AskedPlaces(places, fruits, np.array([4, 9, -1, -1, -1]))
    for found, expected in zip(told.nearest, fruits.nearest(places, 25), strict=True):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(fruits.spacings_m(4), fruits.nearest(fruits.positions, 4)[0][:, 3])
    assert np.isinf(NearFruits(places).spacings_m(6)).all()


@pytest.mark.parametrize("n_around", [1, 2, 7, 25])
def test_the_quantile_of_rows_is_that_of_numpy(n_around: int) -> None:
    counts = np.random.default_rng(n_around).integers(0, 9, (300, n_around))
    for share in (0.85, 0.5, 0.1):
        np.testing.assert_array_equal(quantile_of_rows(counts, share), np.quantile(counts, share, axis=1))


@pytest.mark.parametrize("n_visits", [1, 2])
def test_few_visits_conclude_too(n_visits: int) -> None:
    conclusion = season(np.ones((5, n_visits), bool))
    assert conclusion.states == ["seen"] * 5
    assert np.isnan(conclusion.probabilities).sum() == 5
