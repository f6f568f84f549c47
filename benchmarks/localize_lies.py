"""Is odometry that lies steadily noticed? Drawn rows, few fruits in view, told motions that are too long or too short.

A camera drives six metres along a row that it knows; after four full frames each shows a few fruits. Told motions err
by chance, by the standard deviations that localisation expects of them or by a tenth of these, and from then on by a
lie that is the same in every frame: along the way, toward the row, or a turn about the vertical. NEES is the squared
error under the pose's own covariance, 6 where that is right; beyond 22.5, which one in a thousand should be, the pose
is believed wrongly, and `longest` is the longest run of such frames. Writes localize_lies.md.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.localize import FALSE_M
from benchmarks.results import markdown, write_text
from benchmarks.row_drive import Array, drawn_row, pose_at, seen_from, step_to
from pomona import Localizer

FRAMES, FULL, STEP_M = 60, 4, 0.1
"""Frames of a drive, those of them that show all, and the way between two."""

EXPECTED_M, EXPECTED_RAD = 0.007, 0.005
"""What a told motion of that way errs by: `MEASURED` of the core's `localization/belief.rs`."""

BEYOND = 22.5
"""The 99.9 % quantile of chi squared with 6 degrees of freedom."""


@dataclass(frozen=True)
class Case:
    """Fruits in view, chance errors over what is expected, the lie: metres along and toward the row, degrees."""

    fruits: int
    noise: float
    lie: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def lied(self) -> str:
        """The lie in words."""
        names = ("along", "toward", "turn")
        amounts = [
            f"{1000 * value:.0f} mm {name}" if name != "turn" else f"{value:g}\u00b0"
            for name, value in zip(names, self.lie, strict=True)
            if value
        ]
        return ", ".join(amounts) or "-"


def cases() -> Iterator[Case]:
    for fruits in (3, 9):
        for noise in (0.1, 1.0):
            yield Case(fruits, noise)
    for lie_m in (0.02, 0.05, 0.1):
        yield Case(3, 1.0, (lie_m, 0.0, 0.0))
        yield Case(3, 1.0, (0.0, lie_m, 0.0))
    yield Case(3, 0.1, (0.05, 0.0, 0.0))
    yield Case(9, 1.0, (0.05, 0.0, 0.0))
    yield Case(3, 1.0, (0.0, 0.0, 0.5))
    yield Case(3, 1.0, (0.0, 0.0, 1.5))


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks localize_lies", description=__doc__)
    parser.add_argument("--rows", type=int, default=10, help="drawn rows of each case")
    options = parser.parse_args(arguments)
    text = markdown(HEADER, [as_line(case, [drive(case, seed) for seed in range(options.rows)]) for case in cases()])
    sys.stdout.write(text)
    if options.rows == parser.get_default("rows"):
        write_text("localize_lies.md", text)


@dataclass(frozen=True)
class Frames:
    """The frames with few fruits: error in metres, NaN where none was found; NEES; seconds."""

    off_m: Array
    nees: Array
    seconds: Array


def drive(case: Case, seed: int) -> Frames:
    row, rng = drawn_row(seed, length_m=9.0, n=360), np.random.default_rng(1000 + seed)
    localizer, frames = Localizer(row.map, threads=1), []
    before: Array | None = None
    for number in range(FRAMES):
        true, full = pose_at(1.2 + STEP_M * number), number < FULL
        seen = seen_from(row, true, 100 * seed + number, most=60 if full else case.fruits, share=0.8)
        moved: Array | None = None
        if before is not None:
            moved = np.linalg.solve(before, true) @ _error(case, rng, lies=not full)
        begun_s = time.perf_counter()
        found = localizer.update(seen, moved)
        spent_s, before = time.perf_counter() - begun_s, true
        step = np.full(6, np.nan) if found.map_from_camera is None else step_to(found.map_from_camera, true)
        nees = step @ np.linalg.solve(found.covariance, step) if found else np.nan
        frames.append((np.linalg.norm(step[:3]), nees, spent_s))
    return Frames(*np.array(frames[FULL:]).T)


def _error(case: Case, rng: np.random.Generator, *, lies: bool) -> Array:
    along, toward, turn_deg = case.lie if lies else (0.0, 0.0, 0.0)
    error = np.eye(4)
    error[:3, 3] = rng.normal(0, case.noise * EXPECTED_M, 3) + np.array([along, 0.0, toward])
    chance = Rotation.from_rotvec(rng.normal(0, case.noise * EXPECTED_RAD, 3))
    error[:3, :3] = (chance * Rotation.from_euler("y", turn_deg, degrees=True)).as_matrix()
    return error


HEADER = ("fruits", "noise", "lie", "found", "false", "mm", "95 % mm", "NEES", f"> {BEYOND}", "longest", "ms")


def as_line(case: Case, drives: list[Frames]) -> tuple[str, ...]:
    off_mm = 1000 * np.concatenate([one.off_m for one in drives])
    nees = np.concatenate([one.nees for one in drives])
    found = np.isfinite(off_mm)
    return (
        str(case.fruits),
        f"{case.noise:g}",
        case.lied,
        f"{found.mean():.3f}",
        f"{(off_mm[found] > 1000 * FALSE_M).mean():.3f}",
        f"{np.median(off_mm[found]):.0f}",
        f"{np.percentile(off_mm[found], 95):.0f}",
        f"{nees[found].mean():.1f}",
        f"{(nees[found] > BEYOND).mean():.3f}",
        str(max(_longest(one.nees > BEYOND) for one in drives)),
        f"{1000 * np.median(np.concatenate([one.seconds for one in drives])):.1f}",
    )


def _longest(wrong: NDArray[np.bool_]) -> int:
    most = run = 0
    for one in wrong:
        run = run + 1 if one else 0
        most = max(most, run)
    return most
