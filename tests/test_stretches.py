"""Trees that are grubbed up or picked clean, of which visits without cameras tell by what they have on both sides."""

from dataclasses import dataclass, replace
from datetime import date, timedelta

import numpy as np
import pytest

from pomona.identity import Conclusion, SeenVisit, VisitPair, conclude
from pomona.identity.stretches import FoundAround, went_by

N_TREES, FRUITS, SPACING_M = 8, 40, 1.5
TAKEN = 3
"""The tree that goes."""

DAYS = (0, 14, 28, 42)


@dataclass(frozen=True, eq=False)
class Row:
    """Eight trees; each visit sees four of five fruits where it looks, to a centimetre, with four false points."""

    places: np.ndarray
    trees: np.ndarray
    hangs: np.ndarray
    looked: np.ndarray

    @classmethod
    def of(cls, n_visits: int) -> "Row":
        rng = np.random.default_rng(9)
        trees = np.repeat(np.arange(N_TREES), FRUITS)
        along = SPACING_M * trees + rng.normal(0.0, 0.4, len(trees)).clip(-0.7, 0.7)
        places = np.column_stack([along, rng.uniform(-0.4, 0.4, len(trees)), rng.uniform(0.6, 2.6, len(trees))])
        every = np.ones((len(trees), n_visits), bool)
        return cls(places, trees, every, every.copy())

    def concluded(self, days: tuple[int, ...] = DAYS) -> tuple[Conclusion, np.ndarray]:
        """All that follows, and the conclusion's number of each fruit that was seen, -1 of others."""
        rng = np.random.default_rng(4)
        n_visits = self.hangs.shape[1]
        seen = self.hangs & self.looked & (rng.random(self.hangs.shape) < 0.8)
        rows = [np.flatnonzero(own) for own in seen.T]
        visits = []
        for number, own in enumerate(rows):
            beside = rng.choice(np.flatnonzero(self.looked[:, number]), 4)
            places = self.places[np.concatenate([own, beside])] + rng.normal(0.0, 0.01, (len(own) + 4, 3))
            places[len(own) :] += rng.uniform(-0.15, 0.15, (4, 3))
            day = date(2024, 7, 1) + timedelta(days=days[number])
            key = (day.isoformat(), str(number))
            visits.append(SeenVisit(key, float(day.toordinal()), places, np.full(len(places), np.nan)))
        pairs = []
        for first in range(n_visits):
            for second in range(first + 1, n_visits):
                _, one, other = np.intersect1d(rows[first], rows[second], return_indices=True)
                chances = np.full(len(one), 0.9999)
                pairs.append(VisitPair(first, second, np.eye(4), 100.0, np.column_stack([one, other]), chances))
        found = conclude(visits, pairs, np.tile(np.eye(4), (n_visits, 1, 1)), range(n_visits))
        numbers = np.full(len(self.places), -1)
        for own, labels in zip(rows, np.split(found.labels, found.sights.starts[1:]), strict=True):
            numbers[own] = labels[: len(own)]
        return found, numbers

    def said_gone(self, asked: np.ndarray, days: tuple[int, ...] = DAYS) -> float:
        """The share of the fruits that were seen, of those that are asked for, that are called gone."""
        found, numbers = self.concluded(days)
        return float(np.mean([found.states[number] == "gone" for number in numbers[asked & (numbers >= 0)]]))


@pytest.mark.parametrize(("n_visits", "gone_before", "least"), [(2, 1, 0.7), (3, 2, 0.7), (4, 2, 0.9)])
def test_a_tree_that_is_grubbed_up_is_gone(n_visits: int, gone_before: int, least: float) -> None:
    """The next visit has fruits on both sides of the gap, so it came by; one more that has the same gap is surer."""
    row = Row.of(n_visits)
    row.hangs[row.trees == TAKEN, gone_before:] = False
    assert row.said_gone(row.trees == TAKEN) > least
    assert row.said_gone(row.trees != TAKEN) < 0.02 + 0.02 * (n_visits > 3)


def test_a_few_fruits_that_are_left_do_not_hide_that_the_others_were_taken() -> None:
    row = Row.of(4)
    left = np.arange(len(row.trees)) % 13 == 0
    row.hangs[(row.trees == TAKEN) & ~left, 2:] = False
    assert row.said_gone((row.trees == TAKEN) & ~left) > 0.9
    assert row.said_gone((row.trees == TAKEN) & left) == 0.0


