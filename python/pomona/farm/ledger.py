"""What is done: one small file a step, written when the step has ended, and never before."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from pomona.atomic import whole_file
from pomona.errors import PomonaError

__all__ = ["Done", "Ledger"]


@dataclass(frozen=True)
class Done:
    """A step that was begun, or done.

    Attributes
    ----------
    step : str
        Its name.
    kind : str
        What it did.
    key : str
        All that its result follows from, as a hash; empty from when it begins until it has ended well.
    settings : str
        The flags of the plan, with the files that they name, as a hash.
    outputs : list of str
        What it wrote, named from the folder of the plan.
    told : list of str
        What it said on the way.
    incomplete : bool
        Whether it found no match for some of what it was given: a result, and no failure.
    seconds, peak_bytes : float, int
        What it took.
    """

    step: str
    kind: str
    key: str
    settings: str
    outputs: list[str]
    told: list[str]
    incomplete: bool
    seconds: float
    peak_bytes: int


class Ledger:
    """The steps that were done for a farm.

    Parameters
    ----------
    folder : Path
        Where it is kept; made where it does not exist.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            for name in ("done", "logs"):
                (folder / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise PomonaError(f"{folder}: cannot be made: {error.strerror}") from None

    def read(self, step: str) -> Done | None:
        """Return what became of a step the last time that it ended; None where nothing is known."""
        try:
            return Done(**json.loads(self._file(step).read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return None

    def write(self, done: Done) -> None:
        """Note that a step has ended."""
        with whole_file(self._file(done.step)) as partial:
            partial.write_text(json.dumps(asdict(done), indent=1) + "\n", encoding="utf-8")

    def log(self, step: str) -> Path:
        """Where what a step says is kept; the suffix tells which of its streams."""
        return self.folder / "logs" / _slug(step)

    def peaks_bytes(self) -> dict[str, int]:
        """Return the most memory that steps of each kind took."""
        peaks: dict[str, int] = {}
        for file in (self.folder / "done").glob("*.json"):
            with contextlib.suppress(OSError, ValueError, TypeError):
                done = Done(**json.loads(file.read_text(encoding="utf-8")))
                peaks[done.kind] = max(peaks.get(done.kind, 0), done.peak_bytes)
        return peaks

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Let no other run work on the same farm while the block runs; a killed run leaves no lock.

        Raises
        ------
        PomonaError
            Another one does.
        """
        with (self.folder / "lock").open("a+") as lock:
            if not _is_locked_now(lock.fileno()):
                raise PomonaError(f"{self.folder.parent}: another run is working on this farm, expected one at a time")
            yield

    def is_running(self) -> bool:
        """Tell whether a run is working on the farm."""
        with (self.folder / "lock").open("a+") as lock:
            return not _is_locked_now(lock.fileno())

    def _file(self, step: str) -> Path:
        return self.folder / "done" / f"{_slug(step)}.json"


def _slug(step: str) -> str:
    """Make a file name of a step's, one's own whatever letters it has."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "_", step)[:80]
    return f"{plain}-{hashlib.sha256(step.encode()).hexdigest()[:8]}"


def _is_locked_now(descriptor: int) -> bool:
    """Lock a file until it is closed; tell whether that could be done."""
    try:
        import fcntl
    except ImportError:
        return True  # where nothing can be locked, two runs at once are not told
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
