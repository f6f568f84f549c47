"""Texts beside the pictures: settings in TOML, pairs of a match, boxes of every kind, calipers, trees, points."""

from __future__ import annotations

import json
from datetime import date

import numpy as np

from fuzz.bundle import packed, unpacked
from pomona import FruitCloud
from pomona.detect.from_file import FileDetector
from pomona.detect.picture_boxes import boxes_within, read_boxes
from pomona.growth.caliper_file import read_calipers
from pomona.growth.season_clock import read_temperatures
from pomona.orchard.control_points import read_control_points
from pomona.orchard.given_trees import read_trees
from pomona.pairs import read_pairs
from pomona.recording import Calibration
from pomona.settings import Settings

CAMERA = Calibration(640, 480, 600.0, 600.0, 320.0, 240.0)
CLOUD = FruitCloud(np.eye(3), ids=("a", "b", "c"))

TOML = b'[match]\nmethod = "verified"\nup = [[0, 0, 1], [0.0, -1, 0]]\nnoise_m = 0.01\n[tracking]\nmin_views = 3\n'
BOXES = b"frame,xmin,ymin,xmax,ymax,score,id\n0,10,10,20.5,30,0.9,a\n1,11,10,21,30,0.8,a\n1,50,10,61,30,0.5,b\n"
MOT = b"1,1,10,10,20,20,0.9,-1,-1,-1\n2,1,11,10,20,20,0.9,-1,-1,-1\n"
NAMED = b"image,xmin,ymin,xmax,ymax,score\na.png,10,10,20.5,30,0.9\nb.png,-1,10,21,3e1,0.8\n"
CALIPERS = (
    b"label,date,diameter_mm\na,2024-06-14,30.5\nb,2024-06-14,31\n",
    b"id,2024-06-14,2024-07-01\na,30.5,\nb,,41\n",
)
TEMPERATURES = (
    b"date,mean_c\n2024-06-14,20.5\n2024-06-15,21\n",
    b"date,min_c,max_c\n2024-06-14,9,20\n2024-06-15,8,21\n",
)
TREES = b"name,x,y,z\nA,0,0,1\nB,1.5,0.1,2\n"
POINTS = (
    b"name,x,y,z,lon,lat,height\nA,0,0,1,9.1,47.6,420\nB,6,0,1,9.2,47.6,\n",
    b"frame,easting,northing\n0,512345,5277000\n9,512351,5277001\n",
)
PAIRS = b"query,map,probability,distance_m\na,b,0.9,0.01\nb,c,0.8,0.02\n"


def seeds() -> list[bytes]:
    """One of each kind."""
    coco = {
        "images": [
            {"id": 7, "file_name": "left/0000.png", "width": 640, "height": 480},
            {"id": 8, "file_name": "1.png"},
        ],
        "annotations": [
            {"id": 1, "image_id": 7, "bbox": [10, 10, 20, 20], "track_id": 5, "iscrowd": 0},
            {"id": 2, "image_id": 8, "bbox": [10.5, 10, 20, 2e1], "attributes": {"track_id": 6}, "score": 0.5},
        ],
    }
    results = [{"image_id": 1, "bbox": [1, 2, 3, 4], "score": 0.5, "category_id": 1}]
    answer = {"status": "Found", "matches": [{"query": "a", "map": "b", "probability": 0.9}]}
    boxes = [packed("boxes", {"boxes": each}) for each in (BOXES, MOT, *_dumped(coco, results))]
    pairs = [packed("pairs", {"pairs": each}) for each in (PAIRS, *_dumped(answer))]
    by_hand = [packed("calipers", {"calipers": each}) for each in CALIPERS]
    weather = [packed("temperatures", {"temperatures": each}) for each in TEMPERATURES]
    places = [packed("trees", {"trees": TREES}), *(packed("points", {"points": each}) for each in POINTS)]
    single = [packed("settings", {"settings.toml": TOML}), packed("named", {"named": NAMED})]
    return [*single, *boxes, *pairs, *by_hand, *weather, *places]


def _dumped(*contents: object) -> list[bytes]:
    return [json.dumps(content).encode() for content in contents]


def target(content: bytes) -> None:
    """Read each as the kind that it is called."""
    with unpacked(content) as (_, folder):
        if (folder / "settings.toml").is_file():
            Settings.load(folder / "settings.toml", {}).as_toml()
        if (folder / "boxes").is_file():
            FileDetector.read(folder / "boxes", CAMERA, (0, 1, 2))
        if (folder / "named").is_file():
            for rows in read_boxes(folder / "named", ("a.png", "b.png")).values():
                boxes_within(folder / "named", rows, (640, 480))
        if (folder / "pairs").is_file():
            read_pairs(folder / "pairs", CLOUD, CLOUD)
        if (folder / "calipers").is_file():
            read_calipers(folder / "calipers")
        if (folder / "trees").is_file():
            read_trees(folder / "trees")
        if (folder / "points").is_file():
            is_utm = b"easting" in (folder / "points").read_bytes()
            read_control_points(folder / "points", 32632 if is_utm else None)
        if (folder / "temperatures").is_file():
            read_temperatures(folder / "temperatures", [date(2024, 6, 14), date(2024, 6, 15)])
