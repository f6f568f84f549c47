"""Settings of a match: flags beat the file, the file beats the defaults, and an unknown name is an error."""

from __future__ import annotations

import inspect
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pomona.core_settings import require_kinds
from pomona.errors import PomonaError
from pomona.reading import read_given_text, shown
from pomona.threads import require_threads

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from pomona.cloud import FruitCloud
    from pomona.matching import Match, ReadyCloud

# Table of the file that holds what `pomona.match` is told by name; the other tables are the core's.
_CALL_TABLE = "match"

MOST_NAME = 80
MOST_LINE = 1000
"""Characters of a line: a name of a hundred thousand dots would keep the parser busy for minutes."""

"""Characters of an unknown name that a message repeats."""


@dataclass(frozen=True)
class Settings:
    """What a match runs with.

    Attributes
    ----------
    call
        Arguments of `pomona.match`, defaults included.
    overrides
        Values of the core's tables that the file changes.
    """

    call: Mapping[str, Any]
    overrides: Mapping[str, Any]

    @classmethod
    def load(cls, path: Path | None, flags: Mapping[str, Any]) -> Settings:
        """Put together the defaults, the file at `path` and the flags that were given (None: not given).

        Raises
        ------
        PomonaError
            The file is missing, is no TOML, or names a setting that does not exist; a value is of another kind than it
            should be, or two contradict each other.
        """
        from pomona.matching import default_config

        tables = {} if path is None else _read_toml(path)
        from_file = tables.pop(_CALL_TABLE, {})
        call = _defaults_of_match()
        known = {_CALL_TABLE: call, **default_config()}
        _refuse_unknown(path, {_CALL_TABLE: from_file, **tables}, known)
        for name, value in from_file.items():
            from_file[name] = _checked(f"{path}: {_CALL_TABLE}.{name}", name, value)
        _refuse_wrong_values(path, tables)
        given = {name: value for name, value in flags.items() if value is not None}
        for name in ("threads", "noise_m"):
            if name in given:
                _checked(f"--{name.removesuffix('_m')}", name, given[name])
        call = {**call, **from_file, **given}
        if call["per_frame"] and call["method"] != "paper":
            place = "--per-frame" if "per_frame" in given else f"{path}: {_CALL_TABLE}.per_frame"
            raise PomonaError(
                f"{place}: found it with the method {call['method']}, expected it with --method paper alone"
            )
        return cls(call=call, overrides=tables)

    def match(self, query: FruitCloud, map: FruitCloud) -> Match:
        """Run `pomona.match` with these settings, on clouds that were looked at where they come from."""
        from pomona.cloud.files import vouch_for
        from pomona.matching import match

        vouch_for(query, map)
        return match(query, map, **self.call, config=self.overrides)

    def ready(self, cloud: FruitCloud) -> FruitCloud | ReadyCloud:
        """Make a cloud ready for several of `match_expected`, where these settings have a use for it."""
        from pomona.matching import ReadyCloud

        return ReadyCloud(cloud, threads=self.call["threads"]) if self._takes_expectations else cloud

    def match_expected(
        self, query: FruitCloud | ReadyCloud, map: FruitCloud | ReadyCloud, map_from_query: NDArray[np.float64]
    ) -> Match:
        """Run `pomona.match` with these settings where the pose is known to a few decimetres."""
        from pomona.matching import ReadyCloud, match_expected

        if self._takes_expectations:
            named = {name: self.call[name] for name in ("noise_m", "threads")}
            found = match_expected(query, map, map_from_query, **named, config=self.overrides)
            if found:
                return found
        clouds = (side.cloud if isinstance(side, ReadyCloud) else side for side in (query, map))
        return self.match(*clouds)

    @property
    def _takes_expectations(self) -> bool:
        call = self.call
        return call["method"] == "verified" and call["scale"] == "metric" and call["up"] is None

    def as_toml(self) -> str:
        """Return every effective value with what it means; reading it back gives the same settings."""
        from pomona.matching import default_config
        from pomona.meanings import meanings

        tables = {_CALL_TABLE: self.call, **_merged(default_config(), self.overrides)}
        return "\n".join(_toml_lines(tables, meanings())).lstrip("\n")


