"""The README's tables, taken from results/: `python -m benchmarks readme`."""

from pathlib import Path

from benchmarks.results import FOLDER, markdown

README = Path(__file__).parent.parent / "README.md"
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
    text = README.read_text(encoding="utf-8")
    for name, block in blocks().items():
        start, end = marks(name)
        before, rest = text.split(start)
        text = before + block + rest.split(end)[1]
    README.write_text(text, encoding="utf-8")


def blocks() -> dict[str, str]:
    """Return each block of the README with its marks, as the committed results have it."""
    found = {"accuracy": accuracy(), "scan": (FOLDER / "scan.md").read_text(encoding="utf-8")}
    return {name: text.join(marks(name)) for name, text in found.items()}


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
