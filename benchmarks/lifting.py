"""From boxes and depth to 3D: how well fruits come back to the same place, and how near they are to the truth.

Four Kinect captures of one scene: distance of the same fruits after the best rigid motion between two captures, for
pomona and for the positions that came with the data, over the same fruits. The rendered row: centres and diameters
against the exact truth, with true boxes around the visible part of each fruit, single sightings by how much of the
fruit shows, and fused over the frames; from exact depth, and from the stereo pictures alone. Writes lifting.csv and
lifting.md.
"""

import argparse
import sys
import tempfile
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.recordings import (
    DATES,
    TrueBox,
    detector,
    in_camera,
    rendered_truth,
    scanned,
    scanned_captures,
    with_true_boxes,
)
from benchmarks.results import markdown, shared_data, write_rows, write_text
from pomona.cloud import FruitCloud
from pomona.recording import open_recording
from pomona.survey.depth import lift

VISIBLE = ((0.3, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 1.2))
MIN_VIEWS = (1, 5, 10)


def main(arguments: list[str]) -> None:
    argparse.ArgumentParser(prog="python -m benchmarks lifting", description=__doc__).parse_args(arguments)
    data = shared_data("lifting")
    if data is None:
        return
    with tempfile.TemporaryDirectory() as scratch:
        captures = rigid_rows(data, Path(scratch))
        sightings, fused = [], []
        for date in DATES:
            folder = Path(scratch) / date
            boxes = with_true_boxes(data / "rendered_row" / date, folder)
            sightings += sighting_rows(date, folder, rendered_truth(data / "rendered_row" / date), boxes)
            pair = Path(scratch) / f"{date} stereo"
            with_true_boxes(data / "rendered_row" / date, pair, pictures=("left", "right"))
            for what, recorded in ((f"fused {date}", folder), (f"stereo, fused {date}", pair)):
                fused += fused_rows(what, scanned(recorded).cloud, rendered_truth(data / "rendered_row" / date))
    write_rows("lifting.csv", [*captures, *sightings, *fused])
    text = report(captures, sightings, fused)
    write_text("lifting.md", text)
    sys.stdout.write(text)


def rigid_rows(data: Path, scratch: Path) -> list[dict[str, object]]:
    ours = scanned_captures(data, scratch / "kinect")
    shipped = {name: FruitCloud.read(data / "kinect_apples" / f"{name}_fruits.csv") for name in ours}
    rows, all_residuals = [], {"pomona": [], "shipped": []}
    for pair in combinations(ours, 2):
        common = sorted(set.intersection(*(set(clouds[name].ids) for clouds in (ours, shipped) for name in pair)))
        for source, clouds in (("pomona", ours), ("shipped", shipped)):
            first, second = (rows_named(clouds[name], common) for name in pair)
            residuals_mm = 1000 * rigid_residuals(first.positions, second.positions)
            all_residuals[source].append(residuals_mm)
            rows.append(row("captures", f"{pair[0]} {pair[1]}", source, residuals_mm))
    return rows + [
        row("captures", "all pairs", source, np.concatenate(found)) for source, found in all_residuals.items()
    ]


def rows_named(cloud: FruitCloud, names: list[str]) -> FruitCloud:
    row_of = {name: row for row, name in enumerate(cloud.ids or ())}
    return cloud.select([row_of[name] for name in names])


