"""A row that is longer in one visit than in another is told, though all its fruits are found."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import pomona
from pomona import FruitCloud
from pomona.cli import app
from pomona.row_length import length_in_map
from pomona.synth.clouds import ScenePair, scene_pair


def stretched(pair: ScenePair, factor: float) -> FruitCloud:
    """The query as a camera sees it whose metres are as much longer."""
    return FruitCloud(pair.query.positions * factor)


@pytest.mark.parametrize("factor", [0.95, 1.03, 1.1])
def test_metres_that_are_wrong_are_told_with_their_factor(factor: float) -> None:
    pair = scene_pair("sag8", 4)
    query = stretched(pair, factor)
    length = length_in_map(pomona.match(query, pair.map), query, pair.map)
    assert length == pytest.approx(1.0 / factor, abs=0.01)


@pytest.mark.parametrize("cell", ["base", "sag20", "drift1", "wall", "dense300", "sim3", "torn"])
def test_bends_sag_a_scale_that_is_asked_for_and_tears_are_not_told(cell: str) -> None:
    for seed in range(2):
        pair = scene_pair(cell, seed)
        match = pomona.match(pair.query, pair.map, scale=pair.cell.scale)
        assert match.status == "Found"
        assert length_in_map(match, pair.query, pair.map) is None


def test_a_visit_with_wrong_metres_is_told_by_match_and_where_it_joins_a_map(tmp_path: Path) -> None:
    pair = scene_pair("base", 0)
    first, second, orchard = (tmp_path / name for name in ("first.csv", "second.csv", "row.gpkg"))
    pair.map.write(first)
    stretched(pair, 1.1).write(second)

    matched = CliRunner().invoke(app, ["match", str(second), str(first)])
    assert matched.exit_code == 0
    assert re.search(r"the row is (9|10)% longer in QUERY than in MAP", matched.stderr)

    begun = CliRunner().invoke(app, ["map", "add", str(orchard), str(first), "--date", "2024-06-01"])
    assert begun.stderr == ""
    added = CliRunner().invoke(app, ["map", "add", str(orchard), str(second), "--date", "2024-07-01", "--json"])
    assert added.exit_code == 0
    assert re.search(r"the row is (9|10)% longer in second than in the map", added.stderr)
    assert np.isclose(json.loads(added.stdout)["length_in_map"], 1.0 / 1.1, atol=0.01)
