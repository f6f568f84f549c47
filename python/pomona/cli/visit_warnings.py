"""Warnings of a map's visits, on the standard error."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pomona.cli.terminal import tell


def warn_of_visits(orchard: Path, lines: Iterable[str]) -> None:
    """Tell them, see `pomona.growth.visit_warnings`."""
    for line in lines:
        tell(f"pomona: warning: {orchard}: {line}")
