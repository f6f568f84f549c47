"""The plan of a farm: which recordings there are, and what is made of them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pomona.errors import PomonaError
from pomona.farm.recorded_visits import RecordedVisit, visits_by_pattern, visits_by_table
from pomona.reading import read_text, shown

__all__ = ["PLACES", "FarmPlan", "Flag", "Takes", "read_plan"]

Takes = Literal["path", "switch", "value"]
"""What a flag of a verb takes: a file, nothing, or a text."""

VERBS = ("scan", "map", "growth", "report", "export")
"""Tables of the plan: what is done, with the flags of the verb. The first two are done anyhow."""

RECORDINGS = ("folder", "pattern", "table", "skip")
PLACES = ("{row}", "{date}", "{beside}")
"""What stands in the flags of a scan for each recording's own row, date and folder."""

NAMED = ("shipped",)
"""What a flag may name besides files: the detector that is inside."""

FORMATS = ("csv", "geojson", "mcap", "parquet", "parquet-by-date", "ply", "shp")


@dataclass(frozen=True)
class Flag:
    """A flag of a verb.

    Attributes
    ----------
    takes : str
        What stands behind it.
    on, off : str, str or None
        How it is written on the command line, and the flag that says the opposite of a switch.
    is_repeated : bool
        Whether it may be given several times, in the plan as a list.
    """

    takes: Takes
    on: str
    off: str | None = None
    is_repeated: bool = False


@dataclass(frozen=True)
class FarmPlan:
    """What is to be done with which recordings.

    Attributes
    ----------
    path : Path
        The plan's file; relative paths in it are from its folder, and commands run there.
    results : Path
        Folder that everything is written to.
    visits : tuple of RecordedVisit
        By row and date; those to skip are left out.
    flags : mapping
        By verb, the flags of the plan as arguments for the command line; verbs that are not wanted are not in it.
    files : mapping
        By verb, the files that its flags name.
    formats : tuple of str
        What is exported.
    """

    path: Path
    results: Path
    visits: tuple[RecordedVisit, ...]
    flags: Mapping[str, tuple[str, ...]]
    files: Mapping[str, tuple[Path, ...]]
    formats: tuple[str, ...]

    @property
    def folder(self) -> Path:
        """Where its commands run."""
        return self.path.parent


def read_plan(path: str | Path, flags: Mapping[str, Mapping[str, Flag]]) -> FarmPlan:
    """Read a plan.

    Parameters
    ----------
    path : str or Path
        The plan, TOML.
    flags : mapping
        By verb, the flags that a plan may set, by name, and what each takes.

    Raises
    ------
    PomonaError
        The file cannot be read, says what no plan can say, or finds no recordings.
    """
    path = Path(path).absolute()
    tables = _tables(path)
    results = tables.pop("results", "results")
    if not isinstance(results, str) or not results.isprintable() or not results:
        raise PomonaError(f"{path}: results: found {shown(results)}, expected the name of a folder")
    recordings = tables.pop("recordings", None)
    if recordings is None:
        raise PomonaError(f"{path}: has no [recordings], expected folder and pattern, or table")
    formats = _formats(path, tables.get("export"))
    arguments: dict[str, tuple[str, ...]] = {}
    files: dict[str, tuple[Path, ...]] = {}
    for verb, table in {"scan": {}, "map": {}, **tables}.items():
        given = {name: value for name, value in table.items() if (verb, name) != ("export", "to")}
        places = PLACES if verb == "scan" else ()
        arguments[verb], files[verb] = _arguments(f"{path}: [{verb}]", path.parent, given, flags[verb], places)
    visits = tuple(_visits(path, recordings))
    for visit in visits:
        if visit.path.resolve().is_relative_to((path.parent / results).resolve()):
            raise PomonaError(f"{path}: results: {visit.path} lies in it, expected a folder without recordings")
    return FarmPlan(path, path.parent / results, visits, arguments, files, formats)


