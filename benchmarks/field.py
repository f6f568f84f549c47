"""Single RGB-D pictures in the field against a tape: six trees, three apples each, labelled boxes.

The tape gives the distance of an apple from the plane of the camera (zdef) and along the row from the trunk (x, counted
the other way in the setups called 3d). Its height is left out: nobody noted by which angle the camera was tilted. The
focal length is nominal: positions along the row rest on it, distances do not. The trunk is at the middle of its box, at
the distance of the setup. The depth pictures and the tape differ by an offset that the apples of a picture share (their
surfaces too are that much farther), so errors of the distance are also given less their mean in the picture. Writes
field.csv and field.md.
"""

import argparse
import csv
import json
import sys
from pathlib import Path

import cv2
import numpy as np

from benchmarks.results import markdown, shared_data, write_rows, write_text
from pomona.recording import Calibration
from pomona.survey.depth import lift

NOMINAL_PX = 910.0
"""Focal length of such cameras at 1280 x 720, turned upright here."""

PUBLISHED_MM = 46.0
"""Median error of the positions that were published with the pictures."""


def main(arguments: list[str]) -> None:
    argparse.ArgumentParser(prog="python -m benchmarks field", description=__doc__).parse_args(arguments)
    data = shared_data("field")
    if data is None:
        return
    folder = data / "field_rgbd"
    with (folder / "ground_truth_field_data.csv").open(newline="", encoding="utf-8") as file:
        taped = {row["item"]: row for row in csv.DictReader(file)}
    rows = [row for tree in sorted(folder.glob("[0-9]_[0-9]")) for row in tree_rows(tree, taped)]
    write_rows("field.csv", rows)
    text = report(rows)
    write_text("field.md", text)
    sys.stdout.write(text)


def tree_rows(tree: Path, taped: dict[str, dict[str, str]]) -> list[dict[str, object]]:
    depth_m = cv2.imread(str(tree / f"depth_{tree.name}_0.png"), cv2.IMREAD_UNCHANGED).astype(np.float32) / 1000
    height, width = depth_m.shape
    camera = Calibration(width, height, NOMINAL_PX, NOMINAL_PX, width / 2, height / 2)
    labelled = json.loads((tree / f"annot_{tree.name}_0.json").read_text(encoding="utf-8"))["objects"]
    boxes = {name_of(one): np.array(one["points"]["exterior"], float).ravel() for one in labelled}
    apples = sorted(name for name in boxes if name in taped)
    lifted = lift(depth_m, np.array([boxes[name] for name in apples]), camera)
    trunk = boxes["Trunk"]
    rows = []
    for row, centre, diameter_m in zip(lifted.rows, lifted.centres_in_camera, lifted.diameters_m, strict=True):
        apple = apples[row]
        # In the setups called 3d the row is looked at from its other side.
        side = -1.0 if taped[apple][f"{tree.name}_setup"] == "3d" else 1.0
        tape_mm = {name: 10 * float(taped[apple][f"{tree.name}_{name}"]) for name in ("x", "zdef", "camdist")}
        trunk_mm = ((trunk[0] + trunk[2]) / 2 - camera.cx) / camera.fx * tape_mm["camdist"]
        rows.append(
            {
                "tree": tree.name,
                "apple": apple,
                "distance_mm": 1000 * centre[2],
                "distance_error_mm": 1000 * centre[2] - tape_mm["zdef"],
                "along_row_error_mm": 1000 * centre[0] - trunk_mm - side * tape_mm["x"],
                "diameter_mm": 1000 * diameter_m,
            }
        )
    return rows


def name_of(labelled: dict[str, object]) -> str:
    """Give the number of an apple, or what else it is."""
    return next((str(tag["value"]) for tag in labelled["tags"]), str(labelled["classTitle"]))


def report(rows: list[dict[str, object]]) -> str:
    distance, along = (np.array([row[name] for row in rows]) for name in ("distance_error_mm", "along_row_error_mm"))
    trees = np.array([row["tree"] for row in rows])
    shared = np.array([distance[trees == tree].mean() for tree in trees])
    table = markdown(
        ("tree", "apple", "distance mm", "error of distance", "error along the row", "diameter"),
        [(row["tree"], row["apple"], *(f"{value:.0f}" for value in list(row.values())[2:])) for row in rows],
    )
    parts = {
        "distance": distance,
        "distance, less its mean in the picture": distance - shared,
        "along the row": along,
        "both, less the mean distance": np.hypot(distance - shared, along),
    }
    lines = [
        (name, f"{np.median(off):+.0f}", f"{np.median(np.abs(off)):.0f}", f"{np.max(np.abs(off)):.0f}")
        for name, off in parts.items()
    ]
    summary = markdown((f"{len(rows)} apples, mm", "median", "median size", "largest"), lines)
    return (
        f"# In the field, against a tape\n\n{' '.join((__doc__ or '').split())}\n\n{summary}\n{table}\n"
        f"The positions published with the pictures have a median error of {PUBLISHED_MM:.0f} mm, with a bias along\n"
        "the depth axis.\n"
    )
