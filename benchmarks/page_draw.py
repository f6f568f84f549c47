"""Documents of rows at random places, as large as is asked for, without a map and without a fit."""

import base64
from datetime import date, timedelta
from typing import Any

import cv2
import numpy as np

from pomona.viewer.packed_columns import packed, packed_texts
from pomona.viewer.season_page import FORMAT
from pomona.viewer.told_crops import MOST_REPORT_BYTES, small_crop

VISITS = 10
SEEN = 0.8
FRUITS_OF_TREE = 100
TREE_M = 1.2


def drawn_document(n: int, *, with_pictures: bool, seed: int = 0) -> dict[str, Any]:
    """Draw a season of n fruits on ten dates."""
    rng = np.random.default_rng(seed)
    trees = np.arange(n) // FRUITS_OF_TREE
    places = np.column_stack(
        [TREE_M * trees + rng.uniform(-0.5, 0.5, n), rng.normal(0, 0.3, n), rng.uniform(0, 2.6, n)]
    )
    days = [date(2024, 6, 1) + timedelta(days=12 * visit) for visit in range(VISITS)]
    sizes_mm = rng.normal(1.0, 0.06, n)[:, None] * np.linspace(30, 78, VISITS + 1)
    seen = rng.random((n, VISITS)) < SEEN
    seen[:, 0] |= ~seen.any(axis=1)
    fruit, visit = np.nonzero(seen)
    now = places[fruit] + rng.normal(0, 0.01, (len(fruit), 3))
    rates = rng.normal(0.4, 0.03, n)
    blocks = [_block("all", "", n, sizes_mm)]
    blocks += [_block("tree", str(tree), FRUITS_OF_TREE, sizes_mm) for tree in range(trees.max() + 1)]
    return {
        "format": FORMAT,
        "program": "drawn",
        "name": f"{n} fruits",
        "visits": [{"name": str(day), "date": str(day), "n_fruits": n, "n_matched": n} for day in days],
        "is_vertical_guessed": False,
        "map_from_page": np.eye(4).tolist(),
        "trees": [
            {"name": str(tree), "row": "", "middle": [TREE_M * tree, 0.0, 1.3], "n_hang": float((trees == tree).sum())}
            for tree in range(trees.max() + 1)
        ],
        "fruits": {
            "ids": packed_texts([str(one) for one in range(1, n + 1)]),
            "tree": packed(trees),
            "state": packed(np.where(seen[:, -1], 1, 2)),
            "state_probability": packed(rng.uniform(0.9, 1.0, n), 0.001),
            "fruit_probability": packed(rng.uniform(0.9, 1.0, n), 0.001),
        },
        "sights": {
            "fruit": packed(fruit),
            "visit": packed(visit),
            **{axis: packed(now[:, column], 0.001) for column, axis in enumerate("xyz")},
            "diameter_mm": packed(sizes_mm[fruit, visit] + rng.normal(0, 2, len(fruit)), 0.1),
            "probability": packed(rng.uniform(0.9, 1.0, len(fruit)), 0.001),
        },
        "harvest": "2024-10-01",
        "growth": {
            "days": [*map(str, days), "2024-10-01"],
            "n_visits": VISITS,
            "harvest": "2024-10-01",
            "curve": "drawn",
            "clock": "days",
            "noise_mm": 2.0,
            "scales": {},
            **{name: packed(sizes_mm + by, 0.1) for name, by in (("median_mm", 0), ("low_mm", -2), ("high_mm", 2))},
            "rate_mm_per_day": packed(rates, 0.001),
            "rate_sigma_mm_per_day": packed(np.full(n, 0.02), 0.001),
            "n_unmeasured": 0,
            "stopped": packed(np.zeros(n), 0.001),
            "odd": packed(np.zeros(n)),
            "blocks": blocks,
            "pack_kg": 13.0,
            "classes": [],
        },
        "thinning": None,
        "no_growth": None,
        "sizes": None,
        "calipers": None,
        "crops": _pictures(n, rng) if with_pictures else None,
    }


def _block(kind: str, name: str, n: int, sizes_mm: np.ndarray) -> dict[str, Any]:
    means = sizes_mm.mean(axis=0).round(2).tolist()
    return {"kind": kind, "name": name, "n_fruits": n, "rate_mm_per_day": [0.38, 0.4, 0.42]} | dict.fromkeys(
        ("mean_mm", "low_mm", "high_mm"), means
    )


def _pictures(n: int, rng: np.random.Generator) -> dict[str, Any]:
    """Give each fruit a picture of its own: a red disc before leaves."""
    pictures = []
    for _ in range(n):
        leaves = cv2.resize(rng.integers(20, 160, (9, 9, 3), dtype=np.uint8), (48, 48), interpolation=cv2.INTER_CUBIC)
        leaves[..., 1] = np.clip(leaves[..., 1] + 60.0, 0, 255)
        cv2.circle(leaves, (24, 24), 19, (30, 40, 190), -1, cv2.LINE_AA)
        noisy = np.clip(leaves + rng.normal(0, 6, leaves.shape), 0, 255).astype(np.uint8)
        made = cv2.imencode(".webp", noisy, [cv2.IMWRITE_WEBP_QUALITY, 60])[1].tobytes()
        pictures.append(small_crop(made, MOST_REPORT_BYTES // n))
    kept = {row: picture for row, picture in enumerate(pictures) if picture is not None}
    letters = [base64.b64encode(picture).decode("ascii") for picture in kept.values()]
    return {"best": packed(list(kept)), "pictures": letters, "sights": None}
