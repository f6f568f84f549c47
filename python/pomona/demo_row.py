"""The whole story on recordings: every visit scanned by the detector inside, all in one map, judged by the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pomona.amounts import amount
from pomona.cloud import FruitCloud
from pomona.demo import growth_mm, remove_own
from pomona.demo_season import DemoSeason, told_season
from pomona.errors import PomonaError
from pomona.evaluate import PairScore, score_placed_pairs
from pomona.likes import DEMO_NAME
from pomona.orchard import OrchardMap, add_session, load_session
from pomona.pairs import write_pairs
from pomona.plot import draw_match, save_picture
from pomona.recording import open_recording
from pomona.scanning import scan
from pomona.survey.same_fruits import Seen, draw_same_fruits
from pomona.truth import WITHIN_M, aligned, true_fruits
from pomona.viewer.row_frame import known_vertical

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pomona.matching import Match

__all__ = ["DemoVisit", "RowDemo", "run_row_demo"]

VIDEO, TRUTH = "row.mp4", "fruits.csv"


@dataclass(frozen=True, eq=False)
class DemoVisit:
    """What came out of one visit.

    Attributes
    ----------
    session : Path
    n_fruits : int
    fruit_ids : (N,) int64
        Their identities in the map.
    diameter_mm : float
        Median.
    match : Match or None
        How it was found in the map of the visits before; None for the first.
    picture, pairs : Path or None
        Of the match.
    growth_mm : float
        Median growth of the fruits found again, since they were last seen.
    score : PairScore or None
        The pairs against the truth.
    """

    session: Path
    n_fruits: int
    fruit_ids: NDArray[np.int64]
    diameter_mm: float
    match: Match | None = None
    picture: Path | None = None
    pairs: Path | None = None
    growth_mm: float = float("nan")
    score: PairScore | None = None


@dataclass(frozen=True, eq=False)
class RowDemo:
    """What the demo made.

    Attributes
    ----------
    orchard : Path
    visits : list of DemoVisit
    n_identities : int
        Fruits in the map.
    same_fruits : Path
        Pictures of the last two visits with the fruits that both show.
    season : DemoSeason or None
        What follows from all visits together; None where only one is in the map.
    """

    orchard: Path
    visits: list[DemoVisit]
    n_identities: int
    same_fruits: Path
    season: DemoSeason | None


def run_row_demo(row: Path, folder: Path, tell: Callable[[str], None] = lambda _: None) -> RowDemo:
    """Scan the visits to a row, add them to a map in turn, judge each match, and tell growth and report of the season.

    Parameters
    ----------
    row
        A folder for each visit, named by its date, with `row.mp4`, its calibration, and `fruits.csv`, the truth.
    folder
        Where the files go; what the demo made before is made anew.
    tell
        Is told what is going on, a line a step.

    Raises
    ------
    PomonaError
        When the folder of a visit lacks something, or there is a map in `folder` that the demo did not make.
    """
    visits = _visits_in(row)
    folder.mkdir(parents=True, exist_ok=True)
    orchard = folder / "orchard.gpkg"
    remove_own(orchard)
    made: list[DemoVisit] = []
    seen: list[Seen] = []
    for number, visit in enumerate(visits):
        session, recording = folder / f"{visit.name}.gpkg", open_recording(visit / VIDEO)
        survey = scan(recording, output=session, name=f"{DEMO_NAME}{visit.name}", date=visit.name)
        made.append(_added(orchard, session, visits[: number + 1], folder))
        seen.append(Seen(recording, survey.parts[survey.longest].boxes, made[-1].fruit_ids))
        tell(_line(made[-1], visit.name))
    same = folder / "same_fruits.png"
    draw_same_fruits(same, *seen[-2:])
    truths = {
        f"{DEMO_NAME}{visit.name}": visit / TRUTH
        for visit, one in zip(visits, made, strict=True)
        if one.fruit_ids.any()
    }
    season = told_season(orchard, truths, folder / "report.html") if len(truths) > 1 else None
    return RowDemo(orchard, made, len(OrchardMap(orchard).fruits()), same, season)


def _visits_in(row: Path) -> list[Path]:
    visits = sorted(visit for visit in row.iterdir() if visit.is_dir()) if row.is_dir() else []
    if len(visits) < 2:
        raise PomonaError(f"{row}: found {len(visits)} folders, expected one for each of two visits or more")
    for visit in visits:
        for name in (VIDEO, TRUTH):
            if not (visit / name).is_file():
                raise PomonaError(f"{visit}: found no {name}, expected one in the folder of each visit")
    return visits


def _added(orchard: Path, session: Path, visits: list[Path], folder: Path) -> DemoVisit:
    loaded = load_session(session)
    cloud = loaded.cloud
    sizes_mm = 1000 * float(np.nanmedian(cloud.diameters_m)) if cloud.diameters_m is not None else float("nan")
    added = add_session(orchard, loaded)
    known = added.known
    if known is None or added.match is None or not added.is_added:
        return DemoVisit(session, len(cloud), added.fruit_ids, sizes_mm, added.match)
    day = visits[-1].name
    picture, pairs = folder / f"match_{day}.png", folder / f"pairs_{day}.csv"
    write_pairs(pairs, added.match, cloud, known)
    save_picture(draw_match(cloud, known, added.match, up_in_map=known_vertical(orchard)), picture)
    score = _score(added.match, (cloud, known), (visits[-1] / TRUTH, visits[-2] / TRUTH))
    grown_mm = growth_mm(added.match, cloud, known)
    return DemoVisit(session, len(cloud), added.fruit_ids, sizes_mm, added.match, picture, pairs, grown_mm, score)


def _score(match: Match, clouds: tuple[FruitCloud, FruitCloud], truth: tuple[Path, Path]) -> PairScore:
    """Judge by place: the clouds have frames of their own and are found in the truth first."""
    placed = []
    for cloud, path in zip(clouds, truth, strict=True):
        true = FruitCloud.read(path)
        placed.append(true_fruits(aligned(cloud, true), true, within_m=WITHIN_M))
    return score_placed_pairs(match.pairs.tolist(), *placed)


def _line(visit: DemoVisit, day: str) -> str:
    found = f"{day}: {amount(visit.n_fruits, 'fruit')}, median diameter {visit.diameter_mm:.0f} mm"
    if visit.match is None:
        return found
    return f"{found}; {visit.match.status.value}: {len(visit.match.pairs)} of them known"
