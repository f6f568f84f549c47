"""Clouds whose metres are not those of the map: not found, and told at which size they fit."""

import re
from pathlib import Path

import pytest

from command_line import Pomona
from pomona import FruitCloud
from pomona.synth.clouds import scene_pair

FEET_OF_A_METRE = 3.28084


def written(folder: Path, cell: str, factor: float) -> tuple[Path, Path]:
    """Write a visit in which a metre has as many units, and the map."""
    pair, query, known = scene_pair(cell, 3), folder / "query.csv", folder / "map.csv"
    FruitCloud(pair.query.positions * factor).write(query)
    FruitCloud(pair.map.positions).write(known)
    return query, known


@pytest.mark.parametrize(
    ("cell", "factor", "metres", "said"),
    [
        ("base", FEET_OF_A_METRE, 0.305, "is QUERY in feet?"),
        ("frame25", 1.0 / FEET_OF_A_METRE, 3.28, "is MAP in feet?"),
        ("part45", 1.3, 0.769, "a baseline or focal length that is another camera's?"),
    ],
)
def test_match_tells_at_which_size_a_cloud_fits(
    pomona: Pomona, tmp_path: Path, cell: str, factor: float, metres: float, said: str
) -> None:
    query, known = written(tmp_path, cell, factor)
    code, printed, told = pomona("match", query, known)
    assert (code, printed.split(":")[0]) == (1, "NoMatch")
    found = re.search(r"QUERY fits MAP at another size, with (\d+) pairs: a metre of the one is ([\d.]+) m", told)
    assert found is not None
    assert int(found[1]) >= 19
    assert float(found[2]) == pytest.approx(metres, rel=0.02)
    assert said in told
    assert pomona("match", query, known, "--scale", "free")[0] == 0


def test_map_add_tells_it_and_leaves_the_map(pomona: Pomona, tmp_path: Path) -> None:
    query, known = written(tmp_path, "base", FEET_OF_A_METRE)
    orchard = tmp_path / "orchard.gpkg"
    assert pomona("map", "add", orchard, known, "--date", "2024-06-01")[0] == 0
    before = orchard.read_bytes()
    code, _, told = pomona("map", "add", orchard, query, "--date", "2024-06-20")
    assert code == 1
    assert "query fits the map at another size" in told
    assert "is query in feet?" in told
    assert orchard.read_bytes() == before


def test_strangers_fit_at_no_size(pomona: Pomona, tmp_path: Path) -> None:
    query, known = written(tmp_path, "noov", 1.0)
    code, _, told = pomona("match", query, known)
    assert code == 1
    assert "another size" not in told
