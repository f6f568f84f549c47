"""Things that stay as they are, told by their sizes from fruits that grow, slow down, stop and drop."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.stats import multivariate_normal

from growth_maker import HARVEST, GrownRow
from pomona.growth.season_growth import SeasonGrowth, growth_of
from pomona.identity import SeenVisit, VisitPair, conclude
from pomona.identity.size_fates import (
    GROWS,
    ODD,
    ODD_BY,
    OFF,
    OFF_BY,
    SLOW,
    STANDS,
    THING,
    Growing,
    fate_densities,
    own_growth,
)
from pomona.identity.still_things import still_chances

Numbers = NDArray[np.float64]

GROWING = Growing(np.array([-3.9, -3.4, -3.1, -2.9]), np.array([0.02, -0.03, 0.0, 0.04]), np.full(4, 0.05), 0.1, 0.12)


def drawn(
    rng: np.random.Generator,
    days: Numbers,
    share: float,
    *,
    n_fruits: int = 300,
    growth: float = 1.2,
    noise: float = 0.05,
    scale: float = 0.0,
    hidden: float = 0.25,
    stops: float = 0.0,
    as_at_first: bool = False,
) -> tuple[Numbers, NDArray[np.bool_]]:
    """Logarithms of the sizes that visits measured, (K, V), and which tracks are things.

    A share of `stops` of the fruits stops growing on any day, and hangs on.
    """
    along = 1.0 - np.exp(-2.0 * (days - days[0]) / max(np.ptp(days), 1.0))
    curve = growth * along / along.max()
    ends = np.where(rng.random(n_fruits) < stops, rng.random(n_fruits), 1.0)
    ends = np.interp(ends, np.linspace(0.0, 1.0, len(days)), curve)
    fruits = rng.normal(0.0, 0.1, (n_fruits, 1)) + np.minimum(
        curve * rng.normal(1.0, 0.08, (n_fruits, 1)), ends[:, None]
    )
    n_things = round(share * n_fruits)
    level = rng.normal(0.0, 0.1, n_things) if as_at_first else rng.uniform(-0.1, growth + 0.05, n_things)
    sizes = np.log(0.02) + np.vstack([fruits, np.repeat(level[:, None], len(days), axis=1)])
    sizes = sizes + rng.normal(0.0, noise, sizes.shape) + rng.normal(0.0, scale, len(days))
    missed = np.concatenate([np.full(n_fruits, hidden), np.full(n_things, 0.1)])
    sizes[rng.random(sizes.shape) < missed[:, None]] = np.nan
    return sizes, np.arange(len(sizes)) >= n_fruits


def along_a_row(count: int) -> Numbers:
    """Places anywhere in a row of 20 m."""
    return np.random.default_rng(0).uniform(size=(count, 3)) * [20.0, 1.0, 2.0]


def chances(sizes: Numbers, days: Numbers) -> Numbers:
    return still_chances(sizes, days, np.ones(len(sizes)), along_a_row(len(sizes)))


@pytest.mark.parametrize("share", [0.12, 0.3, 0.5])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_trees_of_another_sort_are_no_things(share: float, seed: int) -> None:
    """Of one size from the first visit on, half as large as the others will be or as large; and a few things."""
    rng = np.random.default_rng(seed)
    days = np.array([0.0, 20.0, 45.0, 70.0, 100.0])
    sizes, is_thing = drawn(rng, days, 0.03)
    places = along_a_row(len(sizes))
    of_another = (places[:, 0] < 20.0 * share) & ~is_thing
    ripe = np.log(0.02) + 0.6 * seed / 1.5 + 0.1 * rng.normal(size=(len(sizes), 1))
    sizes[of_another] = np.where(np.isnan(sizes), np.nan, ripe + 0.05 * rng.normal(size=sizes.shape))[of_another]
    found = still_chances(sizes, days, np.ones(len(sizes)), places)
    elsewhere = is_thing & (places[:, 0] > 20.0 * share + 1.5)
    assert (found[of_another] > 0.5).mean() < 0.02
    assert (found[~is_thing & ~of_another] > 0.5).mean() < 0.02
    assert (found[elsewhere] > 0.5).mean() > 0.8


def days_of(n_visits: int, span: float = 100.0) -> Numbers:
    return np.round(np.linspace(0.0, span, n_visits))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("n_visits", "share"), [(3, 0.1), (3, 0.25), (5, 0.1), (5, 0.25), (8, 0.03), (8, 0.25)])
def test_things_that_stay_are_told(n_visits: int, share: float, seed: int) -> None:
    days = days_of(n_visits)
    sizes, are_things = drawn(np.random.default_rng([1, seed]), days, share)
    found, told = chances(sizes, days), (~np.isnan(sizes)).sum(axis=1) > 1
    assert found[are_things & told].mean() > 0.9
    assert found[~are_things].mean() < 0.01
    assert found[~are_things & told].max() < 0.9
    assert not found[~told].any()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "kind",
    [
        {},
        {"noise": 0.1},
        {"scale": 0.08},
        {"stops": 0.1},
        {"growth": 0.0},
        {"growth": 0.0, "scale": 0.08},
        {"growth": 0.1},
        {"growth": 0.4, "stops": 0.2},
    ],
    ids=str,
)
def test_where_all_are_fruits_none_is_a_thing(kind: dict[str, float], seed: int) -> None:
    for n_visits in (3, 6):
        days = days_of(n_visits)
        assert chances(drawn(np.random.default_rng([2, seed]), days, 0.0, **kind)[0], days).max() < 0.05


@pytest.mark.parametrize("share", [0.15, 0.3])
def test_slow_fruits_are_no_things(share: float) -> None:
    """They grow at half the pace: not at all, were a camera to measure a little more on every visit."""
    days = days_of(5)
    for seed in range(6):
        rng = np.random.default_rng([4, seed])
        sizes, _ = drawn(rng, days, 0.0, noise=0.04, growth=0.5, hidden=0.3, scale=0.02)
        slow = rng.random(len(sizes)) < share
        paces = rng.uniform(0.5, 0.6, np.count_nonzero(slow))
        curve = 0.5 * (1.0 - np.exp(-2.0 * (days - days[0]) / np.ptp(days))) / (1.0 - np.exp(-2.0))
        sizes[slow] -= (1.0 - paces)[:, None] * curve
        assert chances(sizes, days).max() < 0.2


@pytest.mark.parametrize("kind", [{"noise": 0.1}, {"scale": 0.08}, {"stops": 0.1}], ids=str)
def test_things_are_told_beside_what_is_like_them(kind: dict[str, float]) -> None:
    days = days_of(5)
    for seed in range(3):
        sizes, are_things = drawn(np.random.default_rng([3, seed]), days, 0.1, **kind)
        found = chances(sizes, days)
        assert found[are_things].mean() > 0.8
        assert found[~are_things].mean() < 0.03


def test_what_stands_still_as_small_as_fruits_were_is_a_fruit_until_it_should_have_dropped() -> None:
    """Fruitlets that will drop stand still for weeks: over a season what stands still is a thing."""
    for seed in range(3):
        found = {}
        for span in (21.0, 100.0):
            days = days_of(5, span)
            sizes, are_things = drawn(np.random.default_rng([4, seed]), days, 0.15, growth=1.0, as_at_first=True)
            found[span] = chances(sizes, days)[are_things].mean()
        assert found[21.0] < 0.05 < 0.6 < found[100.0]


def test_without_growth_or_sizes_and_of_two_days_nothing_is_told() -> None:
    rng = np.random.default_rng(5)
    for days, growth in ((np.array([0.0, 100.0]), 1.2), (np.array([0.0, 0.2, 100.0]), 1.2), (days_of(5, 6.0), 0.0)):
        assert not chances(drawn(rng, days, 0.25, growth=growth)[0], days).any()
    assert not chances(np.full((50, 4), np.nan), days_of(4)).any()
    assert not chances(np.zeros((0, 4)), days_of(4)).any()
    assert not chances(drawn(rng, days_of(5), 0.25, n_fruits=12)[0], days_of(5)).any()
    assert not chances(np.full((50, 4), -3.0), days_of(4)).any()


def test_fruits_that_are_small_and_seen_late_are_in_doubt() -> None:
    """Half as large as the others, and grown by as little as these lately."""
    days = days_of(5)
    for seed in range(3):
        rng = np.random.default_rng([10, seed])
        sizes, are_things = drawn(rng, days, 0.05)
        small = np.flatnonzero(~are_things)[:10]
        level = np.log(0.02) + np.interp(days, days, 1.2 * (1.0 - np.exp(-0.02 * days)) / (1.0 - np.exp(-2.0))) - 0.5
        sizes[small] = level + rng.normal(0.0, 0.05, (10, 5))
        sizes[small, :3] = np.nan
        assert chances(sizes, days)[small].max() < 0.9


def test_what_visits_say_is_gone_is_no_thing() -> None:
    days = days_of(5)
    sizes, are_things = drawn(np.random.default_rng(6), days, 0.2)
    hanging = np.ones(len(sizes))
    gone = np.flatnonzero(are_things)[:10]
    hanging[gone] = 1e-3
    found = still_chances(sizes, days, hanging, along_a_row(len(sizes)))
    assert (found[gone] < chances(sizes, days)[gone] + 1e-12).all()
    assert found[gone].mean() < 0.9 < found[np.flatnonzero(are_things)[10:]].mean()


def test_many_tracks_are_judged_as_few() -> None:
    """Of many some are learnt from, and all are judged."""
    days = days_of(5)
    sizes, are_things = drawn(np.random.default_rng(7), days, 0.1, n_fruits=4000)
    found = chances(sizes, days)
    assert found[are_things].mean() > 0.9
    assert found[~are_things].mean() < 0.01


def test_densities_are_those_of_one_gaussian() -> None:
    sizes = np.array([[-3.85, -3.5, np.nan, -2.95]])
    drops = np.array([0.7])
    seen = ~np.isnan(sizes[0])
    curves, along = GROWING.fates()

    def density(fate: int, far: float, *, spread: float = 0.0, odd: float = 1.0) -> float:
        middle = (GROWING.scales + curves[fate] + far * along[fate])[seen]
        own = along[fate][seen]
        covariance = np.diag(GROWING.noises[seen] ** 2) + (odd * GROWING.level_spread) ** 2
        return float(multivariate_normal(middle, covariance + spread**2 * np.outer(own, own)).pdf(sizes[0, seen]))

    wanted = {
        GROWS: density(GROWS, 0.0, spread=1.0),
        ODD: density(ODD, 0.0, spread=1.0, odd=ODD_BY),
        SLOW: quad(lambda x: density(SLOW, x) * np.exp(-0.7 * (1.0 - x)), 0.0, 1.0)[0],
        THING: quad(lambda x: density(THING, x), 0.0, 1.0)[0],
        STANDS: density(STANDS, 0.0) * np.exp(-0.7),
        STANDS + 2: density(STANDS + 2, 0.0, spread=1.0),
    }
    found = fate_densities(sizes, drops, GROWING)[0, :, 0] - seen.sum() * np.log1p(-OFF)
    for fate, one in wanted.items():
        assert found[fate] == pytest.approx(np.log(one), abs=1e-5)


def test_a_size_that_is_off_counts_as_none_but_for_its_own_density() -> None:
    sizes = np.array([[-3.85, -3.5, -2.0, -2.95]])
    without = np.where(np.arange(4) == 2, np.nan, sizes)
    off = np.log(OFF / (np.sqrt(2.0 * np.pi) * OFF_BY))
    both = [fate_densities(one, np.zeros(1), GROWING) for one in (sizes, without)]
    assert both[0][0, :, 3] == pytest.approx(both[1][0, :, 0] + off)
    numbers = [own_growth(one, GROWING) for one in (sizes, without)]
    assert numbers[0].squares[:, 0, 3] == pytest.approx(numbers[1].squares[:, 0, 0])
    assert numbers[0].variances[0, 3] == pytest.approx(numbers[1].variances[0, 0])


def test_own_growth_are_those_of_one_gaussian() -> None:
    sizes = np.array([[-3.85, -3.5, -3.2, -2.95]])
    own = np.stack([np.ones(4), GROWING.directions])
    prior = np.diag([GROWING.level_spread**2, GROWING.rate_spread**2])
    gain = prior @ own @ np.linalg.inv(own.T @ prior @ own + np.diag(GROWING.noises**2))
    off = sizes[0] - GROWING.scales - GROWING.growth
    posterior = prior - gain @ own.T @ prior
    found = own_growth(sizes, GROWING)
    assert found.off[0, 0] == pytest.approx(off - own.T @ gain @ off)
    assert found.variances[0, 0] == pytest.approx(np.diag(own.T @ posterior @ own))
    assert found.squares[:, 0, 0] == pytest.approx((gain @ off) ** 2 + np.diag(posterior))


def test_things_do_not_count_as_fruits_in_what_follows_for_a_map() -> None:
    """A quarter of what four visits saw stays as it is, in maps of either unit of one visit."""
    rng, days = np.random.default_rng(8), days_of(4)
    sizes, are_things = drawn(rng, days, 0.25)
    places = rng.uniform((0.0, 0.0, 0.5), (12.0, 0.8, 2.5), (len(sizes), 3))
    seen = ~np.isnan(sizes)
    met = seen.any(axis=1)
    rows = [np.flatnonzero(one) for one in seen.T]
    units = [1.0, 1.0, 2.0, 1.0]
    visits = [
        SeenVisit((f"2024-0{5 + number}-01", "a"), day, unit * places[own], unit * np.exp(sizes[own, number]))
        for number, (own, day, unit) in enumerate(zip(rows, days.tolist(), units, strict=True))
    ]
    pairs = []
    for first in range(4):
        for second in range(first + 1, 4):
            _, *both = np.intersect1d(rows[first], rows[second], return_indices=True)
            scaled = np.diag([units[first] / units[second]] * 3 + [1.0])
            pairs.append(VisitPair(first, second, scaled, 100.0, np.stack(both, axis=1), np.full(len(both[0]), 0.999)))
    known = np.stack([np.diag([1.0 / unit] * 3 + [1.0]) for unit in units])
    found = conclude(visits, pairs, known, range(4))
    fruits = np.zeros(len(found.states), np.int64)
    fruits[found.labels] = np.concatenate(rows)
    count = 1.0 - found.lives.false
    assert count.sum() == pytest.approx((met & ~are_things).sum(), rel=0.06)
    several = found.looks.seen.sum(axis=1) > 1
    assert count[are_things[fruits] & several].mean() < 0.1
    assert count[~are_things[fruits] & several].mean() > 0.99
    shown = np.array([state == "seen" for state in found.states])
    assert found.state_probabilities[shown & are_things[fruits] & several].mean() < 0.1


def test_growth_is_that_of_the_fruits(grown_row: GrownRow, row_growth: SeasonGrowth) -> None:
    """Every fourth point is a thing, which the map says: the others grow as if it were not there."""
    fruits, things = row_growth.fruits, np.arange(1, 90, 4)
    sizes_mm = fruits.diameters_mm.copy()
    sizes_mm[things] = np.linspace(25.0, 60.0, len(things))[:, None] + np.random.default_rng(9).normal(0, 1.0, (23, 4))
    told = np.where(np.isin(np.arange(90), things), "0.02", "1")
    cloud = replace(
        fruits.cloud, extras={**fruits.cloud.extras, "fruit_probability": tuple(told), "n_sessions": ("4",) * 90}
    )
    changed = replace(fruits, diameters_mm=sizes_mm, cloud=cloud)
    others = np.delete(np.arange(90), things)
    assert changed.hanging[others].all()
    assert not changed.hanging[things].any()
    found = growth_of(changed, harvest=HARVEST)
    ratios = found.foretold.rates_mm_per_day[others] / row_growth.foretold.rates_mm_per_day[others]
    assert np.median(ratios) == pytest.approx(1.0, abs=0.02)
    assert found.stopped[others].max() < 0.2
