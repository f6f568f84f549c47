"""`pomona map ...`: the orchard map, one identity for each fruit over all visits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.amounts import amount
from pomona.cli.map_team import map_pull, map_push
from pomona.cli.match_options import (
    Method,
    Scale,
    Unit,
    call_flags,
    config_option,
    method_option,
    noise_option,
    per_frame_option,
    scale_option,
    threads_option,
    up_option,
)
from pomona.cli.terminal import say, say_json, tell
from pomona.cli.verbs import Verbs, Writes
from pomona.likes import MERGED

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    import numpy as np
    from numpy.typing import NDArray

    from pomona.orchard import Added, Change, Merged, OrchardMap, Removed, Session
    from pomona.orchard.georeferencing import Georeferenced
    from pomona.orchard.map_trees import TreeRow

_EVENTS = {"joined": "joined", "split": "split off as", "moved": "moved to"}

_MOST_POINTS = 20
"""A line each; fixes of a whole way are more than anybody reads."""

app = Verbs(help="Keep an orchard map: one identity for each fruit over all visits.", no_args_is_help=True)

orchard_argument = typer.Argument(metavar="ORCHARD", help="The map (.gpkg).")


@app.callback()
def _map() -> None:
    """Keep an orchard map: one identity for each fruit over all visits."""


@app.command("add")
def map_add(
    orchard: Path = typer.Argument(metavar="ORCHARD", help="The map (.gpkg); made when it is not there."),
    sessions: list[Path] = typer.Argument(
        metavar="SESSION...", help="Sessions (.gpkg), or a cloud (.csv, .ply) with --date."
    ),
    date: str | None = typer.Option(
        None, metavar="ISO-DATE", help="Day of the visit, 2024-08-09 or 2024-08-09T14:30:00; a session has its own."
    ),
    method: Method | None = method_option,
    scale: Scale | None = scale_option,
    noise_m: float | None = noise_option,
    up: list[str] | None = up_option,
    config: Path | None = config_option,
    per_frame: bool | None = per_frame_option,
    threads: int | None = threads_option,
    unit: Unit | None = typer.Option(
        None, help="Unit of the coordinates of a .csv or .ply; m also says that odd distances or diameters are right."
    ),
    new_part: bool = typer.Option(
        False, "--new-part", help="Let a session that is not found start a part of its own: another row, for example."
    ),
    name: str | None = typer.Option(None, help="Name of the session in the map; else its own, of a cloud its file's."),
    replace: bool = typer.Option(
        False,
        "--replace",
        help="Take the place of a session of the same name that saw something else; the same one is left as it is.",
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Recognise the fruits of SESSION in ORCHARD and add it.

    Who is who follows from all sessions at once, in whatever order they came. Fruits keep their ids where they can;
    what becomes another fruit is told. The first session starts the map; of several, one that is not found is tried
    again after the others. Exit code 0: added. 1: one was not found in the map. 2: wrong input.
    """
    import dataclasses

    from pomona.cli.progress import working
    from pomona.errors import PomonaError
    from pomona.orchard import add_sessions, load_session
    from pomona.settings import Settings

    if unit is Unit.free and not orchard.exists():
        raise PomonaError(
            f"{orchard}: is not there, and a map starts in metres: found --unit free, expected m, cm or mm"
        )
    if date is not None and len(sessions) > 1:
        found = amount(len(sessions), "session")
        raise PomonaError(f"--date: found it with {found}, expected one; each has a day of its own")
    if name is not None and len(sessions) > 1:
        raise PomonaError(f"--name: found it with {len(sessions)} sessions, expected one; each has a name of its own")
    visits = [load_session(path, date=date, unit=None if unit is None else unit.value) for path in sessions]
    visits = [visit if name is None else dataclasses.replace(visit, name=name) for visit in visits]
    flags = call_flags(method, scale, noise_m, up, per_frame, threads)
    settings = Settings.load(config, flags) if config or any(flag is not None for flag in flags.values()) else None
    with working(f"adding {amount(sum(len(visit.cloud) for visit in visits), 'fruit')} to {orchard.name}"):
        answers = add_sessions(
            orchard, visits, settings=settings, new_part=new_part, replacing=replace, waiting=_waiting(orchard)
        )
    told = list(zip(visits, answers, strict=True))
    if json:
        objects = [_added_as_json(visit, added) for visit, added in told]
        say_json(objects[0] if len(objects) == 1 else objects)
    else:
        say(*(line for visit, added in told for line in _added_as_lines(visit, added)))
    if not all(added.is_added for added in answers):
        raise typer.Exit(1)


