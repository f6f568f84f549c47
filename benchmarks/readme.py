"""The tables of the README and of docs/how-it-decides.md, taken from results/: `python -m benchmarks readme`."""

from collections import defaultdict
from pathlib import Path

from benchmarks.results import FOLDER, markdown, read_rows

HOME = Path(__file__).parent.parent
README, HOW_IT_DECIDES = HOME / "README.md", HOME / "docs" / "how-it-decides.md"
METHODS = ("paper", "verified")
CELLS = {
    "base": "five trees, 30 % hidden, 2 cm of noise",
    "sag8": "the same, branches sagged by 8 cm",
    "sim3": "the same, scale unknown",
    "o45s4": "five trees, 45 % hidden, 4 cm of noise",
    "part45": "two of five trees in common, 45 % hidden",
    "part1": "one of five trees in common, 30 % hidden",
    "part1o45": "one of five trees in common, 45 % hidden",
    "noov": "no tree in common: right is no answer",
    "big5k": "48 trees, 4,600 fruits",
}
HEADER = ("two visits", "method", "right", "wrong", "P", "R", "P of true pose", "R of true pose", "CPU ms")


def main(_options: list[str]) -> None:
    """Replace what is between each pair of marks."""
    for page, name, block in blocks():
        start, end = marks(name)
        before, rest = page.read_text(encoding="utf-8").split(start)
        page.write_text(before + block + rest.split(end)[1], encoding="utf-8")


def blocks() -> list[tuple[Path, str, str]]:
    """Return each block with its page, its name and its marks, as the committed results have it."""
    scan = (FOLDER / "scan.md").read_text(encoding="utf-8")
    found = [(README, "accuracy", accuracy()), (README, "scan", scan), (HOW_IT_DECIDES, "calibration", calibration())]
    return [(page, name, text.join(marks(name))) for page, name, text in found]


def marks(name: str) -> tuple[str, str]:
    """Return the lines around a block."""
    return f"<!-- {name}: python -m benchmarks readme -->\n", f"<!-- end of {name} -->\n"


def accuracy() -> str:
    """Return the table of the cells a reader wants first, both methods, noise estimated where it was measured so."""
    rows = measured()
    lines = []
    for cell, meaning in CELLS.items():
        for method in METHODS:
            row = rows.get((cell, method, "estimated")) or rows.get((cell, method, "given"))
            if row is not None:
                columns = ("right", "wrong", "P", "R", "oracle P", "oracle R", "CPU ms")
                lines.append((meaning, method, *(row[column] for column in columns)))
    return markdown(HEADER, lines)


def calibration() -> str:
    """Return how often pairs of the verified method are right, by the probability they were given."""
    sums: defaultdict[tuple[str, str], list[float]] = defaultdict(lambda: [0.0, 0.0, 0.0])
    for row in read_rows("reliability_verified.csv"):
        if row["noise"] == "estimated":
            one = sums[row["from"], row["to"]]
            for at, column in enumerate(("pairs", "right", "probability_sum")):
                one[at] += float(row[column])
    lines = [
        (f"{least} to {most}", f"{given / pairs:.3f}", f"{right / pairs:.3f}", f"{pairs:,.0f}")
        for (least, most), (pairs, right, given) in sums.items()
    ]
    return markdown(("probability", "mean", "right", "pairs"), lines)


def measured() -> dict[tuple[str, str, str], dict[str, str]]:
    """Return the rows of cells.md by cell, method and noise."""
    lines = [
        [cell.strip() for cell in line.strip("|\n").split("|")]
        for line in (FOLDER / "cells.md").read_text(encoding="utf-8").splitlines()
        if line.startswith("|")
    ]
    header, _, *body = lines
    rows = [dict(zip(header, line, strict=True)) for line in body]
    return {(row["cell"], row["method"], row["noise"]): row for row in rows}