def _defaults_of_match() -> dict[str, Any]:
    """Return what `pomona.match` is told by name, with its defaults, which live in its signature alone."""
    from pomona.matching import match

    named = (p for p in inspect.signature(match).parameters.values() if p.kind is p.KEYWORD_ONLY)
    return {parameter.name: parameter.default for parameter in named if parameter.name != "config"}


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        text = read_given_text(path, "settings in TOML")
        for number, line in enumerate(text.splitlines(), start=1):
            if len(line) > MOST_LINE:
                raise PomonaError(f"{path}: line {number}: found {len(line)} characters, expected at most {MOST_LINE}")
        return tomllib.loads(text)
    except ValueError as error:
        raise PomonaError(f"{path}: is not TOML: {error}") from None
    except RecursionError:
        raise PomonaError(f"{path}: is not TOML of ours: found lists in lists without end") from None


def _refuse_unknown(path: Path | None, found: Mapping[str, Any], known: Mapping[str, Any], table: str = "") -> None:
    for name, value in found.items():
        if name not in known:
            raise PomonaError(f"{path}: unknown setting {table}{name[:MOST_NAME]}, expected one of {', '.join(known)}")
        expected = known[name]
        if isinstance(expected, dict):
            if not isinstance(value, dict):
                raise PomonaError(f"{path}: {table}{name}: found {shown(value)}, expected a table")
            _refuse_unknown(path, value, expected, f"{table}{name}.")


def _checked(place: str, name: str, value: Any) -> Any:
    """Return a value for `pomona.match` that was found at `place`; refuse one of another kind than it takes."""
    is_number = _is_number(value)
    match name:
        case "method":
            expected, fits = '"paper" or "verified"', value in ("paper", "verified")
        case "scale":
            expected, fits = '"metric" or "free"', value in ("metric", "free")
        case "noise_m":
            expected, fits = "a positive number of metres", is_number and value > 0
        case "threads":
            return require_threads(value, place)
        case "per_frame":
            expected, fits = "true or false", isinstance(value, bool)
        case _:
            expected, fits = "[x, y, z], or two of them: in the query, in the map", _is_direction(value)
            if fits:
                return [value, value]
            fits = isinstance(value, list) and len(value) == 2 and all(map(_is_direction, value))
    if not fits:
        raise PomonaError(f"{place}: found {shown(value)}, expected {expected}")
    return value


def _is_number(value: Any) -> bool:
    # Compared, not converted: a whole number of TOML may be beyond every float.
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


def _is_direction(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(_is_number, value))


def _refuse_wrong_values(path: Path | None, tables: Mapping[str, Any]) -> None:
    """Let the core look at its own tables, which it does when it prepares a map, be it of one fruit."""
    from pomona.matching import Index

    if not tables:
        return
    require_kinds(tables, f"{path}: ")
    try:
        Index([[0.0, 0.0, 0.0]], config=tables)
    except PomonaError as error:
        raise PomonaError(f"{path}: {str(error).removeprefix('map: ').removeprefix('config.')}") from None


def _merged(defaults: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(defaults)
    for name, value in overrides.items():
        merged[name] = _merged(defaults[name], value) if isinstance(value, dict) else value
    return merged


def _toml_lines(tables: Mapping[str, Any], meant: Mapping[str, str], place: str = "") -> Iterator[str]:
    """Values first, then the tables below, as TOML asks; None has no value in TOML and becomes a comment."""
    from pomona.meanings import comment

    inner = {name: value for name, value in tables.items() if isinstance(value, dict)}
    for name, value in tables.items():
        if name not in inner:
            yield from comment(meant[f"{place}{name}"])
            yield f"# {name} is not set" if value is None else f"{name} = {_toml_value(value)}"
    for name, table in inner.items():
        yield ""
        yield from comment(meant[f"{place}{name}"])
        yield f"[{place}{name}]"
        yield from _toml_lines(table, meant, f"{place}{name}.")


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        import json

        return json.dumps(value)  # a JSON string is a TOML basic string
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml_value, value))}]"
    return repr(value)