def _tables(path: Path) -> dict[str, Any]:
    try:
        tables = tomllib.loads(read_text(path, "a plan in TOML"))
    except (ValueError, RecursionError) as error:  # not TOML, or a number of thousands of digits
        raise PomonaError(f"{path}: not TOML: {error}") from None
    known = ("results", "recordings", *VERBS)
    for name, value in tables.items():
        if name not in known:
            raise PomonaError(f"{path}: found {shown(name)}, expected one of {', '.join(known)}")
        if name != "results" and not isinstance(value, dict):
            raise PomonaError(f"{path}: {name}: found {shown(value)}, expected a table, [{name}]")
    return tables


def _visits(path: Path, table: Mapping[str, Any]) -> list[RecordedVisit]:
    where = f"{path}: [recordings]"
    for name, value in table.items():
        if name not in RECORDINGS:
            raise PomonaError(f"{where}: found {shown(name)}, expected one of {', '.join(RECORDINGS)}")
        if name != "skip" and not isinstance(value, str):
            raise PomonaError(f"{where} {name}: found {shown(value)}, expected a text")
    if ("table" in table) == ("pattern" in table):
        raise PomonaError(f"{where}: expected either pattern, with folder, or table")
    if "table" in table:
        visits = visits_by_table(path.parent / table["table"])
    else:
        visits = visits_by_pattern(f"{where} pattern", path.parent / table.get("folder", "."), table["pattern"])
    return _without(where, visits, table.get("skip", []))


def _without(where: str, visits: list[RecordedVisit], skipped: Any) -> list[RecordedVisit]:
    titles = {visit.title for visit in visits}
    if not isinstance(skipped, list):
        raise PomonaError(f"{where} skip: found {shown(skipped)}, expected a list of ROW/DATE")
    for title in skipped:
        if title not in titles:
            raise PomonaError(f"{where} skip: found {shown(title)}, expected ROW/DATE of a recording")
    return [visit for visit in visits if visit.title not in skipped]


def _formats(path: Path, table: Mapping[str, Any] | None) -> tuple[str, ...]:
    if table is None:
        return ()
    wanted = table.get("to")
    if not isinstance(wanted, list) or not wanted or any(name not in FORMATS for name in wanted):
        raise PomonaError(f"{path}: [export] to: found {shown(wanted)}, expected a list out of {', '.join(FORMATS)}")
    return tuple(dict.fromkeys(wanted))


def _arguments(
    where: str, folder: Path, table: Mapping[str, Any], flags: Mapping[str, Flag], places: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[Path, ...]]:
    """Turn a table into arguments of the verb, and say which files they name."""
    arguments: list[str] = []
    files: list[Path] = []
    for name, value in table.items():
        flag = flags.get(name.replace("-", "_"))
        if flag is None:
            raise PomonaError(f"{where}: found {shown(name)}, expected one of {', '.join(sorted(flags))}")
        if flag.takes == "switch":
            if not isinstance(value, bool):
                raise PomonaError(f"{where} {name}: found {shown(value)}, expected true or false")
            arguments += filter(None, [flag.on if value else flag.off])
            continue
        for one in value if isinstance(value, list) and flag.is_repeated else [value]:
            if isinstance(one, bool | dict | list):
                raise PomonaError(f"{where} {name}: found {shown(one)}, expected a text or a number")
            # Joined by =, so that no value is taken for a flag.
            arguments.append(f"{flag.on}={one}")
            if flag.takes == "path":
                files += _file(f"{where} {name}", folder, str(one), places)
    return tuple(arguments), tuple(files)


def _file(where: str, folder: Path, name: str, places: tuple[str, ...]) -> list[Path]:
    """Give the file that a flag names, if it is one for all recordings and not the name of what is inside."""
    path = folder / name
    if path.is_file():
        return [path]
    found = re.findall(r"\{[^{}]*\}", name) if places else []
    for place in found:
        if place not in places:
            raise PomonaError(f"{where}: found {shown(place)}, expected {', '.join(places)}")
    if name not in NAMED and not found and not path.exists():
        raise PomonaError(f"{where}: {path}: is not there")
    return []
