"""What a reader says of a file that it does not take."""

from collections.abc import Callable
from pathlib import Path

import pytest

from pomona import PomonaError


def refused(read: Callable[[], object], *named: str) -> str:
    """The one line by which it refuses, which names what is wrong."""
    with pytest.raises(PomonaError) as caught:
        read()
    line = str(caught.value)
    assert "\n" not in line
    assert len(line) < 1000
    for words in named:
        assert words in line, line
    return line


def refused_of(path: Path, read: Callable[[Path], object]) -> str:
    """What the line says after the name of the file, with which it begins."""
    line = refused(lambda: read(path))
    assert line.startswith(f"{path}: ")
    return line.removeprefix(f"{path}: ")
