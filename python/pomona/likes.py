"""What the files are that Pomona makes, told by what is in them: only its like may be replaced by an output."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pomona.table_headers import GROWN_HEADERS, HEAD_BYTES, has_header, head_of, told_of_map, told_of_scan

__all__ = [
    "BOXES",
    "BOXES_DRAWN",
    "BOXES_DRAWN_MARK",
    "BY_DATE",
    "CALIPER_PAIRS",
    "DEMO",
    "DEMO_DATES",
    "DEMO_NAME",
    "DEMO_RECORDING",
    "DEMO_SEED",
    "DRAWN_BOXES",
    "EXPORTS",
    "FARM_PLAN",
    "GROWN",
    "INDEX",
    "KEPT",
    "MCAP_MARK",
    "MERGED",
    "METRIC_MODEL",
    "MODEL",
    "PAIRS",
    "PARQUET_MARK",
    "PICTURE",
    "POSES",
    "PULLED",
    "RENDERED",
    "REPLAYED",
    "REPORT",
    "REPORT_MARK",
    "SCANNED",
    "THINNING",
    "VIDEO",
    "VISITS",
    "Database",
    "Like",
    "database_of",
    "drawn_season",
    "is_like",
    "is_of_demo",
    "visits_of_season",
]

SQLITE = b"SQLite format 3\0"

VIDEO_MARK = "boxes drawn by pomona"
"""Comment in the videos of `--preview`, by which they are told from recordings."""

BOXES_DRAWN = ".boxes.png"
"""How the names of pictures end in which boxes were drawn."""

BOXES_DRAWN_MARK = b"Software\0boxes drawn by pomona"
"""Text in these pictures, by which they are told from others of such a name."""

POSES_MARK = "# time tx ty tz qx qy qz qw: map_from_camera"
"""First line of the poses that are found in a map, by which they are told from those of a recording."""

WAY_MARK = "# time tx ty tz qx qy qz qw: session_from_camera"
"""First line of the poses of a session."""

PLY_MARK = "comment fruits written by pomona, metres"
"""Line in the header of the PLY files that are written here."""

MODEL_MARK = b"pomona_training"
"""Key in the metadata of the models that are trained here."""

GEOJSON_MARK = b'"comment": "fruits by pomona"'
"""In a GeoJSON on Earth, whose reference system tells nothing."""

DBASE_MARK = bytes([3, 80, 1, 1])
"""How the table of a Shapefile begins: dBASE III of the first day of 1980, the same for the same input."""

PARQUET_MARK = b"fruits written by pomona"
"""In the footer of the Parquet files that are written here."""

MCAP_MARK = "fruits written by pomona"
"""The library, in the first record of the MCAP files that are written here."""

REPORT_MARK = b"<!-- season report written by pomona -->"
"""In the first lines of the reports that are written here."""

INDEX_MARK = b"POMONAix"
"""How the index of a map begins."""

DRAWN = re.compile(r"(query|map|truth)(?P<seed>|_[0-9]+)\.(csv|json)")
"""Names of the files of drawn visits."""

TRUTH_KEYS = {"cell", "seed", "map_from_query"}
"""In the truth of drawn visits."""

DATED = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}\.csv")
"""Names of the visits of a drawn season."""

SEASON_KEYS = {"season", "seed", "visits"}
"""In the truth of a drawn season."""

DEMO_SEED = 1
DEMO_DATES = ("2024-08-09", "2024-08-28")
DEMO_RECORDING = f"synthetic, seed {DEMO_SEED}"
DEMO_NAME = "demo "
"""Begins the names of the sessions that the demo scans."""

"""Of the visits of `pomona demo`, and in their tables."""

GROWN_PICTURES = ("curves.png", "sizes.png", "variability.png")
"""What `pomona growth` draws."""

Database = Literal["session", "map", "other"]


@dataclass(frozen=True)
class Like:
    """A kind of file or folder that a verb makes.

    Attributes
    ----------
    name : str
        What it is called, with its article.
    tells : callable
        Whether an existing file, or folder, is one. It may raise `OSError`, `ValueError` or `LookupError` for no.
    is_folder : bool
        Whether it is a folder with files of fixed names.
    """

    name: str
    tells: Callable[[Path], bool]
    is_folder: bool = False


def is_like(like: Like, path: Path) -> bool:
    """Tell whether an existing path may give its place to a new one; a file in which there is nothing may."""
    try:
        if path.is_dir() or like.is_folder:
            return path.is_dir() == like.is_folder and like.tells(path)
        return path.stat().st_size == 0 or like.tells(path)
    except (OSError, ValueError, LookupError):
        return False


def database_of(path: Path) -> Database | None:
    """Tell which database a file is: a session or a map of ours, or another, also one that cannot be read now."""
    from pomona.errors import PomonaError

    try:
        if not _is_sqlite(path):
            # Of a map in its first transaction there is an empty file, and a journal.
            begun = path.stat().st_size == 0 and Path(f"{path}-journal").exists()
            return "other" if begun else None
    except OSError:
        return None
    from pomona.store.opening import snapshot

    try:
        with snapshot(path) as (_, kind):
            return kind
    except PomonaError:
        return "other"


def _is_sqlite(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(SQLITE)) == SQLITE


def _tail(path: Path) -> bytes:
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - HEAD_BYTES))
        return file.read()


def _is_ply(path: Path) -> bool:
    return head_of(path).startswith(b"ply\n") and PLY_MARK.encode() in head_of(path)


def _has_poses(path: Path) -> bool:
    return head_of(path).startswith(POSES_MARK.encode())


def _is_way(path: Path) -> bool:
    return head_of(path).startswith(WAY_MARK.encode())


def _is_geojson(path: Path) -> bool:
    head = head_of(path)
    return head.startswith(b'{"type": "FeatureCollection"') and (b"LOCAL_CS" in head or GEOJSON_MARK in head)


def _is_shapefile(path: Path) -> bool:
    """Tell any of the files of a Shapefile by those that say where it lies, and from which day: in 1980, as ours do."""
    if not head_of(path.with_suffix(".dbf")).startswith(DBASE_MARK):
        return False
    head = head_of(path.with_suffix(".prj"))
    return b"LOCAL_CS" in head or head.startswith(b'GEOGCS["GCS_WGS_1984"')


def _is_parquet(path: Path) -> bool:
    return head_of(path).startswith(b"PAR1") and PARQUET_MARK in _tail(path)


def _is_mcap(path: Path) -> bool:
    return head_of(path).startswith(b"\x89MCAP0\r\n") and MCAP_MARK.encode() in head_of(path)[:100]


def _is_session(path: Path) -> bool:
    return database_of(path) == "session"


def _is_scanned(path: Path) -> bool:
    tells = {".gpkg": _is_session, ".ply": _is_ply}
    return tells.get(path.suffix.lower(), told_of_scan)(path)


def _is_picture(path: Path) -> bool:
    """Tell a plot from a photograph: Matplotlib signs at the beginning, in PDF in front of the last table."""
    starts = (b"\x89PNG", b"%PDF", b"<?xml")
    return head_of(path).startswith(starts) and b"Matplotlib" in head_of(path) + _tail(path)


def _is_video(path: Path) -> bool:
    return head_of(path)[4:8] == b"ftyp" and VIDEO_MARK.encode() in _tail(path)


def _is_model(path: Path) -> bool:
    """Tell a model that was trained here from one of others: ONNX writes its metadata at the end."""
    return MODEL_MARK in _tail(path)


def _is_report(path: Path) -> bool:
    return REPORT_MARK in head_of(path)


def _is_index(path: Path) -> bool:
    return head_of(path).startswith(INDEX_MARK)


def _has_drawn_boxes(folder: Path) -> bool:
    return all(path.name.endswith(BOXES_DRAWN) and BOXES_DRAWN_MARK in head_of(path) for path in folder.iterdir())


def _has_note(folder: Path) -> bool:
    return (folder / "made_from.json").is_file() or not any(folder.iterdir())


def _has_drawn_visits(folder: Path) -> bool:
    """Tell a folder in which every file with one of our names belongs to a truth of ours."""
    ours = filter(None, (DRAWN.fullmatch(path.name) for path in folder.iterdir()))
    return all(_is_truth(folder / f"truth{name['seed']}.json") for name in ours)


def visits_of_season(folder: Path) -> set[str]:
    """Names of the visits that the truth of a drawn season in a folder tells of; none where there is no such truth."""
    try:
        found = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
        if not found.keys() >= SEASON_KEYS:
            return set()
        return {name for visit in found["visits"] if DATED.fullmatch(name := visit["file"])}
    except (OSError, ValueError, LookupError, AttributeError, TypeError):
        return set()


def drawn_season(name: str, seed: int) -> Like:
    """Say what a drawn season may replace: itself, drawn otherwise; another season or seed it may not."""

    def tells(folder: Path) -> bool:
        names = {path.name for path in folder.iterdir()}
        if not {name for name in names if DATED.fullmatch(name)} <= visits_of_season(folder):
            return False
        if "truth.json" not in names:
            return True
        truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
        return bool(visits_of_season(folder)) and (truth["season"], truth["seed"]) == (name, seed)

    return Like(f"a folder of the season {name} with seed {seed}", tells, is_folder=True)


def is_of_demo(path: Path) -> bool:
    """Tell a map or a session that holds visits drawn by the demo and no others."""
    from pomona.errors import PomonaError
    from pomona.store.opening import snapshot
    from pomona.store.rows import columns_of

    try:
        with snapshot(path) as (connection, _):
            recordings, names = columns_of(connection, "sessions", ("recording", "name"))
    except PomonaError:
        return False
    visits = zip(recordings, names, strict=True)
    return all(recording == DEMO_RECORDING or name.startswith(DEMO_NAME) for recording, name in visits)


def _is_demo(folder: Path) -> bool:
    """Tell a folder in which every file with one of the demo's names is of its kind."""
    tells: dict[str, Callable[[Path], bool]] = {"orchard.gpkg": is_of_demo, "????-??-??.gpkg": is_of_demo}
    tells |= {f"pairs{dated}.csv": PAIRS.tells for dated in ("", "_????-??-??")}
    tells |= {f"match{dated}.png": PICTURE.tells for dated in ("", "_????-??-??")}
    tells |= {"report.html": REPORT.tells}
    return all(is_kind(path) for name, is_kind in tells.items() for path in folder.glob(name))


