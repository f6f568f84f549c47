"""The picture of the benchmark `tracking`: who is who over the frames, and count errors where boxes are missing."""

from __future__ import annotations

from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

from benchmarks.tracking_scores import MIN_VIEWS, Names, Numbers

RIGHT, WRONG, LOST = "tab:green", "tab:red", "0.3"


def draw(runs: list[tuple[str, Names, Numbers]], curve: list[dict[str, object]], path: Path) -> None:
    """Draw titled runs and the curve."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, len(runs) + 1, figsize=(6 * len(runs) + 6, 7), layout="constrained")
    for axes, run in zip(panels, runs, strict=False):
        _draw_tracks(axes, *run)
    _draw_curve(panels[-1], curve)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_tracks(axes, title: str, names: Names, numbers: Numbers) -> None:
    """One line a fruit, in the order of its first frame; a dot a box."""
    of_fruit = defaultdict(list)
    for frame, (found, told) in enumerate(zip(names, numbers, strict=True)):
        for name, number in zip(found, told.tolist(), strict=True):
            of_fruit[name].append((frame, number))
    often = sorted((seen for seen in of_fruit.values() if len(seen) >= MIN_VIEWS), key=lambda seen: seen[0][0])
    dots = defaultdict(list)
    for line, seen in enumerate(often):
        own = Counter(number for _, number in seen if number >= 0).most_common(1)
        main = own[0][0] if own else -1
        axes.plot([frame for frame, _ in seen], [line] * len(seen), color="0.85", linewidth=0.8, zorder=1)
        for frame, number in seen:
            dots[RIGHT if number == main >= 0 else LOST if number < 0 else WRONG].append((frame, line))
    for colour, text in ((RIGHT, "the fruit's track"), (WRONG, "another track"), (LOST, "no track")):
        x, y = np.array(dots[colour]).reshape(-1, 2).T
        axes.scatter(x, y, s=9, color=colour, label=f"{text}: {len(x)} boxes", zorder=2)
    axes.set(xlabel="frame", ylabel=f"fruits seen in {MIN_VIEWS} frames or more", title=title)
    axes.legend(loc="upper left", fontsize=8)


def _draw_curve(axes, curve: list[dict[str, object]]) -> None:
    groups = defaultdict(list)
    for row in curve:
        groups[row["date"], row["depth"], row["kind"]].append(row)
    for (date, depth, kind), rows in groups.items():
        colour = {"2024-08-09": "tab:blue", "2024-08-28": "tab:orange"}[date]
        x = [100 * row["missing"] for row in rows]
        y = [100 * row["mean_abs_error"] for row in rows]
        style = "-" if depth == "exact" else "--"
        marker = "o" if kind == "boxes missing" else "x"
        axes.plot(x, y, color=colour, linestyle=style, marker=marker, label=f"{date}, {depth}, {kind}")
    axes.axhline(2, color="0.6", linewidth=0.8)
    axes.set(xlabel="boxes missing, %", ylabel="count error, %, mean of absolute", ylim=(0, None))
    axes.legend(fontsize=7)
