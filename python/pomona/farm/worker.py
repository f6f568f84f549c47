"""A worker: runs the commands of one job, and ends at once when whoever started it is gone.

Started as ``python -m pomona.farm.worker``; the job comes as a line of JSON on the standard input, which stays open as
long as somebody waits for the result: a killed run leaves no process that goes on writing.
"""

from __future__ import annotations

import json
import os
import runpy
import sys
import threading

GIVEN_UP = 143
"""Exit code of a worker for whom nobody waits."""


def main() -> int:
    """Run the job, and stop at the first command that fails."""
    job = json.loads(_line())
    threading.Thread(target=_end_with_the_input, daemon=True).start()
    os.chdir(job["folder"])
    if job["cores"] and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, job["cores"])
    worst = 0
    for command in job["commands"]:
        code = _run(command)
        if code not in (0, 1):
            return code
        worst = max(worst, code)
    return worst


def _line() -> bytes:
    """Read a line without Python's buffer, whose lock a thread that waits for more would hold for ever."""
    line = b""
    while not line.endswith(b"\n") and (piece := os.read(0, 1)):
        line += piece
    return line


def _end_with_the_input() -> None:
    while os.read(0, 1):
        pass
    os._exit(GIVEN_UP)


def _run(command: list[str]) -> int:
    """Run one command as the command line would, in this process, which has what it needs loaded by then."""
    sys.argv = ["pomona", *command]
    try:
        runpy.run_module("pomona", run_name="__main__")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


if __name__ == "__main__":
    sys.exit(main())
