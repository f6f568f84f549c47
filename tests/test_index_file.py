"""The index of a map in a file beside it: what it answers, and what becomes of files that are not its own."""

import os
import re
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pomona import FruitCloud, Index, Localizer, PomonaError, PomonaWarning
from pomona.synth.clouds import ScenePair, scene_pair


@pytest.fixture(scope="module")
def pair() -> ScenePair:
    return scene_pair("base", 3)


@pytest.fixture
def saved(pair: ScenePair, tmp_path: Path) -> Path:
    path = tmp_path / "map.index"
    Index(pair.map, compact=True).save(path)
    return path


def quietly_opened(path: Path, pair: ScenePair) -> Index:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return Index.open(path, pair.map)


def test_an_opened_index_answers_as_the_one_that_was_saved(pair: ScenePair, saved: Path) -> None:
    made, opened = Index(pair.map, compact=True).match(pair.query), quietly_opened(saved, pair).match(pair.query)
    assert made.status == opened.status == "Found"
    np.testing.assert_array_equal(made.map_from_query, opened.map_from_query)
    np.testing.assert_array_equal(made.pairs, opened.pairs)


def test_its_pairs_are_the_true_ones(pair: ScenePair, saved: Path) -> None:
    match = quietly_opened(saved, pair).match(pair.query)
    right = [pair.query.label(query) == pair.map.label(row) for query, row in match.pairs.tolist()]
    assert len(right) > 150
    assert np.mean(right) > 0.85


def test_pairs_under_a_known_pose(pair: ScenePair, saved: Path) -> None:
    match = quietly_opened(saved, pair).pairs_under(pair.query, pair.map_from_query)
    assert match
    assert len(match.pairs) > 150


def test_rows_that_are_not_in_the_map_are_not_found(saved: Path, pair: ScenePair) -> None:
    assert quietly_opened(saved, pair).match(scene_pair("noov", 5).query).status == "NoMatch"


def test_an_index_of_a_map_that_has_changed_is_made_anew_and_said(pair: ScenePair, saved: Path) -> None:
    grown = FruitCloud(np.vstack([pair.map.positions, [[0.0, 0.0, 9.0]]]))
    with pytest.warns(PomonaWarning, match="made from another map.*; it was made anew"):
        assert Index.open(saved, grown).match(pair.query)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Index.open(saved, grown)


@pytest.mark.parametrize("place", [3 / 4, 1 / 2, 1 / 100])
def test_a_byte_that_changed_is_noticed(pair: ScenePair, saved: Path, place: float) -> None:
    content = bytearray(saved.read_bytes())
    content[int(place * len(content))] ^= 4
    saved.write_bytes(content)
    with pytest.warns(PomonaWarning, match="made anew"):
        assert Index.open(saved, pair.map).match(pair.query)
    assert quietly_opened(saved, pair).match(pair.query)


@pytest.mark.parametrize("length", [0, 100, 512, 100_000])
def test_a_file_cut_short_is_noticed(pair: ScenePair, saved: Path, length: int) -> None:
    os.truncate(saved, length)
    with pytest.warns(PomonaWarning, match="made anew"):
        assert Index.open(saved, pair.map).match(pair.query)


def test_another_version_is_made_anew(pair: ScenePair, saved: Path) -> None:
    content = bytearray(saved.read_bytes())
    content[8] = 99
    saved.write_bytes(content)
    with pytest.warns(PomonaWarning, match="found version 99 of the format, expected 2; it was made anew"):
        Index.open(saved, pair.map)


def test_what_is_no_index_stays_as_it_is(pair: ScenePair, tmp_path: Path) -> None:
    other = tmp_path / "fruits.csv"
    other.write_text("x,y,z\n1,2,3\n", encoding="utf-8")
    with pytest.raises(PomonaError, match="is not the index of a map"):
        Index.open(other, pair.map)
    with pytest.raises(PomonaError, match="is there already"):
        Index(pair.map, compact=True).save(other)
    assert other.read_text(encoding="utf-8") == "x,y,z\n1,2,3\n"
    with pytest.raises(PomonaError, match="is no file"):
        Index.open(tmp_path / "absent.index", pair.map)


FULL = """
import resource, sys
from pomona import Index, PomonaError
resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
try:
    Index.open(sys.argv[1], sys.argv[2])
except PomonaError as error:
    print(error)
"""
"""Files may become no larger than 10 kB here."""


def test_a_damaged_index_that_cannot_be_made_anew_says_both(pair: ScenePair, saved: Path, tmp_path: Path) -> None:
    pair.map.write(tmp_path / "map.csv")
    saved.write_bytes(saved.read_bytes()[:-1])
    damaged = saved.read_bytes()
    command = [sys.executable, "-c", FULL, str(saved), str(tmp_path / "map.csv")]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert told.count("\n") == 1
    assert re.search(r"map\.index: .*; it cannot be made anew: .*File too large", told)
    assert saved.read_bytes() == damaged


@pytest.mark.parametrize("count", [0, 3, 4, 500])
@pytest.mark.parametrize("spread", [0.0, 1.0])
def test_maps_without_a_constellation_have_an_index_too(tmp_path: Path, count: int, spread: float) -> None:
    """Few fruits, all on one spot, or all in a line."""
    cloud = FruitCloud(np.arange(count)[:, np.newaxis] * np.array([spread, 0.0, 0.0]))
    Index(cloud, compact=True).save(tmp_path / "map.index")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        opened = Index.open(tmp_path / "map.index", cloud)
    assert opened.match(cloud).status in ("TooFew", "NoMatch", "Ambiguous")


def test_only_a_compact_index_is_saved(pair: ScenePair, tmp_path: Path) -> None:
    with pytest.raises(PomonaError, match="expected one made with compact=True"):
        Index(pair.map).save(tmp_path / "map.index")
    assert not list(tmp_path.iterdir())
    with pytest.raises(PomonaError, match="expected one by verified, metric"):
        Index(pair.map, scale="free", compact=True)


def test_a_file_in_the_way_stays_and_the_message_tells_what_to_do(pair: ScenePair, tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.index"
    foreign.write_text("someone's", encoding="ascii")
    with pytest.raises(PomonaError) as refused:
        Index(pair.map, compact=True).save(foreign)
    told = "is there already and is not the index of a map: take another name, or remove it first"
    assert str(refused.value) == f"{foreign}: {told}"
    assert foreign.read_text(encoding="ascii") == "someone's"


@pytest.mark.parametrize(
    "ask",
    [
        lambda path, cloud: Index(cloud, compact=True).save(path),
        lambda path, cloud: Index.open(path, cloud),
        lambda path, cloud: Localizer(cloud, index=path),
    ],
    ids=["save", "open", "localize"],
)
def test_a_name_that_no_file_can_have_is_an_error_of_one_line(
    pair: ScenePair, tmp_path: Path, ask: Callable[[Path, FruitCloud], object]
) -> None:
    with pytest.raises(PomonaError, match="has a NUL in it") as refused:
        ask(tmp_path / "map\0.index", pair.map)
    assert "\0" not in str(refused.value)
    assert "\n" not in str(refused.value)


def test_another_process_opens_it(pair: ScenePair, saved: Path) -> None:
    np.save(saved.with_suffix(".npy"), pair.map.positions)
    code = "import sys, numpy as np; from pomona import Index; print(Index.open(sys.argv[1], np.load(sys.argv[2])))"
    command = [sys.executable, "-W", "error", "-c", code, str(saved), str(saved.with_suffix(".npy"))]
    told = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout
    assert told == f"Index({len(pair.map)} fruits, verified, metric)\n"
