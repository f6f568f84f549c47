"""A table gives its place to a new one only where a verb wrote exactly such a table: no table of one's own is lost."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command_line import Pomona
from growth_maker import GrownRow, grow_row
from pomona import OrchardMap
from pomona.detect.picture_boxes import COLUMNS
from pomona.earth import Anchor
from pomona.export import export_cloud
from pomona.growth.growth_tables import BLOCK_COLUMNS, CLASS_COLUMNS, CURVE_COLUMNS, FRUIT_COLUMNS, SERIES_COLUMNS
from pomona.likes import BOXES, CALIPER_PAIRS, EXPORTS, GROWN, PAIRS, SCANNED, THINNING, Like, is_like
from pomona.pairs import PAIR_COLUMNS
from pomona.table_headers import GROWN_HEADERS

OF_SCAN = "id,x,y,z,diameter_m,cxx,cyy,czz,cxy,cxz,cyz,n_views,diameter_sigma_m,colour,probability"
OF_MAP = "id,x,y,z,diameter_m,state,last_seen,n_sessions,n_missed,state_probability,fruit_probability"


@pytest.fixture(scope="module")
def row(tmp_path_factory: pytest.TempPathFactory) -> GrownRow:
    return grow_row(tmp_path_factory.mktemp("row") / "orchard.gpkg", days=(35, 42), n_trees=2, scales=(1.0, 1.0))


def refused(pomona: Pomona, path: Path, *command: object) -> None:
    """Exit code 2, one line that says what there is to do, and the file as it was; --force replaces it."""
    before = path.read_bytes()
    code, printed, told = pomona(*command)
    assert (code, printed, told.count("\n")) == (2, "", 1)
    assert f"{path}: is there already and is not " in told
    assert "--force to replace it" in told
    assert path.read_bytes() == before
    assert pomona(*command, "--force")[0] == 0
    assert path.read_bytes() != before


@pytest.mark.parametrize("more", ["", "--observations"])
@pytest.mark.parametrize(
    "text",
    [
        "name,x,y,z\ntree 1,0,0,1\n",
        "x,y,z\n0,0,1\n",
        "id,x,y,z,diameter_m,note\n1,0,0,1,0.07,rotten\n",
        f"{OF_SCAN}\n",
        f"{OF_MAP},checked_by\n",
        f"x,{OF_MAP}\n",
        f"{OF_MAP}\r\n",
        f"\ufeff{OF_MAP}\n",
        OF_MAP,
    ],
)
def test_a_table_of_ones_own_is_not_replaced_by_an_export(
    pomona: Pomona, row: GrownRow, tmp_path: Path, text: str, more: str
) -> None:
    path = tmp_path / "trees.csv"
    path.write_bytes(text.encode())
    refused(pomona, path, "export", row.path, "-o", path, *more.split())


def test_nor_by_an_export_of_growth(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    (tmp_path / "trees.csv").write_text("name,x,y,z\ntree 1,0,0,1\n")
    refused(pomona, tmp_path / "trees.csv", "export", row.path, "-o", tmp_path / "trees.csv", "--growth")


def test_the_visit_that_a_map_was_made_of_is_not_replaced_by_its_export(pomona: Pomona, here: Path) -> None:
    assert pomona("map", "add", "one.gpkg", "map.csv", "--date", "2024-08-01")[0] == 0
    refused(pomona, Path("map.csv"), "export", "one.gpkg", "-o", "map.csv")


def test_an_export_of_a_session_replaces_no_visit_of_its_columns(pomona: Pomona, here: Path) -> None:
    assert pomona("scan", "R", "-o", "scanned.gpkg")[0] == pomona("scan", "R", "-o", "visit.csv")[0] == 0
    Path("visit.csv").write_text(Path("visit.csv").read_text() + "\n")
    refused(pomona, Path("visit.csv"), "export", "scanned.gpkg", "-o", "visit.csv")


@pytest.mark.parametrize("trees", [False, True])
@pytest.mark.parametrize("more", ["", "--observations", "--growth", "--growth --harvest 2024-09-10"])
def test_every_export_of_a_map_is_replaced_by_every_other(
    pomona: Pomona, row: GrownRow, tmp_path: Path, more: str, trees: bool
) -> None:
    orchard, path = tmp_path / "orchard.gpkg", tmp_path / "fruits.csv"
    orchard.write_bytes(row.path.read_bytes())
    if trees:
        assert pomona("map", "trees", orchard)[0] == 0
    path.write_text(f"{OF_MAP}\n")
    for _ in range(2):
        code, _, told = pomona("export", orchard, "-o", path, *more.split())
        assert (code, told.count("is there already")) == (0, 0), told
    assert ("tree" in path.read_text().splitlines()[0].split(",")) == (
        (trees or "growth" in more) and "obs" not in more
    )


@pytest.mark.parametrize("rows", [False, True])
def test_places_on_earth_and_rows_are_columns_of_exports(row: GrownRow, tmp_path: Path, rows: bool) -> None:
    orchard, anchor = OrchardMap(row.path), Anchor(np.eye(4), 8.0, 47.0, 400.0)
    fruits = orchard.fruits()
    named = dict.fromkeys(("tree", "row") if rows else ("tree",), ("1",) * len(fruits))
    for cloud in (replace(fruits, extras={**fruits.extras, **named}), orchard.observations().cloud()):
        export_cloud(cloud, tmp_path / "fruits.csv", "csv", anchor)
        assert (tmp_path / "fruits.csv").read_text().splitlines()[0].endswith(",longitude_deg,latitude_deg,height_m")
        assert is_like(EXPORTS["csv"], tmp_path / "fruits.csv")


@pytest.mark.parametrize(
    ("like", "columns"),
    [
        (PAIRS, ",".join(PAIR_COLUMNS)),
        (BOXES, ",".join(COLUMNS)),
        (SCANNED, OF_SCAN),
        (SCANNED, OF_SCAN.removesuffix(",colour,probability")),
        (THINNING, "fruit_id,tree,cluster,n_in_cluster,diameter_mm,rate_mm_per_day,drop_probability,action"),
        (CALIPER_PAIRS, "fruit_id,label,session,date,measured_mm,caliper_mm"),
    ],
)
def test_a_table_is_told_by_all_of_its_columns_and_nothing_else(tmp_path: Path, like: Like, columns: str) -> None:
    path, (first, *others) = tmp_path / "table.csv", columns.split(",")
    path.write_text(f"{columns}\n")
    assert is_like(like, path)
    for other in (f"{columns},checked_by", f"{first},{first},{','.join(others)}", ",".join([*others, first])):
        path.write_text(f"{other}\n")
        assert not is_like(like, path)


def test_pairs_with_a_column_of_ones_own_are_not_replaced(pomona: Pomona, here: Path) -> None:
    command = "match", "query.csv", "map.csv", "-o", "pairs.csv"
    assert [pomona(*command)[0] for _ in range(2)] == [0, 0]
    checked = "\n".join(f"{line},me" for line in Path("pairs.csv").read_text().splitlines())
    Path("pairs.csv").write_text(f"{checked.replace(',me', ',checked_by', 1)}\n")
    refused(pomona, Path("pairs.csv"), *command)


def test_a_scan_and_a_plan_of_thinning_replace_their_own(
    pomona: Pomona, here: Path, row: GrownRow, tmp_path: Path
) -> None:
    for command in (
        ("scan", "R", "-o", tmp_path / "scanned.csv"),
        ("thinning", row.path, "--target", 20, "-o", tmp_path / "thinned.csv"),
    ):
        assert [pomona(*command)[0] for _ in range(2)] == [0, 0]


def test_tables_of_growth_are_told_by_the_columns_that_they_have(tmp_path: Path) -> None:
    columns = (SERIES_COLUMNS, CURVE_COLUMNS, FRUIT_COLUMNS, BLOCK_COLUMNS, CLASS_COLUMNS)
    assert list(GROWN_HEADERS.values()) == [",".join(names) for names in columns]
    for name, header in GROWN_HEADERS.items():
        (tmp_path / name).write_text(f"{header}\n")
    assert is_like(GROWN, tmp_path)
    (tmp_path / "fruits.csv").write_text(f"{GROWN_HEADERS['fruits.csv']},checked_by\n")
    assert not is_like(GROWN, tmp_path)
