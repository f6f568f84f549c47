"""Render the pairs of a job that are not there yet: `python render_job.py FOLDER [FIRST]`.

The folder has `job.json` and `surfaces.npz`, written by pomona.render.photo; pairs come to `pairs/NNNN.npz`, each whole
or not at all, and what is there before them to `truth/NNNN.npz`. A line on the standard output tells of each pair.
"""

from __future__ import annotations

import sys
from pathlib import Path

NO_BLENDER = 3
"""Exit code when Blender's module cannot be loaded."""


def main(folder: Path, first: int = 0) -> int:
    """Render from pair `first` on; give the exit code."""
    try:
        import bpy  # noqa: F401
    except ImportError as error:
        print(error, file=sys.stderr)
        return NO_BLENDER
    from traced_pairs import render_missing

    render_missing(folder, first)
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), *map(int, sys.argv[2:])))
