"""COLMAP models of both forms and layouts: read, moved and written back."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from fuzz.bundle import packed_folder, unpacked
from pomona.reconstruction import open_reconstruction, write_reconstruction

HALF = np.diag([0.5, 0.5, 0.5, 1.0])


def seeds() -> list[bytes]:
    """Two images and two points in each form and layout."""
    from model_maker import Model

    found = []
    for form in ("text", "binary"):
        for rigs in (False, True):
            with tempfile.TemporaryDirectory() as place:
                Model(["a/1.png", "a/2.png"], np.tile(np.eye(4), (2, 1, 1)), rigs=rigs).write(Path(place), form)
                found.append(packed_folder(form, Path(place)))
    return found


def target(content: bytes) -> None:
    """Bring the model into another frame and read what is written."""
    with unpacked(content) as (_, folder), tempfile.TemporaryDirectory() as place:
        model = open_reconstruction(folder).moved(HALF)
        write_reconstruction(Path(place), model)
        again = open_reconstruction(place)
        assert len(again.images) == len(model.images)
