"""Stereo depth: the disparity of fruits on the rendered row, and of all pixels on two Middlebury pairs.

At fruits: the disparity of the lifted centre, f B / Z, less the true one, with true boxes; OpenCV's semi-global
matching as it comes, the dense depth of pomona, whose pixels vote, and the match of each fruit as one disc. What a
fruit hidden from the right camera gets from its size is a row of its own. Chi^2 is over one degree of freedom. Time is
CPU time of one process, lifting included. Middlebury: share of pixels off by more than 1 px, missing ones included; a
pixel whose truth in the left picture is not found in that of the right one is not seen by both. Writes stereo.csv and
stereo.md.
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.recordings import DATES, TrueBox, in_camera, rendered_truth, true_boxes
from benchmarks.results import markdown, shared_data, write_rows, write_text
from pomona.recording import Calibration, open_recording
from pomona.stereo import DenseStereo, FruitDepth, StereoDepth
from pomona.survey.depth import lift

Stereo = Callable[[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.float64]], FruitDepth]

PAIRS = ("cones", "teddy")
TRUTH_SCALE = 4.0
"""Middlebury's quarter-size disparities are stored times 4."""

MATCHED_PX = 64
"""Disparities tried on Middlebury: the largest true one is 55."""

FRUIT_COLUMNS = (
    "at fruits",
    "method",
    "boxes",
    "answered %",
    "bias px",
    "deviation px",
    "> 1 px %",
    "> 2 px %",
    "chi2 median",
    "< 1 sigma %",
    "> 3 sigma %",
    "ms a frame",
    "ms for 50 boxes",
)


def main(arguments: list[str]) -> None:
    argparse.ArgumentParser(prog="python -m benchmarks stereo", description=__doc__).parse_args(arguments)
    data = shared_data("stereo")
    if data is None:
        return
    fruits = [row for date in DATES for row in fruit_rows(date, data / "rendered_row" / date)]
    pixels = [row for name in PAIRS for row in pixel_rows(name, data / "middlebury" / name)]
    write_rows("stereo.csv", [{key: row.get(key) for key in {**fruits[0], **pixels[0]}} for row in [*fruits, *pixels]])
    text = report(fruits, pixels)
    write_text("stereo.md", text)
    sys.stdout.write(text)


class Plain:
    """OpenCV's semi-global matching with its default arguments."""

    def __init__(self, calibration: Calibration, disparities: int = 128) -> None:
        self._focal_baseline = calibration.fx * calibration.baseline_m
        self._matcher = cv2.StereoSGBM.create(0, disparities, 5)

    def __call__(self, left: NDArray[np.uint8], right: NDArray[np.uint8], boxes_px: NDArray[np.float64]) -> FruitDepth:
        """Give the depth of the whole picture."""
        greys = (cv2.cvtColor(one, cv2.COLOR_BGR2GRAY) for one in (left, right))
        disparity_px = self._matcher.compute(*greys).astype(np.float32) / 16
        depth_m = np.where(disparity_px > 0, self._focal_baseline / np.maximum(disparity_px, 1e-3), 0)
        return FruitDepth(depth_m.astype(np.float32), np.full(len(boxes_px), 0.5))


def fruit_rows(date: str, source: Path) -> list[dict[str, object]]:
    recording, truth = open_recording(source), rendered_truth(source)
    place_of = dict(zip(truth.ids, truth.positions, strict=True))
    boxes: dict[int, list[TrueBox]] = {}
    for box in true_boxes(source):
        boxes.setdefault(box.frame, []).append(box)
    calibration = recording.calibration
    methods: dict[str, Stereo] = {
        "plain SGBM": Plain(calibration),
        "dense": DenseStereo(calibration),
        "disc": StereoDepth(calibration),
    }
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in (*methods, "disc, by size")}
    spent_s = dict.fromkeys(methods, 0.0)
    for frame in recording.frames():
        left, right, here = frame.read_left(), frame.read_right(), boxes[frame.number]
        boxes_px = np.array([box.box_px for box in here], float)
        z = np.array([in_camera(frame.session_from_camera, place_of[box.fruit])[2] for box in here])
        for name, stereo in methods.items():
            start_s = time.process_time()
            lifted = lift(stereo(left, right, boxes_px), boxes_px, calibration)
            spent_s[name] += time.process_time() - start_s
            per_m2 = calibration.fx * calibration.baseline_m
            off_px = per_m2 / lifted.centres_in_camera[:, 2] - per_m2 / z[lifted.rows]
            chi2 = (lifted.centres_in_camera[:, 2] - z[lifted.rows]) ** 2 / lifted.covariances[:, 2, 2]
            for one, square, measured in zip(off_px, chi2, lifted.measured, strict=True):
                found[name if measured else "disc, by size"].append((one, square))
    count = sum(map(len, boxes.values()))
    ms = {name: 1e3 * total_s / len(boxes) for name, total_s in spent_s.items()}
    return [fruit_row(date, name, np.array(pairs), count, ms.get(name), len(boxes)) for name, pairs in found.items()]


