"""Who will drop, out of two visits to fruitlets whose growth is known.

Ninety fruitlets of 20 mm, give or take a tenth. Those that stay grow 0.8 mm a day, give or take a tenth; those that
drop at 0 to 0.35 mm. All sizes of a visit are off together by 1.5 %. Drawn for shares of fruitlets that drop, for noise
of a diameter and for days between the visits. Writes thinning.csv and thinning.md.
"""

import argparse
import sys
from dataclasses import replace
from datetime import datetime, timedelta
from itertools import product

import numpy as np
from numpy.typing import NDArray

from benchmarks.growth_draw import as_fruits
from benchmarks.results import markdown, share, write_rows, write_text
from pomona.cloud import FruitCloud
from pomona.growth.measured import MeasuredFruits
from pomona.growth.season_growth import growth_of
from pomona.growth.thinning_plan import plan_thinning

SEEDS = range(1000, 1003)
SHARES, NOISES_MM, GAPS_DAYS = (0.0, 0.1, 0.33, 0.6), (0.1, 0.5, 1.0, 2.0), (3, 5, 7, 14)
N_FRUITS, SIZE_MM, OWN = 90, 20.0, 0.1
RATE_MM_PER_DAY, SLOWEST, SLOW = 0.8, 0.0, 0.35
SCALE_SIGMA = 0.015


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks thinning", description=__doc__)
    parser.parse_args(arguments)
    rows = [score(*one) for one in product(SHARES, NOISES_MM, GAPS_DAYS, SEEDS)]
    write_rows("thinning.csv", rows)
    write_text("thinning.md", report(rows))


def drawn(dropping: float, noise_mm: float, n_days: int, seed: int) -> tuple[MeasuredFruits, NDArray[np.bool_]]:
    """Two visits, and which fruits will drop."""
    rng = np.random.default_rng([seed, round(100 * dropping), round(10 * noise_mm), n_days])
    drops = rng.permutation(N_FRUITS) < round(dropping * N_FRUITS)
    slow = rng.uniform(SLOWEST, SLOW, N_FRUITS)
    rates = np.where(drops, slow, RATE_MM_PER_DAY * (1.0 + OWN * rng.normal(size=N_FRUITS)))
    first_mm = SIZE_MM * (1.0 + OWN * rng.normal(size=N_FRUITS))
    true_mm = np.column_stack([first_mm, first_mm + n_days * rates])
    measured_mm = true_mm * np.exp(SCALE_SIGMA * rng.normal(size=2)) + rng.normal(0.0, noise_mm, true_mm.shape)
    day = datetime(2024, 6, 1)
    moments = day, day + timedelta(days=n_days)
    fruits = as_fruits(np.maximum(measured_mm, 2.0), np.zeros(N_FRUITS, np.int64), moments, np.ones(N_FRUITS, bool))
    places = rng.uniform(0.0, 3.0, (N_FRUITS, 3))
    return replace(fruits, cloud=FruitCloud(places, extras=fruits.cloud.extras)), drops


def score(dropping: float, noise_mm: float, n_days: int, seed: int) -> dict[str, object]:
    fruits, drops = drawn(dropping, noise_mm, n_days, seed)
    plan = plan_thinning(growth_of(fruits))
    said = np.array(plan.actions) == "drops"
    sys.stderr.write(f"thinning: {dropping}, {noise_mm} mm, {n_days} days, {seed} done\n")
    return {
        "share": dropping,
        "noise_mm": noise_mm,
        "n_days": n_days,
        "seed": seed,
        "is_told": int(plan.drop.is_told),
        "found": int((said & drops).sum()),
        "n_dropping": int(drops.sum()),
        "false_alarms": int((said & ~drops).sum()),
        "n_staying": int((~drops).sum()),
        "expected": float(plan.drop.probabilities.sum()),
        "fast_mm_per_day": plan.drop.fast_mm_per_day,
    }


def report(rows: list[dict[str, object]]) -> str:
    lines = [
        (f"{dropping:g}", f"{noise_mm:g}", *(cell(rows, dropping, noise_mm, n_days) for n_days in GAPS_DAYS))
        for dropping, noise_mm in product(SHARES, NOISES_MM)
    ]
    header = ("share that drops", "noise, mm", *(f"{n_days} days" for n_days in GAPS_DAYS))
    about = " ".join((__doc__ or "").split())
    return (
        f"# Thinning\n\n{about}\n\nOf the fruitlets that drop, the share that is found, and of those that stay, the "
        "share that is said to drop; over the seeds that give a verdict, and in brackets of how many, where not of all "
        f"{len(SEEDS)}.\n\n{markdown(header, lines)}"
    )


def cell(rows: list[dict[str, object]], dropping: float, noise_mm: float, n_days: int) -> str:
    one = [row for row in rows if (row["share"], row["noise_mm"], row["n_days"]) == (dropping, noise_mm, n_days)]
    told = [row for row in one if row["is_told"]]
    if not told:
        return "cannot tell"
    found, n_dropping, wrong, n_staying = (
        sum(int(str(row[name])) for row in told) for name in ("found", "n_dropping", "false_alarms", "n_staying")
    )
    of = "" if len(told) == len(one) else f" ({len(told)})"
    return f"{share(found / n_dropping if n_dropping else None)}, {wrong / n_staying:.3f}{of}"
