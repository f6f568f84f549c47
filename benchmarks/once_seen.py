"""Whether what one visit alone saw is as often a fruit as the map says: `fruit_probability` against the truth.

Two visits of cells of `pomona synth clouds`, also with other shares of false points; rows of `base` of which visits
miss three fruits in ten, each for itself, by place (stretches of the row, others on every visit) or always the same,
to 1 cm, after two to eight visits; seasons of `pomona synth season`. All go into maps as `map add` does it. Writes
once_seen.csv and once_seen.md.
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from benchmarks.drawn_seasons import drawn_season
from benchmarks.results import markdown, share, write_rows, write_text
from pomona.cloud import FruitCloud
from pomona.orchard import OrchardMap, Session, add_session, load_session
from pomona.synth.clouds import CELLS, Cell, scene_pair
from pomona.synth.false_points import false_points
from pomona.synth.scenes import draw_scene

CELL_NAMES = ("base", "o45s4", "part45", "thinned30", "thinned70", "doubled10", "trellis-part45")
FALSE_RATES = (0.0, 0.03, 0.1, 0.3)
N_VISITS = (2, 3, 5, 8)
HIDDEN = 0.3
NOISE_M = 0.01
STRETCH_M = 1.5
"""Of the row, in which a visit sees less, or more."""

Visit = tuple[Session, dict[str, bool]]
"""And which of its points, by name, are fruits."""


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks once_seen", description=__doc__)
    parser.add_argument("--first", type=int, default=20, help="first seed; model and beliefs were chosen on 0 to 5")
    parser.add_argument("--seeds", type=int, default=2, help="of each; default: as in the committed table")
    options = parser.parse_args(arguments)
    rows: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.first, options.first + options.seeds):
            for kind, false_rate, visits in drawn(Path(folder), seed):
                rows += [{"kind": kind, "false": false_rate, "seed": seed, **row} for row in counted(visits)]
            sys.stderr.write(f"seed {seed}\n")
    write_rows("once_seen.csv", rows)
    write_text("once_seen.md", f"# Seen once\n\n{' '.join((__doc__ or '').split())}\n\n{table(rows)}")


def drawn(folder: Path, seed: int) -> Iterator[tuple[str, str, list[Visit]]]:
    """Yield what is drawn with a seed: its kind, false points as a fraction of the fruits seen, and the visits."""
    for name in CELL_NAMES:
        yield f"cell {name}", f"{CELLS[name].false_rate:.2f}", visits_of_cell(folder, CELLS[name], seed)
    for rate in FALSE_RATES:
        cell = replace(CELLS["base"], false_rate=rate)
        yield "cell base", f"{rate:.2f}", visits_of_cell(folder, cell, seed)
        for hiding in ("each", "place", "same"):
            for n_visits in N_VISITS:
                yield f"hidden: {hiding}", f"{rate:.2f}", visits_of_row(folder, hiding, rate, n_visits, seed)
    for name, rate in (("easy", 0.02), ("hard", 0.08)):
        season = drawn_season(folder, name, seed)
        truths = [{str(row): fruit > 0 for row, fruit in enumerate(visit.fruits)} for visit in season.visits]
        sessions = [visit.session() for visit in season.visits]
        for n_visits in N_VISITS:
            if n_visits <= len(sessions):
                yield f"season {name}", f"{rate:.2f}", list(zip(sessions, truths, strict=True))[:n_visits]


def visits_of_cell(folder: Path, cell: Cell, seed: int) -> list[Visit]:
    pair = scene_pair(cell, seed)
    return [
        visit(folder, day, cloud.positions, np.array([name.startswith("f") for name in cloud.ids or ()]))
        for day, cloud in enumerate((pair.map, pair.query))
    ]


def visits_of_row(folder: Path, hiding: str, false_rate: float, n_visits: int, seed: int) -> list[Visit]:
    """Draw visits that miss fruits in one of three ways."""
    rng = np.random.default_rng([crc32(f"{hiding} {false_rate} {n_visits}".encode()), seed])
    places = draw_scene(rng, CELLS["base"]).row.positions
    chances = hidden_chances(rng, hiding, places, n_visits)
    visits = []
    for day in range(n_visits):
        seen = places[rng.random(len(places)) >= chances[:, day]]
        false = false_points(rng, seen, round(false_rate * len(seen)))
        points = np.concatenate([seen, false])
        points = points + rng.normal(0.0, NOISE_M / np.sqrt(2.0), points.shape)
        visits.append(visit(folder, day, points, np.arange(len(points)) < len(seen)))
    return visits


def hidden_chances(
    rng: np.random.Generator, hiding: str, places: NDArray[np.float64], n_visits: int
) -> NDArray[np.float64]:
    """Return the chance of each visit to miss each fruit, (N, V): the same, by place, or of each fruit its own."""
    shape = (len(places), n_visits)
    if hiding == "each":
        return np.full(shape, HIDDEN)
    if hiding == "same":
        own = rng.beta(1.2 * HIDDEN, 1.2 * (1.0 - HIDDEN), len(places))
        return np.broadcast_to(own[:, None], shape)
    waves, phases = rng.normal(0.0, 1.0 / STRETCH_M, (12, n_visits)), rng.uniform(0.0, 2.0 * np.pi, (12, n_visits))
    field = np.cos(places[:, 0, None, None] * waves + phases).sum(axis=1) / np.sqrt(6.0)
    return np.asarray(1.0 / (1.0 + np.exp(1.25 * np.log(1.0 / HIDDEN - 1.0) - 1.5 * field)))


def visit(folder: Path, day: int, points: NDArray[np.float64], is_fruit: NDArray[np.bool_]) -> Visit:
    path = folder / f"visit{day}.csv"
    FruitCloud(points).write(path)
    session = load_session(path, date=f"2024-{6 + day // 2:02d}-{1 + 14 * (day % 2):02d}")
    names = tuple(map(str, range(len(points))))
    return replace(session, cloud=replace(session.cloud, ids=names)), dict(zip(names, is_fruit.tolist(), strict=True))


def counted(visits: Sequence[Visit]) -> Iterator[dict[str, object]]:
    """Add the visits to a map, and count by state what one of them alone saw."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "orchard.gpkg"
        for session, _ in visits:
            add_session(path, session)
        orchard = OrchardMap(path)
        fruits, seen = orchard.fruits(), orchard.observations()
    truth_of = {session.name: truth for session, truth in visits}
    sights: dict[int, list[bool]] = {}
    for fruit, name, label in zip(seen.fruit_ids.tolist(), seen.sessions, seen.labels, strict=True):
        sights.setdefault(fruit, []).append(truth_of[name][str(label)])
    said = {
        int(fruit): (state, float(chance))
        for fruit, state, chance in zip(
            fruits.ids or (), fruits.extras["state"], fruits.extras["fruit_probability"], strict=True
        )
    }
    for wanted in ("new", "missed"):
        once = [(said[fruit][1], own[0]) for fruit, own in sights.items() if len(own) == 1 and said[fruit][0] == wanted]
        yield {
            "visits": len(visits),
            "state": wanted,
            "n": len(once),
            "said": sum(chance for chance, _ in once),
            "fruits": sum(is_fruit for _, is_fruit in once),
            "squares": sum((chance - is_fruit) ** 2 for chance, is_fruit in once),
        }


def table(rows: Sequence[dict[str, object]]) -> str:
    """Lay out what was said beside what is, all seeds together; then by what was drawn, all together."""
    names = ("kind", "false", "visits", "state")
    drawn_so = [tuple(str(row[name]) for name in names) for row in rows]
    pooled = [(kind.split()[0] if kind.startswith("cell") else kind, visits) for kind, _, visits, _ in drawn_so]
    header = ("seen once", "said", "are fruits", "Brier")
    by_state = markdown(("drawn", "false", "visits", "state", *header), lines(rows, drawn_so))
    return f"{by_state}\nAll shares of false points and both states together:\n\n" + markdown(
        ("drawn", "visits", *header), lines(rows, pooled)
    )


def lines(rows: Sequence[dict[str, object]], keys: Sequence[tuple[str, ...]]) -> Iterator[tuple[str, ...]]:
    for key in dict.fromkeys(keys):
        own = [row for row, one in zip(rows, keys, strict=True) if one == key]
        n, *sums = (sum(float(str(row[name])) for row in own) for name in ("n", "said", "fruits", "squares"))
        yield (*key, f"{n:.0f}", *(share(one / n if n else None) for one in sums))
