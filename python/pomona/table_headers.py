"""The headers of the tables that are written here: by these alone an earlier output is told from a table of one's own.

A CSV has no place for a mark. So a header counts only whole and byte for byte: with a column more, in another order or
with the line ends of a spreadsheet somebody has worked on the table, or it was never ours.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

__all__ = ["GROWN_HEADERS", "HEAD_BYTES", "has_header", "head_of", "told_of_map", "told_of_scan"]

HEAD_BYTES = 4096
"""Of the beginning or the end of a file, where it says what it is."""

GROWN_HEADERS = {
    "series.csv": "fruit_id,date,diameter_mm,sigma_mm",
    "curves.csv": "fruit_id,date,diameter_mm,low_mm,high_mm",
    "fruits.csv": (
        "fruit_id,tree,n_dates,rate_mm_per_day,rate_sigma_mm_per_day,rate_relative_per_day,"
        "forecast_mm,forecast_low_mm,forecast_high_mm,outlier,hangs_probability,stopped_probability"
    ),
    "blocks.csv": (
        "block,name,n_fruits,x,y,z,date,mean_mm,mean_low_mm,mean_high_mm,spread_mm,"
        "rate_mm_per_day,rate_sigma_mm_per_day,forecast_date,forecast_mm,forecast_low_mm,forecast_high_mm,"
        "n_fruits_low,n_fruits_high"
    ),
    "classes.csv": (
        "date,from_mm,below_mm,n_fruits,n_fruits_low,n_fruits_high,kg,kg_low,kg_high,packs,packs_low,packs_high"
    ),
}
"""Of the tables of `pomona growth`."""

_UPPER = "cxx,cyy,czz,cxy,cxz,cyz"
_ON_EARTH = "(,longitude_deg,latitude_deg,height_m)?"
_GROWTH = (
    ",size_mm,rate_mm_per_day,rate_sigma_mm_per_day(,forecast_mm,forecast_low_mm,forecast_high_mm)?(,tree)?,outlier"
)
_OF_MAP = re.compile(
    f"id,x,y,z(,diameter_m)?(,{_UPPER})?,state,last_seen,n_sessions,n_missed,state_probability,fruit_probability"
    f"(,tree(,row)?)?({_GROWTH})?{_ON_EARTH}"
)
_OBSERVED = re.compile(f"x,y,z(,diameter_m)?,fruit,session,date,label,probability{_ON_EARTH}")
_SCANNED = re.compile(f"id,x,y,z,diameter_m,{_UPPER},n_views,diameter_sigma_m(,colour)?(,probability)?")


def head_of(path: Path) -> bytes:
    """Return the beginning of a file."""
    with path.open("rb") as file:
        return file.read(HEAD_BYTES)


def has_header(header: str) -> Callable[[Path], bool]:
    """Give what tells whether a table has this header, and nothing else."""
    return lambda path: _header_of(path) == header


def told_of_map(path: Path) -> bool:
    """Tell a table that `pomona export` made from a map, or from the observations of a map or session."""
    header = _header_of(path)
    return any(kind.fullmatch(header) for kind in (_OF_MAP, _OBSERVED))


def told_of_scan(path: Path) -> bool:
    """Tell a table of `pomona scan`; the true fruits of a recording have no sigmas of their sizes."""
    return _SCANNED.fullmatch(_header_of(path)) is not None


def _header_of(path: Path) -> str:
    """Return the first line as `csv_rows` ends it; what has no such end, or is no text, has the header of no table."""
    line, end, _ = head_of(path).partition(b"\n")
    return line.decode() if end else ""