def _is_grown(folder: Path) -> bool:
    """Tell a folder in which every file with one of growth's names is of its kind."""
    tells = {name: has_header(header) for name, header in GROWN_HEADERS.items()}
    tells |= dict.fromkeys(GROWN_PICTURES, _is_picture)
    return all(is_kind(folder / name) for name, is_kind in tells.items() if (folder / name).exists())


def _has_dates(folder: Path) -> bool:
    """Tell a folder in which every file by row and date is one of ours."""
    return all(_is_parquet(path) for path in folder.glob("row=*/date=*/observations.parquet"))


def _is_truth(path: Path) -> bool:
    found = json.loads(path.read_text(encoding="utf-8"))
    return isinstance(found, dict) and found.keys() >= TRUTH_KEYS


SCANNED = Like("what a scan writes", _is_scanned)
PAIRS = Like("a table of pairs", has_header("query,map,probability,distance_m"))
BOXES = Like("a table of boxes", has_header("image,xmin,ymin,xmax,ymax,score"))
MODEL = Like("a model that was trained here", _is_model)
DRAWN_BOXES = Like("a folder of drawn boxes", _has_drawn_boxes, is_folder=True)
PULLED = Like("a pulled map, which takes a name of its own", lambda _: False)
REPLAYED = Like("a replayed bag, which takes a name of its own", lambda _: False)
MERGED = Like("a merged map, which takes a name of its own", lambda _: False)
METRIC_MODEL = Like("a metric model, which takes a folder of its own", lambda _: False, is_folder=True)
PICTURE = Like("a plot", _is_picture)
POSES = Like("poses in a map", _has_poses)
VIDEO = Like("a preview", _is_video)
KEPT = Like("a folder that a scan keeps", _has_note, is_folder=True)
RENDERED = Like("a rendered recording", _has_note, is_folder=True)
VISITS = Like("a folder of drawn visits", _has_drawn_visits, is_folder=True)
CALIPER_PAIRS = Like(
    "a table of calipers beside diameters", has_header("fruit_id,label,session,date,measured_mm,caliper_mm")
)
THINNING = Like(
    "a table of thinning",
    has_header("fruit_id,tree,cluster,n_in_cluster,diameter_mm,rate_mm_per_day,drop_probability,action"),
)
REPORT = Like("a report of a season", _is_report)
INDEX = Like("the index of a map", _is_index)
GROWN = Like("a folder of growth", _is_grown, is_folder=True)
BY_DATE = Like("a folder of observations by date", _has_dates, is_folder=True)
FARM_PLAN = Like("a first plan, which takes a name of its own", lambda _: False)
DEMO = Like("a folder of the demo", _is_demo, is_folder=True)
EXPORTS = {
    # Of a session or a cloud it has the columns of a scan's, or any: it may be the only file of a visit.
    "csv": Like("a CSV that was exported from a map", told_of_map),
    "ply": Like("a PLY of fruits", _is_ply),
    "geojson": Like("a GeoJSON of fruits", _is_geojson),
    "shp": Like("a Shapefile of fruits", _is_shapefile),
    "parquet": Like("a GeoParquet of fruits", _is_parquet),
    "mcap": Like("an MCAP of fruits", _is_mcap),
    "tum": Like("poses of a session", _is_way),
    "kitti": Like("poses in KITTI's text, which nothing tells from those of a recording", lambda _: False),
}
