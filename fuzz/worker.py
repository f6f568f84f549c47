"""One target in a process of its own, which may die: the case that it is at lies in a file before it is tried.

Tells each new failure as a line of JSON on the standard output: the case, its bytes, and what left the target.
"""

from __future__ import annotations

import argparse
import faulthandler
import hashlib
import json
import os
import random
import re
import resource
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from fuzz import load_target
from fuzz.mutation import mutated
from pomona.errors import PomonaError, PomonaWarning

__all__ = ["MEMORY_BYTES", "SLOW_S"]

MEMORY_BYTES = 2 << 30
"""A case may take so much more address space than the process had before the first one."""

MOST_MESSAGE = 3000
"""Characters of one line for the user; the longest ones list what a bag holds."""

SLOW_S = 20
"""A case that takes longer hangs; they take some milliseconds."""


def main() -> None:
    """Try cases until the time is over, or those of some files."""
    parser = argparse.ArgumentParser()
    parser.add_argument("target")
    parser.add_argument("--case", type=Path, required=True, help="file for the case that is tried")
    parser.add_argument("--seconds", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--replay", nargs="*", type=Path, help="cases to try instead")
    given = parser.parse_args()
    module = load_target(given.target)
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", PomonaWarning)
    with os.fdopen(os.dup(1), "w") as channel:
        os.dup2(2, 1)  # for libraries that print
        attempts = Attempts(module.target, given.case, channel)
        if given.replay is not None:
            _limit_memory()
            for path in given.replay:
                attempts.attempt(path.stem, path.read_bytes())
        else:
            _vary(attempts, module.seeds(), given)


def _vary(attempts: Attempts, seeds: list[bytes], given: argparse.Namespace) -> None:
    """Try the seeds, and damaged ones until the time is over."""
    for row, seed in enumerate(seeds if not given.first else ()):
        attempts.attempt(f"-{row}", seed)
    _limit_memory()
    number, end = given.first, time.monotonic() + given.seconds
    while time.monotonic() < end:
        draw = random.Random(f"{given.target} {given.seed} {number}")
        attempts.attempt(str(number), mutated(draw, seeds))
        number += 1
    attempts.tell({"tried": number - given.first})


def _limit_memory() -> None:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    limit = pages * resource.getpagesize() + MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


class Attempts:
    """Tries cases one by one.

    Parameters
    ----------
    target : callable
        What is tried.
    case : Path
        File for the case that is being tried.
    channel : text stream
        Where failures are told, each once by where it comes from.
    """

    def __init__(self, target: Callable[[bytes], None], case: Path, channel: TextIO) -> None:
        self._target, self._case, self._channel = target, case, channel
        self._told: set[str] = set()

    def attempt(self, name: str, content: bytes) -> None:
        """Try one case."""
        self._case.write_bytes(name.encode() + b"\n" + content)
        faulthandler.dump_traceback_later(SLOW_S, exit=True)
        try:
            self._target(content)
        except PomonaError as error:
            if len(str(error)) > MOST_MESSAGE:
                self._tell_failure(name, content, error)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a panic of Rust is no Exception
            self._tell_failure(name, content, error)
        finally:
            faulthandler.cancel_dump_traceback_later()

    def tell(self, fact: dict[str, Any]) -> None:
        """Print a line of JSON."""
        print(json.dumps(fact), file=self._channel, flush=True)

    def _tell_failure(self, name: str, content: bytes, error: BaseException) -> None:
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if "/pomona/" in frame.filename] or frames
        first_line = re.sub(r"0x\w+|\d+", "#", (str(error).splitlines() or [""])[0])[:60]
        what = f"{type(error).__name__} {Path(own[-1].filename).name}:{own[-1].lineno} {first_line}"
        if what not in self._told:
            self._told.add(what)
            digest = hashlib.sha256(content).hexdigest()[:12]
            trace = "".join(traceback.format_exception(error)[-8:])
            self.tell({"case": name, "digest": digest, "what": what, "trace": trace, "hex": content.hex()})


if __name__ == "__main__":
    main()
