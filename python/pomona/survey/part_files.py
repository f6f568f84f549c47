"""How the files of a survey's parts are named: a part has its own frame of reference, so it is a file of its own."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable
from pathlib import Path

from pomona.errors import PomonaWarning
from pomona.streams import is_stream
from pomona.survey.story import Survey

__all__ = ["part_files", "parts_there", "tell_others"]


def part_files(path: Path, survey: Survey) -> dict[int, Path]:
    """Give the file of each part that is written, by the number of the part, from 0.

    The longest part has the name that was asked for. The others go by their place in time, from 1: where
    `row.gpkg` is the second, `row-part1.gpkg` came before it and `row-part3.gpkg` after. Parts without fruits are
    not written; into a stream, only the longest is.
    """
    written = {
        number: _path_of(path, number)
        for number, part in enumerate(survey.parts)
        if len(part.cloud) and not is_stream(path)
    }
    return {**written, survey.longest: path}


def parts_there(path: Path) -> list[Path]:
    """Return the files that are there under the names of parts."""
    name = re.compile(rf"{re.escape(path.stem)}-part[1-9][0-9]*{re.escape(path.suffix)}")
    folder = path.parent
    return sorted(file for file in folder.iterdir() if name.fullmatch(file.name)) if folder.is_dir() else []


def tell_others(path: Path, written: Iterable[Path]) -> None:
    """Warn of files with names of parts that this survey has not: an earlier one with other parts left them."""
    ours = set(written)
    others = [str(file) for file in parts_there(path) if file not in ours]
    if others:
        message = (
            f"{path}: {', '.join(others)} {'are' if len(others) > 1 else 'is'} of an earlier scan, not of this one"
        )
        warnings.warn(message, PomonaWarning, stacklevel=3)


def _path_of(path: Path, number: int) -> Path:
    return path.with_stem(f"{path.stem}-part{number + 1}")
