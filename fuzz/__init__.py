"""Readers and bindings fed with damaged input: nothing but a `PomonaError` may leave them, in bounded time and memory.

Each module with `seeds` and `target` is a target. `python -m fuzz` runs them all, `fuzz/run.py` tells how; a case that
it finds becomes a file in `testdata/fuzz/TARGET/`, which `tests/test_fuzz.py` plays back for ever.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[1]
CASES = ROOT / "testdata" / "fuzz"
"""Found cases, a folder for each target."""

sys.path.append(str(ROOT / "tests"))  # whose makers write the seeds


def target_names() -> list[str]:
    """Names of all targets, in the order of the alphabet."""
    sources = {module.name: Path(__file__).with_name(f"{module.name}.py") for module in pkgutil.iter_modules(__path__)}
    return sorted(name for name, source in sources.items() if "\ndef target(" in source.read_text(encoding="utf-8"))


def load_target(name: str) -> ModuleType:
    """Import a target: `seeds() -> list[bytes]`, real and small, and `target(content: bytes) -> None`."""
    return importlib.import_module(f"fuzz.{name}")
