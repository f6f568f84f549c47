"""Pictures as files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pomona.atomic import whole_file
from pomona.errors import PomonaError
from pomona.file_names import given_path
from pomona.reading import shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["PICTURE_SUFFIXES", "require_picture_name", "save_picture"]

PICTURE_SUFFIXES = (".png", ".svg", ".pdf")


def require_picture_name(path: Path) -> None:
    """Refuse a file name that is no picture, before any work is done.

    Raises
    ------
    PomonaError
        The suffix is none of `PICTURE_SUFFIXES`.
    """
    if path.suffix.lower() not in PICTURE_SUFFIXES:
        found = path.suffix or "no suffix"
        raise PomonaError(f"{path}: found {found}, expected a picture named {', '.join(PICTURE_SUFFIXES)}")


def save_picture(figure: Figure, path: str | Path) -> None:
    """Write a figure as its suffix says; the file appears whole or not at all.

    Raises
    ------
    PomonaError
        The suffix is none of `PICTURE_SUFFIXES`, the file cannot be written, or there is no figure.
    """
    if not hasattr(figure, "savefig"):
        raise PomonaError(f"figure: found {shown(figure)}, expected one of matplotlib, as draw_match gives it")
    path = given_path(path)
    require_picture_name(path)
    with whole_file(path) as partial:
        figure.savefig(partial, format=path.suffix.lower()[1:])
