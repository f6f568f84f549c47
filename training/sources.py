"""The data of the shipped detector: photographs of an orchard by rows, and rendered recordings."""

from __future__ import annotations

import csv
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pomona.detect.training.labels import Labelled

__all__ = ["TEST_ROWS", "VALIDATION_ROWS", "photographs", "rendered"]

TEST_ROWS = (3, 11, 36)
VALIDATION_ROWS = (2, 12, 39)
"""Rows of the apple block that are not trained on. All apples stand in one block of the orchard, 17: its rows are the
largest units that can be held out. A row is held out on both dates."""

NAME = re.compile(r"(?P<kind>apple_76|apple_81|pear)_(?:\d+_)*?\d+_\d+kv(?P<row>\d+)r")
"""A picture: kind, number of the photograph, block, row; then tree and crop."""

LEAST_VISIBLE = 0.3
"""Rendered fruits that show less are neither wanted nor punished."""

LEAST_PX = 5.0
"""The same for smaller ones."""


def photographs(
    folder: Path, kind: str, rows: tuple[int, ...] | None = None, but: tuple[int, ...] = ()
) -> list[Labelled]:
    """Read the pictures of a kind, `apple_76`, `apple_81` or `pear`, in some rows, None for all, but not in others."""
    boxes = defaultdict(list)
    with (folder / "boxes.csv").open(encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            boxes[line["image"]].append([float(line[name]) for name in ("xmin", "ymin", "xmax", "ymax")])
    chosen = []
    for name in sorted(boxes):
        found = NAME.match(name)
        if found is None or found["kind"] != kind:
            continue
        row = int(found["row"])
        if row not in but and (rows is None or row in rows):
            boxes_px = np.array(boxes[name], np.float32)
            unknown = np.full(len(boxes_px), np.nan, np.float32)
            chosen.append(Labelled(folder / "images" / name, boxes_px, unknown))
    return chosen


def rendered(recording: Path) -> Iterator[Labelled]:
    """Read the left pictures of a rendered recording whose `boxes.csv` says how much of each fruit is visible."""
    lines = defaultdict(list)
    with (recording / "boxes.csv").open(encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            row = [float(line[name]) for name in ("xmin", "ymin", "xmax", "ymax", "visible")]
            lines[int(line["frame"])].append(row)
    for picture in sorted((recording / "left").iterdir()):
        rows = np.array(lines[int(picture.stem)], np.float32).reshape(-1, 5)
        sides_px = rows[:, 2:4] - rows[:, :2]
        wanted = (rows[:, 4] >= LEAST_VISIBLE) & (sides_px.min(axis=1, initial=np.inf) >= LEAST_PX)
        yield Labelled(picture, rows[wanted, :4], rows[wanted, 4], rows[~wanted, :4], complete=True)
