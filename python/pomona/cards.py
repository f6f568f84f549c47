"""How results show themselves in a notebook: a small table of facts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

__all__ = ["as_card", "as_table"]


def as_card(title: str, facts: Mapping[str, object]) -> str:
    """Give HTML with a title and one fact a line; names may come from strangers and are escaped."""
    return _html(title, (f"<tr><th>{_cell(name)}</th><td>{_cell(value)}</td></tr>" for name, value in facts.items()))


def as_table(title: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Give HTML with a title, a line of names and the rows below."""
    names = "".join(f"<th>{_cell(name)}</th>" for name in header)
    lines = ("<tr>" + "".join(f"<td>{_cell(value)}</td>" for value in row) + "</tr>" for row in rows)
    return _html(title, [f"<tr>{names}</tr>", *lines])


def _html(title: str, rows: Iterable[str]) -> str:
    return f"<table><caption><b>{_cell(title)}</b></caption>{''.join(rows)}</table>"


def _cell(value: object) -> str:
    return escape(str(value))
