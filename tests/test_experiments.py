"""The paper's experiments, one end to end on a small recording."""

import datetime

import numpy as np
import pytest
from benchmarks.experiments import tables, trajectory
from benchmarks.experiments.page import page
from benchmarks.experiments.scores import score
from benchmarks.experiments.sets import SETS, ExperimentSet, Line
from benchmarks.experiments.takes import Take, laid_out
from benchmarks.experiments.videos import VIDEOS, rendered
from benchmarks.experiments.visits import Visit, visited
from benchmarks.experiments.worse import FALSE, HIDDEN, made_worse

from pomona.cloud import FruitCloud
from pomona.recording import open_recording
from pomona.recording.poses import read_tum
from pomona.render.filming import Filming
from pomona.synth.living import RowDesign

SMALL = Filming(
    RowDesign(n_trees=3, leaves_per_tree=1500, row_behind=False, grass_blades_per_m2=0.0, clear_of_posts=False),
    datetime.date(2024, 9, 1),
    seed=3,
    pairs=20,
    size_px=(320, 180),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(VIDEOS, "small", SMALL)
        yield tmp_path_factory.mktemp("experiments")


def a_visit(*names, countable=None, detected=None):
    of_truth = frozenset(filter(None, names if countable is None else countable))
    places = np.arange(3.0 * len(names)).reshape(-1, 3)
    return Visit(FruitCloud(places), names, of_truth, of_truth if detected is None else detected)


def test_a_take_is_what_a_user_has(folder):
    """Backwards, without the first tree and without any truth but the boxes beside it."""
    take = laid_out(Take("small", backwards=True), rendered("small", folder), folder)
    recording = open_recording(take.folder)
    assert recording.trajectory is None
    assert set(recording.description()["pictures"]) == {"left", "right"}
    assert 8 < len(recording) < SMALL.pairs - 5
    last = next(iter(recording.frames([len(recording) - 1]))).read_left()
    assert (last == next(iter(open_recording(rendered("small", folder)).frames([0]))).read_left()).all()
    assert {box.frame for box in take.boxes} == set(range(len(recording)))


def test_an_experiment_runs_from_pictures_to_its_table(folder, monkeypatch):
    monkeypatch.setattr(tables, "CONDITIONS", ("true", "hard"))
    backwards = Take("small", backwards=True)
    said = tables.table(ExperimentSet("Small", "", "small", (Line(backwards, (0.9, 0.8), (0.9, 0.8)),)), folder, 2)
    lines = [line for line in said.splitlines() if line.startswith("| small-backwards")]
    assert len(lines) == 4
    assert all("0.900 / 0.800" in line for line in lines[:2])
    found = tables.measured("small", backwards, "true", folder, 1)
    assert found["verified"].precision > 0.95
    assert found["verified"].recall > 0.9
    assert found["verified"].common > 20


def test_what_was_scanned_is_taken_up(folder, monkeypatch):
    first = visited(Take("small"), "true", folder)
    monkeypatch.setattr("benchmarks.experiments.visits.pomona.scan", None)
    again = visited(Take("small"), "true", folder)
    assert (again.cloud.positions == first.cloud.positions).all()
    assert again.true_ids == first.true_ids
    assert first.countable <= first.detected
    assert len(first.countable - set(first.true_ids)) <= 1


def test_each_frame_is_located_by_its_fruits(folder):
    video = rendered("small", folder)
    map_ = visited(Take("small"), "true", folder)
    frames = trajectory.frames_in_camera(laid_out(Take("small"), video, folder))
    motion = trajectory.row_from_map(map_, video)
    _, true = read_tum(video / "poses_tum.txt")
    found = trajectory.located(frames, map_.cloud, motion, true, "verified")
    assert np.isfinite(found.shifts_m).mean() > 0.8
    assert np.nanmedian(found.shifts_m) < 0.04
    assert np.nanmedian(found.turns_deg) < 2.0


def test_a_worse_visit_lacks_fruits_has_false_ones_and_the_same_draw_again(folder):
    visit = visited(Take("small"), "true", folder)
    worse, again = (made_worse(visit, 1.5, (1, 0)) for _ in range(2))
    assert (worse.cloud.positions == again.cloud.positions).all()
    assert worse.true_ids.count("") - visit.true_ids.count("") == round(FALSE * len(visit.cloud))
    assert 0.4 < len(worse.countable) / len(visit.countable) < 1.2 - HIDDEN
    assert worse.countable < visit.countable
    assert set(worse.cloud.views.fruits.tolist()) == set(range(len(worse.cloud)))


def test_a_score_tells_what_is_wrong():
    query, map_ = a_visit("a", "b", "c", "", ""), a_visit("a", "c", "b", "", "d")
    found = score(query, map_, [(0, 0), (1, 1), (3, 3), (4, 4)])
    assert (found.right, found.to_another, found.to_none) == (1, 1, 1)
    assert found.precision == pytest.approx(1 / 3)
    assert (found.common, found.found, found.not_scanned, found.not_paired) == (3, 1, 0, 2)


def test_a_fruit_that_a_scan_lacks_is_missed():
    query, map_ = a_visit("a", countable=("a", "b")), a_visit("a", "b")
    found = score(query, map_, [(0, 0)])
    assert (found.recall, found.not_detected, found.not_scanned, found.not_paired) == (0.5, 0, 1, 0)


def test_a_fruit_that_a_detector_lacks_is_its_miss():
    query, map_ = a_visit("a", countable=("a", "b"), detected=frozenset("a")), a_visit("a", "b")
    found = score(query, map_, [(0, 0)])
    assert (found.recall, found.not_detected, found.not_scanned, found.not_paired) == (0.5, 1, 0, 0)


def test_the_page_has_every_set():
    parts = ("robustness", *SETS, "trajectory", "from_above")
    said = page({name: f"what {name} says" for name in parts}, 10)
    assert all(f"what {name} says" in said for name in parts)
    assert "{" not in said
