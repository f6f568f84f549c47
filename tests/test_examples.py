"""The notebooks run, and show what they say that they show; the shipped row is a whole."""

import contextlib
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from notebook import executed
from pomona.recording import open_recording
from pomona.recording.poses import read_tum

ROOT = Path(__file__).parent.parent
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
MOST_BYTES = 200_000


def texts_of(notebook: dict[str, Any]) -> list[list[str]]:
    """What the cells print and answer, as text without its numbers, which may become better; pictures are not read."""
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    texts = [["".join(shown.get("text") or shown["data"]["text/plain"]) for shown in cell["outputs"]] for cell in cells]
    return [[re.sub(r"[-\d.\s]+", " ", text) for text in shown] for shown in texts]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_runs_and_shows_what_it_keeps(path: Path, tmp_path: Path) -> None:
    with contextlib.chdir(tmp_path):
        again = executed(path)
    kept = json.loads(path.read_text(encoding="utf-8"))
    assert texts_of(again) == texts_of(kept), f"stale: run python tests/notebook.py {path}"
    assert path.stat().st_size < MOST_BYTES


def test_there_is_a_notebook_of_the_first_steps() -> None:
    assert [path.name for path in NOTEBOOKS] == ["first_steps.ipynb"]


@pytest.mark.parametrize("date", ["2024-08-09", "2024-08-28", "2024-09-12"])
def test_the_true_poses_of_the_shipped_row_have_the_times_of_its_frames(date: str) -> None:
    folder = ROOT / "examples" / "row" / date
    frames_s = [frame.time_s for frame in open_recording(folder / "row.mp4").frames()]
    np.testing.assert_allclose(read_tum(folder / "poses_tum.txt")[0], frames_s, atol=1e-6)
