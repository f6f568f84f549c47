"""The page of the documentation, put together from what the experiments say."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from benchmarks.experiments.robustness import NOISE, OCCLUSION
from benchmarks.experiments.sets import SETS
from benchmarks.experiments.trajectory import FIGURE
from benchmarks.experiments.worse import FALSE, HIDDEN, NEAR_M, SIGMA_M

OPENING = Path(__file__).with_name("opening.md")


def page(found: Mapping[str, str], runs: int) -> str:
    """Lay out the page.

    Parameters
    ----------
    found : mapping
        Markdown of `robustness`, of each of `SETS`, of `trajectory` and `from_above`.
    runs
        Matches that each share is the mean of.
    """
    sets = [f"## {one.title}\n\n{one.about}\n\n{found[name]}" for name, one in SETS.items()]
    robust = f"## Occlusion and noise\n\n{found['robustness']}\n{_pictures(OCCLUSION, NOISE)}"
    way = f"## Where the camera was\n\n{found['trajectory']}\n{_pictures(FIGURE)}"
    above = f"## Seen from above\n\n{found['from_above']}"
    opening = OPENING.read_text(encoding="utf-8").format(
        hidden=round(100 * HIDDEN), false=round(100 * FALSE), sigma=round(100 * SIGMA_M, 1), near=NEAR_M, runs=runs
    )
    return "\n".join([opening, robust, *sets, way, above]).rstrip() + "\n"


def _pictures(*names: str) -> str:
    return "\n\n".join(f"![{_said(name)}](images/{name})" for name in names) + "\n"


def _said(name: str) -> str:
    return name.removesuffix(".png").replace("-", " ")
