"""Outcomes of a long run, kept as they come: what was interrupted goes on where it ended."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path


class KeptRows:
    """A file of outcomes, a line each; without a file nothing is kept.

    Parameters
    ----------
    path : Path or None
        Of one version of the program: whoever changes that begins another file.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        lines = path.read_text(encoding="utf-8").splitlines() if path and path.exists() else []
        self._known = {_name(one["of"]): one["row"] for one in map(json.loads, lines)}

    def row(self, of: Mapping[str, object], make: Callable[[], Mapping[str, object]]) -> dict[str, object]:
        """Return the outcome of something, made where it is not kept yet."""
        if _name(of) in self._known:
            return dict(self._known[_name(of)])
        row = dict(make())
        if self._path is not None:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"of": dict(of), "row": row}) + "\n")
        return row


def _name(of: Mapping[str, object]) -> str:
    return json.dumps(dict(of), sort_keys=True)
