"""Codes of constellations against the golden cases that the core reads too."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pomona._core import describe

CASES = json.loads((Path(__file__).parents[1] / "testdata" / "star_i.json").read_text(encoding="utf-8"))["cases"]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_codes_are_as_worked_out_elsewhere(case: dict[str, Any]) -> None:
    points = np.array(case["points"])
    k = len(points)
    members, codes = describe(points, k, k - 1)
    if "degenerate" in case:
        assert members.shape == (0, k)
        assert codes.shape == (0, 3 * k - 7)
    else:
        np.testing.assert_array_equal(members, [case["order"]])
        np.testing.assert_allclose(codes, [case["code"]], atol=2e-8)


def test_a_fruit_and_its_neighbours_give_each_set_once() -> None:
    points = np.random.default_rng(0).normal(size=(11, 3))
    members, _ = describe(points, 5, 10)
    sets = {tuple(sorted(row)) for row in members.tolist()}
    assert len(sets) == len(members) <= 462


def test_k_is_four_to_seven() -> None:
    with pytest.raises(ValueError, match="k: found 3, expected 4 to 7"):
        describe(np.zeros((9, 3)), 3, 8)
