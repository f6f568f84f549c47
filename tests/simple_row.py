"""A row of trees of a few lines, with fruits, limbs and leaves: enough to draw, without the model that grows them."""

import numpy as np

from pomona.synth.row_geometry import FruitSolids, Leaves, Limbs, RowGeometry

SPACING_M, HEIGHT_M = 2.0, 2.6
UP = np.array([0.0, 0.0, 1.0])


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def simple_row(seed=0, *, trees=2, fruits=25, leaves=1500, behind=0):
    """`trees` in the row, each with branches, fruits and leaves; as many in the rows `behind`, without labels."""
    rng = np.random.default_rng(seed)
    parts = []
    for row in range(behind + 1):
        parts += [
            tree(rng, np.array([number * SPACING_M, 3.5 * row, 0.0]), fruits, leaves, labelled=row == 0)
            for number in range(trees)
        ]
    solids = joined(FruitSolids, [part[0] for part in parts])
    solids.ids[solids.ids > 0] = np.arange(1, (solids.ids > 0).sum() + 1)
    return RowGeometry(solids, joined(Limbs, [part[1] for part in parts]), joined(Leaves, [part[2] for part in parts]))


def joined(kind, parts):
    return kind(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in parts[0].__dict__})


def tree(rng, foot, n_fruits, n_leaves, *, labelled):
    n = 22
    roots = foot + np.stack([np.zeros(n), np.zeros(n), np.linspace(0.5, HEIGHT_M - 0.3, n)], axis=1)
    turns, reaches = rng.uniform(0, 2 * np.pi, n), rng.uniform(0.5, 1.0, n) * np.linspace(1.1, 0.5, n)
    tips = roots + np.stack([reaches * np.cos(turns), 0.7 * reaches * np.sin(turns), rng.uniform(-0.1, 0.3, n)], axis=1)
    limbs = Limbs(
        starts_m=np.vstack([foot, roots]),
        ends_m=np.vstack([foot + HEIGHT_M * UP, tips]),
        start_radii_m=np.r_[0.045, np.full(n, 0.012)],
        end_radii_m=np.r_[0.015, np.full(n, 0.003)],
        colours=np.tile([0.10, 0.08, 0.06], (n + 1, 1)),
    )
    return fruits_on(rng, roots, tips, n_fruits, labelled), limbs, leaves_on(rng, roots, tips, n_leaves)


def places_on(rng, roots, tips, count, scatter_m):
    on = rng.integers(len(roots), size=count)
    along = rng.uniform(0.15, 1.0, (count, 1))
    return roots[on] + along * (tips[on] - roots[on]) + rng.normal(0.0, scatter_m, (count, 3)), tips[on] - roots[on]


def fruits_on(rng, roots, tips, count, labelled):
    places, _ = places_on(rng, roots, tips, count, 0.05)
    diameters_m = rng.normal(0.072, 0.005, count)
    return FruitSolids(
        ids=np.full(count, int(labelled)),
        trees=np.zeros(count, np.int64),
        centres_m=places - [0.0, 0.0, 0.06],
        diameters_m=diameters_m,
        heights_m=0.88 * diameters_m,
        axes=unit(rng.normal(UP, 0.25, (count, 3))),
        ground_colours=np.tile([0.50, 0.42, 0.08], (count, 1)),
        blush_colours=np.tile([0.42, 0.025, 0.02], (count, 1)),
        blush_shares=rng.uniform(0.4, 0.95, count),
        blush_directions=unit(rng.normal([0.0, -0.8, 0.6], 1.0, (count, 3))),
    )


def leaves_on(rng, roots, tips, count):
    places, ways = places_on(rng, roots, tips, count, 0.07)
    out = unit(rng.normal(unit(ways) - 0.3 * UP, 0.7))
    up = rng.normal(UP, 0.45, (count, 3))
    up = unit(up - out * (up * out).sum(axis=1, keepdims=True))
    lengths_m = rng.normal(0.08, 0.014, count).clip(0.03)
    shade = rng.uniform(0.75, 1.25, (count, 1)) * np.array([1.0, 1.0, 1.0])
    return Leaves(
        bases_m=places,
        tips=out,
        normals=up,
        lengths_m=lengths_m,
        widths_m=0.55 * lengths_m,
        folds_rad=rng.uniform(0.05, 0.5, count),
        bends_rad=rng.uniform(0.1, 0.9, count),
        colours=np.array([0.055, 0.115, 0.022]) * shade,
    )