@pytest.mark.parametrize("n_visits", [2, 3])
def test_of_what_lies_beyond_the_ends_of_a_visit_it_says_nothing(n_visits: int) -> None:
    row = Row.of(n_visits)
    row.looked[row.trees >= N_TREES // 2, 1:] = False
    beyond = row.trees >= N_TREES // 2
    assert row.said_gone(beyond) == 0.0
    found, numbers = row.concluded()
    inner = numbers[(row.trees > N_TREES // 2) & (numbers >= 0)]
    assert {found.states[number] for number in inner} == {"seen"}
    assert not found.looks.emptied[inner].any()


def test_a_visit_of_two_pieces_does_not_empty_what_is_between() -> None:
    """That three of eight trees were taken at once is less likely than that nobody filmed them."""
    row = Row.of(2)
    between = (row.trees > 2) & (row.trees < 6)
    row.looked[between, 1] = False
    assert row.said_gone(between) == 0.0


def test_whether_three_of_eight_trees_were_picked_or_left_out_stays_open() -> None:
    """Both are told as likely as they are, so intervals of counts hold both; the trees beside hang."""
    row = Row.of(3)
    between = (row.trees > 2) & (row.trees < 6)
    row.hangs[between, 2] = False
    found, numbers = row.concluded()
    hangs = np.array(found.state_probabilities)
    assert 0.4 < hangs[numbers[between & (numbers >= 0)]].mean() < 0.75
    assert hangs[numbers[~between & (numbers >= 0) & row.hangs[:, 2]]].mean() > 0.85


def test_two_visits_do_not_leave_out_the_same_by_chance() -> None:
    row = Row.of(4)
    between = (row.trees > 2) & (row.trees < 6)
    row.hangs[between, 2:] = False
    assert row.said_gone(between) > 0.9


def test_what_a_later_visit_sees_again_was_left_out() -> None:
    """Fruits do not come back: the one visit with the gap did not look there, and has missed nothing."""
    row = Row.of(3)
    row.looked[row.trees == TAKEN, 1] = False
    assert row.said_gone(row.trees == TAKEN) < 0.05
    found, numbers = row.concluded()
    own = numbers[(row.trees == TAKEN) & (numbers >= 0)]
    assert not found.looks.emptied[own].any()


def test_nothing_is_emptied_between_two_visits_of_one_day() -> None:
    row = Row.of(2)
    row.hangs[row.trees == TAKEN, 1] = False
    assert row.said_gone(row.trees == TAKEN, (14, 14)) == 0.0


def test_a_gap_that_leaves_may_hide_is_none() -> None:
    """Where visits miss half of all fruits, one in thirty places has nothing near: few at once, and no stretch."""
    row = Row.of(3)
    hidden = replace(row, hangs=np.random.default_rng(2).random(row.hangs.shape) < 0.65)
    assert hidden.said_gone(np.ones(len(row.trees), bool)) < 0.02


def test_a_visit_went_by_between_its_first_and_last_fruits_and_where_its_cameras_say_so():
    row = np.column_stack([np.arange(30.0), np.zeros((30, 2))])
    places = np.column_stack([[-1.0, 0.5, 15.0, 28.5, 31.0], np.zeros((5, 2))])
    visit = FoundAround(row, places, np.ones(5), np.ones(5, bool), True)
    assert went_by(visit).tolist() == [False, False, True, False, False]
    assert went_by(replace(visit, is_asked=False)).all()


def test_a_visit_to_half_of_a_short_row_did_not_go_by_the_other_half() -> None:
    """The half is as high as it is long: which way the row goes the other visits say."""
    row = np.random.default_rng(4).uniform([0.0, 0.0, 0.0], [5.0, 1.0, 2.2], (200, 3))
    visit = FoundAround(row[row[:, 0] < 2.5], row, np.ones(200), np.ones(200, bool), True)
    told = went_by(visit)
    assert not told[row[:, 0] > 2.7].any()
    assert told[(row[:, 0] > 0.4) & (row[:, 0] < 2.1)].all()
