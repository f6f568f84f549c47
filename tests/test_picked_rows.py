"""Visits one of which was picked: found whichever of the two is the map."""

from dataclasses import replace

import numpy as np
import pytest

import pomona
from pomona.synth.clouds import scene_pair


@pytest.mark.parametrize("seed", [8, 11])
def test_a_picked_visit_is_found_as_query_and_as_map(seed: int) -> None:
    pair = scene_pair("picked80", seed)
    picked, full = pair.query, pair.map
    found, other = pomona.match(picked, full), pomona.match(full, picked)
    # One of the two is found by looking for the map in the query.
    assert ["exchanged" in dict(match.stages) for match in (found, other)].count(True) == 1
    for match, clouds, truth in (
        (found, (picked, full), pair.map_from_query),
        (other, (full, picked), np.linalg.inv(pair.map_from_query)),
    ):
        assert match.status == "Found"
        query, into = clouds
        right = np.array([query.ids[i] == into.ids[j] for i, j in match.pairs])
        assert right.mean() > 0.85
        assert np.all(np.diff(match.pairs[:, 0]) > 0)
        off_m = query.transformed(match.map_from_query).positions - query.transformed(truth).positions
        assert np.median(np.linalg.norm(off_m, axis=1)) < 0.05
        laid_m = query.transformed(match.map_from_query).positions[match.pairs[:, 0]]
        np.testing.assert_allclose(
            np.median(np.linalg.norm(laid_m - into.positions[match.pairs[:, 1]], axis=1)),
            np.median(match.distances_m),
            atol=0.02,
        )


def test_a_visit_that_shows_a_fruit_in_ten_is_found() -> None:
    found = 0
    for seed in range(12):
        row, rng = scene_pair("wall", seed).map, np.random.default_rng(seed)
        sparse = row.select(rng.random(len(row)) < 0.1)
        sparse = replace(sparse, positions=sparse.positions + rng.normal(0, 0.02, sparse.positions.shape))
        full = row.select(rng.random(len(row)) < 0.75)
        match = pomona.match(sparse.transformed(scene_pair("wall", seed).map_from_query), full)
        if match:
            found += 1
            assert np.mean([sparse.ids[i] == full.ids[j] for i, j in match.pairs]) > 0.8
    assert found >= 9
