"""A reconstruction in the frame and the metres of a map."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pomona.atomic import whole_folder
from pomona.cloud import Cloud, FruitCloud, as_cloud
from pomona.free_scale.scaling import FreeScaling, scaling_of
from pomona.localize.map_fruits import hanging_rows
from pomona.matching import Index, Match
from pomona.reconstruction import SparseModel, write_reconstruction

__all__ = ["NOTE", "Upgrade", "metric", "write_metric"]

NOTE = "metric.json"
"""Beside the files of an upgraded model: its scale, how sure it is, and of what map."""


ROUNDS = 5
"""Of pairing anew under the scale that was fitted: where a row bends, the first pairs are those of one part of it."""


@dataclass(frozen=True, eq=False)
class Upgrade:
    """What a map says of a reconstruction; true where it was found.

    Attributes
    ----------
    match : Match
        Of the fruits of the model with those of the map, the scale free.
    scaling : FreeScaling or None
        None where nothing was found, or too few pairs say how sure the scale is.
    """

    match: Match
    scaling: FreeScaling | None

    def __bool__(self) -> bool:
        return self.scaling is not None

    @property
    def numbers(self) -> dict[str, Any]:
        """Give what is known, JSON values."""
        found = self.scaling
        about: dict[str, Any] = {"status": str(self.match.status), "n_fruits": self.match.n_query}
        about |= {"n_map": self.match.n_map, "n_pairs": len(self.match.pairs)}
        if found is None:
            return about
        interval = {"interval_90": [found.low, found.high]}
        matrix = found.map_from_model.tolist()
        return {**about, "scale": found.scale, "sigma": found.sigma, **interval, "map_from_model": matrix}


def metric(
    fruits: Cloud, map: Cloud, *, config: Mapping[str, Any] | None = None, threads: int | None = None
) -> Upgrade:
    """Find the fruits of a reconstruction in a map, whatever its scale.

    Parameters
    ----------
    fruits : FruitCloud, array_like, str or Path
        In the frame and units of the reconstruction.
    map : FruitCloud, OrchardMap, array_like, str or Path
        Metres. Fruits that are gone are left out.
    config, threads : optional
        As in `pomona.match`.

    Raises
    ------
    PomonaError
        An array or a file is wrong. That there is no match is no error.
    """
    query: FruitCloud = as_cloud(fruits, "free")
    known = as_cloud(map)
    known = known.select(hanging_rows(known))
    index = Index(known, scale="free", config=config, threads=threads)
    match = index.match(query)
    scaling = scaling_of(match, query, known)
    for _ in range(ROUNDS):
        if scaling is None:
            break
        again = index.pairs_under(query, scaling.map_from_model, noise_m=match.noise_m)
        if len(again.pairs) <= len(match.pairs):
            break
        match = replace(again, log_odds=match.log_odds, noise_m=match.noise_m)
        scaling = scaling_of(match, query, known)
    return Upgrade(match, scaling)


def write_metric(folder: Path, model: SparseModel, upgrade: Upgrade, about: Mapping[str, Any]) -> None:
    """Write the model in the map's frame, metres, in the layout and form it came in, with a note beside it.

    The folder appears whole or not at all; it must not be there yet.
    """
    assert upgrade.scaling is not None
    note = json.dumps({**about, **upgrade.numbers}, indent=1)
    with whole_folder(folder) as partial:
        partial.mkdir()
        write_reconstruction(partial, model.moved(upgrade.scaling.map_from_model))
        (partial / NOTE).write_text(note + "\n", encoding="utf-8")
