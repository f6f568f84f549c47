"""Run the named benchmarks, or all of them: `python -m benchmarks [NAME ...] [-- OPTIONS]`.

Options after the name of a single benchmark go to it: `python -m benchmarks cells --cells base --seeds 0:5`.
"""

import importlib
import itertools
import sys

NAMES = (
    "robustness",
    "cells",
    "false_alarms",
    "chance",
    "sizes",
    "units",
    "detector",
    "stereo",
    "lifting",
    "field",
    "diameters",
    "kinect",
    "season",
    "season_map",
    "growth",
    "thinning",
    "seasons",
    "once_seen",
    "trees",
    "mapscale",
    "million",
    "clouds",
    "odometry",
    "slam",
    "tracking",
    "scan",
    "shipped",
    "localize",
    "localize_loop",
    "localize_lies",
    "metric",
    "disturbed",
    "endurance",
    "page",
    "speed",
    "farm",
    "readme",
)
"""In the order in which all of them run."""


def main(arguments: list[str]) -> int:
    if arguments and arguments[0] in ("-h", "--help"):
        sys.stdout.write(f"{__doc__}\n{', '.join(NAMES)}\n")
        return 0
    if not arguments:
        for name in NAMES:
            _run(name, [])
        return 0
    names = list(itertools.takewhile(NAMES.__contains__, arguments))
    options = arguments[len(names) :]
    if not names or (options and len(names) > 1):
        sys.stderr.write(f"benchmarks: found {' '.join(arguments)!r}, expected names of {', '.join(NAMES)}\n")
        return 2
    for name in names:
        _run(name, options)
    return 0


def _run(name: str, options: list[str]) -> None:
    sys.stderr.write(f"== {name}\n")
    importlib.import_module(f"benchmarks.{name}").main(options)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
