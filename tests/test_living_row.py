"""The living row: what holds on every day of its season."""

from dataclasses import fields, replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.synth.living import LivingRow, RowDesign, Wind, grow
from pomona.synth.living.cultivars import CULTIVARS
from pomona.synth.living.fruit_lives import ALIVE, DROPPED, PICKED, THINNED
from pomona.synth.living.training_systems import SYSTEMS
from pomona.synth.row_geometry import FruitSolids, Leaves, RowGeometry

DESIGN = RowDesign(
    n_trees=2,
    fruits_per_tree=(70, 90),
    leaves_per_tree=1500,
    thinned_share=0.2,
    pickings=((150, 0.5),),
    row_behind=False,
    grass_blades_per_m2=0.0,
)
DAYS = [DESIGN.bloom + timedelta(days=days) for days in (40, 62, 90, 120, 149, 151, 168)]


@pytest.fixture(scope="module")
def row() -> LivingRow:
    return grow(DESIGN, 3)


@pytest.fixture(scope="module")
def every_system() -> dict[str, LivingRow]:
    return {system: grow(replace(DESIGN, system=system, softness=2.0), 5) for system in SYSTEMS}


def arrays(geometry: RowGeometry) -> list[np.ndarray]:
    parts = (geometry.fruits, geometry.limbs, geometry.leaves)
    return [getattr(part, field.name) for part in parts for field in fields(part)]


def test_the_same_seed_grows_the_same_row_and_other_days_change_nothing(row: LivingRow) -> None:
    again = grow(DESIGN, 3)
    first = row.on(DAYS[3])
    again.on(DAYS[0])
    for one, two in zip(arrays(first), arrays(again.on(DAYS[3])), strict=True):
        np.testing.assert_array_equal(one, two)
    other = grow(DESIGN, 4).on(DAYS[3])
    assert not np.array_equal(other.limbs.starts_m, first.limbs.starts_m)


def test_geometry_is_what_the_border_promises(every_system: dict[str, LivingRow]) -> None:
    for row in every_system.values():
        geometry = row.on(DAYS[4])
        fruits, limbs, leaves = geometry.fruits, geometry.limbs, geometry.leaves
        for part in (fruits, limbs, leaves):
            for field in fields(part):
                values = getattr(part, field.name)
                assert len(values) == len(part), field.name
                assert np.isfinite(values).all(), field.name
                if field.name.endswith("colours"):
                    assert ((values >= 0) & (values <= 1)).all(), field.name
        for directions in (fruits.axes, fruits.blush_directions, leaves.tips, leaves.normals):
            np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-9)
        np.testing.assert_allclose((leaves.tips * leaves.normals).sum(axis=1), 0.0, atol=1e-9)
        labelled = fruits.ids[fruits.ids > 0]
        assert len(np.unique(labelled)) == len(labelled)
        assert fruits.ids.dtype == fruits.trees.dtype == np.int64
        assert limbs.start_radii_m.min() > 0


def test_an_id_is_the_same_fruit_on_every_day(row: LivingRow) -> None:
    earlier = row.fruits_on(DAYS[0])
    for day in DAYS[1:]:
        later = row.fruits_on(day)
        assert set(later.ids) <= set(earlier.ids), "a fruit came back"
        before = np.searchsorted(earlier.ids, later.ids)
        np.testing.assert_array_equal(earlier.trees[before], later.trees)
        assert np.linalg.norm(later.centres_m - earlier.centres_m[before], axis=1).max() < 0.12
        assert (later.diameters_m >= earlier.diameters_m[before]).all(), "a fruit shrank"
        earlier = later


def test_fruits_end_as_designed(row: LivingRow) -> None:
    before, after = (row.states_on(DESIGN.bloom + timedelta(days=days)) for days in (59, 60))
    thinned = (after == THINNED) & (before == ALIVE)
    assert thinned.sum() == pytest.approx(0.2 * (before == ALIVE).sum(), rel=0.1)
    clusters = row.crop.spurs
    assert set(clusters[thinned]) <= set(clusters[after == ALIVE]), "thinning emptied a cluster"
    ready, picked = (row.states_on(DESIGN.bloom + timedelta(days=days)) for days in (149, 150))
    gone = (ready == ALIVE) & (picked == PICKED)
    assert gone.sum() == round(0.5 * (ready == ALIVE).sum())
    sizes = row.crop.curves.harvest_diameters_m
    assert sizes[gone].min() >= sizes[picked == ALIVE].max()
    assert (picked == DROPPED).mean() == pytest.approx(0.14, abs=0.08)


