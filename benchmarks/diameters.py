"""Diameters of the Kinect captures against calipers: 26 apples and two balls, four captures.

Diameters go as 1 / f and the focal length of the captures is nominal, so they are shown twice: as scanned, and scaled
by what the two balls say of f. The balls then no longer test anything; the apples do. Writes diameters.csv,
diameters.png (Bland-Altman) and diameters.md.
"""

import argparse
import csv
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.recordings import scanned_captures
from benchmarks.results import FOLDER, markdown, shared_data, write_rows, write_text
from pomona.cloud import FruitCloud
from pomona.recording.formats.kinect_apples import NOMINAL

COLOURS = ("#2a5d8f", "#c8502d", "#4b9b6e", "#8a6fb0")


@dataclass(frozen=True)
class Measured:
    """One fruit or ball in one capture."""

    capture: str
    name: str
    caliper_mm: float
    diameter_mm: float
    sigma_mm: float

    @property
    def is_ball(self) -> bool:
        """Whether it is one of the two white balls."""
        return self.name.startswith("BALL")


def main(arguments: list[str]) -> None:
    argparse.ArgumentParser(prog="python -m benchmarks diameters", description=__doc__).parse_args(arguments)
    data = shared_data("diameters")
    if data is None:
        return
    calipers_mm = read_calipers(data / "kinect_apples" / "calipers.csv")
    with tempfile.TemporaryDirectory() as scratch:
        clouds = scanned_captures(data, Path(scratch) / "kinect")
    measured = [one for name, cloud in clouds.items() for one in measured_in(name, cloud, calipers_mm)]
    scale = scale_of_balls(measured)
    write_rows("diameters.csv", [{**vars(one), "scaled_mm": one.diameter_mm / scale} for one in measured])
    draw(measured, scale, FOLDER / "diameters.png")
    text = report(measured, scale)
    write_text("diameters.md", text)
    sys.stdout.write(text)


def read_calipers(path: Path) -> dict[str, float]:
    with path.open(newline="", encoding="utf-8") as file:
        return {row["id"]: float(row["diameter_mm"]) for row in csv.DictReader(file)}


def measured_in(capture: str, cloud: FruitCloud, calipers_mm: dict[str, float]) -> list[Measured]:
    sigmas_m = cloud.extras["diameter_sigma_m"]
    return [
        Measured(capture, name, calipers_mm[name], 1000 * float(diameter_m), 1000 * float(sigma_m))
        for name, diameter_m, sigma_m in zip(cloud.ids, cloud.diameters_m, sigmas_m, strict=True)
    ]


def scale_of_balls(measured: list[Measured]) -> float:
    """Mean factor of measured over true diameters of the balls."""
    return float(np.mean([one.diameter_mm / one.caliper_mm for one in measured if one.is_ball]))


def agreement(errors_mm: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Bias, standard deviation, RMSE and median absolute error."""
    return (
        float(errors_mm.mean()),
        float(errors_mm.std(ddof=1)),
        float(np.sqrt((errors_mm**2).mean())),
        float(np.median(np.abs(errors_mm))),
    )


def draw(measured: list[Measured], scale: float, path: Path) -> None:
    """Bland-Altman: difference over mean, with bias and 95 % limits of the apples."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 2, sharey=True)
    titles = (f"nominal f = {NOMINAL.fx:.0f} px", f"f = {NOMINAL.fx * scale:.0f} px, from the balls")
    for axes, factor, title in zip(panels, (1.0, scale), titles, strict=True):
        for capture, colour in zip(dict.fromkeys(one.capture for one in measured), COLOURS, strict=False):
            for ball, marker in ((False, "o"), (True, "s")):
                shown = [one for one in measured if one.capture == capture and one.is_ball == ball]
                pairs = np.array([(one.diameter_mm / factor, one.caliper_mm) for one in shown])
                label = None if ball else f"{capture[:2]}:{capture[2:4]}"
                axes.scatter(
                    pairs.mean(axis=1), pairs[:, 0] - pairs[:, 1], s=16, color=colour, marker=marker, label=label
                )
        bias, sd, _, _ = agreement(apple_errors(measured, factor))
        axes.axhline(bias, color="black", linewidth=1)
        for limit in (bias - 1.96 * sd, bias + 1.96 * sd):
            axes.axhline(limit, color="black", linewidth=0.8, linestyle="--")
        axes.axhline(0, color="0.8", linewidth=0.8, zorder=0)
        axes.set_title(f"{title}: bias {bias:+.1f} mm, limits \N{PLUS-MINUS SIGN}{1.96 * sd:.1f} mm", fontsize=10)
        axes.set_xlabel("mean of scan and caliper, mm")
    panels[0].set_ylabel("scan - caliper, mm")
    panels[1].legend(title="capture (squares: balls)", fontsize=8, title_fontsize=8)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def apple_errors(measured: list[Measured], factor: float) -> NDArray[np.float64]:
    return np.array([one.diameter_mm / factor - one.caliper_mm for one in measured if not one.is_ball])


def mean_errors(measured: list[Measured], factor: float) -> NDArray[np.float64]:
    """Errors of each apple's mean over its captures."""
    by_name: dict[str, list[float]] = {}
    for one in measured:
        if not one.is_ball:
            by_name.setdefault(one.name, []).append(one.diameter_mm / factor - one.caliper_mm)
    return np.array([np.mean(errors) for errors in by_name.values()])


def repeatability(measured: list[Measured]) -> float:
    """Pool the standard deviation of one apple's diameter over the captures."""
    by_name: dict[str, list[float]] = {}
    for one in measured:
        if not one.is_ball:
            by_name.setdefault(one.name, []).append(one.diameter_mm)
    return float(np.sqrt(np.mean([np.var(found, ddof=1) for found in by_name.values()])))


def report(measured: list[Measured], scale: float) -> str:
    def line(what: str, errors_mm: NDArray[np.float64]) -> tuple[str, ...]:
        return what, str(len(errors_mm)), *(f"{value:.1f}" for value in agreement(errors_mm))

    focal = NOMINAL.fx
    table = markdown(
        ("diameters against calipers, mm", "n", "bias", "sd", "RMSE", "median error"),
        [
            line(f"apples, nominal f = {focal:.0f} px", apple_errors(measured, 1.0)),
            line(f"apples, f = {focal * scale:.0f} px from the balls", apple_errors(measured, scale)),
            line("the same, mean of an apple's captures", mean_errors(measured, scale)),
        ],
    )
    balls = markdown(
        ("ball", "scanned, mm", "f it implies, px"),
        [
            (
                f"{true:.0f} mm",
                f"{np.mean(found):.1f} \N{PLUS-MINUS SIGN} {np.std(found, ddof=1):.1f}",
                f"{focal * np.mean(found) / true:.0f}",
            )
            for true, found in (
                (true, [one.diameter_mm for one in measured if one.is_ball and one.caliper_mm == true])
                for true in (60.0, 120.0)
            )
        ],
    )
    within = np.mean([abs(one.diameter_mm / scale - one.caliper_mm) < 2 * one.sigma_mm for one in measured])
    per_percent = np.mean([one.diameter_mm for one in measured if not one.is_ball]) / 100
    return (
        f"{table}\nA diameter goes as 1 / f: 1 % of f is {per_percent:.1f} mm on these apples.\n\n{balls}\n"
        "The two balls ask for different focal lengths, so what is left after scaling is no better than that.\n\n"
        f"The same apple differs by {repeatability(measured):.1f} mm (sd) between captures; "
        f"{within:.0%} of the scaled diameters lie within twice their stated sigma.\n"
    )
