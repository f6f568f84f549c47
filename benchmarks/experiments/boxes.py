"""The true boxes around the fruits of a video, and those among them that a scan is given."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path

from benchmarks.recordings import MIN_VISIBLE, MIN_WIDTH_PX, TrueBox

BOXES = ("true", "shipped")
"""What a scan is given: boxes of the truth without names, or those of the detector that is inside."""

MIN_FRAMES = 5
"""The paper: only fruits that are visible in so many frames are considered."""


def boxes_of(video: Path) -> list[TrueBox]:
    """Whatever shows of a fruit, be it one pixel."""
    with (video / "boxes.csv").open(encoding="utf-8", newline="") as file:
        return [
            TrueBox(
                int(line["frame"]),
                line["id"],
                (int(line["xmin"]), int(line["ymin"]), int(line["xmax"]), int(line["ymax"])),
                float(line["visible"]),
            )
            for line in csv.DictReader(file)
        ]


def clear(boxes: list[TrueBox]) -> list[TrueBox]:
    """Boxes that a good detector finds."""
    return [box for box in boxes if box.visible > MIN_VISIBLE and box.box_px[2] - box.box_px[0] >= MIN_WIDTH_PX]


def fruits_often_in(boxes: list[TrueBox]) -> frozenset[str]:
    """Fruits with boxes in enough frames."""
    views = Counter(box.fruit for box in boxes)
    return frozenset(name for name, frames in views.items() if frames >= MIN_FRAMES)


def write_boxes(path: Path, boxes: list[TrueBox]) -> None:
    """Write them as a scan reads them, without names."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("frame", "xmin", "ymin", "xmax", "ymax", "score"))
        writer.writerows((box.frame, *box.box_px, 1) for box in sorted(boxes, key=lambda box: box.frame))
