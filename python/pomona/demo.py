"""The whole story on a seeded orchard: two visits, one map, every fruit found again, its growth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pomona.amounts import amount
from pomona.errors import PomonaError
from pomona.evaluate import PairScore, score_pairs
from pomona.likes import DEMO_DATES, DEMO_RECORDING, DEMO_SEED, is_of_demo
from pomona.orchard import OrchardMap, add_session, load_session, write_session
from pomona.pairs import write_pairs
from pomona.plot import draw_match, save_picture
from pomona.synth.clouds import scene_pair
from pomona.synth.named_cells import Cell

if TYPE_CHECKING:
    from pomona.cloud import FruitCloud
    from pomona.matching import Match

__all__ = ["Demo", "growth_mm", "remove_own", "run_demo"]

# Three weeks apart: a third hidden on each visit, branches 3 cm lower, fruits 12 mm thicker, nobody knows the poses.
DEMO_CELL = Cell("demo", hidden=0.30, false_rate=0.05, noise_m=0.02, sag_m=0.03, upright=True, sizes=True)


@dataclass(frozen=True, eq=False)
class Demo:
    """What the demo made and what came out of it.

    Attributes
    ----------
    sessions, orchard, pairs, picture
        The files.
    match
        How the second visit was found in the map of the first.
    n_identities
        Fruits in the map after both visits.
    growth_mm
        Median growth of the fruits found again, from their diameters.
    score
        The pairs against the truth.
    """

    sessions: tuple[Path, Path]
    orchard: Path
    pairs: Path
    picture: Path
    match: Match
    n_identities: int
    growth_mm: float
    score: PairScore


def run_demo(folder: Path, tell: Callable[[str], None] = lambda _: None) -> Demo:
    """Draw two visits, add both to a map, draw the match; the files in `folder` are made anew.

    Parameters
    ----------
    folder
        Where the files go; made where it does not exist.
    tell
        Is told what is going on, a line a step.

    Raises
    ------
    PomonaError
        When there is a map in `folder` that the demo did not make, or a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    orchard, pairs, picture = folder / "orchard.gpkg", folder / "pairs.csv", folder / "match.png"
    remove_own(orchard)

    scene = scene_pair(DEMO_CELL, DEMO_SEED)
    tell(f"drew a row of five trees as two visits saw it: {amount(len(scene.map), 'fruit')}, then {len(scene.query)}")
    first_date, second_date = DEMO_DATES
    sessions = (_write_visit(folder, first_date, scene.map), _write_visit(folder, second_date, scene.query))

    first = add_session(orchard, load_session(sessions[0]))
    second = add_session(orchard, load_session(sessions[1]))
    known = second.known
    if known is None or second.match is None or not second.is_added:
        raise RuntimeError("the second visit of the demo was not found in the map of the first")
    tell(f"added both to a map: {amount(second.n_matched, 'fruit')} known again, {second.n_new} new")

    write_pairs(pairs, second.match, scene.query, known)
    save_picture(draw_match(scene.query, known, second.match, up_in_map=scene.up), picture)
    truth_of = dict(zip(map(str, first.fruit_ids.tolist()), scene.map.ids or (), strict=True))
    return Demo(
        sessions=sessions,
        orchard=orchard,
        pairs=pairs,
        picture=picture,
        match=second.match,
        n_identities=len(OrchardMap(orchard).fruits()),
        growth_mm=growth_mm(second.match, scene.query, known),
        score=score_pairs(
            second.match.pairs.tolist(), scene.query.ids or (), tuple(truth_of[name] for name in known.ids or ())
        ),
    )


def remove_own(orchard: Path) -> None:
    """Remove the map that a demo made; refuse any other."""
    if orchard.exists() and not is_of_demo(orchard):
        raise PomonaError(f"{orchard}: is not the map of a demo: take another folder")
    orchard.unlink(missing_ok=True)


def _write_visit(folder: Path, date: str, cloud: FruitCloud) -> Path:
    path = folder / f"{date}.gpkg"
    write_session(path, cloud, name=date, date=date, recording=DEMO_RECORDING)
    return path


def growth_mm(match: Match, query: FruitCloud, map: FruitCloud) -> float:
    """Median difference of the diameters over the pairs."""
    assert query.diameters_m is not None
    assert map.diameters_m is not None
    growth_m = query.diameters_m[match.pairs[:, 0]] - map.diameters_m[match.pairs[:, 1]]
    return 1000.0 * float(np.nanmedian(growth_m))