def test_diameters_follow_a_season_of_apples() -> None:
    row = grow(replace(DESIGN, cultivar="fuji", n_trees=4, pickings=(), thinned_share=0.0), 1)
    means = {}
    for month, day in ((6, 4), (6, 18), (8, 10), (8, 24), (10, 1), (10, 12)):
        hanging = row.fruits_on(date(2024, month, day)).diameters_m
        means[month, day] = 1000 * hanging.mean()
    assert 21 < means[6, 4] < 29
    assert 76 < means[10, 12] < 86
    assert 0.7 < (means[6, 18] - means[6, 4]) / 14 < 1.0
    assert 0.25 < (means[8, 24] - means[8, 10]) / 14 < 0.5
    assert 0.12 < (means[10, 12] - means[10, 1]) / 11 < 0.3
    final = row.fruits_on(date(2024, 10, 12)).diameters_m
    assert final.std() / final.mean() == pytest.approx(0.072, abs=0.015)


def test_a_fruit_starves_before_it_drops(row: LivingRow) -> None:
    crop = row.crop
    drops = np.flatnonzero((crop.lives.causes == DROPPED) & (crop.lives.ends_days > 38))
    ends = crop.lives.ends_days[drops]
    curves, free = crop.curves.chosen(drops), replace(crop.curves.chosen(drops), slowed_from_days=np.inf)
    growth = curves.diameters_m(ends) - curves.diameters_m(ends - 6)
    assert len(drops) > 5
    assert (growth < 0.5 * (free.diameters_m(ends) - free.diameters_m(ends - 6))).all()


@pytest.mark.parametrize("system", SYSTEMS)
def test_fruits_overlap_neither_one_another_nor_the_wood(every_system: dict[str, LivingRow], system: str) -> None:
    row = every_system[system]
    for day in (DAYS[0], DAYS[2], DAYS[6]):
        geometry = row.on(day)
        hanging = geometry.fruits.ids > 0
        centres, radii = geometry.fruits.centres_m[hanging], geometry.fruits.diameters_m[hanging] / 2
        pairs = cKDTree(centres).query_pairs(0.12, output_type="ndarray")
        gaps = np.linalg.norm(centres[pairs[:, 0]] - centres[pairs[:, 1]], axis=1)
        assert (radii[pairs].sum(axis=1) - gaps).max() < 0.001
        wood = slice(len(row.supports), len(row.supports) + 9 * len(row.wood))
        limbs = geometry.limbs
        share = np.linspace(0, 1, 7)[:, None, None]
        points = ((1 - share) * limbs.starts_m[wood] + share * limbs.ends_m[wood]).reshape(-1, 3)
        thick = ((1 - share[..., 0]) * limbs.start_radii_m[wood] + share[..., 0] * limbs.end_radii_m[wood]).ravel()
        near, which = cKDTree(points).query(centres, k=4)
        assert (radii[:, None] + thick[which] - near).max() < 0.004


def in_posts_and_wires(row: LivingRow, day: date) -> tuple[np.ndarray, np.ndarray]:
    """Ids of the fruits that hang, and how deep posts and wires are in each, metres."""
    fruits, rods = row.fruits_on(day), row.supports
    share = np.linspace(0, 1, 2000)[:, None, None]
    points = ((1 - share) * rods.starts_m + share * rods.ends_m).transpose(1, 0, 2)
    depths = []
    for place, radius in zip(points, rods.start_radii_m, strict=True):
        gaps, _ = cKDTree(place).query(fruits.centres_m)
        depths.append(fruits.diameters_m / 2 + radius - gaps)
    return fruits.ids, np.max(depths, axis=0)