def fruit_row(
    date: str, method: str, found: NDArray[np.float64], boxes: int, ms: float | None, frames: int
) -> dict[str, object]:
    off_px, chi2 = found.T
    return {
        "what": date,
        "method": method,
        "boxes": boxes,
        "answered": len(off_px) / boxes,
        "bias_px": float(np.median(off_px)),
        "deviation_px": float(np.median(np.abs(off_px - np.median(off_px)))),
        "over_1_px": float(np.mean(np.abs(off_px) > 1)),
        "over_2_px": float(np.mean(np.abs(off_px) > 2)),
        "chi2_median": float(np.median(chi2)),
        "within_sigma": float(np.mean(chi2 < 1)),
        "over_3_sigma": float(np.mean(chi2 > 9)),
        "ms_per_frame": ms,
        "ms_per_50_boxes": None if ms is None else 50 * ms * frames / boxes,
    }


def pixel_rows(name: str, folder: Path) -> list[dict[str, object]]:
    left, right = (cv2.imread(str(folder / f"im{view}.png")) for view in (2, 6))
    true_px, from_right = (
        cv2.imread(str(folder / f"disp{view}.png"), cv2.IMREAD_UNCHANGED) / TRUTH_SCALE for view in (2, 6)
    )
    known, seen = true_px > 0, both_see(true_px, from_right)
    height, width = true_px.shape
    # Any camera whose nearest depth has the largest disparity that is tried.
    camera = Calibration(width, height, 450.0, 450.0, width / 2, height / 2, baseline_m=0.3 * MATCHED_PX / 450)
    rows = []
    for method, stereo in (("plain SGBM", Plain(camera, MATCHED_PX)), ("dense", DenseStereo(camera))):
        start_s = time.process_time()
        depth_m = stereo(left, right, np.empty((0, 4))).depth_m
        spent_s = time.process_time() - start_s
        measured = depth_m > 0
        found_px = np.divide(camera.fx * camera.baseline_m, depth_m, out=np.zeros(depth_m.shape), where=measured)
        wrong = np.abs(found_px - true_px) > 1
        rows.append(
            {
                "what": name,
                "method": method,
                "wrong_seen": float(wrong[seen].mean()),
                "wrong_all": float(wrong[known].mean()),
                "missing": float((~measured)[known].mean()),
                "ms_per_frame": 1e3 * spent_s,
            }
        )
    return rows


def both_see(left_px: NDArray[np.float64], right_px: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pixels whose true disparity leads to a pixel of the right picture with the same one."""
    columns = np.arange(left_px.shape[1]) - np.round(left_px).astype(int)
    inside = (left_px > 0) & (columns >= 0)
    there = np.take_along_axis(right_px, np.clip(columns, 0, None), axis=1)
    return inside & (np.abs(there - left_px) <= 1)


def report(fruits: list[dict[str, object]], pixels: list[dict[str, object]]) -> str:
    def percent(value: object) -> str:
        return f"{100 * value:.1f}"

    def number(value: object, digits: int = 2) -> str:
        return "-" if value is None else f"{value:.{digits}f}"

    at_fruits = markdown(
        FRUIT_COLUMNS,
        [
            (
                row["what"],
                row["method"],
                row["boxes"],
                percent(row["answered"]),
                f"{row['bias_px']:+.2f}",
                number(row["deviation_px"]),
                *(percent(row[name]) for name in ("over_1_px", "over_2_px")),
                number(row["chi2_median"]),
                *(percent(row[name]) for name in ("within_sigma", "over_3_sigma")),
                *(number(row[name], 1) for name in ("ms_per_frame", "ms_per_50_boxes")),
            )
            for row in fruits
        ],
    )
    at_pixels = markdown(
        ("Middlebury", "method", "> 1 px, seen by both %", "> 1 px, all %", "missing %", "ms"),
        [
            (
                row["what"],
                row["method"],
                *(percent(row[name]) for name in ("wrong_seen", "wrong_all", "missing")),
                number(row["ms_per_frame"], 0),
            )
            for row in pixels
        ],
    )
    return (
        f"# Stereo depth\n\n{' '.join((__doc__ or '').split())}\n\n{at_fruits}\n"
        "Deviation: the median of deviations from the bias. Of chi^2 with one degree of freedom the median is 0.45,\n"
        f"and 68.3 % lie within one sigma, 0.3 % beyond three.\n\n{at_pixels}\n"
        "Not held out: how a sigma follows from a margin (`SIGMA_MARGIN_PX`) was measured on this row.\n"
    )
