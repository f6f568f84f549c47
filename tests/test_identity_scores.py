"""The benchmark of identities over seasons: what counts as right."""

from pathlib import Path
from zlib import crc32

from benchmarks.drawn_seasons import DrawnSeason, DrawnVisit
from benchmarks.identity_scores import IdentityScore, score_identities
from benchmarks.seasons import scored

from pomona import FruitCloud
from pomona.orchard import OrchardMap, add_session
from pomona.synth.clouds import scene_pair


def test_every_pair_of_visits_counts() -> None:
    # Fruit 1 has one identity; fruit 2 changes it at the last visit; a false point has taken the identity of fruit 3.
    visits = [[(10, 1), (20, 2), (30, 3)], [(10, 1), (20, 2), (30, 0)], [(10, 1), (21, 2)]]
    score = score_identities(visits)
    assert (score.right, score.said, score.common) == (3 + 1, 3 + 1 + 1, 3 + 3)
    assert (score.whole, score.tracked) == (1, 2)


def test_gone_is_asked_of_the_identity_of_the_last_sight() -> None:
    visits = [[(10, 1), (20, 2), (30, 3)], [(11, 1), (20, 2)]]
    score = score_identities(visits, said_gone={10, 20, 30}, truly_gone={3, 4})
    # Identity 10 was left by its fruit; fruit 4 was never seen; fruit 2 hangs.
    assert (score.gone_right, score.gone_said, score.gone_true) == (1, 2, 1)
    assert (score.gone_wrong, score.living) == (1, 2)


def test_scores_of_seasons_add_up_and_nothing_asked_is_no_share() -> None:
    one = score_identities([[(1, 1)], [(1, 1)]])
    assert (one + one).right == 2
    assert set(IdentityScore().shares().values()) == {None}


def test_a_map_is_held_against_the_rows_of_the_files(tmp_path: Path) -> None:
    pair = scene_pair("base", seed=3)
    visits = []
    for date, cloud in (("2024-08-01", pair.map), ("2024-09-01", pair.query)):
        path = tmp_path / f"{date}.csv"
        FruitCloud(cloud.positions).write(path)
        # The true names of false points of the scenes are of no other point.
        visits.append(DrawnVisit(date, path, [1 + crc32(name.encode()) for name in cloud.ids or ()]))
    season = DrawnSeason("base", 3, tuple(visits), frozenset())
    for visit in visits:
        add_session(tmp_path / "orchard.gpkg", visit.session())
    score = scored(season, OrchardMap(tmp_path / "orchard.gpkg"))
    common = len(set(visits[0].fruits) & set(visits[1].fruits))
    assert score.common == common
    assert score.right > 0.9 * common
    assert score.said < 1.1 * common
