"""Maps over more than one year: rows are found again by their wood, and no fruit outlives the winter."""

import re
import sqlite3
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from orchard_maker import frame_of_its_own, grow_map
from pomona import FruitCloud
from pomona.cli import app
from pomona.growth.measured import measured_fruits
from pomona.growth.season_growth import grow_season
from pomona.growth.visit_warnings import of_visits
from pomona.identity import seasons_of
from pomona.orchard import OrchardMap, Session, add_session, problems, remove_session
from pomona.orchard.hanging import hang_chances
from pomona.orchard.map_trees import find_trees
from pomona.synth.clouds import scene_pair

LAST_YEAR, THIS_YEAR = ("2024-06-10", "2024-07-20"), ("2025-06-12", "2025-07-15")


def hung(places: np.ndarray, year: str) -> FruitCloud:
    """Fruits of one size in names that are the year's own."""
    ids = tuple(f"{year}-{number}" for number in range(len(places)))
    return FruitCloud(places, ids=ids, diameters_m=np.full(len(places), 0.03))


def visits_to(fruits: FruitCloud, dates: tuple[str, ...], rng: np.random.Generator) -> list[Session]:
    """Visits that miss a seventh, each in a frame of its own, a third larger each time."""
    visits = []
    for number, date in enumerate(dates):
        seen = fruits.select(rng.random(len(fruits)) < 0.86)
        places = seen.positions + rng.normal(0, 0.006, seen.positions.shape)
        sizes = seen.diameters_m * 1.3**number * rng.normal(1.0, 0.03, len(seen))
        cloud = replace(seen, positions=places, diameters_m=sizes).transformed(frame_of_its_own(rng))
        visits.append(Session(date, date, "test", cloud))
    return visits


@pytest.fixture(scope="module")
def years() -> tuple[list[Session], list[Session]]:
    """Visits of two years: four in five places bear again, 6 cm from where fruits hung."""
    rng = np.random.default_rng(4)
    wood = scene_pair("base", seed=3).map.positions
    again = wood[rng.random(len(wood)) < 0.8]
    again = again + rng.normal(0, 0.06 / np.sqrt(3.0), again.shape)
    return visits_to(hung(wood, "old"), LAST_YEAR, rng), visits_to(hung(again, "new"), THIS_YEAR, rng)


