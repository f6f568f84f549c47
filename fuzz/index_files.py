"""The index of a map, saved beside it."""

from __future__ import annotations

import contextlib
import tempfile
import warnings
from pathlib import Path

import numpy as np

from pomona import Index, PomonaError, PomonaWarning

MAP = np.random.default_rng(0).uniform(0.0, [4.0, 1.0, 2.0], (120, 3))


def seeds() -> list[bytes]:
    """An index of the map, and one of another."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.index"
        contents = []
        for places in (MAP, MAP[1:]):
            Index(places, compact=True).save(path)
            contents.append(path.read_bytes())
    return contents


def target(content: bytes) -> None:
    """Open it for the map and ask."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", PomonaWarning)
        path = Path(folder) / "map.index"
        path.write_bytes(content)
        with contextlib.suppress(PomonaError):
            assert Index.open(path, MAP).match(MAP[:60]).n_map == len(MAP)