@app.command("remove")
def map_remove(
    orchard: Path = orchard_argument,
    session: str = typer.Argument(metavar="SESSION", help="Name of the session, as `pomona map info` gives it."),
    yes: bool = typer.Option(False, "--yes", help="Do it; without, only say what would go."),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Undo `map add`: take SESSION and what only it saw out of ORCHARD.

    The other fruits fall back to where the last of the remaining sessions saw them. Exit code 0: removed. 1: ORCHARD
    has no such session, or no --yes was given, and the map stays as it was. 2: wrong input.
    """
    from pomona.orchard import remove_session

    removed = remove_session(orchard, session, waiting=_waiting(orchard), dry=not yes)
    done = removed is not None and yes
    if json:
        say_json({**_removed_as_json(session, removed), "removed": done})
    else:
        say(_removed_as_text(session, removed))
    if removed is not None and not yes:
        tell(f"pomona: {orchard}: nothing is removed without --yes")
    if not done:
        raise typer.Exit(1)


@app.command("merge")
def map_merge(
    orchard: Path = orchard_argument,
    other: Path = typer.Argument(metavar="OTHER", help="The map whose sessions come; it stays as it is."),
    output: Annotated[Path | None, Writes(MERGED)] = typer.Option(
        None, "--output", "-o", help="Write the merged map here (.gpkg) and leave ORCHARD as it is."
    ),
    config: Path | None = config_option,
    threads: int | None = threads_option,
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Join two maps that overlap: all sessions of OTHER come to ORCHARD.

    The result is that of adding each session. Fruits of ORCHARD keep their ids, those of OTHER get ids of ORCHARD. Exit
    code 0: merged. 1: OTHER was not found in ORCHARD, and nothing is written. 2: wrong input.
    """
    from pomona.cli.progress import working
    from pomona.orchard import merge_maps
    from pomona.settings import Settings

    settings = Settings.load(config, {"threads": threads})
    with working(f"merging {other.name} into {orchard.name}"):
        merged = merge_maps(orchard, other, output=output, settings=settings, waiting=_waiting(orchard))
    if json:
        say_json(_merged_as_json(other, merged))
    else:
        say(*_merged_as_lines(other, merged))
    if not merged.is_merged:
        raise typer.Exit(1)


@app.command("trees")
def map_trees(
    orchard: Path = orchard_argument,
    trees: Path | None = typer.Option(
        None, "--trees", metavar="FILE", help="Trees that are known: a table (.csv) with x,y,z in the map, and name."
    ),
    spacing_m: float | None = typer.Option(None, "--spacing", metavar="METRES", help="Between trunks, where known."),
    segment_m: float | None = typer.Option(
        None, "--segments", metavar="METRES", help="Part rows in which no trees can be told into lengths of this."
    ),
    renumber: bool = typer.Option(False, "--renumber", help="Count from 1 again; else trees keep their numbers."),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Find the rows and trees of ORCHARD from its fruits, number the trees along their row and write them.

    Trees that are drawn in the map, that --trees gives or that sessions name in a column `tree` are taken as they are.
    In a hedge or a wall, where fruits hang evenly, no tree can be told; that is said.
    """
    from dataclasses import asdict

    from pomona.cli.progress import working
    from pomona.orchard.given_trees import read_trees
    from pomona.orchard.map_trees import find_trees

    given = () if trees is None else read_trees(trees)
    with working(f"finding trees in {orchard.name}"):
        rows = find_trees(
            orchard,
            given=given,
            spacing_m=spacing_m,
            segment_m=segment_m,
            renumber=renumber,
            waiting=_waiting(orchard),
        )
    if json:
        say_json([{**asdict(row), "log_odds": _finite(row.log_odds)} for row in rows])
    else:
        say(*(line for row in rows for line in _row_as_lines(row)) if rows else ("no row of fruits: too few",))


@app.command("georeference")
def map_georeference(
    orchard: Path = orchard_argument,
    points: Path = typer.Option(
        ...,
        "--points",
        metavar="FILE",
        help="Known points: a table (.csv) with x,y,z in the map, or frame or time of a session, and lon,lat or "
        "easting,northing; name and height where known.",
    ),
    epsg: int | None = typer.Option(None, metavar="CODE", help="UTM zone of easting,northing, as 32632."),
    session: str | None = typer.Option(None, metavar="NAME", help="Session whose frames or times FILE tells."),
    up: str | None = typer.Option(None, metavar="X,Y,Z", help="The vertical in the map; else that of the cameras."),
    within_m: float = typer.Option(1.0, "--within", metavar="METRES", help="A point that is farther off is refused."),
    free_scale: bool = typer.Option(False, "--free-scale", help="The map's metres may be longer or shorter."),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Say where on Earth ORCHARD lies, by two or more known points or by fixes along the way of its camera.

    Fruits stay in local metres; layers and exports for GIS get longitude and latitude (WGS 84). Two points tell the
    heading; the vertical is then that of the cameras. A point that contradicts the others is refused.
    """
    from pomona.orchard.control_points import read_control_points
    from pomona.orchard.georeferencing import georeference

    found = georeference(
        orchard,
        read_control_points(points, epsg),
        session=session,
        up_in_map=None if up is None else _vector(up),
        within_m=within_m,
        free_scale=free_scale,
        waiting=_waiting(orchard),
    )
    if json:
        say_json(_anchor_as_json(found))
    else:
        say(*_anchor_as_lines(found))


@app.command("info")
def map_info(orchard: Path = orchard_argument, json: bool = typer.Option(False, "--json", help="Print JSON.")) -> None:
    """Say what a map or a session holds: fruits, visits, what was recognised."""
    from pomona.orchard import OrchardMap

    info = _info(OrchardMap(orchard))
    if json:
        say_json(info)
    else:
        say(*_info_as_lines(info))


@app.command("check")
def map_check(orchard: Path = orchard_argument, json: bool = typer.Option(False, "--json", help="Print JSON.")) -> None:
    """Check that a map or a session is whole. Exit code 0: it is. 1: a problem a line. 2: not a map of ours."""
    from pomona.cli.progress import working
    from pomona.orchard import problems

    with working(f"checking {orchard.name}"):
        found = problems(orchard)
    if json:
        say_json({"problems": found})
    else:
        say(*(found or ["ok"]))
    if found:
        raise typer.Exit(1)


def _vector(text: str) -> NDArray[np.float64]:
    import numpy as np

    from pomona.errors import PomonaError

    try:
        vector = np.array([float(cell) for cell in text.split(",")])
    except ValueError:
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise PomonaError(f"--up: found {text!r}, expected three numbers as 0,-1,0")
    return vector


def _anchor_as_json(found: Georeferenced) -> dict[str, Any]:
    anchor = found.anchor
    return {
        "enu_from_map": anchor.enu_from_map.tolist(),
        "longitude_deg": anchor.longitude_deg,
        "latitude_deg": anchor.latitude_deg,
        "height_m": anchor.height_m,
        "scale": found.scale,
        "rms_m": found.rms_m,
        "points": [
            {"name": name, "off_m": [None if metres != metres else metres for metres in off]}
            for name, off in zip(found.names, found.off_m.tolist(), strict=True)
        ],
    }


def _anchor_as_lines(found: Georeferenced) -> list[str]:
    anchor = found.anchor
    height = "no heights" if anchor.height_m is None else f"height {anchor.height_m:.2f} m"
    lines = [
        f"origin {anchor.latitude_deg:.8f} N, {anchor.longitude_deg:.8f} E, {height}; {len(found.names)} known points, "
        f"{100 * found.rms_m:.1f} cm off (root mean square), scale {found.scale:.5f}"
    ]
    for name, off in list(zip(found.names, found.off_m.tolist(), strict=True))[:_MOST_POINTS]:
        east, north, up = ("     ?" if metres != metres else f"{100 * metres:+6.1f}" for metres in off)
        lines.append(f"  {name}: {east} cm east, {north} cm north, {up} cm up")
    more = len(found.names) - _MOST_POINTS
    return [*lines, f"  and {more} more"] if more > 0 else lines


def _finite(number: float) -> float | None:
    """Return a number for JSON, which knows none that is not finite."""
    return number if abs(number) < float("inf") else None


def _row_as_lines(row: TreeRow) -> list[str]:
    if row.kind == "none":
        return [
            f"row: {row.n_fruits} fruits, no trees can be told; --segments METRES parts it, --trees FILE names them"
        ]
    what = "segments" if row.kind == "segments" else f"trees, {row.source}"
    return [
        f"row {row.number}: {row.n_fruits} fruits, {len(row.trees)} {what}, {row.spacing_m:.2f} m apart",
        *(f"  {name}: {n_fruits} fruits" for name, _, n_fruits in row.trees),
    ]


app.command("push")(map_push)
app.command("pull")(map_pull)


def _waiting(orchard: Path) -> Callable[[], None]:
    """Say on the standard error why nothing happens."""
    from pomona.store.opening import TIMEOUT_S

    return lambda: tell(f"pomona: {orchard}: another program is writing to it, waiting up to {TIMEOUT_S:g} s")


def _removed_as_json(session: str, removed: Removed | None) -> dict[str, Any]:
    from dataclasses import asdict

    return {"session": session, **({} if removed is None else asdict(removed))}


def _removed_as_text(session: str, removed: Removed | None) -> str:
    if removed is None:
        return f"{session}: no session of that name in the map, which stays as it was"
    return (
        f"{session}: takes away {amount(removed.n_observations, 'observation')}, with them "
        f"{amount(removed.n_gone, 'fruit')} that nobody else saw; {amount(removed.n_changed, 'fruit')} fall back; "
        f"left: {amount(removed.n_left, 'session')}"
    )


def _added_as_json(visit: Session, added: Added) -> dict[str, Any]:
    from dataclasses import asdict

    match = added.match
    return {
        "session": visit.name,
        "added": added.is_added,
        "status": None if match is None else match.status.value,
        "n_fruits": len(visit.cloud),
        "n_matched": added.n_matched,
        "n_new": added.n_new,
        "n_missed": added.n_missed,
        "changes": [asdict(change) for change in added.changes],
        "map_from_session": None if match is None or match.map_from_query is None else match.map_from_query.tolist(),
        "fruits": {visit.cloud.label(row): fruit_id for row, fruit_id in enumerate(added.fruit_ids.tolist())}
        if added.is_added
        else {},
    }


def _merged_as_json(other: Path, merged: Merged) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "other": str(other),
        "merged": merged.is_merged,
        "status": None if merged.match is None else merged.match.status.value,
        "sessions": list(merged.sessions),
        "shared": list(merged.shared),
        "n_fruits": len(merged.fruit_ids),
        "n_known": merged.n_known,
        "fruit_ids": merged.fruit_ids,
        "changes": [asdict(change) for change in merged.changes],
    }


def _merged_as_lines(other: Path, merged: Merged) -> list[str]:
    if not merged.is_merged:
        assert merged.match is not None
        return [f"{other}: {merged.match.status.value}, not found in the map, which stays as it was"]
    n_fruits, n_came, n_shared = len(merged.fruit_ids), len(merged.sessions), len(merged.shared)
    told = (
        f"{other}: sessions that came: {n_came}, in both: {n_shared}; {merged.n_known} of {n_fruits} fruits were known"
    )
    return [told, *map(_change_as_text, merged.changes)]


def _added_as_lines(visit: Session, added: Added) -> list[str]:
    return [_added_as_text(visit, added), *map(_change_as_text, added.changes)]


def _change_as_text(change: Change) -> str:
    count = amount(change.n_observations, "observation")
    return f"  fruit {change.from_fruit_id}: {count} {_EVENTS[change.event]} fruit {change.to_fruit_id}"


def _added_as_text(visit: Session, added: Added) -> str:
    match = added.match
    if added.was_there:
        return f"{visit.name}: is in the map already, the very same"
    if match is None:
        return f"{visit.name}: starts the map with {amount(added.n_new, 'fruit')}"
    if not added.is_added:
        return f"{visit.name}: {match.status.value}, not found in the map, which stays as it was"
    if match.status.value != "Found":
        return f"{visit.name}: {match.status.value}, starts a part of its own with {amount(added.n_new, 'fruit')}"
    return (
        f"{visit.name}: {added.n_matched} of {amount(len(visit.cloud), 'fruit')} recognised, {added.n_new} new, "
        f"{added.n_missed} in view and not seen"
    )


def _info(orchard: OrchardMap) -> dict[str, Any]:
    from collections import Counter

    from pomona.orchard import FORMAT_VERSION

    fruits, visits = orchard.fruits(), orchard.visits()
    low, high = (fruits.positions.min(axis=0), fruits.positions.max(axis=0)) if len(fruits) else (None, None)
    return {
        "path": str(orchard.path),
        "kind": orchard.kind,
        "format_version": FORMAT_VERSION,
        "n_fruits": len(fruits),
        "n_observations": sum(visit.n_fruits for visit in visits),
        "states": dict(sorted(Counter(fruits.extras["state"]).items())),
        "extent_m": None if low is None or high is None else [low.tolist(), high.tolist()],
        "sessions": [
            {
                "name": visit.name,
                "date": visit.date,
                "recording": visit.recording,
                "n_fruits": visit.n_fruits,
                "n_matched": visit.n_matched,
                "n_new": visit.n_fruits - visit.n_matched,
                "method": visit.method,
                "log_odds": visit.log_odds,
                "noise_m": visit.noise_m,
                "map_from_session": visit.map_from_session.tolist(),
            }
            for visit in visits
        ],
    }


def _info_as_lines(info: dict[str, Any]) -> list[str]:
    states = ", ".join(f"{count} {state}" for state, count in info["states"].items())
    header = ("session", "date", "fruits", "matched", "new", "method", "noise")
    rows = [
        (
            visit["name"],
            visit["date"],
            str(visit["n_fruits"]),
            str(visit["n_matched"]),
            str(visit["n_new"]),
            visit["method"] or "-",
            "-" if visit["noise_m"] is None else f"{100 * visit['noise_m']:.1f} cm",
        )
        for visit in info["sessions"]
    ]
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    table = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in (header, *rows)]
    return [
        f"{info['path']}: {info['kind']}, format {info['format_version']}",
        f"{amount(info['n_fruits'], 'fruit')} ({states}), {amount(info['n_observations'], 'observation')} "
        f"in {amount(len(rows), 'session')}",
        "",
        *(line.rstrip() for line in table),
    ]
