"""`remove_session`: what is left is what the other sessions say."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchard_maker import frame_of_its_own
from pomona import FruitCloud, PomonaError, Views, geopackage
from pomona.orchard import OrchardMap, Session, add_session, problems, remove_session
from pomona.synth.clouds import scene_pair
from pomona.trajectory import Trajectory


@pytest.fixture(scope="module")
def scene() -> FruitCloud:
    cloud = scene_pair("base", seed=3).map
    rng = np.random.default_rng(4)
    return replace(cloud, diameters_m=rng.uniform(0.05, 0.09, len(cloud)))


def visit(scene: FruitCloud, date: str, seed: int) -> Session:
    """Nine of ten fruits, a little elsewhere, some larger, some of unknown size, in a frame of its own."""
    rng = np.random.default_rng(seed)
    seen = scene.select(np.sort(rng.choice(len(scene), len(scene) * 9 // 10, replace=False)))
    sizes = np.where(rng.random(len(seen)) < 0.2, np.nan, seen.diameters_m * 1.1)  # type: ignore[operator]
    shifted = replace(seen, positions=seen.positions + rng.normal(0, 0.004, (len(seen), 3)), diameters_m=sizes)
    frame = frame_of_its_own(rng)
    views = Views(frames=np.array([0, 1]), fruits=np.array([0, 1]))
    poses = Trajectory(np.array([0, 1]), np.array([0.0, 0.1]), np.tile(np.eye(4), (2, 1, 1)))
    return Session(date, date, "test", replace(shifted.transformed(frame), views=views), poses)


def table(path: Path) -> list[tuple[object, ...]]:
    fruits = OrchardMap(path).fruits()
    assert fruits.ids is not None
    assert fruits.diameters_m is not None
    # The scale of a frame, that sizes are told in, is 1 but for its last bit.
    diameters = map("{:.9f}".format, fruits.diameters_m)
    rows = zip(fruits.ids, map(tuple, fruits.positions.tolist()), diameters, strict=True)
    return [(*row, *about) for row, *about in zip(rows, *fruits.extras.values(), strict=True)]


# The order of adding is not that of the dates: a visit may be added late.
DATES = ("2024-06-01", "2024-08-01", "2024-07-01", "2024-09-01")


@pytest.fixture
def season(tmp_path: Path, scene: FruitCloud) -> Path:
    path = tmp_path / "orchard.gpkg"
    for seed, date in enumerate(DATES):
        assert add_session(path, visit(scene, date, seed)).is_added
        assert problems(path) == []
    return path


def test_the_last_one_in_and_out_leaves_no_trace(season: Path, scene: FruitCloud) -> None:
    before, visits = table(season), OrchardMap(season).visits()
    last = visit(scene.select(np.arange(0, len(scene), 2)), "2024-10-01", 9)
    stray = replace(last.cloud, positions=np.vstack([last.cloud.positions[:-1], [[90.0, 90.0, 90.0]]]))
    added = add_session(season, replace(last, cloud=stray))
    assert added.is_added
    assert added.n_new >= 1
    removed = remove_session(season, "2024-10-01")
    assert removed is not None
    assert (removed.n_observations, removed.n_gone, removed.n_left) == (len(stray), added.n_new, len(DATES))
    # Some of those it missed had been missed before.
    assert added.n_matched <= removed.n_changed <= added.n_matched + added.n_missed
    assert table(season) == before
    assert [one.name for one in OrchardMap(season).visits()] == [one.name for one in visits]
    # The new fruits had ids, which nobody gets again.
    again = add_session(season, replace(last, cloud=stray))
    assert again.fruit_ids.max() == added.fruit_ids.max() + added.n_new


@pytest.mark.parametrize("name", DATES)
def test_whichever_goes_the_map_is_whole(season: Path, scene: FruitCloud, name: str) -> None:
    transforms = {one.name: one.map_from_session.tolist() for one in OrchardMap(season).visits()}
    assert remove_session(season, name) is not None
    assert problems(season) == []
    # The frame stays, that of the first session too; who hung on the one that goes hangs on its neighbour.
    for one in OrchardMap(season).visits():
        np.testing.assert_allclose(one.map_from_session, transforms[one.name], atol=0.01)
    firsts = np.unique(OrchardMap(season).observations().fruit_ids, return_counts=True)
    unmatched = np.isnan(OrchardMap(season).observations().probabilities).sum()
    assert unmatched == len(firsts[0])
    assert add_session(season, visit(scene, "2024-11-01", 7)).is_added
    assert problems(season) == []


def test_one_after_the_other_but_the_last(season: Path) -> None:
    for name in DATES[:-1]:
        assert remove_session(season, name) is not None
        assert problems(season) == []
    before = season.read_bytes()
    with pytest.raises(PomonaError, match="2024-09-01 is its only session, and a map has at least one"):
        remove_session(season, DATES[-1])
    assert season.read_bytes() == before


def test_nobody_and_a_look_change_nothing(season: Path) -> None:
    before = season.read_bytes()
    assert remove_session(season, "nobody") is None
    told = remove_session(season, DATES[1], dry=True)
    assert season.read_bytes() == before
    assert remove_session(season, DATES[1]) == told


def add_crops(path: Path, picture: bytes) -> None:
    """Give every observation a picture."""
    connection = geopackage.connect(path)
    connection.execute(
        "INSERT INTO crops (session_id, observation_id, frame, picture) SELECT session_id, id, 0, ? FROM observations",
        (picture,),
    )
    connection.close()


def count_crops(path: Path) -> int:
    connection = geopackage.connect(path)
    (count,) = connection.execute("SELECT count(*) FROM crops").fetchone()
    connection.close()
    return int(count)


def test_pictures_go_with_their_session(season: Path) -> None:
    add_crops(season, b"RIFF\0\0\0\0WEBP")
    assert problems(season) == []
    before = count_crops(season)
    removed = remove_session(season, DATES[1])
    assert removed is not None
    assert count_crops(season) == before - removed.n_observations
    assert problems(season) == []


def test_what_is_no_picture_is_told(season: Path) -> None:
    add_crops(season, b"<svg onload='alert(1)'/>")
    told = problems(season)
    assert len(told) == count_crops(season)
    assert told[0].startswith("crops 1: picture: found b\"<svg onload='alert(1)'/>\", expected a WebP or JPEG picture")
