"""What occlusion and noise do to the paper's registration (its section IV-A), on the frames of a scanned video."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.experiments.takes import Take
from benchmarks.experiments.visits import Visit, visited
from benchmarks.results import markdown
from benchmarks.robustness import OCCLUSIONS, SIGMAS_M, conditions, draw_noise, draw_occlusion

VIDEO = "synthetic-1"

OCCLUSION, NOISE = "experiments-occlusion.png", "experiments-noise.png"

FEWEST_FRUITS = 20
"""With 45 % of them hidden, enough are left to answer at all."""


def robustness(folder: Path, images: Path) -> str:
    """Perturb the fruits of each frame as the tracker placed them; draw both figures and say it in markdown."""
    frames = seen_in_frames(visited(Take(VIDEO), "true", folder))
    rows = conditions(frames)
    draw_occlusion(rows, images / OCCLUSION)
    draw_noise(rows, images / NOISE)
    return report(rows, frames)


def seen_in_frames(visit: Visit) -> list[NDArray[np.float64]]:
    """Places, (N, 3) metres, of the fruits that each frame saw, where those are enough."""
    views = visit.cloud.views
    assert views is not None
    rows = [np.unique(views.fruits[views.frames == frame]) for frame in np.unique(views.frames)]
    return [visit.cloud.positions[seen] for seen in rows if len(seen) >= FEWEST_FRUITS]


def report(rows: list[dict[str, object]], frames: list[NDArray[np.float64]]) -> str:
    """Lay out the median errors and how many frames got an answer."""
    of = {(row["occlusion"], row["sigma_m"]): row for row in rows}
    shown = OCCLUSIONS[::3]
    lines = [(f"{100 * sigma_m:g} cm", *(_cell(of[occlusion, sigma_m]) for occlusion in shown)) for sigma_m in SIGMAS_M]
    header = ("noise", *(f"{100 * occlusion:.0f} % hidden" for occlusion in shown))
    fruits = np.array([len(frame) for frame in frames])
    spans_m = np.array([np.ptp(frame, axis=0).max() for frame in frames])
    return (
        f"{len(frames)} frames of `{VIDEO}` with {fruits.mean():.0f} fruits each ({fruits.min()} to {fruits.max()}), "
        f"{spans_m.mean():.1f} m across, with the places that the scan gave them. Median distance of the transformed "
        f"fruits to the originals, and frames with an answer:\n\n{markdown(header, lines)}"
    )


def _cell(row: dict[str, object]) -> str:
    answered = f"{row['registered']}/{row['frames']}"
    return f"- ({answered})" if row["median_m"] is None else f"{1000 * float(str(row['median_m'])):.1f} mm ({answered})"