@pytest.mark.parametrize("system", SYSTEMS)
def test_fruits_hang_beside_posts_and_wires_and_the_others_stay(
    every_system: dict[str, LivingRow], system: str
) -> None:
    now = every_system[system]
    before = grow(replace(now.design, clear_of_posts=False), 5)
    was_in_one: set[int] = set()
    for day in (DAYS[0], DAYS[2], DAYS[4]):
        ids, depths = in_posts_and_wires(before, day)
        was_in_one |= set(ids[depths > 0])
        assert in_posts_and_wires(now, day)[1].max() < 0.004
        moved = np.linalg.norm(now.fruits_on(day).centres_m - before.fruits_on(day).centres_m, axis=1)
        aside = set(ids[moved > 0.02])
        in_october = np.flatnonzero(now.crop.hangs[:, 0] != before.crop.hangs[:, 0]) + 1
        assert aside <= was_in_one | set(in_october), "a fruit that stood in nothing was moved"
        assert (moved < 1e-9).mean() > 0.8
    assert was_in_one, "nothing was to be moved"
    np.testing.assert_array_equal(now.crop.spurs, before.crop.spurs)
    np.testing.assert_array_equal(now.crop.lives.ends_days, before.crop.lives.ends_days)


def test_no_fruit_of_a_filmed_cordon_stands_in_the_post() -> None:
    day, design = date(2024, 9, 5), RowDesign(system="cordon", cultivar="granny-smith", n_trees=3)
    ids, depths = in_posts_and_wires(grow(replace(design, clear_of_posts=False), 11), day)
    assert depths[ids == 38][0] > 0.04
    assert in_posts_and_wires(grow(design, 11), day)[1].max() < 0.002


@pytest.mark.parametrize("day", [date(2024, 8, 9), date(2024, 8, 28), date(2024, 9, 12)])
def test_the_recipe_of_the_shipped_row_still_gives_its_truth(day: date) -> None:
    from benchmarks.shipped_recordings import DESIGN as SHIPPED_DESIGN
    from benchmarks.shipped_recordings import SEED

    shipped = FruitCloud.read(Path(__file__).parents[1] / "examples" / "row" / day.isoformat() / "fruits.csv")
    fruits = grow(SHIPPED_DESIGN, SEED).fruits_on(day)
    rows = np.searchsorted(fruits.ids, np.array(shipped.ids, int))
    np.testing.assert_allclose(shipped.diameters_m, fruits.diameters_m[rows], atol=1e-5)
    apart = [np.linalg.norm(places - places[0], axis=1) for places in (shipped.positions, fruits.centres_m[rows])]
    np.testing.assert_allclose(apart[0], apart[1], atol=1e-4)


def test_fruits_hang_from_their_stalks(row: LivingRow) -> None:
    geometry = row.on(DAYS[3])
    fruits = geometry.fruits
    n = int((fruits.ids > 0).sum())
    ends, starts = geometry.limbs.ends_m[-n:], geometry.limbs.starts_m[-n:]
    below = starts[:, 2] - fruits.centres_m[:n, 2]
    assert (below > 0).mean() > 0.9
    into = np.linalg.norm(ends - fruits.centres_m[:n], axis=1)
    np.testing.assert_allclose(into, 0.36 * fruits.heights_m[:n], atol=1e-9)
    out = np.linalg.norm(starts - fruits.centres_m[:n], axis=1) - fruits.heights_m[:n] / 2
    assert np.percentile(out, [2, 98]) == pytest.approx([0.014, 0.045], abs=0.008)


def test_branches_sink_smoothly_from_nothing_at_the_trunk() -> None:
    row = grow(replace(DESIGN, softness=3.0), 3)
    bent = row._bent(149.0, None)
    wood = row.wood
    assert np.abs(bent.shifts_m[wood.orders == 0]).max() == 0.0
    branches = wood.orders == 1
    shifts = np.linalg.norm(bent.shifts_m[branches], axis=2)
    assert shifts[:, 0].max() == 0.0
    steps = np.diff(shifts, axis=1)
    sank = shifts[:, -1] > 0.02
    assert sank.sum() > 5
    assert (steps[sank] > -1e-4).all(), "a branch does not sink more towards its tip"
    assert np.abs(np.diff(steps, axis=1)).max() < 0.3 * shifts.max(), "a branch has a kink"
    assert (bent.shifts_m[branches][sank][:, -1, 2] < 0).mean() > 0.9
    early = np.linalg.norm(row._bent(60.0, None).shifts_m[branches], axis=2)
    assert early.max() < 0.5 * shifts.max()


