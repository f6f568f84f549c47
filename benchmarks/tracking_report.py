"""What the benchmark `tracking` tells, as tables."""

from __future__ import annotations

from benchmarks.recordings import DATES
from benchmarks.results import markdown
from benchmarks.tracking_runs import Disturbance

Rows = list[dict[str, object]]

DEPTHS = ("exact", "stereo")
MISSING = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
KINDS = {"boxes missing": Disturbance(), "and 10 % false, 1 px": Disturbance(false=0.1, jitter_px=1.0)}
DRIFTS = {"2 mm, 0.05 deg": (0.002, 0.0009), "4 mm, 0.1 deg": (0.004, 0.0017), "8 mm, 0.2 deg": (0.008, 0.0035)}
"""Standard deviations along and about each axis, in each frame; a frame is 180 mm of way."""

PAPER = """\
The paper's own tracker, as published (Matos et al., CVPR Workshops 2024; true boxes, four other videos of 110-250
frames with 204-373 apples): count errors 12.9, 0.84, 4.6 and 1.1 %, MOTA .76, .70, .61 and .94. ByteTrack's counts on
those err by 4 to 114 %.
"""


def report(rows: Rows, curve: Rows, drift: Rows, seeds: int) -> str:
    """Put the tables together."""
    return (
        "Fruits with boxes in at least 5 frames against tracks with at least 5 boxes; all other boxes are left out.\n"
        f"Depth, poses and when the track was told:\n\n{often_table(rows)}\n"
        f"Every fruit, every box, every track:\n\n{all_table(rows)}\n"
        "ByteTrack knows neither poses nor depth; between two frames a fruit moves by two of its diameters.\n\n"
        f"{PAPER}\nBoxes missing at random, and then also 10 % false ones and 1 px on each edge; {seeds} seeds, true\n"
        "poses. Counted are fruits with boxes in at least 5 frames among those that are left. Mean of the absolute\n"
        f"error in %, and the largest:\n\n{curve_table(curve)}\n"
        "Poses that drift: normal noise in each frame, kept ever after; along the row and back, so that every fruit\n"
        f"comes again. The way that the last pose is off, and count errors as above, {seeds} seeds:\n\n"
        f"{drift_table(drift)}"
    )


def often_table(rows: Rows) -> str:
    header = ("date, depth, poses, told", "fruits", "reported", "error %", "split", "MOTA", "HOTA", "IDF1", "switches")
    return markdown(
        header,
        [
            (
                label(row),
                str(row["fruits"]),
                str(row["reported"]),
                f"{100 * row['error']:+.1f}",
                str(row["split"]),
                *mot_cells(row, "_often"),
            )
            for row in rows
        ],
    )


def all_table(rows: Rows) -> str:
    return markdown(
        ("date, depth, poses, told", "fruits", "tracks", "MOTA", "HOTA", "IDF1", "switches"),
        [(label(row), str(row["all_fruits"]), str(row["all_tracks"]), *mot_cells(row, "")) for row in rows],
    )


def mot_cells(row: dict[str, object], of: str) -> list[str]:
    return [*(f"{row[f'{name}{of}']:.3f}" for name in ("mota", "hota", "idf1")), str(row[f"switches{of}"])]


def label(row: dict[str, object]) -> str:
    return ", ".join(str(row[name]) for name in ("date", "depth", "poses", "tracker"))


def curve_table(curve: Rows) -> str:
    return markdown(
        ("boxes missing", *(f"{missing:.0%}" for missing in MISSING)),
        [
            (
                f"{date}, {depth}, {kind}",
                *(error_cell(curve, date=date, depth=depth, kind=kind, missing=missing) for missing in MISSING),
            )
            for date in DATES
            for depth in DEPTHS
            for kind in KINDS
        ],
    )


def drift_table(drift: Rows) -> str:
    return markdown(
        ("noise a frame", *DRIFTS),
        [
            (f"{date}, {depth}", *(drift_cell(drift, date, depth, step) for step in DRIFTS))
            for date in DATES
            for depth in DEPTHS
        ],
    )


def drift_cell(drift: Rows, date: str, depth: str, step: str) -> str:
    of = {"date": date, "depth": depth, "step": step}
    return f"{100 * row_of(drift, **of)['end_m']:.0f} cm: {error_cell(drift, **of)}"


def error_cell(rows: Rows, **of: object) -> str:
    row = row_of(rows, **of)
    largest = max(row["largest_error"], row["least_error"], key=abs)
    return f"{100 * row['mean_abs_error']:.1f} ({100 * largest:+.1f})"


def row_of(rows: Rows, **of: object) -> dict[str, object]:
    return next(row for row in rows if all(row[name] == value for name, value in of.items()))
