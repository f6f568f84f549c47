"""Scans by `--slam`: a shipped recording, one that is stopped, and recordings that it can do nothing with."""

import json
from pathlib import Path

import pytest

from command_line import Pomona
from pomona import scan as pomona_scan
from pomona.errors import PomonaError
from pomona.recording import open_recording
from pomona.survey.pose_source import Followed
from recording_maker import make_recording

ROW = Path(__file__).parents[1] / "examples" / "row" / "2024-08-09"


def test_scan_with_slam(pomona: Pomona, tmp_path: Path) -> None:
    """The first 14 frames, 1.7 m, of a shipped row: poses by its fruits and pictures, the same again on another run."""
    command = ("scan", ROW / "row.mp4", "--calibration", ROW / "calibration.json", "--detections", ROW / "boxes.csv")
    flags = ("--retrack", "--slam", "--no-crops", "--to", "13", "--date", "2024-08-09")
    code, out, err = pomona(*command, *flags, "-o", tmp_path / "row.gpkg", "--json")
    assert code == 0, err
    assert json.loads(out)["n_frames"] == 14
    true = "\n".join((ROW / "poses_tum.txt").read_text().splitlines()[:15])
    (tmp_path / "true.tum").write_text(true + "\n")
    judge = ("evaluate", "trajectory", tmp_path / "row.gpkg", tmp_path / "true.tum", "--in-order", "--json")
    figures = json.loads(pomona(*judge)[1])
    assert figures["poses"] == 14
    assert figures["absolute"]["translation_m"]["rmse"] < 0.004
    assert figures["absolute"]["rotation_deg"]["rmse"] < 0.15


def test_a_scan_with_slam_that_is_stopped_has_what_was_looked_at() -> None:
    recording = open_recording(ROW / "row.mp4", calibration=ROW / "calibration.json")
    asked = iter([False] * 6 + [True] * 20)
    told: list[tuple[int, int, int]] = []
    survey = pomona_scan(
        recording,
        detections=ROW / "boxes.csv",
        slam=True,
        retrack=True,
        crops=False,
        progress=lambda *done: told.append(done),
        stop=lambda: next(asked),
    )
    assert survey.stopped == 6
    assert survey.trajectory.frames.tolist() == list(range(7))
    assert [done for done, _, _ in told] == [*range(1, 8), *range(49, 56)]


def test_one_frame_is_no_way(tmp_path: Path) -> None:
    recording = open_recording(make_recording(tmp_path / "R", (0.0,)))
    with pytest.raises(PomonaError, match="found 1 frame to follow, expected two or more; leave out --slam"):
        pomona_scan(recording, slam=True)


def test_a_recording_whose_frames_share_nothing_is_told(tmp_path: Path) -> None:
    recording = open_recording(make_recording(tmp_path / "R", (0.0, 0.1, 0.2)))
    with pytest.raises(
        PomonaError, match="found 3 frames that show no fruits in common, expected 5 or more in each two"
    ):
        pomona_scan(recording, slam=True)


def test_links_of_fruits_may_outvote_odometry() -> None:
    """In a gust corners of leaves agree on motions that never were; what is trusted no link outvotes."""
    recording = open_recording(ROW / "row.mp4", calibration=ROW / "calibration.json")
    camera = Followed(recording, None)
    for frame in recording.frames({0, 1, 2}):
        camera(frame)
    motions = camera.motions([0, 1, 2])
    assert len(motions) >= 2
    assert motions.which_are_doubtful().all()
