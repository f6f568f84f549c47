"""The way of the camera in the map of another date, and whether covariances are what errors are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from benchmarks.results import FOLDER

if TYPE_CHECKING:
    from benchmarks.localize import Outcome

MOST_NEES = 30.0


def write_picture(name: str, shown: Outcome, nees: Mapping[str, NDArray[np.float64]]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    above, *below = figure.subplot_mosaic([["way"] * len(nees), list(nees)]).values()
    _draw_way(above, shown)
    for axes, (mode, values) in zip(below, nees.items(), strict=True):
        _draw_nees(axes, mode, values)
    figure.supxlabel("squared error under the own covariance", fontsize="medium")
    figure.savefig(FOLDER / name, dpi=120, metadata={"Software": None})


def _draw_way(axes: Any, shown: Outcome) -> None:
    fruits = shown.map.map.positions
    true = shown.query.map_from_camera[:, :3, 3]
    found = np.array([one.position_m for one in shown.found if one])
    axes.scatter(fruits[:, 0], fruits[:, 1], s=6, color="tab:green", label=f"fruits of {shown.map.date}")
    axes.plot(true[:, 0], true[:, 1], color="0.6", label="true way")
    axes.plot(found[:, 0], found[:, 1], ".", color="tab:red", label=f"found, {shown.query.date}, {shown.mode}")
    axes.set(xlabel="along the row, m", ylabel="across, m", aspect="equal")
    # Beside the row, not on it: fruits are everywhere in it.
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize="small", frameon=False)


def _draw_nees(axes: Any, mode: str, values: NDArray[np.float64]) -> None:
    edges = np.linspace(0.0, MOST_NEES, 31)
    middle = np.linspace(0.0, MOST_NEES, 200)
    axes.hist(
        values.clip(max=MOST_NEES - 1e-9),
        edges,
        density=True,
        color="tab:blue",
        alpha=0.6,
        label=f"{len(values)} poses",
    )
    axes.plot(middle, chi2.pdf(middle, 6), color="black", label=r"$\chi^2$, 6 degrees")
    axes.set_title(f"{mode}: mean {values.mean():.1f}", fontsize="medium")
    axes.legend(fontsize="small")
