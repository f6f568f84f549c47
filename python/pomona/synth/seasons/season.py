"""A season told: a row is grown, each visit drives along it, sees what shows, and measures it in its own way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pomona.cloud import FruitCloud
from pomona.synth.false_points import false_points
from pomona.synth.living import LivingRow, grow
from pomona.synth.living.axis_growth import unit
from pomona.synth.living.streams_of_chance import chance
from pomona.synth.rotations import uniform_rotation
from pomona.synth.seasons.drive import Drive, plan_drive
from pomona.synth.seasons.place_errors import drifted, ray_covariances
from pomona.synth.seasons.visibility import shown_shares

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from datetime import date

    from numpy.typing import NDArray

    from pomona.synth.row_geometry import FruitSolids
    from pomona.synth.seasons.season_plan import SeasonPlan

__all__ = ["FALSE", "Season", "SeasonVisit", "draw_season"]

FALSE = 0
"""In place of a fruit's id: a point that is none."""

_BEST_FRAMES = 3
"""A fruit is as visible as these frames that see most of it, on average."""

_CHANCE_OF_SEEING = 0.08
"""Standard deviation of how a detector takes the visible share: of two fruits alike one is found."""

_SHOWN_IN_VIEW = 0.1
"""A frame that shows less of a fruit is no view of it."""

_TRANSLATION_M = 20.0
_FALSE_VIEWS = (3, 12)
"""Fewest and most frames that show a false point."""


@dataclass(frozen=True, eq=False)
class SeasonVisit:
    """One visit: the cloud, and the truth about it.

    Attributes
    ----------
    day : date
    drive : Drive
    cloud : FruitCloud
        N fruits in the session's frame, without ids.
    fruits : (N,) int64
        Fruit that each row of the cloud is, `FALSE` for none.
    map_from_session : (4, 4)
        Rigid, to the row frame; drift is what it leaves.
    size_scale : float
        Factor of all diameters of the visit.
    truth : FruitSolids
        All labelled fruits that hang on that day.
    shown : (F,)
        Visible share of each of `truth`, NaN where the drive did not look.
    """

    day: date
    drive: Drive
    cloud: FruitCloud
    fruits: NDArray[np.int64]
    map_from_session: NDArray[np.float64]
    size_scale: float
    truth: FruitSolids
    shown: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Season:
    """Visits to one row, in the order of their dates."""

    plan: SeasonPlan
    seed: int
    row: LivingRow
    visits: tuple[SeasonVisit, ...]


def draw_season(
    plan: SeasonPlan, seed: int, *, tell: Callable[[int, int], None] = lambda _done, _total: None
) -> Season:
    """Draw a season; the same plan and seed give the same.

    Parameters
    ----------
    plan : SeasonPlan
    seed : int
    tell : callable
        Told how many visits are drawn, and of how many.

    Raises
    ------
    PomonaError
        When the seed is negative, or a tree has no room for its fruits.
    """
    row = grow(plan.design, seed)
    tell(0, plan.n_visits)
    visits = []
    for visit in visits_of(plan, seed, row):
        visits.append(visit)
        tell(len(visits), plan.n_visits)
    return Season(plan, seed, row, tuple(visits))


def visits_of(plan: SeasonPlan, seed: int, row: LivingRow) -> Iterator[SeasonVisit]:
    """Visit a row on the days of the plan; what a visit draws depends on its date alone, not on other visits."""
    for number, day in enumerate(plan.days):
        yield _visit(plan, row, number, day, chance(seed, f"visit of {day.isoformat()}"))


def _visit(plan: SeasonPlan, row: LivingRow, number: int, day: date, rng: np.random.Generator) -> SeasonVisit:
    drive = plan_drive(rng, plan, number)
    geometry = row.on(day)
    truth = row.fruits_on(day)
    by_frame = shown_shares(geometry, drive)
    shown = _best(by_frame)
    seen = _found(rng, plan, shown)
    n_false = round(plan.false_rate * len(seen))
    true_m = np.concatenate([truth.centres_m[seen], false_points(rng, truth.centres_m[seen], n_false)])
    rays = _rays(drive, true_m)
    covariances = ray_covariances(plan, rays)
    noise = np.einsum("nij,nj->ni", _roots(covariances), rng.normal(size=true_m.shape))
    measured = drifted(rng, plan, true_m + noise)
    size_scale = float(np.exp(plan.size_scale_sigma * rng.normal()))
    diameters = np.concatenate([truth.diameters_m[seen], rng.choice(truth.diameters_m, n_false)])
    diameters = np.maximum(size_scale * diameters + rng.normal(0.0, plan.size_noise_m, len(diameters)), 0.005)
    views = np.concatenate([_views(by_frame[:, seen]), rng.integers(*_FALSE_VIEWS, n_false)])
    map_from_session = _own_frame(rng) if plan.own_frames else np.eye(4)
    turn = map_from_session[:3, :3]
    order = rng.permutation(len(true_m))
    cloud = FruitCloud(
        ((measured - map_from_session[:3, 3]) @ turn)[order],
        diameters_m=diameters[order],
        covariances=_symmetric(turn.T @ covariances @ turn)[order],
        n_views=views[order],
    )
    fruits = np.concatenate([truth.ids[seen], np.full(n_false, FALSE)])[order]
    return SeasonVisit(day, drive, cloud, fruits, map_from_session, size_scale, truth, shown)


def _best(by_frame: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean share of the frames that see most of each fruit, (K, F) to (F,); NaN where none looks at it."""
    looked = np.isfinite(by_frame)
    most = np.sort(np.where(looked, by_frame, 0.0), axis=0)[::-1][:_BEST_FRAMES]
    count = np.minimum(looked.sum(axis=0), _BEST_FRAMES)
    return np.where(count > 0, most.sum(axis=0) / np.maximum(count, 1), np.nan)


def _found(rng: np.random.Generator, plan: SeasonPlan, shown: NDArray[np.float64]) -> NDArray[np.int64]:
    """Rows of the fruits that a detector finds: all in view but the share that is hidden most."""
    in_view = np.isfinite(shown)
    taken_for = shown + rng.normal(0.0, _CHANCE_OF_SEEING, len(shown))
    if not in_view.any():
        return np.empty(0, np.int64)
    least = np.quantile(taken_for[in_view], plan.hidden_share)
    return np.flatnonzero(in_view & (taken_for >= least))


def _views(by_frame: NDArray[np.float64]) -> NDArray[np.int64]:
    """Frames that show enough of each fruit, at least one."""
    views: NDArray[np.int64] = (np.nan_to_num(by_frame) >= _SHOWN_IN_VIEW).sum(axis=0)
    return np.maximum(views, 1)


def _rays(drive: Drive, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lines of sight from the camera that passes nearest, unit vectors."""
    along = np.abs(places[:, 0, None] - drive.cameras_m[None, :, 0])
    return unit(places - drive.cameras_m[along.argmin(axis=1)])


def _roots(covariances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Symmetric square roots; no noise has one too."""
    values, vectors = np.linalg.eigh(covariances)
    return np.asarray(np.einsum("nik,nk,njk->nij", vectors, np.sqrt(np.maximum(values, 0.0)), vectors))


def _symmetric(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((matrices + matrices.transpose(0, 2, 1)) / 2.0)


def _own_frame(rng: np.random.Generator) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, :3] = uniform_rotation(rng)
    pose[:3, 3] = rng.uniform(-_TRANSLATION_M, _TRANSLATION_M, 3)
    return pose
