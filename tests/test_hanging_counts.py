"""How many hang is one number: of the page, of `growth` with its tables, and of `thinning`."""

import csv
import json
import shutil
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from command_line import Pomona
from growth_maker import GrownRow
from pomona import geopackage
from pomona.growth.whole_fruits import whole_fruits
from pomona.viewer.season_page import Wishes, season_document
from test_page_document import unpacked


@pytest.fixture(scope="module")
def doubted(grown_row: GrownRow, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A row of which a third was missed and may hang, some is likelier no fruit, some gone, some never measured."""
    path = Path(shutil.copy(grown_row.path, tmp_path_factory.mktemp("doubted")))
    with closing(geopackage.connect(path)) as connection, connection:
        connection.execute("UPDATE fruits SET state = 'missed', state_probability = 0.55 WHERE id % 3 = 0")
        connection.execute("UPDATE fruits SET state = 'gone', state_probability = 0.6 WHERE id % 10 = 1")
        connection.execute("UPDATE fruits SET fruit_probability = 0.3, state = 'missed' WHERE id % 10 = 4")
        connection.execute("UPDATE fruits SET fruit_probability = 0.9 WHERE id % 10 = 5")
        connection.execute("UPDATE observations SET diameter_m = NULL WHERE fruit_id % 9 = 2")
    return path


def test_all_count_alike(doubted: Path, pomona: Pomona, tmp_path: Path) -> None:
    told = season_document(doubted, Wishes(target=20))
    by_tree = {tree["name"]: whole_fruits(tree["n_hang"]) for tree in told["trees"]}
    thinning = json.loads(pomona("thinning", doubted, "--target", 20, "--json")[1])
    assert {tree["tree"] or "": tree["n_fruits"] for tree in thinning["trees"]} == by_tree
    assert [tree["n_to_thin"] for tree in thinning["trees"]] == [
        max(0, count - 20) if name else 0 for name, count in by_tree.items()
    ]
    places = unpacked(told["thinning"]["place"])
    assert np.nansum(places > 20) == sum(tree["n_to_thin"] for tree in thinning["trees"])
    growth = json.loads(pomona("growth", doubted, "-o", tmp_path / "growth", "--json")[1])
    assert growth["n_unmeasured"] == thinning["n_unmeasured"] == told["growth"]["n_unmeasured"] > 0
    total = whole_fruits(sum(tree["n_hang"] for tree in told["trees"]))
    assert growth["blocks"][0]["n_fruits"] + growth["n_unmeasured"] == pytest.approx(total, abs=1)
    with (tmp_path / "growth" / "blocks.csv").open(encoding="utf-8") as file:
        written = [int(line["n_fruits"]) for line in csv.DictReader(file)]
    assert written == [block["n_fruits"] for block in growth["blocks"]]


def test_what_no_visit_measured_is_said(doubted: Path, pomona: Pomona, tmp_path: Path) -> None:
    printed = pomona("growth", doubted, "-o", tmp_path / "growth")[1].splitlines()[-1]
    count = printed.split()[0]
    assert printed == f"  {count} fruits that no visit measured: in no table"
    assert f"  {count} fruits that no visit measured: none of them is thinned" in pomona("thinning", doubted)[1]


def test_a_target_beyond_what_hangs_thins_none(doubted: Path, pomona: Pomona) -> None:
    """A tree has thirty points on the map, of which some twenty hang."""
    trees = json.loads(pomona("thinning", doubted, "--target", 28, "--json")[1])["trees"]
    assert max(tree["n_fruits"] for tree in trees) <= 28
    assert [tree["n_to_thin"] for tree in trees] == [0, 0, 0, 0]


@pytest.mark.parametrize(("expected", "whole"), [(23.5, 24), (24.5, 25), (24.5 - 1e-12, 25), (24.49, 24), (0.0, 0)])
def test_halves_go_up_in_any_order_of_sums(expected: float, whole: int) -> None:
    assert whole_fruits(expected) == whole
