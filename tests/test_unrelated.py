"""What has nothing in common is not answered, however alike it looks."""

import numpy as np
import pytest

import pomona
from pomona.synth.clouds import scene_pair


def test_lines_of_fruits_laid_on_lines_of_fruits_are_no_answer():
    """The wrong pose has enough evidence by every sum over fruits, but its pairs are not believed."""
    pair = scene_pair("cone-noov", 7)
    assert pomona.match(pair.query, pair.map).status == pomona.Verdict.NO_MATCH


def on_wires(rng: np.random.Generator, length_m: float) -> np.ndarray:
    """Fruits of a row on four wires, 45 cm apart, no two of a wire nearer than 6 cm."""
    wires = []
    for wire in range(4):
        along = np.sort(rng.uniform(0, length_m, int(7 * length_m)))
        along = along[np.diff(along, prepend=-1.0) > 0.06]
        off = rng.normal((0.0, 0.8 + 0.45 * wire), (0.025, 0.03), (len(along), 2))
        wires.append(np.column_stack([along, off]))
    return np.concatenate(wires)


def seen(rng: np.random.Generator, fruits: np.ndarray) -> np.ndarray:
    return (fruits + rng.normal(0, 0.012, fruits.shape))[rng.random(len(fruits)) < 0.65]


@pytest.mark.parametrize("seed", range(6))
def test_long_rows_on_the_same_wires_are_no_answer(seed):
    """Hundreds of fruits speak for a wrong pose a little: of 220 such rows 52 were found, and 23 ambiguous."""
    rng = np.random.default_rng(seed)
    query, map = (seen(rng, on_wires(rng, 60.0)) for _ in range(2))
    assert pomona.match(query, map).status == pomona.Verdict.NO_MATCH


@pytest.mark.parametrize("seed", range(4))
def test_long_rows_that_share_some_metres_are_found_by_these_alone(seed):
    """And no further part is laid where the two have nothing in common."""
    rng = np.random.default_rng(seed)
    row = on_wires(rng, 60.0)
    query, map = seen(rng, row[row[:, 0] < 33.0]), seen(rng, row[row[:, 0] > 27.0]) + np.array([1.3, 0.2, -0.4])
    found = pomona.match(query, map)
    assert found.status == pomona.Verdict.FOUND
    assert len(found.parts) == 1
    at = found.map_from_query[:3, :3] @ (30.0, 0.0, 1.5) + found.map_from_query[:3, 3]
    assert np.linalg.norm(at - (31.3, 0.2, 1.1)) < 0.1


@pytest.mark.filterwarnings("ignore:query. neighbouring fruits are:pomona.PomonaWarning")
@pytest.mark.parametrize("factor", [0.001, 30.0, 100.0, 1000.0])
def test_a_cloud_in_another_unit_has_no_match_and_takes_no_memory(factor):
    pair = scene_pair("base", 1)
    other = pomona.FruitCloud(factor * np.asarray(pair.query.positions))
    assert pomona.match(other, pair.map).status == pomona.Verdict.NO_MATCH
