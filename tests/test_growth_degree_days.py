"""Growth by warmth in place of days: degree days, and the tables of temperatures that they come from."""

from contextlib import closing
from datetime import date, datetime, timedelta
from pathlib import Path

import pytest

from growth_maker import BLOOM, grow_row
from pomona import PomonaError, geopackage
from pomona.growth.season_clock import DegreeDays, read_temperatures
from pomona.growth.season_growth import grow_season


def write_temperatures(path: Path, first: date, means_c: list[float]) -> Path:
    lines = [f"{first + timedelta(days=i)},{mean - 6:g},{mean + 6:g}" for i, mean in enumerate(means_c)]
    path.write_text("date,min_c,max_c\n" + "\n".join(lines) + "\n")
    return path


def test_degree_days_run_as_fast_as_it_is_warm(tmp_path: Path) -> None:
    first = date(2024, 6, 1)
    path = write_temperatures(tmp_path / "t.csv", first, [15.0] * 10 + [25.0] * 10)
    means = read_temperatures(path, [first, first + timedelta(days=19)])
    moments = [datetime(2024, 6, day) for day in (1, 11, 20)]
    clock = DegreeDays(means, moments[0], moments[-1])
    times = clock.times(moments)
    assert times[2] - times[0] == pytest.approx(19.0)
    assert (times[2] - times[1]) / (times[1] - times[0]) == pytest.approx(9 * 20 / (10 * 10))
    assert clock.per_day(moments[-1]) == pytest.approx(2 * clock.per_day(moments[0]))
    # Beyond the table goes on what was usual at its end.
    later = clock.times([datetime(2024, 6, 21), datetime(2024, 6, 22)])
    assert later[1] - later[0] == pytest.approx(15.0 * clock.per_day(moments[0]) / 10.0)


def test_growth_by_degree_days_is_found_by_what_it_foretells(tmp_path: Path) -> None:
    """A cold fortnight in the middle: fruits that grow by warmth stand still in it."""
    first = BLOOM + timedelta(days=50)
    path = write_temperatures(tmp_path / "t.csv", first, [25.0] * 15 + [6.0] * 15 + [25.0] * 16)
    row = grow_row(tmp_path / "o.gpkg", days=(50, 65, 66, 88), scales=(1.0,) * 4, noise_mm=0.5, n_trees=2)
    moved = tmp_path / "moved.gpkg"
    moved.write_bytes(row.path.read_bytes())
    # The same sizes, seen when the warmth that they took had come: after the cold.
    with closing(geopackage.connect(moved)) as connection:
        (name,) = connection.execute("SELECT name FROM sessions ORDER BY date LIMIT 1 OFFSET 2").fetchone()
        connection.execute("UPDATE sessions SET date = ? WHERE name = ?", (str(first + timedelta(days=30)), name))
    found = grow_season(moved, temperature=path)
    assert found.curve.clock.name == "degree days"
    assert len(found.curves) == 6


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "found the header ''"),
        ("day,mean_c\n", "expected a table with date and mean_c"),
        ("date,mean_c\n", "found no days"),
        ("date,mean_c\n2024-06-01,x\n", "line 2: mean_c: found 'x', expected a number"),
        ("date,mean_c\n2024-06-01,294\n", "line 2: mean_c: found 294, expected degrees Celsius"),
        ("date,mean_c\n2024-06-01,20\n2024-06-01,21\n", "line 3: found 2024-06-01 a second time"),
        ("date,min_c,max_c\n2024-06-01,24,12\n", "line 2: found min_c 24 above max_c 12, expected it below"),
        ("date,mean_c\n01.06.2024,20\n", "date: found '01.06.2024', expected a day"),
        ("date,mean_c\n2024-06-01,20\n2024-06-03,20\n", "found no 2024-06-02"),
        ("date,mean_c\n2024-06-02,20\n2024-06-03,20\n", "expected all days from 2024-06-01 to 2024-06-03"),
        ("date,mean_c\n2024-06-01\n", "line 2: found 1 cells, expected 2"),
    ],
)
def test_temperatures_that_are_none_are_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(PomonaError) as refused:
        read_temperatures(path, [date(2024, 6, 1), date(2024, 6, 3)])
    assert said in str(refused.value)
    assert str(refused.value).startswith(str(path))
