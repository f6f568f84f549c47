"""The order in which visits come and go changes nothing: drawn seasons, a partial row, both sides, both ways."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pomona.orchard import OrchardMap, Session, add_sessions, problems, remove_session
from pomona.synth.seasons import SEASONS, draw_season

N_VISITS = 4

FEW = settings(max_examples=4, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def season(name: str) -> list[Session]:
    """Visits to three trees, one of which sees but two of them."""
    plan = SEASONS[name]
    small = replace(plan, n_visits=N_VISITS, design=replace(plan.design, n_trees=3, leaves_per_tree=800))
    drawn = draw_season(small, 5)
    clouds = [
        replace(visit.cloud, ids=tuple(f"{n}.{row}" for row in range(len(visit.cloud))))
        for n, visit in enumerate(drawn.visits)
    ]
    in_row = clouds[1].transformed(drawn.visits[1].map_from_session).positions[:, 0]
    clouds[1] = clouds[1].select(np.flatnonzero(in_row < np.quantile(in_row, 0.65)))
    days = [day.isoformat() for day in small.days]
    return [Session(day, day, "drawn", cloud) for day, cloud in zip(days, clouds, strict=True)]


@pytest.fixture(scope="module", params=["easy", "hard"])
def visits(request: pytest.FixtureRequest) -> list[Session]:
    return season(request.param)


@pytest.fixture(scope="module")
def in_order(visits: list[Session], tmp_path_factory: pytest.TempPathFactory) -> set[tuple[object, ...]]:
    path = tmp_path_factory.mktemp("season") / "orchard.gpkg"
    assert all(added.is_added for added in add_sessions(path, visits))
    told = what_it_says(path)
    assert sum(len(sights) > 1 for sights, *_ in told) > 100
    return told


def what_it_says(path: Path) -> set[tuple[object, ...]]:
    """Who is who, by the names of the sights, and what has become of it; probabilities to a thousandth."""
    orchard = OrchardMap(path)
    seen, fruits = orchard.observations(), orchard.fruits()
    sights: dict[str, list[str]] = {}
    for fruit, label in zip(seen.fruit_ids.tolist(), seen.labels, strict=True):
        sights.setdefault(str(fruit), []).append(str(label))
    facts = zip(*(fruits.extras[name] for name in ("state", "n_missed", "state_probability")), strict=True)
    return {
        (frozenset(sights[name]), state, n_missed, round(float(probability), 3))
        for name, (state, n_missed, probability) in zip(fruits.ids or (), facts, strict=True)
    }


@FEW
@given(order=st.permutations(range(N_VISITS)), gone=st.sets(st.integers(0, N_VISITS - 1), max_size=N_VISITS - 1))
def test_whoever_came_first_and_whoever_left_and_came_again(
    visits: list[Session], in_order: set[tuple[object, ...]], order: list[int], gone: set[int]
) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "orchard.gpkg"
        assert all(added.is_added for added in add_sessions(path, [visits[number] for number in order]))
        for number in gone:
            assert remove_session(path, visits[number].name) is not None
            assert problems(path) == []
        assert all(added.is_added for added in add_sessions(path, [visits[number] for number in gone]))
        assert what_it_says(path) == in_order
        assert problems(path) == []
