"""Diameters of a map against those by hand."""

import csv
import json
import math
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest

from command_line import Pomona
from growth_maker import GrownRow, grow_row
from pomona.growth.agreement import agreement_of
from pomona.growth.caliper_pairs import CaliperPair


@pytest.fixture(scope="module")
def row(tmp_path_factory: pytest.TempPathFactory) -> GrownRow:
    """Two visits, the second 3 % too large."""
    return grow_row(tmp_path_factory.mktemp("row") / "orchard.gpkg", days=(50, 65), scales=(1.0, 1.03), n_trees=1)


def long_table(row: GrownRow, path: Path, name: str = "label", unit: str = "diameter_mm", per_mm: float = 1.0) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([name, "date", unit])
        for after_bloom in row.days:
            for fruit, size_mm in enumerate(row.sizes_mm(after_bloom)):
                writer.writerow([f"apple {fruit}", row.day(after_bloom), size_mm * per_mm])
    return path


def test_bias_rmse_and_limits_are_those_of_the_differences() -> None:
    day = date(2024, 8, 1)
    pairs = [CaliperPair(i, str(i), "s", day, 70.0 + i, 70.0) for i in range(3)]
    found = agreement_of(pairs)
    assert (found.n, found.bias_mm) == (3, 1.0)
    assert found.rmse_mm == pytest.approx(math.sqrt(5 / 3))
    assert (found.low_mm, found.high_mm) == pytest.approx((1.0 - 1.96, 1.0 + 1.96))
    assert math.isnan(agreement_of(pairs[:1]).low_mm)


