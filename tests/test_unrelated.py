"""What has nothing in common is not answered, however alike it looks."""

import numpy as np
import pytest

import pomona
from pomona.synth.clouds import scene_pair


def test_lines_of_fruits_laid_on_lines_of_fruits_are_no_answer():
    """The wrong pose has enough evidence by every sum over fruits, but its pairs are not believed."""
    pair = scene_pair("cone-noov", 7)
    assert pomona.match(pair.query, pair.map).status == pomona.Verdict.NO_MATCH


@pytest.mark.filterwarnings("ignore:query. neighbouring fruits are:pomona.PomonaWarning")
@pytest.mark.parametrize("factor", [0.001, 30.0, 100.0, 1000.0])
def test_a_cloud_in_another_unit_has_no_match_and_takes_no_memory(factor):
    pair = scene_pair("base", 1)
    other = pomona.FruitCloud(factor * np.asarray(pair.query.positions))
    assert pomona.match(other, pair.map).status == pomona.Verdict.NO_MATCH
