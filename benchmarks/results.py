"""Where results go and how their tables look."""

import csv
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

FOLDER = Path(__file__).parent / "results"


def shared_data(asking: str) -> Path | None:
    """Find the real recordings: POMONA_DATA, or ../shared/data beside the checkout; None, and said, where are none."""
    folder = Path(os.environ.get("POMONA_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if folder.is_dir():
        return folder
    sys.stderr.write(f"{asking}: skipped, no folder of recordings (set POMONA_DATA)\n")
    return None


def read_rows(name: str) -> list[dict[str, str]]:
    """Rows of a result file; none where it does not exist yet."""
    path = FOLDER / name
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write_rows(name: str, rows: Sequence[Mapping[str, object]]) -> None:
    """Write rows with equal keys as CSV; floats with 6 significant digits, None as nothing."""
    with (FOLDER / name).open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({key: f"{value:.6g}" if isinstance(value, float) else value for key, value in row.items()})


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Lay out a table in markdown; the first column left, the others right."""
    body = [list(map(str, row)) for row in rows]
    widths = [max(len(line[column]) for line in [list(header), *body]) for column in range(len(header))]
    rule = [":" + "-" * (widths[0] - 1), *("-" * (width - 1) + ":" for width in widths[1:])]

    def line(cells: Sequence[str]) -> str:
        padded = [
            cells[0].ljust(widths[0]),
            *(cell.rjust(width) for cell, width in zip(cells[1:], widths[1:], strict=True)),
        ]
        return "| " + " | ".join(padded) + " |"

    return "\n".join([line(list(header)), line(rule), *map(line, body)]) + "\n"


def write_text(name: str, text: str) -> None:
    (FOLDER / name).write_text(text, encoding="utf-8")


def share(value: float | None) -> str:
    """Three digits, a dash for None."""
    return "-" if value is None else f"{value:.3f}"
