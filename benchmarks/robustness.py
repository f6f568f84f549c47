"""The paper's robustness experiment, section IV-A: what occlusion and noise do to the paper's registration.

A frame is a scene of about 40 fruits, 10 m long, some 5000 constellations. Detections are removed at random and
Gaussian noise is added to the rest; votes, RANSAC and Procrustes give the transform back to the original; the error is
the mean distance of the transformed original fruits to where they are. The perturbed frame also lies in a random frame
of its own. Writes robustness.csv and the paper's two figures.
"""

import argparse
import sys
from pathlib import Path
from statistics import fmean

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import pomona
from benchmarks.results import FOLDER, write_rows
from pomona.synth.planting import RowShape, grow_row

OCCLUSIONS = tuple(step / 100 for step in range(0, 50, 5))
SIGMAS_M = (0.0, 0.005, 0.01, 0.02, 0.03, 0.04, 0.06, 0.08)
SCENE_LENGTH_M = 10.0
# Eight trees over 10 m; 44 fruits and 5200 constellations on average.
FRAME = RowShape(spacing_m=1.3, fruits_per_tree=(5, 6), cluster_sizes=(1.0,))


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks robustness", description=__doc__)
    parser.add_argument("--frames", type=int, default=40, help="frames per occlusion and noise")
    options = parser.parse_args(arguments)
    rows = conditions([frame(np.random.Generator(np.random.PCG64(number))) for number in range(options.frames)])
    write_rows("robustness.csv", rows)
    draw_occlusion(rows, FOLDER / "robustness_occlusion.png")
    draw_noise(rows, FOLDER / "robustness_noise.png")


def conditions(frames: list[NDArray[np.float64]]) -> list[dict[str, object]]:
    """Perturb the same frames in all ways."""
    rows: list[dict[str, object]] = []
    for sigma_m in SIGMAS_M:
        rows.extend(condition(occlusion, sigma_m, frames) for occlusion in OCCLUSIONS)
        sys.stderr.write(f"sigma {100 * sigma_m:g} cm done\n")
    return rows


def condition(occlusion: float, sigma_m: float, frames: list[NDArray[np.float64]]) -> dict[str, object]:
    """Perturb frames, (N, 3) each, alike and register each to its original."""
    errors_m: list[float] = []
    for number, original in enumerate(frames):
        rng = np.random.Generator(np.random.PCG64([number, round(100 * occlusion), round(1e4 * sigma_m)]))
        error_m = registration_error_m(original, *perturbed(rng, original, occlusion, sigma_m))
        if error_m is not None:
            errors_m.append(error_m)
    return {
        "occlusion": occlusion,
        "sigma_m": sigma_m,
        "frames": len(frames),
        "registered": len(errors_m),
        "mean_m": fmean(errors_m) if errors_m else None,
        "median_m": float(np.median(errors_m)) if errors_m else None,
        "p90_m": float(np.quantile(errors_m, 0.9)) if errors_m else None,
        "max_m": max(errors_m, default=None),
    }


def frame(rng: np.random.Generator) -> NDArray[np.float64]:
    """About 40 fruits over 10 m, (N, 3)."""
    positions = grow_row(rng, 8, FRAME).positions
    along = positions[:, 0]
    positions[:, 0] = (along - along.min()) * (SCENE_LENGTH_M / np.ptp(along))
    return positions


def perturbed(
    rng: np.random.Generator, original: NDArray[np.float64], occlusion: float, sigma_m: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Hide a share of the fruits, disturb and move the others: the fruits, and the true `original_from_perturbed`."""
    kept = rng.permutation(len(original))[: len(original) - round(occlusion * len(original))]
    rotation = Rotation.random(random_state=rng).as_matrix()
    translation = rng.uniform(-20.0, 20.0, 3)
    noisy = original[kept] + rng.normal(0.0, sigma_m, (len(kept), 3))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ translation
    return noisy @ rotation.T + translation, pose


def registration_error_m(
    original: NDArray[np.float64], fruits: NDArray[np.float64], true: NDArray[np.float64]
) -> float | None:
    """Mean distance between the original fruits and where the registration puts them; None if there is none."""
    found = pomona.match(fruits, original, method="paper", threads=1).map_from_query
    if found is None:
        return None
    shift = found @ np.linalg.inv(true) - np.eye(4)
    return float(np.linalg.norm(original @ shift[:3, :3].T + shift[:3, 3], axis=1).mean())


def draw_occlusion(rows: list[dict[str, object]], path: Path) -> None:
    """Draw the paper's figure without noise."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    clean = [row for row in rows if row["sigma_m"] == 0.0 and row["mean_m"] is not None]
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    percent = [100 * row["occlusion"] for row in clean]
    axes.plot(percent, [1e3 * row["mean_m"] for row in clean], "o-", label="mean")
    axes.plot(percent, [1e3 * row["max_m"] for row in clean], ".:", color="0.5", label="worst frame")
    axes.axhline(1.0, color="tab:red", linewidth=1, label="1 mm")
    axes.set(xlabel="occluded fruits (%)", ylabel="distance to the originals (mm)")
    axes.set_title("Without noise")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def draw_noise(rows: list[dict[str, object]], path: Path) -> None:
    """Draw the paper's figure with noise."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    colours = plt.get_cmap("viridis")(np.linspace(0.0, 0.9, len(SIGMAS_M)))
    for sigma_m, colour in zip(SIGMAS_M, colours, strict=True):
        line = [row for row in rows if row["sigma_m"] == sigma_m and row["mean_m"] is not None]
        percent, mean_m = [100 * row["occlusion"] for row in line], [row["mean_m"] for row in line]
        axes.plot(percent, mean_m, color=colour, label=f"{100 * sigma_m:g} cm")
        # An open circle warns: one frame in ten or more got no answer, and the mean is over the others.
        fills = [colour if row["registered"] > 0.9 * row["frames"] else "white" for row in line]
        axes.scatter(percent, mean_m, s=20, c=fills, edgecolors=[colour], zorder=3)
    axes.set(xlabel="occluded fruits (%)", ylabel="mean distance to the originals (m)", yscale="log", ylim=(1e-3, 0.2))
    axes.set_title("Occlusion and noise (open circles: over 10 % of the frames got no answer)", fontsize=10)
    axes.legend(title="sigma", frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(path, dpi=130)
    plt.close(figure)
