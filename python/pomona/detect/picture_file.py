"""Pictures that a user names: files, or all those in a folder; each a name of its own."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import require_file
from pomona.recording.pictures import UnreadablePictureError, decoded_picture

__all__ = ["SUFFIXES", "pictures_in", "read_picture"]

SUFFIXES = (".png", ".jpg", ".jpeg")
"""Of the pictures that are taken out of a folder; a file that is named may be called anything."""


def pictures_in(places: Iterable[Path]) -> dict[str, Path]:
    """List pictures by the names of their files, in the order given; in folders by name. One given twice is one.

    Raises
    ------
    PomonaError
        A picture that is named is not there, a folder holds none, two have the same name, or a name is not UTF-8, as
        tables of boxes are.
    """
    found: dict[str, Path] = {}
    for place in places:
        if not place.is_dir():
            require_file(place, "a picture")
        for path in _of_folder(place) if place.is_dir() else [place]:
            _require_text(path)
            if path.name in found and path.resolve() != found[path.name].resolve():
                raise PomonaError(f"{path}: found the name of {found[path.name]}, expected names that differ")
            found[path.name] = path
    return found


def _require_text(path: Path) -> None:
    try:
        path.name.encode()
    except UnicodeEncodeError:
        raise PomonaError(f"{path}: found a name that is not UTF-8, expected one that can be in a table") from None


def _of_folder(folder: Path) -> list[Path]:
    named = (file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES and not file.name.startswith("."))
    pictures = sorted(file for file in named if not file.is_dir())
    if not pictures:
        raise PomonaError(f"{folder}: found no pictures, expected {', '.join(SUFFIXES)}")
    return pictures


def read_picture(path: Path) -> NDArray[np.uint8]:
    """Read a picture as (H, W, 3) uint8, BGR.

    Raises
    ------
    UnreadablePictureError
        It is not there, is none, or is cut off.
    """
    import cv2

    try:
        require_file(path, "a picture")
    except PomonaError as error:
        raise UnreadablePictureError(str(error)) from None
    return np.asarray(decoded_picture(path, np.fromfile(path, np.uint8), cv2.IMREAD_COLOR), np.uint8)
