"""Visits to rows, maps of them, and who is who there."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from pomona import FruitCloud
from pomona.orchard import OrchardMap, Session, add_sessions, write_session
from pomona.synth.clouds import scene_pair


def frame_of_its_own(rng: np.random.Generator) -> np.ndarray:
    """Where a visit that knows no other sees the row, 4 x 4: turned at random, some metres away."""
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.uniform(-5, 5, 3)
    return frame


def write_two_sessions(folder: Path) -> tuple[Path, Path]:
    """Session files of two visits to one row."""
    pair = scene_pair("base", seed=3)
    write_session(folder / "august.gpkg", pair.map, name="august", date="2024-08-01", recording="test")
    write_session(folder / "september.gpkg", pair.query, name="september", date="2024-09-01", recording="test")
    return folder / "august.gpkg", folder / "september.gpkg"


def scattered(cloud: FruitCloud, rng: np.random.Generator, scatter_m: float = 0.005) -> FruitCloud:
    """The fruits as another visit sees them, off a little; a map refuses what is the same to the millimetre."""
    return replace(cloud, positions=cloud.positions + rng.normal(0, scatter_m, cloud.positions.shape))


def grow_map(path: Path, visits: Sequence[Session]) -> Path:
    """Add visits to a map, which may not be there yet."""
    assert all(added.is_added for added in add_sessions(path, visits))
    return path


def who_is_who(path: Path) -> set[frozenset[str]]:
    """The sights of each fruit, by the names that the visits gave them."""
    seen = OrchardMap(path).observations()
    sights: dict[int, set[str]] = {}
    for fruit, label in zip(seen.fruit_ids.tolist(), seen.labels, strict=True):
        sights.setdefault(fruit, set()).add(str(label))
    return set(map(frozenset, sights.values()))