def test_what_stands_on_a_branch_moves_with_it(row: LivingRow) -> None:
    foliage, crop = row.foliage, row.crop
    bent = row._bent(120.0, None)
    tips = np.linalg.norm(bent.shifts_m[:, -1], axis=1)
    lowest = int(np.argmax(np.where(row.wood.orders == 1, tips, 0.0)))
    at_rest = grow(replace(DESIGN, softness=0.0), 3)
    leaf = foliage.axes == lowest
    moved = row.on(DAYS[3]).leaves.bases_m - at_rest.on(DAYS[3]).leaves.bases_m
    wanted = bent.shifts(foliage.axes[leaf], foliage.places[leaf], foliage.offsets_m[leaf])
    np.testing.assert_allclose(moved[leaf], wanted, atol=1e-9)
    fruits, resting = row.fruits_on(DAYS[3]), at_rest.fruits_on(DAYS[3])
    by_tips = row._spur_tips(bent) - at_rest._spur_tips(at_rest._bent(120.0, None))
    errors = np.linalg.norm(fruits.centres_m - resting.centres_m - by_tips[crop.spurs[fruits.ids - 1]], axis=1)
    assert np.median(errors) < 1e-9, "only fruits that touch are pushed aside"


def test_wind_sways_and_still_air_does_not(row: LivingRow) -> None:
    still = row.on(DAYS[3])
    breeze = [row.on(DAYS[3], Wind(3.0, azimuth_rad=0.5, time_s=time_s)) for time_s in (0.0, 0.7)]
    moved = np.linalg.norm(breeze[0].leaves.bases_m - still.leaves.bases_m, axis=1)
    assert 0.001 < np.percentile(moved, 95) < 0.15
    assert np.linalg.norm(breeze[0].leaves.bases_m - breeze[1].leaves.bases_m, axis=1).max() > 0.001
    calm = row.on(DAYS[3], Wind(0.0))
    np.testing.assert_array_equal(calm.leaves.bases_m, still.leaves.bases_m)


@pytest.mark.parametrize("leaves", [0, 1000, 7000])
def test_a_tree_has_as_many_leaves_as_asked(leaves: int) -> None:
    row = grow(replace(DESIGN, leaves_per_tree=leaves, n_trees=1), 0)
    assert len(row.on(DAYS[3]).leaves) == leaves


def test_leaves_unfold_turn_and_fall(row: LivingRow) -> None:
    spring, summer, autumn, winter = (row.on(date(2024, *day)).leaves for day in ((5, 5), (7, 20), (10, 28), (12, 31)))
    assert spring.lengths_m.mean() < 0.6 * summer.lengths_m.mean()
    assert len(summer) > len(autumn) > 100 * len(winter)
    redness = [(leaves.colours[:, 0] / leaves.colours[:, 1]).mean() for leaves in (summer, autumn)]
    assert redness[0] < 0.6 < redness[1]


def test_leaves_look_to_the_light_and_lie_beside_the_fruits(row: LivingRow) -> None:
    geometry = row.on(DAYS[2])
    leaves = geometry.leaves
    assert (leaves.normals[:, 2] > 0).mean() > 0.9
    outside = np.abs(leaves.bases_m[:, 1]) > 0.35
    outward = leaves.normals[:, 1] * np.sign(leaves.bases_m[:, 1])
    assert outward[outside].mean() > 0.15
    middles = leaves.bases_m + 0.5 * leaves.lengths_m[:, None] * leaves.tips
    gaps, nearest = cKDTree(geometry.fruits.centres_m).query(middles)
    assert (gaps < geometry.fruits.diameters_m[nearest] / 2 - 0.004).mean() < 0.005


@pytest.mark.parametrize("cultivar", CULTIVARS)
def test_fruits_colour_as_their_cultivar_does(cultivar: str) -> None:
    row = grow(replace(DESIGN, cultivar=cultivar, pickings=(), thinned_share=0.0), 2)
    green, ripe = (row.fruits_on(date(2024, *day)) for day in ((6, 10), (10, 5)))

    def redness(fruits: FruitSolids) -> float:
        share = fruits.blush_shares[:, None]
        skin = share * fruits.blush_colours + (1 - share) * fruits.ground_colours
        return float((skin[:, 0] / skin[:, 1]).mean())

    assert redness(green) < 0.9
    reds = {"gala": (2.0, 9.0), "fuji": (1.7, 9.0), "jonagold": (1.3, 3.0), "granny-smith": (0.4, 1.0)}
    least, most = reds.get(cultivar, (0.9, 1.4))
    assert least < redness(ripe) < most
    assert green.blush_shares.mean() < 0.1


