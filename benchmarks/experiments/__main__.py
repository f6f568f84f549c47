"""Run the paper's experiments and write docs/experiments.md with its pictures.

Videos and scans are kept in FOLDER, so that a run that was interrupted, or one with a new matcher, goes on from there.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from benchmarks.experiments.from_above import from_above
from benchmarks.experiments.page import page
from benchmarks.experiments.robustness import robustness
from benchmarks.experiments.sets import SETS
from benchmarks.experiments.tables import table
from benchmarks.experiments.trajectory import trajectory
from benchmarks.experiments.videos import VIDEOS, rendered
from benchmarks.experiments.visits import program
from pomona.atomic import whole_file

ROOT = Path(__file__).parents[2]


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.experiments", description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "out" / "experiments", metavar="FOLDER")
    parser.add_argument("--render-only", action="store_true", help="make the videos and stop")
    parser.add_argument("--runs", type=int, default=10, help="matches that are averaged; the paper: 10")
    options = parser.parse_args(arguments)
    for name in VIDEOS:
        rendered(name, options.folder)
    if not options.render_only:
        _experiments(options.folder, ROOT / "docs", options.runs)
    return 0


def _experiments(folder: Path, docs: Path, runs: int) -> None:
    stories = {
        "robustness": partial(robustness, folder, docs / "images"),
        **{name: partial(table, one, folder, runs) for name, one in SETS.items()},
        "trajectory": partial(trajectory, folder, docs / "images"),
        "from_above": partial(from_above, folder, docs / "images"),
    }
    made_by = f"{_made_by()}-{runs}"
    found = {name: _kept(folder / "said" / f"{name}-{made_by}.md", story) for name, story in stories.items()}
    (docs / "experiments.md").write_text(page(found, runs), encoding="utf-8")


def _kept(path: Path, story: Callable[[], str]) -> str:
    """Run an experiment, or take up what the same program found before."""
    if not path.is_file():
        began, said = time.process_time(), story()
        sys.stderr.write(f"{path.stem}: {time.process_time() - began:.0f} s of CPU\n")
        path.parent.mkdir(exist_ok=True)
        with whole_file(path) as partial_file:
            partial_file.write_text(said, encoding="utf-8")
    return path.read_text(encoding="utf-8")


def _made_by() -> str:
    """Digest of the program and of the benchmarks."""
    sources = sorted((ROOT / "benchmarks").rglob("*.py"))
    return hashlib.sha256(program() + b"".join(path.read_bytes() for path in sources)).hexdigest()[:12]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