@pytest.fixture(scope="module")
def map_of_years(years: tuple[list[Session], list[Session]], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nobody writes to it."""
    return grow_map(tmp_path_factory.mktemp("years") / "orchard.gpkg", [*years[0], *years[1]])


def counted(path: Path) -> float:
    return float(hang_chances(OrchardMap(path).fruits()).sum())


def test_a_winter_lies_between_visits_that_are_months_apart() -> None:
    days = np.array([0.0, 30.0, 160.0, 365.0, 366.0, 900.0])
    assert seasons_of(days) == [slice(0, 3), slice(3, 5), slice(5, 6)]
    assert seasons_of(days[:3]) == [slice(0, 3)]


def test_somebody_may_come_by_in_the_winter() -> None:
    """What is longer than a season is parted at its longest pauses; fruits that hang all year are visited all year."""
    year = np.array([0.0, 30.0, 80.0])
    assert seasons_of(np.concatenate([year, [220.0], 365.0 + year])) == [slice(0, 3), slice(3, 4), slice(4, 7)]
    assert seasons_of(np.concatenate([year, year + 240.0])) == [slice(0, 3), slice(3, 6)]
    assert seasons_of(np.array([0.0, 160.0])) == [slice(0, 2)]
    assert seasons_of(np.arange(0.0, 800.0, 60.0)) == [slice(0, 14)]
    assert seasons_of(np.empty(0)) == [slice(0, 0)]


def test_no_fruit_is_one_of_last_year(map_of_years: Path) -> None:
    seen = OrchardMap(map_of_years).observations()
    of_years = {fruit: set() for fruit in seen.fruit_ids.tolist()}
    for fruit, date in zip(seen.fruit_ids.tolist(), seen.dates, strict=True):
        of_years[fruit].add(date[:4])
    assert all(len(one) == 1 for one in of_years.values())
    fruits = OrchardMap(map_of_years).fruits()
    for fruit, state, chance in zip(
        fruits.ids or (), fruits.extras["state"], fruits.extras["state_probability"], strict=True
    ):
        assert of_years[int(fruit)] == {"2025"} or (state, float(chance)) == ("gone", 1.0)
    assert problems(map_of_years) == []


def test_this_year_is_counted_as_if_there_had_been_no_other(
    map_of_years: Path, years: tuple[list[Session], list[Session]], tmp_path: Path
) -> None:
    alone = grow_map(tmp_path / "alone.gpkg", years[1])
    assert counted(map_of_years) == pytest.approx(counted(alone), rel=0.01)
    n_fruits = len({label for one in years[1] for label in one.cloud.ids or ()})
    assert counted(map_of_years) == pytest.approx(n_fruits, rel=0.1)


def test_the_first_visit_of_a_year_is_found_and_says_so(
    years: tuple[list[Session], list[Session]], tmp_path: Path
) -> None:
    path = grow_map(tmp_path / "orchard.gpkg", years[0])
    first = add_session(path, years[1][0])
    assert (first.is_added, first.n_matched, first.n_missed) == (True, 0, 0)
    assert first.n_new == len(years[1][0].cloud)
    assert first.season_before == LAST_YEAR[-1]
    assert not first.is_year_doubted
    second = add_session(path, years[1][1])
    assert second.season_before is None
    assert not second.is_year_doubted
    assert second.n_matched > 0.7 * len(years[1][1].cloud)


@pytest.mark.parametrize("date", ["2023-07-20", "2025-07-20"])
def test_a_slip_of_the_year_is_told(years: tuple[list[Session], list[Session]], tmp_path: Path, date: str) -> None:
    """Fruits a year apart do not hang where they hung to a centimetre."""
    path, csv = grow_map(tmp_path / "orchard.gpkg", years[0][:1]), tmp_path / "late.csv"
    years[0][1].cloud.write(csv)
    told = CliRunner().invoke(app, ["map", "add", str(path), str(csv), "--date", date]).stderr
    assert re.search(
        rf"2\d\d of 3\d\d fruits of late lie where .* to [6-9] mm along each axis.*: is {date} right", told
    )


def test_the_order_of_years_changes_nothing(
    map_of_years: Path, years: tuple[list[Session], list[Session]], tmp_path: Path
) -> None:
    other = grow_map(tmp_path / "orchard.gpkg", [*years[1], *years[0]])
    assert counted(other) == pytest.approx(counted(map_of_years), abs=0.01)
    for session in years[0]:
        assert remove_session(other, session.name) is not None
    assert counted(other) == pytest.approx(counted(map_of_years), rel=0.01)


def test_maps_of_two_years_merge_and_say_that_no_fruit_was_known(
    years: tuple[list[Session], list[Session]], tmp_path: Path
) -> None:
    one, other = (grow_map(tmp_path / f"{visits[0].name}.gpkg", visits) for visits in years)
    told = CliRunner().invoke(app, ["map", "merge", str(one), str(other)]).stdout
    assert re.search(r"found by where \d+ fruits hung; none was known, for none outlives the winter", told), told
    assert counted(one) == pytest.approx(counted(other), rel=0.01)


def test_growth_is_of_the_last_year(map_of_years: Path, years: tuple[list[Session], list[Session]]) -> None:
    fruits = measured_fruits(map_of_years)
    assert fruits.sessions == THIS_YEAR
    labels = {label for of_fruit in fruits.labels for label in of_fruit if label is not None}
    assert labels == {label for one in years[1] for label in one.cloud.ids or ()}


def test_a_stretch_that_this_year_has_not_visited_is_found_by_last_year(
    years: tuple[list[Session], list[Session]], tmp_path: Path
) -> None:
    """The first visit of the year saw one half; the second is to the other, where all fruits of the map are gone."""
    old, new = years
    path = grow_map(tmp_path / "orchard.gpkg", old)
    # Ends of the row by its longest extent in the first visit's own frame.
    places = new[0].cloud.positions - new[0].cloud.positions.mean(axis=0)
    along = places @ np.linalg.svd(places, full_matrices=False)[2][0]
    names = np.array(new[0].cloud.ids)
    first = new[0].cloud.select(along < -0.5)
    beyond = new[1].cloud.select(np.isin(new[1].cloud.ids, names[along > 0.5]))
    assert add_session(path, replace(new[0], cloud=first)).is_added
    added = add_session(path, replace(new[1], cloud=beyond))
    assert (added.is_added, added.n_matched) == (True, 0)


def test_growth_names_a_part_that_this_year_has_not_visited(
    years: tuple[list[Session], list[Session]], tmp_path: Path
) -> None:
    other = [replace(visit, name=f"other {visit.name}", cloud=scattered_wood(visit)) for visit in years[0]]
    path = grow_map(tmp_path / "orchard.gpkg", years[0][:1])
    for session in [years[0][1], *other, *years[1]]:
        assert add_session(path, session, new_part=True).is_added
    assert {visit.name: visit.part for visit in OrchardMap(path).visits()}[other[0].name] == 2
    growth = grow_season(path)
    assert growth.blocks[0].n_fruits == pytest.approx(len(growth.fruits.ids), rel=0.2)
    assert f"part 2 of the map was visited on {LAST_YEAR[-1]} last" in "; ".join(of_visits(growth))


def scattered_wood(visit: Session) -> FruitCloud:
    """Another row, that has nothing in common with that one: each of its fruits at a place of its own."""
    places = scene_pair("base", seed=11).map.positions[: len(visit.cloud)]
    first = places + np.random.default_rng(int(visit.date[-2:])).normal(0.0, 0.006, places.shape)
    return replace(visit.cloud.select(np.arange(len(first))), positions=first)


def test_trees_stay_for_years_and_count_the_fruits_of_the_last_season(
    years: tuple[list[Session], list[Session]], tmp_path: Path
) -> None:
    """Of a row whose trees the fruits of both years no longer tell, as it happens."""
    path = grow_map(tmp_path / "orchard.gpkg", years[0])
    (first,) = find_trees(path)
    assert first.kind == "trees"
    assert first.n_fruits == len(OrchardMap(path).fruits())
    for session in years[1]:
        assert add_session(path, session).is_added
    hanging = [day >= "2025" for day in OrchardMap(path).fruits().extras["last_seen"]]
    with sqlite3.connect(path) as connection:
        counts = [count for (count,) in connection.execute("SELECT n_fruits FROM trees ORDER BY number")]
    connection.close()
    assert sum(counts) == sum(hanging) < len(hanging)
    (now,) = find_trees(path)
    assert [name for name, _, _ in now.trees] == [name for name, _, _ in first.trees]
    assert now.n_fruits == sum(hanging)
    assert [count for _, _, count in now.trees] == pytest.approx(counts, abs=12)
    assert problems(path) == []
    (forgotten,) = find_trees(path, forget=True)
    assert forgotten.kind == "none"
    assert forgotten.n_fruits == sum(hanging)