def rigid_residuals(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances after the least-squares rigid motion of `first` onto `second` (Kabsch)."""
    from_first, from_second = first - first.mean(axis=0), second - second.mean(axis=0)
    u, _, vt = np.linalg.svd(from_first.T @ from_second)
    u[:, 2] *= np.sign(np.linalg.det(u @ vt))
    return np.linalg.norm(from_first @ u @ vt - from_second, axis=1)


def sighting_rows(date: str, folder: Path, truth: FruitCloud, boxes: list[TrueBox]) -> list[dict[str, object]]:
    """Errors of single sightings, by how much of the fruit shows."""
    visible = {(box.frame, box.fruit): box.visible for box in boxes}
    row_of = {name: row for row, name in enumerate(truth.ids or ())}
    recording = open_recording(folder)
    boxes_of = detector(folder, recording)
    shows, distances, sizes = [], [], []
    for frame in recording.frames():
        found = boxes_of(frame)
        lifted = lift(frame.read_depth(), found.boxes_px, recording.calibration)
        for place, row_of_box, diameter_m in zip(
            lifted.centres_in_camera, lifted.rows, lifted.diameters_m, strict=True
        ):
            name = found.ids[row_of_box]
            true_place = in_camera(frame.session_from_camera, truth.positions[row_of[name]])
            shows.append(visible[frame.number, name])
            distances.append(1000 * np.linalg.norm(place - true_place))
            sizes.append(1000 * (diameter_m - truth.diameters_m[row_of[name]]))
    shows, distances, sizes = np.array(shows), np.array(distances), np.array(sizes)
    return [
        row(f"sightings {date}", f"{low:.0%}-{min(high, 1):.0%} shows", "pomona", distances[of], sizes[of])
        for low, high in VISIBLE
        if (of := (shows >= low) & (shows < high)).any()
    ]


def fused_rows(what: str, cloud: FruitCloud, truth: FruitCloud) -> list[dict[str, object]]:
    """Errors of fused fruits, by the number of frames; no alignment, the poses are true."""
    true = rows_named(truth, list(cloud.ids))
    distances_mm = 1000 * np.linalg.norm(cloud.positions - true.positions, axis=1)
    sizes_mm = 1000 * (cloud.diameters_m - true.diameters_m)
    return [
        row(what, f"{views} frames or more", "pomona", distances_mm[of], sizes_mm[of])
        for views in MIN_VIEWS
        if (of := cloud.n_views >= views).any()
    ]


def row(
    what: str, part: str, source: str, distances_mm: NDArray[np.float64], sizes_mm: NDArray[np.float64] | None = None
) -> dict[str, object]:
    known = sizes_mm is not None
    return {
        "what": what,
        "part": part,
        "source": source,
        "n": len(distances_mm),
        "median_mm": float(np.median(distances_mm)),
        "p90_mm": float(np.percentile(distances_mm, 90)),
        "p95_mm": float(np.percentile(distances_mm, 95)),
        "rms_mm": float(np.sqrt(np.mean(distances_mm**2))),
        "diameter_bias_mm": float(np.mean(sizes_mm)) if known else None,
        "diameter_rmse_mm": float(np.sqrt(np.mean(sizes_mm**2))) if known else None,
    }


def report(
    captures: list[dict[str, object]], sightings: list[dict[str, object]], fused: list[dict[str, object]]
) -> str:
    def cells(found: dict[str, object], *names: str) -> list[str]:
        return [f"{found[name]:.1f}" for name in names]

    places = ("median_mm", "p90_mm", "rms_mm")
    rigid = markdown(
        ("pair", "positions", "fruits", "median", "90 %", "rms"),
        [(one["part"], one["source"], one["n"], *cells(one, *places)) for one in captures],
    )
    true = markdown(
        ("rendered row", "", "n", "median", "95 %", "diameter bias", "RMSE"),
        [
            (
                one["what"],
                one["part"],
                one["n"],
                *cells(one, "median_mm", "p95_mm", "diameter_bias_mm", "diameter_rmse_mm"),
            )
            for one in [*sightings, *fused]
        ],
    )
    return (
        "Distance between the same fruits of two Kinect captures after a rigid motion, mm:\n\n"
        f"{rigid}\nDistance of fruits to their true place, and error of their diameter, mm:\n\n{true}\n"
        "Not held out: how wide the votes are (`SURFACE_SIGMA`) was chosen on these captures, and how much leaves\n"
        "hide (`HIDDEN`, `HIDDEN_UNMATCHED`) measured on this row.\n"
    )