def test_a_visit_that_is_off_is_seen(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    table = long_table(row, tmp_path / "c.csv")
    pairs, plot = tmp_path / "pairs.csv", tmp_path / "plot.png"
    code, printed, told = pomona("validate", row.path, "--calipers", table, "-o", pairs, "--plot", plot, "--json")
    assert (code, told) == (0, "")
    found = json.loads(printed)["agreement"]
    assert list(found) == ["all", "2024-06-14", "2024-06-29"]
    assert [one["n"] for one in found.values()] == [60, 30, 30]
    assert abs(found["2024-06-14"]["bias_mm"]) < 0.6
    assert found["2024-06-29"]["bias_mm"] == pytest.approx(0.03 * row.sizes_mm(65).mean(), abs=0.6)
    assert plot.read_bytes().startswith(b"\x89PNG")
    with pairs.open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert list(lines[0]) == ["fruit_id", "label", "session", "date", "measured_mm", "caliper_mm"]
    differences = [float(line["measured_mm"]) - float(line["caliper_mm"]) for line in lines]
    assert np.mean(differences) == pytest.approx(found["all"]["bias_mm"], abs=1e-3)
    code, printed, _ = pomona("validate", row.path, "--calipers", table)
    assert [line.split()[0] for line in printed.splitlines()] == ["visit", "all", "2024-06-14", "2024-06-29"]


@pytest.mark.parametrize(("unit", "per_mm"), [("diameter_cm", 0.1), ("diameter_m", 0.001)])
def test_units_are_in_the_name_of_the_column(
    pomona: Pomona, row: GrownRow, tmp_path: Path, unit: str, per_mm: float
) -> None:
    table = long_table(row, tmp_path / "c.csv", unit=unit, per_mm=per_mm)
    code, printed, _ = pomona("validate", row.path, "--calipers", table, "--json")
    assert code == 0
    assert abs(json.loads(printed)["agreement"]["2024-06-14"]["bias_mm"]) < 0.6


def test_centimetres_that_are_called_millimetres_are_doubted(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    """Tenths of the fruits' diameters, which are those of fruitlets: not refused, and never taken without a word."""
    with (tmp_path / "c.csv").open("w", newline="") as file:
        lines = [[f"apple {fruit}", row.day(65), size_mm / 10] for fruit, size_mm in enumerate(row.sizes_mm(65) + 20.0)]
        csv.writer(file).writerows([["label", "date", "diameter_mm"], *lines])
    code, printed, told = pomona("validate", row.path, "--calipers", tmp_path / "c.csv")
    assert (code, told.count("\n")) == (0, 1)
    assert "times those by hand: is a unit wrong?" in told
    assert "all" in printed


@pytest.mark.parametrize(
    ("times", "said"), [(0.5, "by hand radii?"), (math.pi, "by hand girths?"), (2.0, "radii, or is a day wrong?")]
)
def test_another_measure_is_named(pomona: Pomona, row: GrownRow, tmp_path: Path, times: float, said: str) -> None:
    told = pomona("validate", row.path, "--calipers", long_table(row, tmp_path / "c.csv", per_mm=times))[2]
    assert told.count("\n") == 1
    assert said in told


def test_sizes_of_other_fruits_are_doubted(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    sizes_mm = np.random.default_rng(2).permutation(row.sizes_mm(65))
    lines = [f"apple {fruit},{row.day(65)},{size_mm}" for fruit, size_mm in enumerate(sizes_mm)]
    (tmp_path / "c.csv").write_text("\n".join(["label,date,diameter_mm", *lines]))
    told = pomona("validate", row.path, "--calipers", tmp_path / "c.csv")[2]
    assert told.count("\n") == 1
    assert "do not go together" in told


def test_a_column_a_day_is_read_between_its_days(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    """By hand on days 46, 54 and 67: between two of them a line, near one its own, further away none."""
    days = (46, 54, 67)
    sizes = np.column_stack([row.sizes_mm(day) for day in days])
    lines = [",".join(["id", *(str(row.day(day)) for day in days)])]
    lines += [",".join([f"apple {fruit}", *map(str, of_fruit)]) for fruit, of_fruit in enumerate(sizes.tolist())]
    lines[3] = "apple 2,,,"
    (tmp_path / "c.csv").write_text("\n".join(lines) + "\n")
    code, printed, told = pomona("validate", row.path, "--calipers", tmp_path / "c.csv", "--json")
    found = json.loads(printed)["agreement"]
    assert (code, told) == (0, "")
    assert [one["n"] for one in found.values()] == [58, 29, 29]
    assert abs(found["2024-06-14"]["bias_mm"]) < 0.6


def test_numbers_of_the_map_name_fruits_too(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    table = tmp_path / "c.csv"
    table.write_text(f"fruit_id,date,diameter_mm\n1,{row.day(50)},30\n")
    code, printed, _ = pomona("validate", row.path, "--calipers", table)
    assert code == 0
    assert "2024-06-14" in printed


def test_fruits_that_no_visit_saw_are_told(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    table = tmp_path / "c.csv"
    table.write_text(f"label,date,diameter_mm\napple 3,{row.day(50)},30\n\x1b[2J,{row.day(50)},30\n")
    code, _, told = pomona("validate", row.path, "--calipers", table)
    assert (code, told.count("\n")) == (0, 1)
    assert r"1 fruit measured by no visit near: \x1b[2J" in told


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "found the header ''"),
        ("name,date,diameter_mm\n", "expected fruit_id or label, date, diameter_mm"),
        ("label,date,diameter_inch\na,2024-06-14,2\n", "found the column 'diameter_inch', expected one of diameter_mm"),
        ("label,date,size\na,2024-06-14,2\n", "expected one of diameter_mm"),
        ("label,date,diameter_mm,diameter_mm\n", "column 'diameter_mm' is there twice"),
        ("label,date,diameter_mm\n", "found no diameters"),
        (
            "label,date,diameter_mm\napple 3,2024-06-14,0\n",
            "line 2: diameter_mm: found '0', expected a diameter",
        ),
        ("label,date,diameter_mm\napple 3,2024-06-14,-30\n", "found '-30', expected a diameter above 0"),
        ("label,date,diameter_mm\napple 3,2024-06-14,nan\n", "found 'nan', expected a number"),
        ("label,date,diameter_mm\napple 3,14.6.2024,30\n", "line 2: date: found '14.6.2024', expected a day"),
        ("label,date,diameter_mm\napple 3,2024-06-14,3.1\n", "found a median of 3.1 mm, expected 5 to 200 mm"),
        ("label,date,diameter_mm\n,2024-06-14,30\n", "line 2: label: found nothing"),
        ("label,date,diameter_mm\napple 3,2024-06-14\n", "line 2: found 2 cells, expected 3"),
        ("label,date,diameter_mm\na,2024-06-14,30\na,2024-06-14,31\n", "line 3: found fruit 'a' a second time on"),
        ("label,date,diameter_mm\nnobody,2024-06-14,30\n", "found the fruits 'nobody', expected names that sessions"),
        ("fruit_id,date,diameter_mm\n999,2024-06-14,30\n", "line 2: fruit_id: found '999', expected the number of a"),
        ("label,diameter_mm\napple 3,30\n", "found no column date, expected one"),
        ("label,date,diameter_mm\napple 3,2023-06-14,30\n", "found no diameter within 3 days of a visit of"),
    ],
)
def test_calipers_that_are_none_are_one_line(
    pomona: Pomona, row: GrownRow, tmp_path: Path, text: str, said: str
) -> None:
    table = tmp_path / "c.csv"
    table.write_text(text)
    code, printed, told = pomona("validate", row.path, "--calipers", table, "-o", tmp_path / "pairs.csv")
    assert (code, printed, told.count("\n")) == (2, "", 1)
    assert said in told
    assert str(table) in told
    assert not (tmp_path / "pairs.csv").exists()


def test_names_that_each_session_gives_anew_are_refused(pomona: Pomona, tmp_path: Path) -> None:
    row = grow_row(tmp_path / "anew.gpkg", days=(50, 65), n_trees=1, numbered_anew=True)
    code, _, told = pomona("validate", row.path, "--calipers", long_table(row, tmp_path / "c.csv"))
    assert (code, told.count("\n")) == (2, 1)
    assert "c.csv: found names of which 30 of 30 are different fruits in different sessions" in told


def test_one_day_needs_no_date(pomona: Pomona, tmp_path: Path) -> None:
    row = grow_row(tmp_path / "once.gpkg", days=(50,), n_trees=1)
    (tmp_path / "c.csv").write_text("id,diameter_mm,weight_g\napple 0,30.1,20\napple 1,29.5,\n")
    code, printed, _ = pomona("validate", row.path, "--calipers", tmp_path / "c.csv", "--json")
    assert code == 0
    assert json.loads(printed)["agreement"]["all"]["n"] == 2


def test_calipers_of_the_day_after_hold_within_three_days(pomona: Pomona, row: GrownRow, tmp_path: Path) -> None:
    for away, n in ((3, 1), (4, 0)):
        day = row.day(65) + timedelta(days=away)
        (tmp_path / "c.csv").write_text(f"label,date,diameter_mm\napple 3,{day},30\n")
        code, *_ = pomona("validate", row.path, "--calipers", tmp_path / "c.csv")
        assert code == (0 if n else 2)
