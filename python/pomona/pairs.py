"""Pairs of fruits as files: what `pomona match -o` writes and `pomona evaluate match` reads."""

from __future__ import annotations

import csv
import io
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from pomona.atomic import whole_file
from pomona.csv_rows import write_rows
from pomona.errors import PomonaError
from pomona.reading import parsed_json, read_given_text, shown

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pomona.cloud import FruitCloud
    from pomona.matching import Match

PAIR_COLUMNS = ("query", "map", "probability", "distance_m")


def write_pairs(path: Path, match: Match, query: FruitCloud, map: FruitCloud) -> None:
    """Write one pair a line as CSV; fruits go by id, or by row number in a cloud without ids."""
    with whole_file(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        write_rows(file, chain([PAIR_COLUMNS], _rows_of(match, query, map)))


def _rows_of(match: Match, query: FruitCloud, map: FruitCloud) -> Iterator[tuple[str, ...]]:
    for (q, m), probability, distance_m in zip(
        match.pairs.tolist(), match.probabilities.tolist(), match.distances_m.tolist(), strict=True
    ):
        yield query.label(q), map.label(m), f"{probability:.6f}", f"{distance_m:.6f}"


def read_pairs(path: Path, query: FruitCloud, map: FruitCloud) -> list[tuple[int, int]]:
    """Read pairs of rows from the CSV of `pomona match -o` or the JSON of `pomona match --json`.

    Parameters
    ----------
    path
        The file; ``-`` is the standard input.
    query, map
        The clouds that were matched: they say which row an id is.

    Raises
    ------
    PomonaError
        The file is not one of the two, or names a fruit that a cloud does not have.
    """
    text = read_given_text(path, "pairs as CSV or JSON")
    in_query, in_map = _row_of_label(query), _row_of_label(map)
    pairs: list[tuple[int, int]] = []
    for place, query_label, map_label in _labels_of(path, text):
        for side, label, rows in (("query", query_label, in_query), ("map", map_label, in_map)):
            if label not in rows:
                raise PomonaError(
                    f"{path}: {place}: {side} {shown(label)} is no fruit of the {side}, expected one of its ids"
                )
        pairs.append((in_query[query_label], in_map[map_label]))
    return pairs


def _row_of_label(cloud: FruitCloud) -> dict[str, int]:
    return {cloud.label(row): row for row in range(len(cloud))}


def _labels_of(path: Path, text: str) -> Iterator[tuple[str, str, str]]:
    """Yield the place in the file and the two labels of each pair."""
    return _labels_of_json(path, text) if text.lstrip().startswith("{") else _labels_of_csv(path, text)


def _labels_of_json(path: Path, text: str) -> Iterator[tuple[str, str, str]]:
    answer = parsed_json(str(path), text, "the JSON of `pomona match --json`")
    try:
        labels = [(str(entry["query"]), str(entry["map"])) for entry in answer["matches"]]
    except (KeyError, TypeError) as error:
        raise PomonaError(f"{path}: expected the JSON of `pomona match --json`, found {error!r}") from None
    for number, (query_label, map_label) in enumerate(labels):
        yield f"matches[{number}]", query_label, map_label


def _labels_of_csv(path: Path, text: str) -> Iterator[tuple[str, str, str]]:
    lines = csv.reader(io.StringIO(text, newline=""))
    try:
        header = next(lines, [])
        if not {"query", "map"} <= set(header):
            found = shown(",".join(header)) if header else "nothing"
            raise PomonaError(f"{path}: line 1: found {found}, expected a header with the columns query and map")
        query_column, map_column = header.index("query"), header.index("map")
        for cells in lines:
            if not cells:
                continue
            if len(cells) != len(header):
                raise PomonaError(f"{path}: line {lines.line_num}: found {len(cells)} values, expected {len(header)}")
            yield f"line {lines.line_num}", cells[query_column], cells[map_column]
    except csv.Error as error:
        raise PomonaError(f"{path}: line {lines.line_num}: is not CSV: {error}") from None
