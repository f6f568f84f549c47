"""What an outsider found who had not read the code: each is refused in one line, or without an answer."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest

import pomona


def test_no_output_takes_the_name_of_a_journal(here, pomona):
    Path("orchard.gpkg-journal").write_bytes(b"what a killed writer left")
    for name in ("orchard.gpkg-journal", "orchard.gpkg-wal", "new.gpkg-shm"):
        code, _, err = pomona("match", "query.csv", "map.csv", "-o", name, "--force")
        assert code == 2
        assert "journal" in err
        assert err.count("\n") == 1
    assert Path("orchard.gpkg-journal").read_bytes() == b"what a killed writer left"


@pytest.mark.parametrize(
    ("edit", "told"),
    [
        ("UPDATE sessions SET date = X'00'", "date"),
        ("DELETE FROM fruits", "fruit"),
    ],
)
def test_a_map_that_was_edited_is_no_match_for_nothing(here, pomona, edit, told):
    with sqlite3.connect("orchard.gpkg") as connection:
        connection.create_function("ST_IsEmpty", 1, lambda _: 0)
        for name in ("ST_MinX", "ST_MaxX", "ST_MinY", "ST_MaxY"):
            connection.create_function(name, 1, lambda _: 0.0)
        connection.execute(edit)
    connection.close()
    code, _, err = pomona("map", "add", "orchard.gpkg", "query.csv", "--date", "2024-09-28")
    assert code == 2
    assert told in err
    assert err.count("\n") == 1


def test_settings_of_endless_names_are_refused(here, pomona):
    Path("x.toml").write_text("[" + "a." * 200_000 + "a]")
    code, _, err = pomona("match", "query.csv", "map.csv", "--config", "x.toml")
    assert code == 2
    assert "x.toml: line 1: found 400003 characters, expected at most 1000" in err


def test_millimetres_come_into_no_map_as_free_units(here, pomona):
    cloud = np.loadtxt("map.csv", delimiter=",", skiprows=1, usecols=(1, 2, 3)) * 1000
    np.savetxt("mm.csv", cloud, delimiter=",", header="x,y,z", comments="")
    code, _, err = pomona("map", "add", "new.gpkg", "mm.csv", "--date", "2024-09-01", "--unit", "free")
    assert code == 2
    assert "--unit" in err
    assert not Path("new.gpkg").exists()


def test_a_noise_beyond_the_spacing_is_refused_and_one_of_nothing_finds_nothing(here):
    for noise_m in (1.0, 1e30, 1e300):
        with pytest.raises(pomona.PomonaError, match=r"noise_m: found .* expected at most"):
            pomona.match("query.csv", "map.csv", noise_m=noise_m)
    found = pomona.match("query.csv", "map.csv", noise_m=5e-324)
    assert bool(len(found.pairs)) == (found.status == "Found")


@pytest.mark.parametrize(
    "arguments",
    [
        {"noise_m": "x"},
        {"noise_m": 10**400},
        {"scale": None},
        {"method": ["paper"]},
        {"per_frame": "x"},
    ],
)
def test_arguments_of_other_types_are_our_error(here, arguments):
    with pytest.raises(pomona.PomonaError) as refused:
        pomona.match("query.csv", "map.csv", **arguments)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("cloud", [[["a", "b", "c"]], {}, [[1.0, 2.0], [3.0]], [[10**400, 0, 0]] * 9])
def test_arrays_of_other_things_are_our_error(cloud):
    with pytest.raises(pomona.PomonaError):
        pomona.match(cloud, np.zeros((5, 3)))
