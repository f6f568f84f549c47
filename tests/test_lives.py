"""What visits that looked and did not see say of fruits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import check_grad

from pomona.identity.first_views import N_BINS, N_SETTINGS, WIDTHS, ViewDensities
from pomona.identity.histories import HistoryOdds, histories_of
from pomona.identity.lives import MOST_WRONGLY_GONE, SHARE_FALSE, Lives, lives_of, states_of
from pomona.identity.local_shares import fruits_about, shares_of_places
from pomona.identity.looks import MISSES, Looks, visibility_classes

HIDDEN, FREE = 0.04, 0.9
"""Ranks of fruits deep in the leaves, and of those that hang free."""


def looks_at(seen, ranks=None, places=None):
    """Looks from one side at fruits that all visits had in view; ranks where frames are counted."""
    views = seen * (0.5 if ranks is None else np.asarray(ranks))
    counted = np.full(seen.shape[1], ranks is not None)
    no_side, emptied = np.full((*seen.shape, 3), np.nan), np.zeros(seen.shape)
    about = fruits_about(np.random.default_rng(0).random((len(seen), 3)) if places is None else places)
    everywhere = np.ones(seen.shape, bool)
    return Looks(seen, everywhere, views, no_side, counted, emptied, everywhere, about)


def fortnights(n_visits):
    return 14.0 * np.arange(n_visits)


def lives(seen, ranks=None, days=None, places=None):
    told = looks_at(seen, ranks, places)
    return lives_of(histories_of(told, fortnights(seen.shape[1]) if days is None else np.array(days)))


def row(rng, *, n_visits, hidden, false, persistent=False, n_fruits=600):
    """What visits see of a row, and which of it are fruits; false points are as many as a share of the fruits seen."""
    chances = 1.0 - (rng.beta(1.2 * hidden, 1.2 * (1.0 - hidden), n_fruits) if persistent else hidden)
    fruits = rng.random((n_fruits, n_visits)) < np.broadcast_to(chances, n_fruits)[:, None]
    fruits = fruits[fruits.any(axis=1)]
    points = np.repeat(np.arange(n_visits), np.rint(false * fruits.sum(axis=0)).astype(int))
    seen = np.concatenate([fruits, points[:, None] == np.arange(n_visits)])
    return seen, np.arange(len(seen)) < len(fruits)


def test_after_one_visit_its_fruits_are_fruits_but_for_the_usual_share():
    """Nobody has looked a second time: the visit says nothing but what is known of visits."""
    found = lives(np.ones((130, 1), bool))
    assert found.false == pytest.approx(np.full(130, SHARE_FALSE), abs=0.005)
    assert found.gone == pytest.approx(np.zeros(130), abs=1e-6)


@pytest.mark.parametrize("hidden", [0.2, 0.3, 0.45])
def test_two_visits_that_miss_fruits_of_one_another_do_not_make_them_false(hidden):
    """That as many hide explains it as well as that so many are false, and is no news."""
    seen, is_fruit = row(np.random.default_rng(2), n_visits=2, hidden=hidden, false=0.05)
    once = seen.sum(axis=1) == 1
    assert 1.0 - lives(seen).false[once].mean() == pytest.approx(is_fruit[once].mean(), abs=0.1)


@pytest.mark.parametrize("persistent", [False, True])
@pytest.mark.parametrize("false", [0.1, 0.3])
@pytest.mark.parametrize("n_visits", [5, 8])
def test_many_visits_tell_false_points_from_fruits_that_hide(n_visits, false, persistent):
    rng = np.random.default_rng(4)
    seen, is_fruit = row(rng, n_visits=n_visits, hidden=0.3, false=false, persistent=persistent)
    once = seen.sum(axis=1) == 1
    found = 1.0 - lives(seen).false
    assert found[once].mean() == pytest.approx(is_fruit[once].mean(), abs=0.15)
    assert (found[~once] == 1.0).all()


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3])
def test_the_share_of_false_points_is_that_of_fruits_seen_alone_beyond_those_that_hide(share):
    rng = np.random.default_rng(3)
    real = rng.random((1000, 3)) > 0.2
    real = real[real.any(axis=1)]
    false = np.eye(3, dtype=bool)[rng.integers(0, 3, round(share * 800 * 3))]
    seen = np.concatenate([real, false])
    found = lives(seen).false
    expected = len(false) / seen.sum()
    assert found.sum() / seen.sum() == pytest.approx(expected, abs=0.05)
    assert not found[seen.sum(axis=1) > 1].any()


def test_a_visit_to_a_part_of_the_row_says_nothing_of_the_others():
    """False points are spread over what the visit looked at, and so are its fruits."""
    rng = np.random.default_rng(6)
    seen, is_fruit = row(rng, n_visits=6, hidden=0.25, false=0.1, n_fruits=900)
    in_view = np.ones(seen.shape, bool)
    in_view[::2, -1] = False
    half = looks_at(seen & in_view)
    kept = half.seen.any(axis=1)
    half = replace(looks_at(half.seen[kept]), in_view=in_view[kept])
    found = lives_of(histories_of(half, fortnights(6))).false
    once = half.seen.sum(axis=1) == 1
    assert found[once].mean() == pytest.approx(1.0 - is_fruit[kept][once].mean(), abs=0.1)


def uneven_row(rng, *, false, hidden, n_fruits=900):
    """What visits of a row see, each with its own share of false points, of fruits of which some hide more."""
    chances = 1.0 - rng.beta(1.3, 1.3 * (1.0 / hidden - 1.0), n_fruits)
    fruits = rng.random((n_fruits, len(false))) < chances[:, None]
    fruits = fruits[fruits.any(axis=1)]
    points = np.repeat(np.arange(len(false)), np.rint(np.array(false) * fruits.sum(axis=0)).astype(int))
    seen = np.concatenate([fruits, points[:, None] == np.arange(len(false))])
    return seen, np.arange(len(seen)) < len(fruits)


@pytest.mark.parametrize("false", [(0.04, 0.04, 0.04, 0.04, 0.4), (0.04, 0.04, 0.04, 0.4, 0.04)])
def test_one_visit_may_have_far_more_false_points_than_the_others(false):
    """Hundreds of points appear at once where the visits before saw none, and nothing else that hid."""
    seen, is_fruit = uneven_row(np.random.default_rng(21), false=false, hidden=0.15)
    worst = int(np.argmax(false))
    found, once = lives(seen).false, seen.sum(axis=1) == 1
    assert found[once & seen[:, worst]].mean() > 0.75
    assert found.sum() == pytest.approx((~is_fruit).sum(), rel=0.2)


@pytest.mark.parametrize("n_visits", [3, 5])
@pytest.mark.parametrize("share", [0.5, 0.7])
def test_what_was_thinned_after_the_first_visit_is_gone_and_was_no_false_point(share, n_visits):
    """Of two thirds of a visit that no other saw, people took more, sooner than that it alone saw so many of none."""
    rng = np.random.default_rng(31)
    seen, is_fruit = uneven_row(rng, false=(0.02,) * n_visits, hidden=0.25, n_fruits=330)
    thinned = is_fruit & (rng.random(len(seen)) < share)
    seen[thinned, 1:] = False
    seen, thinned = seen[seen.any(axis=1)], thinned[seen.any(axis=1)]
    found = lives(seen)
    assert found.false[thinned].mean() < 0.1
    assert found.gone[thinned].mean() > 0.8
    assert found.gone[seen[:, -1]].max() == 0.0


@pytest.mark.parametrize(("thinned", "within"), [(0.0, 0.06), (0.5, 0.15)])
def test_of_two_visits_the_second_sees_as_many_where_nothing_goes(thinned, within):
    """What half as many sights mean two visits tell by that alone: a fruit hides from either as often."""
    rng = np.random.default_rng(33)
    chances = 1.0 - rng.beta(1.3, 3.9, 360)
    seen = rng.random((360, 2)) < chances[:, None]
    gone = rng.random(360) < thinned
    seen[gone, 1] = False
    met = seen.any(axis=1)
    found = lives(seen[met]).gone
    assert found.sum() == pytest.approx(gone[met].sum(), abs=within * met.sum())


def test_what_a_visit_looks_at_as_the_first_is_not_false_for_being_new():
    rng = np.random.default_rng(22)
    seen, is_fruit = uneven_row(rng, false=(0.04,) * 4, hidden=0.15, n_fruits=600)
    in_view = np.ones(seen.shape, bool)
    in_view[rng.random(len(seen)) < 0.5, :3] = False
    met = (seen & in_view).any(axis=1)
    told = replace(looks_at((seen & in_view)[met]), in_view=in_view[met])
    elsewhere = ~in_view[met, 0]
    found = lives_of(histories_of(told, fortnights(4))).false[elsewhere]
    assert found.mean() == pytest.approx(1.0 - is_fruit[met][elsewhere].mean(), abs=0.06)


def test_when_leaves_fall_what_hid_appears_and_is_no_false_point():
    """The visit sees more fruits that looks had missed, those that others had seen among them."""
    rng = np.random.default_rng(23)
    chances = np.where(rng.random(600) < 0.4, 0.35, 0.95)[:, None] * np.ones(4)
    chances[:, 3] = 0.95
    seen = rng.random((600, 4)) < chances
    seen = seen[seen.any(axis=1)]
    new = seen[:, 3] & (seen.sum(axis=1) == 1)
    assert new.sum() > 40
    assert lives(seen).false[new].mean() < 0.2


def test_as_many_are_gone_as_have_gone_though_many_hide():
    """The share that goes and the chances of seeing are learnt from the same looks: none takes from the other."""
    rng = np.random.default_rng(8)
    hard = rng.random(4000) < 0.4
    hangs = np.cumsum(rng.random((4000, 5)) < [0.0, 0.04, 0.04, 0.04, 0.04], axis=1) == 0
    seen = hangs & (rng.random((4000, 5)) < np.where(hard, 0.4, 0.97)[:, None])
    met = seen.any(axis=1)
    found = lives(seen[met], np.where(hard[met], HIDDEN, FREE)[:, None])
    gone = ~hangs[met, -1]
    assert found.gone[hard[met]].mean() == pytest.approx(gone[hard[met]].mean(), abs=0.03)
    assert found.gone[~hard[met]].mean() == pytest.approx(gone[~hard[met]].mean(), abs=0.01)


def test_a_fruit_that_hung_free_is_gone_sooner_than_one_that_hid():
    seen = np.array([[True, True, False], [True, True, False], *[[True, True, True]] * 30])
    free, hidden = lives(seen, np.array([FREE, HIDDEN, *[FREE] * 30])[:, None]).gone[:2]
    assert free > 0.5 > hidden


def test_nothing_goes_between_two_visits_of_one_date():
    """Only what a later date misses, too, may have gone, and overnight few do."""
    seen = np.array([[True, False]] * 30 + [[True, True]] * 70)
    assert not lives(seen, days=(3.4, 3.5)).gone.any()
    assert lives(seen, days=(3.0, 17.0)).gone[:30].mean() > 0.05
    thrice = np.column_stack([np.ones(100, bool), seen])
    assert lives(thrice, days=(3.4, 3.5, 18.0)).gone[:30].mean() > 0.2
    assert lives(thrice, days=(3.0, 18.4, 18.5)).gone[:30].max() < 0.02
    few = np.array([[True, False]] * 3 + [[True, True]] * 97)
    overnight, fortnight = (lives(few, days=(3.0, last)).gone[:3].mean() for last in (4.0, 17.0))
    assert overnight < 0.5 * fortnight


def test_a_fruit_seen_late_and_well_is_rather_a_false_point_than_one_seen_late_and_hardly():
    """What looks missed before hides, and is seen by few frames when it is seen."""
    rng = np.random.default_rng(5)
    hidden = rng.random(600) < 0.2
    seen = rng.random((600, 5)) < np.where(hidden, 0.4, 0.98)[:, None]
    ranks = np.where(hidden, 0.2, 0.2 + 0.8 * rng.random(600))[:, None] * np.where(hidden, rng.random(600), 1)[:, None]
    seen[:2], ranks[:2] = np.arange(5) == 2, [[0.02], [0.9]]
    met = seen.any(axis=1)
    hardly, well = lives(seen[met], ranks[met]).false[:2]
    assert hardly < well


@pytest.mark.parametrize("frames", ["few", "alike", "many"])
def test_frames_tell_false_points_from_fruits_by_what_fruits_seen_twice_are_seen_by(frames):
    """Whether few frames see false points, as many as see fruits, or all: none of it is known beforehand."""
    rng = np.random.default_rng(11)
    seen, is_fruit = row(rng, n_visits=5, hidden=0.4, false=0.06, n_fruits=400)
    spread = rng.random(seen.shape)
    of_false = {"few": 0.05 * spread, "alike": spread, "many": 1.0 - 0.05 * spread}[frames]
    found = 1.0 - lives(seen, np.where(is_fruit[:, None], spread, of_false)).false
    once = seen.sum(axis=1) == 1
    assert found[once].mean() == pytest.approx(is_fruit[once].mean(), abs=0.1)
    if frames != "alike":
        assert found[~is_fruit].mean() < 0.2 < 0.4 < found[once & is_fruit].mean()


def test_the_slopes_of_view_densities_are_those_of_their_logarithms():
    rng = np.random.default_rng(12)
    counts = rng.integers(0, 9, (3, N_BINS)).astype(float)
    settings = rng.normal(0.0, 0.5, N_SETTINGS)
    value = lambda told: (counts * ViewDensities.of(told).logs[:, :-1]).sum()  # noqa: E731
    assert check_grad(value, lambda told: ViewDensities.of(told).slopes(counts), settings) < 1e-4
    assert np.exp(ViewDensities.of(settings).logs[:, :-1]) @ WIDTHS == pytest.approx(np.ones(3))


def test_a_density_of_false_points_has_more_room_the_more_points_are_taken_for_false():
    densities = ViewDensities.of(np.zeros(N_SETTINGS))
    few, many = (densities.room(n * WIDTHS, np.zeros(N_BINS)) for n in (1.0, 100.0))
    assert densities.room(np.zeros(N_BINS), np.zeros(N_BINS)) == 0.0 < few < many


def test_where_a_stretch_was_stripped_its_fruits_are_gone_and_those_beside_it_hide():
    """The share that goes is that of the place: one for the whole row, a fifth, would say .42 of what was missed."""
    rng = np.random.default_rng(13)
    places = np.column_stack([20.0 * np.sort(rng.random(1000)), rng.random((1000, 2))])
    stripped = (places[:, 0] > 8.0) & (places[:, 0] < 12.0)
    seen = rng.random((1000, 4)) > 0.35
    seen[stripped, -1] = False
    met = seen.any(axis=1)
    found = lives(seen[met], places=places[met]).gone
    inside, missed = stripped[met], ~seen[met, -1]
    assert found[inside].mean() > 0.9
    assert found[missed & ~inside].mean() < 0.2


def test_what_a_visit_missed_beyond_its_end_says_nothing_of_the_share_there():
    rng = np.random.default_rng(16)
    places = np.column_stack([20.0 * np.sort(rng.random(800)), rng.random((800, 2))])
    beyond = places[:, 0] > 18.0
    seen = rng.random((800, 4)) > 0.35
    seen[beyond, -1] = False
    met = seen.any(axis=1)
    told = looks_at(seen[met], places=places[met])
    passed = ~(beyond[met, None] & (np.arange(4) == 3))
    sure, doubtful = (
        lives_of(histories_of(each, fortnights(4))).gone[beyond[met]].mean()
        for each in (told, replace(told, went_by=passed))
    )
    assert doubtful < 0.5 < 0.9 < sure


@pytest.mark.parametrize("gone", [0.0, 0.4])
def test_where_as_many_go_everywhere_a_place_has_the_common_share(gone):
    rng = np.random.default_rng(14)
    about = fruits_about(rng.random((800, 3)) * [20.0, 1.0, 1.0])
    went = (rng.random(800) < gone).astype(float)
    shares = shares_of_places(went, 1.0 - went, max(gone, 0.01), about)
    assert shares == pytest.approx(np.full(800, max(gone, 0.01)), abs=0.06)


def test_a_place_of_which_nothing_was_seen_has_the_common_share():
    about = fruits_about(np.column_stack([np.arange(400.0), np.zeros((400, 2))]))
    went = np.where(np.arange(400) < 100, 1.0, np.where(np.arange(400) < 250, 0.0, 0.4))
    shares = shares_of_places(went, 1.0 - went, 0.4, about)
    assert shares[:80].min() > 0.9
    assert shares[120:230].max() < 0.1
    assert shares[270:] == pytest.approx(np.full(130, 0.4), abs=0.02)


def test_the_gradient_of_the_posterior_is_that_of_its_value():
    rng = np.random.default_rng(9)
    seen, _ = row(rng, n_visits=4, hidden=0.3, false=0.1, n_fruits=60)
    odds = HistoryOdds(histories_of(looks_at(seen, rng.random((len(seen), 1))), np.array([3.0, 3.1, 5.0, 30.0])))
    told = odds.start() + rng.normal(0.0, 0.3, len(odds.start()))
    assert check_grad(lambda x: odds(x, 0.1)[0], lambda x: odds(x, 0.1)[1], told, epsilon=1e-6) < 1e-3


def test_looks_that_all_missed_a_fruit_are_counted_from_its_side():
    seen = np.zeros((1, MISSES + 2), bool)
    seen[0, -1] = True
    classes, unseen = visibility_classes(looks_at(seen))
    assert classes.tolist() == unseen.tolist() == [[*range(MISSES + 1), MISSES]]
    towards = np.tile([[0.0, 1.0, 0.0]], (1, MISSES + 2, 1))
    towards[0, 1::2] *= -1.0
    classes, _ = visibility_classes(replace(looks_at(seen), towards=towards))
    assert classes.tolist() == [[0, 0, 1, 1, 2, 2, 3]]


def test_what_no_later_visit_looked_at_hangs_as_surely_as_what_they_looked_at_stays():
    """Half of a row is not visited again, and of the other two fifths went: nobody knows whether of this one, too."""
    rng = np.random.default_rng(15)
    places = np.column_stack([20.0 * np.sort(rng.random(800)), rng.random((800, 2))])
    seen, in_view = rng.random((800, 3)) < 0.9, np.ones((800, 3), bool)
    in_view[:400, -1] = False
    seen[:, -1] &= in_view[:, -1] & (rng.random(800) > 0.4)
    met = seen.any(axis=1)
    told = replace(looks_at(seen[met], places=places[met]), in_view=in_view[met])
    states, sure = states_of(told.seen, told.in_view, lives_of(histories_of(told, fortnights(3))))
    elsewhere = (np.array(states) == "seen") & (places[met, 0] < places[400, 0])
    assert sure[elsewhere].mean() == pytest.approx(0.6, abs=0.07)


def test_no_more_are_called_gone_than_may_be_called_so_wrongly():
    """Half of what two visits saw and the third did not may be gone, and nobody can say which half."""
    seen = np.array([[True, False]] * 40 + [[True, True]] * 60)
    doubtful = Lives(np.array([0.95] * 4 + [0.5] * 36 + [0.0] * 60), np.zeros(100))
    states, _ = states_of(seen, np.ones(seen.shape, bool), doubtful)
    assert states == ["gone"] * 4 + ["missed"] * 36 + ["seen"] * 60
    assert MOST_WRONGLY_GONE * (1.0 - doubtful.gone).sum() < 36 * 0.5


def test_of_fruits_that_are_gone_as_surely_all_are_called_so_where_most_of_them_may():
    """One fruit more or less must not call a hundred gone or none."""
    seen = np.array([[True, False]] * 100 + [[True, True]] * 100)
    called = {}
    for n_hidden in (100, 90, 40):
        gone = np.concatenate([np.full(n_hidden, 0.9), np.full(100 - n_hidden, 0.2), np.zeros(100)])
        states, _ = states_of(seen, np.ones(seen.shape, bool), Lives(gone, np.zeros(200)))
        called[n_hidden] = states.count("gone")
        assert MOST_WRONGLY_GONE * (1.0 - gone).sum() > 0.5 * 0.1 * n_hidden
    assert called == {100: 100, 90: 90, 40: 40}
