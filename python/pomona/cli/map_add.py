"""`pomona map add`: the fruits of a session are recognised, and it joins the map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pomona.amounts import amount
from pomona.cli.map_words import change_as_text
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

if TYPE_CHECKING:
    from typing import Any

    from pomona.orchard import Added, Session
    from pomona.settings import Settings

BEYOND = 0.1
"""Share of the fruits of a part that a session did not look at from which on it is told."""


def map_add(
    orchard: Path = typer.Argument(metavar="ORCHARD", help="The map (.gpkg); made when it is not there."),
    sessions: list[Path] = typer.Argument(
        metavar="SESSION...", help="Sessions (.gpkg), or a cloud (.csv, .ply) with --date."
    ),
    date: str | None = typer.Option(
        None,
        metavar="ISO-DATE",
        help="Day of the visit, 2024-08-09 or 2024-08-09T14:30:00; a session has its own, which this overrides.",
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
    from pomona.row_length import length_told
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
    for path, visit in zip(sessions, visits, strict=True):
        if not len(visit.cloud):
            # Named by its file: a farm tells so how the row goes on without it.
            raise PomonaError(f"{path}: has no fruits, expected at least one")
    visits = [visit if name is None else dataclasses.replace(visit, name=name) for visit in visits]
    flags = call_flags(method, scale, noise_m, up, per_frame, threads)
    settings = Settings.load(config, flags) if config or any(flag is not None for flag in flags.values()) else None
    with working(f"adding {amount(sum(len(visit.cloud) for visit in visits), 'fruit')} to {orchard.name}"):
        answers = add_sessions(orchard, visits, settings=settings, new_part=new_part, replacing=replace)
    told = list(zip(visits, answers, strict=True))
    for visit, added in told:
        if added.length_in_map is not None:
            tell(f"pomona: warning: {orchard}: {length_told(added.length_in_map, visit.name, 'the map')}")
        _say_why_not_found(orchard, visit, added, settings)
        _doubt_year(orchard, visit, added)
        if added.copy_of is not None:
            tell(
                f"pomona: warning: {orchard}: fruits of {visit.name} lie where those of {added.copy_of} do, in "
                "its frame and nearer than two visits are to each other: is it a copy? It counts as a visit of its own"
            )
    if json:
        objects = [_added_as_json(visit, added) for visit, added in told]
        say_json(objects[0] if len(objects) == 1 else objects)
    else:
        say(*(line for visit, added in told for line in _added_as_lines(visit, added)))
    if not all(added.is_added for added in answers):
        raise typer.Exit(1)


def _say_why_not_found(orchard: Path, visit: Session, added: Added, settings: Settings | None) -> None:
    """Say whether its mirror image fits the map, or it does at another size."""
    from pomona.cli.progress import working
    from pomona.mirrored import mirror_told, pairs_of_mirror_image
    from pomona.other_metres import other_size, size_told
    from pomona.settings import Settings

    if added.is_added or added.match is None or added.known is None:
        return
    asked = visit.cloud, added.known, added.match, settings or Settings.load(None, {})
    with working(f"looking at the mirror image of {visit.name}, and at other sizes"):
        pairs = pairs_of_mirror_image(*asked)
        size = None if pairs else other_size(*asked)
    if pairs:
        tell(f"pomona: {orchard}: {mirror_told(pairs, visit.name, 'the map')}")
    elif size is not None:
        tell(f"pomona: {orchard}: {size_told(size, visit.name, 'the map')}")


def _doubt_year(orchard: Path, visit: Session, added: Added) -> None:
    if added.match is not None and added.is_year_doubted:
        of_all = f"{len(added.match.pairs)} of {amount(added.match.n_query, 'fruit')}"
        tell(
            f"pomona: warning: {orchard}: {of_all} of {visit.name} lie where fruits of another season do, to "
            f"{1000 * added.match.noise_m:.0f} mm along each axis, as those of one season: is {visit.date[:10]} right?"
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
        "n_beyond": added.n_beyond,
        "n_parts": 0 if match is None else match.n_parts,
        "torn_near": list(added.torn_near),
        "torn_like": added.torn_like,
        "season_before": added.season_before,
        "is_year_doubted": added.is_year_doubted,
        "copy_of": added.copy_of,
        "length_in_map": added.length_in_map,
        "changes": [asdict(change) for change in added.changes],
        "map_from_session": None if match is None or match.map_from_query is None else match.map_from_query.tolist(),
        "fruits": {visit.cloud.label(row): fruit_id for row, fruit_id in enumerate(added.fruit_ids.tolist())}
        if added.is_added
        else {},
    }


def _added_as_lines(visit: Session, added: Added) -> list[str]:
    return [_added_as_text(visit, added), *map(change_as_text, added.changes)]


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
    if added.season_before is not None:
        return (
            f"{visit.name}: first visit of its season, found by where fruits hung until {added.season_before[:10]}: "
            f"{amount(added.n_new, 'new fruit')}, for none outlives the winter{_torn_as_text(added)}"
        )
    is_part = added.n_beyond > BEYOND * (added.n_matched + added.n_missed + added.n_beyond)
    beyond = f", {added.n_beyond} beyond its view" if is_part else ""
    return (
        f"{visit.name}: {added.n_matched} of {amount(len(visit.cloud), 'fruit')} recognised, {added.n_new} new, "
        f"{added.n_missed} in view and not seen{beyond}{_torn_as_text(added)}"
    )


def _torn_as_text(added: Added) -> str:
    """Say where a session and the map are torn against each other; which of the two it is one session cannot tell."""
    if not added.torn_near or added.match is None:
        return ""
    near = f"near {'fruit' if len(added.torn_near) == 1 else 'fruits'} {', '.join(added.torn_near)}"
    if added.torn_like is not None:
        return (
            f"; the map is torn apart {near}, {added.torn_like} showed it too: what was added before that one is torn"
        )
    parts = f"{added.match.n_parts} parts, and each lies by its own pose"
    return f"; it and the map are torn against each other {near}, {parts}"
