"""What chance reaches: the fit of the threshold's constants, beside those in the code.

The threshold of the verified method (docs/how-it-decides.md, Acceptance) takes the most evidence L of a search among
strangers, over N poses, to be distributed as `P(L < t) = exp(-exp(-(t - b - d ln N) / c))`: the largest of many values
with an exponential tail of width c. This command draws pairs of visits without a common tree, from trees of a dozen
fruits to rows of five trees, reads the most evidence of each search, and fits b, c and d by maximum likelihood: to the
fifth of the searches of a size that found most, for only the tail decides; of the others it takes that they are below.
Intervals of 95 % come from drawing the searches anew. Beside them stand the constants of the code, which the matcher's
own thresholds give, and how often its threshold for a rate is exceeded. Writes chance.csv and chance.md.
"""

import argparse
import math
import sys
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import pomona
from benchmarks.results import markdown, write_rows, write_text
from pomona.cloud import FruitCloud
from pomona.synth.clouds import CELLS, Cell, scene_pair
from pomona.synth.planting import RowShape

PAIRS = 100
"""Pairs of a size by default."""
RATES = (0.5, 0.2, 0.05, 0.01)
TAIL = 0.2
"""Share of the searches of a size that the law is fitted to."""
RESAMPLED = 200
"""Times that the pairs are drawn anew for the intervals."""


def _strangers(name: str, trees: int, fruits: tuple[int, int] | None) -> Cell:
    row = CELLS["noov"].row if fruits is None else RowShape(fruits_per_tree=fruits)
    return replace(CELLS["noov"], name=f"strangers-{name}", seen=trees, row=row)


SIZES = (
    _strangers("dozen", 1, (18, 18)),
    _strangers("forty", 1, (60, 60)),
    _strangers("tree", 1, None),
    _strangers("two-trees", 2, None),
    CELLS["noov"],
    CELLS["frame25-noov"],
)

Law = tuple[float, float, float]
"""b, c and d."""


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks chance", description=__doc__)
    parser.add_argument("--pairs", type=int, default=PAIRS, help=f"of each size; default {PAIRS}")
    options = parser.parse_args(arguments)
    rows: list[dict[str, object]] = []
    for cell in SIZES:
        rows.extend(row for seed in range(options.pairs) if (row := searched(cell, seed)))
        sys.stderr.write(f"chance: {cell.name} done\n")
    write_rows("chance.csv", rows)
    write_text("chance.md", report(rows, options.pairs))


def searched(cell: Cell, seed: int) -> dict[str, object] | None:
    """Read the most evidence of one search among strangers; None where no pose was grown."""
    pair = scene_pair(cell, seed)
    stages = dict(pomona.match(pair.query, pair.map, threads=1).stages)
    nats = stages.get("best_nats", math.nan)
    if math.isnan(nats):
        return None
    return {"size": cell.name, "seed": seed, "poses": stages["query_fruits"] * stages["map_fruits"], "nats": nats}


def law_in_the_code() -> Law:
    """Ask the matcher for thresholds at two rates and numbers of poses, so strict that no pose stands out of others."""
    places = np.random.Generator(np.random.PCG64(0)).uniform(0.0, 1.0, (20, 3))

    def threshold(fruits: int, rate: float) -> float:
        config = {"verified": {"false_alarm_rate": rate}}
        match = pomona.match(FruitCloud(places[:5]), FruitCloud(places[-fruits:]), config=config, threads=1)
        return dict(match.stages)["threshold_nats"]

    rate = 1e-6
    few, strict, many = threshold(5, rate), threshold(5, 0.1 * rate), threshold(10, rate)
    width = (strict - few) / math.log(10.0)
    growth = (many - few) / math.log(2.0)
    return few + width * math.log(rate) - growth * math.log(25.0), width, growth


def fitted(sizes: NDArray[np.str_], poses: NDArray[np.float64], nats: NDArray[np.float64]) -> Law:
    """Fit the law to the tail of the most evidence of each search, by maximum likelihood."""
    logarithms = np.log(poses)
    least = np.empty(len(nats))
    for size in np.unique(sizes):
        least[sizes == size] = np.quantile(nats[sizes == size], 1.0 - TAIL)
    told = nats > least

    def loss(numbers: NDArray[np.float64]) -> float:
        middle, log_width, growth = numbers
        apart = (np.maximum(nats, least) - middle - growth * (logarithms - logarithms.mean())) / np.exp(log_width)
        below = np.exp(-np.maximum(apart, -50.0))
        return float(np.sum(below) + np.sum(apart[told] + log_width))

    start = np.array([np.median(nats), np.log(nats.std()), 0.0])
    middle, log_width, growth = minimize(loss, start, method="Nelder-Mead", options={"maxiter": 2000}).x
    return float(middle - growth * logarithms.mean()), float(np.exp(log_width)), float(growth)


def threshold(law: Law, poses: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    b, c, d = law
    return b + d * np.log(poses) - c * math.log(rate)


def intervals(sizes: NDArray[np.str_], poses: NDArray[np.float64], nats: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2, 3) lower and upper ends of b, c and d."""
    rng = np.random.Generator(np.random.PCG64(1))
    drawn = (rng.integers(len(nats), size=len(nats)) for _ in range(RESAMPLED))
    laws = [fitted(sizes[rows], poses[rows], nats[rows]) for rows in drawn]
    return np.asarray(np.quantile(np.array(laws), [0.025, 0.975], axis=0))


def report(rows: list[dict[str, object]], pairs: int) -> str:
    names = np.array([row["size"] for row in rows])
    poses, nats = (np.array([row[column] for row in rows], float) for column in ("poses", "nats"))
    code, law, (low, high) = law_in_the_code(), fitted(names, poses, nats), intervals(names, poses, nats)
    constants = [
        (name, f"{code[at]:.2f}", f"{law[at]:.2f}", f"{low[at]:.2f} to {high[at]:.2f}") for at, name in enumerate("bcd")
    ]
    over = [
        (f"{rate:g}", *(f"{np.mean(nats > threshold(one, poses, rate)):.3f}" for one in (code, law))) for rate in RATES
    ]
    sizes = [
        (
            cell.name,
            f"{(names == cell.name).sum()} of {pairs}",
            f"{np.median(poses[names == cell.name]):,.0f}",
            *(f"{np.quantile(nats[names == cell.name], share):.1f}" for share in (0.5, 0.95)),
            f"{np.median(threshold(code, poses[names == cell.name], 0.05)):.1f}",
        )
        for cell in SIZES
        if (names == cell.name).any()
    ]
    return (
        f"# Chance\n\n{' '.join((__doc__ or '').split())}\n\n"
        f"{markdown(('constant', 'code', 'fit', '95 %'), constants)}\n"
        f"{markdown(('rate', 'above the threshold of the code', 'of the fit'), over)}\n"
        f"{markdown(('strangers', 'with a pose', 'poses', 'median nats', '19 of 20', 't for 1 in 20'), sizes)}"
    )
