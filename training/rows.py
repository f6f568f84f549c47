"""The rendered rows that the shipped detector learns from: `python -m training.rows FOLDER [--rows N] [--photo]`.

Every row differs in training, cultivar, date, foliage, weather and way of the camera, all drawn by its number. What is
in FOLDER already is not rendered again.
"""

from __future__ import annotations

import argparse
import datetime
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from pomona.render.camera_path import PATHS
from pomona.render.filming import Filming, film
from pomona.render.sensor import Sensor
from pomona.render.weather import WEATHERS
from pomona.synth.living import RowDesign
from pomona.synth.living.cultivars import CULTIVARS
from pomona.synth.living.training_systems import SYSTEMS
from pomona.threads import cores

FIRST_SEED = 1000
"""Far from the seeds that people try first, and from those of the shipped recordings."""

FIRST_DAY, DAYS = datetime.date(2024, 7, 1), 100
JPEG_QUALITY = 90


def drawn_row(number: int, pairs: int, renderer: str) -> Filming:
    """Give the row of a number, and how it is filmed."""
    seed = FIRST_SEED + number
    draw = np.random.default_rng([seed, 0xF00D])
    fruits = int(draw.integers(20, 140))
    design = RowDesign(
        system=str(draw.choice(sorted(SYSTEMS))),
        cultivar=str(draw.choice(sorted(CULTIVARS))),
        n_trees=3,
        fruits_per_tree=(fruits, round(1.3 * fruits)),
        leaves_per_tree=int(draw.integers(2000, 6500)),
        row_spacing_m=float(draw.uniform(2.8, 4.5)),
        grass_blades_per_m2=float(draw.uniform(0, 90)),
        clear_of_posts=False,  # as what ships was trained on
    )
    sensor = Sensor(
        white_balance=(float(draw.uniform(0.9, 1.1)), float(draw.uniform(0.9, 1.1))),
        vignetting=float(draw.uniform(0, 0.4)),
        full_well=float(draw.uniform(3000, 12000)),
        shutter_s=float(draw.uniform(0.0005, 0.006)),
    )
    return Filming(
        design,
        FIRST_DAY + datetime.timedelta(days=int(draw.integers(DAYS))),
        seed,
        path=str(draw.choice(sorted(PATHS))),
        weather=str(draw.choice(sorted(WEATHERS))),
        pairs=pairs,
        jitter=0.9,
        eyes=(sensor, sensor),
        jpeg_quality=JPEG_QUALITY,
        renderer=renderer,
    )


def _render(number: int, pairs: int, renderer: str, folder: Path) -> str:
    row = drawn_row(number, pairs, renderer)
    film(row, folder / f"{renderer}_{number:04d}")
    return f"{renderer} {number}: {row.design.system}, {row.design.cultivar}, {row.day}, {row.path}, {row.weather}"


def main() -> None:
    """Render the rows, each in a process."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rows", type=int, default=100)
    parser.add_argument("--pairs", type=int, default=8, help="of each row")
    parser.add_argument("--renderer", default="raster")
    parser.add_argument("--processes", type=int, default=cores())
    given = parser.parse_args()
    with ProcessPoolExecutor(given.processes) as pool:
        runs = [pool.submit(_render, row, given.pairs, given.renderer, given.folder) for row in range(given.rows)]
        for run in runs:
            print(run.result(), flush=True)


if __name__ == "__main__":
    main()
