"""How an index grows with its map: times, memory and answers over the number of fruits."""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt

from benchmarks.results import FOLDER

TIMES = ("make cpu_s", "open cpu_s", "visit, cpu_s", "visit, refused cpu_s", "frame, cpu_s", "frame, refused cpu_s")


def write_picture(rows: Sequence[dict[str, Any]]) -> None:
    fruits = [row["fruits"] for row in rows]
    figure, (times, memory, found) = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    for key in TIMES:
        times.loglog(fruits, [row[key] for row in rows], "o-", label=key.replace(" cpu_s", "").replace(",", ""))
    times.set(xlabel="fruits in the map", ylabel="CPU seconds")
    for key in ("file_mb", "resident_mb"):
        memory.loglog(fruits, [row[key] for row in rows], "o-", label=key.removesuffix("_mb"))
    memory.set(xlabel="fruits in the map", ylabel="MB")
    for name in ("visit", "visit up", "frame", "frame up"):
        share = [row[f"{name}, right"] / row[f"{name}, places"] for row in rows]
        found.semilogx(fruits, share, "o-", label=name)
    found.set(xlabel="fruits in the map", ylabel="share found at the right place", ylim=(0, 1.02))
    for axes in (times, memory, found):
        axes.legend(fontsize=8)
        axes.grid(alpha=0.3)
    figure.savefig(FOLDER / "million.png", dpi=110, metadata={"Software": None})
    plt.close(figure)