def test_the_blush_is_on_the_side_that_has_the_sun(row: LivingRow) -> None:
    fruits = row.fruits_on(DAYS[4])
    assert (fruits.blush_directions[:, 2] > 0).mean() > 0.9
    faces = np.abs(fruits.centres_m[:, 1]) > 0.3
    lit = fruits.blush_directions[:, 1]
    assert lit[faces & (fruits.centres_m[:, 1] < 0)].mean() < lit[faces & (fruits.centres_m[:, 1] > 0)].mean() - 0.5


def test_what_drops_lies_on_the_ground_without_a_label(row: LivingRow) -> None:
    day = DESIGN.bloom + timedelta(days=61)
    fruits = row.on(day).fruits
    lying = fruits.ids == 0
    assert lying.sum() >= (row.states_on(day) == THINNED).sum() > 5
    np.testing.assert_allclose(fruits.centres_m[lying, 2], fruits.heights_m[lying] / 2)


def test_the_row_behind_is_there_without_labels_and_cheap() -> None:
    geometry = grow(replace(DESIGN, row_behind=True, row_spacing_m=3.2, grass_blades_per_m2=30.0), 3).on(DAYS[3])
    alone = grow(DESIGN, 3).on(DAYS[3])
    fruits = geometry.fruits
    behind = fruits.centres_m[:, 1] > 1.6
    assert behind.sum() > 200
    assert (fruits.ids[behind] == 0).all()
    np.testing.assert_array_equal(fruits.ids[fruits.ids > 0], alone.fruits.ids[alone.fruits.ids > 0])
    far = geometry.leaves.bases_m[:, 1] > 1.8
    assert np.median(fruits.centres_m[behind, 1]) == pytest.approx(3.2, abs=0.1)
    assert 0 < far.sum() < len(alone.leaves)
    assert (geometry.leaves.bases_m[:, 2] == 0).sum() > 100, "no grass"


def test_a_bare_row_is_no_error() -> None:
    row = grow(replace(DESIGN, n_trees=1, fruits_per_tree=(0, 0), leaves_per_tree=0), 0)
    geometry = row.on(DAYS[3])
    assert len(geometry.fruits) == len(geometry.leaves) == 0
    assert isinstance(geometry.leaves, Leaves)
    assert len(geometry.limbs) > 100
    assert len(row.fruits_on(DAYS[3])) == 0


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"n_trees": 0}, "n_trees: found 0, expected 1 to 200"),
        ({"system": "vase"}, "system: found 'vase', expected one of spindle, cordon, wall"),
        ({"cultivar": "pear"}, "cultivar: found 'pear', expected one of gala"),
        ({"fruits_per_tree": (9, 3)}, "fruits_per_tree: found 9 to 3"),
        ({"cluster_sizes": (0.5, 0.2)}, "cluster_sizes: .* sum to 1"),
        ({"leaves_per_tree": 10**9}, "leaves_per_tree: found 1000000000"),
        ({"softness": float("nan")}, "softness: found nan"),
        ({"pickings": ((150, 2.0),)}, "pickings: share: found 2.0"),
        ({"spacing_m": -1.0}, "spacing_m: found -1.0"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(changes: dict, line: str) -> None:
    with pytest.raises(PomonaError, match=line) as refused:
        replace(DESIGN, **changes)
    assert "\n" not in str(refused.value)


def test_more_fruits_than_fit_are_refused() -> None:
    with pytest.raises(PomonaError, match=r"fruits_per_tree: tree 0 has room for \d+ of 1000 fruits, expected fewer"):
        grow(replace(DESIGN, n_trees=1, fruits_per_tree=(1000, 1000)), 0)
    with pytest.raises(PomonaError, match="seed -1 is negative"):
        grow(DESIGN, -1)
