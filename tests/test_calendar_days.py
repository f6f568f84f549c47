"""A date that there is not is told as that, and not as one that is written in a wrong way."""

import json
from datetime import date, timedelta
from pathlib import Path

import pytest

from pomona import FruitCloud, PomonaError
from pomona.calendar_days import expected_day
from pomona.farm.recorded_visits import visits_by_table
from pomona.growth.harvest_day import harvest_day
from pomona.orchard import Session, add_session
from pomona.orchard.visit_days import require_visit_day
from pomona.store.values import iso_date

NO_DAY = "expected a day of the calendar: there is no such day"


@pytest.mark.parametrize(
    "text", ["2024-02-30", "20240230", " 2023-02-29 ", "2024-04-31T10:00:00", "2024-13-01", "2024-00-10", "0000-01-01"]
)
def test_a_day_that_there_is_not(text: str) -> None:
    assert expected_day(text, "a day") == NO_DAY


@pytest.mark.parametrize("text", ["9 August", "", "2024-2-30", "2024-02-20T25:00:00", "202402301", 5, None])
def test_what_is_written_otherwise(text: object) -> None:
    assert expected_day(text, "a day") == "expected a day"


def test_every_day_of_a_leap_year_is_one() -> None:
    days = (date.fromordinal(date(2024, 1, 1).toordinal() + day) for day in range(366))
    assert {expected_day(day.isoformat(), "a day") for day in days} == {"expected a day"}


def test_it_is_told_where_days_are_said(pomona, here: Path) -> None:
    for refusing, words in (
        (lambda: iso_date("2024-02-30"), "session: found the date '2024-02-30', "),
        (lambda: harvest_day("2024-06-31"), "--harvest: found '2024-06-31', "),
        (lambda: visits_by_table(here / "table.csv"), "line 2: date: found '2024-02-30', "),
    ):
        (here / "table.csv").write_text("row,date,recording\na,2024-02-30,map.csv\n")
        with pytest.raises(PomonaError) as refused:
            refusing()
        assert str(refused.value).endswith(words + NO_DAY)
    code, printed, told = pomona("map", "add", "new.gpkg", "map.csv", "--date", "2024-02-30")
    assert (code, printed) == (2, "")
    assert told == f"pomona: map.csv: date: found the date '2024-02-30', {NO_DAY}\n"
    (here / "R" / "recording.json").write_text(json.dumps({"date": "2024-02-30"}))
    code, _, told = pomona("scan", "R", "-o", "new.gpkg")
    assert (code, told.count("\n")) == (2, 1)
    assert told.endswith(f"recording.json: date: found '2024-02-30', {NO_DAY}\n")


@pytest.mark.parametrize("day", ["3024-08-09", "0024-08-09", "1970-01-01T00:10:00"])
def test_a_visit_was_on_a_day_that_has_come(pomona, here: Path, day: str) -> None:
    code, printed, told = pomona("map", "add", "new.gpkg", "map.csv", "--date", day)
    assert (code, printed, told.count("\n")) == (2, "", 1)
    assert told.startswith(f"pomona: map.csv: date: found the date '{day}', expected a day from 2000-01-01 to today, ")
    assert not (here / "new.gpkg").exists()
    with pytest.raises(PomonaError, match=f"session map: found the date '{day}', expected a day from 2000-01-01"):
        add_session(here / "new.gpkg", Session("map", day, "", FruitCloud.read(here / "map.csv")))


def test_today_may_be_tomorrow_in_the_orchard() -> None:
    require_visit_day((date.today() + timedelta(days=1)).isoformat(), "session row")
    require_visit_day(f"{date.today()}T23:59:59", "session row")
    with pytest.raises(PomonaError, match="session row: found the date"):
        require_visit_day((date.today() + timedelta(days=2)).isoformat(), "session row")


def test_a_clock_that_was_never_set_refuses_no_day(monkeypatch: pytest.MonkeyPatch) -> None:
    class Unset(date):
        @classmethod
        def today(cls) -> "Unset":
            return cls(1970, 1, 1)

    monkeypatch.setattr("pomona.orchard.visit_days.date", Unset)
    require_visit_day("2026-08-09", "session row")
    with pytest.raises(PomonaError, match="expected a day from 2000-01-01"):
        require_visit_day("1999-12-31", "session row")
