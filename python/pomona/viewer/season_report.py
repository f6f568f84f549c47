"""A report: the page with its document in one file, for mailing."""

from __future__ import annotations

from pathlib import Path

from pomona.atomic import whole_file
from pomona.viewer.built_page import built_page, report_of
from pomona.viewer.season_page import Warn, Wishes, season_document, unheard

__all__ = ["write_report"]


def write_report(orchard: str | Path, output: str | Path, wishes: Wishes | None = None, warn: Warn = unheard) -> int:
    """Write a map as one HTML file that needs no network.

    Parameters
    ----------
    orchard : str or Path
        The map (.gpkg).
    output : str or Path
    wishes : Wishes, optional
    warn : callable
        Takes a line on what is wrong with visits.

    Returns
    -------
    int
        Bytes written.

    Raises
    ------
    PomonaError
        As `season_document`, or when the file cannot be written.
    """
    report = report_of(built_page(), season_document(Path(orchard), wishes or Wishes(), warn=warn)).encode()
    with whole_file(output) as partial:
        partial.write_bytes(report)
    return len(report)
