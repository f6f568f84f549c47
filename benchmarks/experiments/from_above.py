"""Two matched clouds seen from above, apart: a line for every pair, as in the paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import pomona
from benchmarks.experiments.takes import Take
from benchmarks.experiments.visits import visited
from pomona.cloud import FruitCloud

PAIRS = (
    ("tractor-08-28", "walking-08-28-darker-far", "experiments-from-above-same-day.png"),
    ("walking-08-09", "tractor-08-28-inverse", "experiments-from-above-weeks-apart.png"),
)
"""The paper's two figures: map, query, picture."""

APART_M = 1.6
"""The query is moved off the map by so much; else it lies where the match puts it, so right lines are parallel."""


KINDS = {"right": "tab:green", "wrong": "black", "between fruits of other rows": "0.75"}
"""What a pair joins, and the colour of its line."""

SAID = "lines green, black, grey; map red, query blue; own detections"


def from_above(folder: Path, images: Path) -> str:
    """Draw both figures and say in markdown what they show."""
    said = []
    for map_name, query_name, picture in PAIRS:
        map_, query = (visited(Take(name), "shipped", folder) for name in (map_name, query_name))
        match = pomona.match(query.cloud, map_.cloud)
        kinds = [_kind(query.true_ids[row], map_.true_ids[other]) for row, other in match.pairs.tolist()]
        draw(match, query.cloud, map_.cloud, kinds, images / picture)
        counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in KINDS)
        title = f"`{query_name}` in `{map_name}`"
        said.append(f"![{query_name}](images/{picture})\n\n{title}: {len(match.pairs)} pairs, {counts} ({SAID}).\n")
    return "\n".join(said)


def _kind(first: str, second: str) -> str:
    if not first and not second:
        return "between fruits of other rows"
    return "right" if first == second else "wrong"


def draw(match: pomona.Match, query: FruitCloud, map_: FruitCloud, kinds: list[str], path: Path) -> None:
    """Draw the query where the match puts it, but apart; the map's frame is a camera's: x along the row, z across."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    laid = query if match.map_from_query is None else query.transformed(match.map_from_query)
    seen_query, seen_map = laid.positions[:, [0, 2]] + [0.0, APART_M], map_.positions[:, [0, 2]]
    figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
    for (row, other), kind in zip(match.pairs.tolist(), kinds, strict=True):
        axes.plot(*np.array([seen_map[other], seen_query[row]]).T, color=KINDS[kind], linewidth=0.7)
    axes.scatter(*seen_map.T, s=9, color="tab:red", label="map", zorder=3)
    axes.scatter(*seen_query.T, s=9, color="tab:blue", label="query", zorder=3)
    axes.set(xlabel="along the row (m)", ylabel="across (m)")
    axes.set_aspect("equal")
    axes.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    figure.savefig(path, dpi=100)
    plt.close(figure)
