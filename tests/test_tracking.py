"""Tracks through a rendered row, true poses and exact depth; what the Python face promises."""

from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.recordings import true_boxes
from scipy.spatial.transform import Rotation

from pomona import PomonaError, default_config
from pomona.detect import Detections
from pomona.recording import open_recording
from pomona.recording.calibration import Calibration
from pomona.survey.depth import Lifted, lift
from pomona.survey.tracking import Tracker, Tracks

CALIBRATION = Calibration(width=640, height=360, fx=417.0, fy=417.0, cx=320.0, cy=180.0, baseline_m=0.12)


def lifted(centres_in_camera: list[list[float]], radius_m: float = 0.035) -> Lifted:
    n = len(centres_in_camera)
    return Lifted(
        rows=np.arange(n),
        centres_in_camera=np.array(centres_in_camera).reshape(-1, 3),
        covariances=np.tile(np.diag([1e-5, 1e-5, 4e-4]), (n, 1, 1)),
        diameters_m=np.full(n, 2 * radius_m),
        diameter_sigmas_m=np.full(n, 0.005),
        hidden=np.zeros(n),
        support=np.ones(n),
        refused=Counter(),
    )


def boxes(centres_in_camera: list[list[float]], radius_m: float = 0.035) -> Detections:
    centres = np.array(centres_in_camera).reshape(-1, 3)
    middle = 417.0 * centres[:, :2] / centres[:, 2:] + [320.0, 180.0]
    half = 417.0 * radius_m / centres[:, 2:]
    return Detections(np.hstack([middle - half, middle + half]), np.ones(len(centres)))


def pose(x_m: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[0, 3] = x_m
    return matrix


Tracked = tuple[Tracks, dict[tuple[int, int], str], list[np.ndarray]]


@pytest.fixture(scope="module")
def row(shared_data: Path) -> Tracked:
    """Tracks of one date by true poses."""
    return tracked(shared_data, 0, np.eye(4))


def tracked(shared_data: Path, jumps_at: int, off: np.ndarray) -> Tracked:
    """Tracks of one date, the fruit behind each box, the online numbers; from a frame on all poses are `off`."""
    source = shared_data / "rendered_row" / "2024-08-28"
    recording = open_recording(source)
    of_frame = defaultdict(list)
    for box in true_boxes(source):
        of_frame[box.frame].append(box)
    tracker, names, online = Tracker(recording.calibration), {}, []
    for frame in recording.frames():
        found = of_frame[frame.number]
        boxes_px = np.array([box.box_px for box in found], float)
        fruits = lift(frame.read_depth(), boxes_px, recording.calibration)
        given = frame.session_from_camera @ (off if frame.number >= jumps_at else np.eye(4))
        online.append(tracker.update(frame.number, given, Detections(boxes_px, np.ones(len(found))), fruits))
        names |= {(frame.number, row): box.fruit for row, box in enumerate(found)}
    return tracker.finish(), names, online


def test_a_rendered_row_is_counted(row: Tracked) -> None:
    tracks, names, _ = row
    often = {name for name, views in Counter(names.values()).items() if views >= 5}
    assert abs(len(tracks) - len(often)) <= 0.02 * len(often)
    held = [Counter() for _ in range(len(tracks))]
    for frame, box, fruit in zip(tracks.frames, tracks.rows, tracks.fruits, strict=True):
        held[fruit][names[frame, box]] += 1
    main = [of.most_common(1)[0][0] for of in held]
    assert len(set(main)) >= 0.98 * len(main), "fruits are split"
    strange = sum(of.total() - of.most_common(1)[0][1] for of in held)
    assert strange <= 0.01 * len(tracks.frames)


def test_tracks_are_consistent(row: Tracked) -> None:
    tracks, _, online = row
    assert np.array_equal(np.bincount(tracks.fruits, minlength=len(tracks)), tracks.n_views)
    assert tracks.n_views.min() >= default_config()["tracking"]["min_views"]
    sightings = np.stack([tracks.frames, tracks.rows], axis=1)
    assert len(np.unique(sightings, axis=0)) == len(sightings)
    assert len(np.unique(np.stack([tracks.frames, tracks.fruits], axis=1), axis=0)) == len(sightings)
    assert np.all(np.diff(tracks.frames) >= 0)
    # Online and in the end, nearly all boxes are told alike.
    numbers = tracks.numbers[tracks.fruits]
    first = online[0]
    same = np.mean(
        [first[box] == number for (frame, box), number in zip(sightings, numbers, strict=True) if frame == 0]
    )
    assert same > 0.9
    # The tracked places are good enough to start a refinement.
    assert np.median(np.sqrt(np.linalg.eigvalsh(tracks.covariances).max(axis=1))) < 0.01


@pytest.mark.parametrize(
    ("x_m", "y_m", "z_m", "turn_deg"), [(0.15, 0.0, 0.0, 0.0), (-0.4, 0.1, 0.2, 0.0), (0.05, 0.0, 0.0, 5.0)]
)
def test_a_row_is_counted_once_where_poses_jump(
    row: Tracked, shared_data: Path, x_m: float, y_m: float, z_m: float, turn_deg: float
) -> None:
    """As odometry does that slips amid the row: the fruits in view say where the camera is."""
    off = np.eye(4)
    off[:3, :3] = Rotation.from_euler("y", turn_deg, degrees=True).as_matrix()
    off[:3, 3] = (x_m, y_m, z_m)
    tracks, _, _ = tracked(shared_data, 20, off)
    assert len(tracks) == pytest.approx(len(row[0]), rel=0.02)


def test_numbers_follow_a_fruit_and_come_back_after_a_gap() -> None:
    tracker = Tracker(CALIBRATION)
    there = [[0.0, 0.0, 1.5], [0.0, 0.2, 1.5]]
    for frame in range(3):
        x_m = 0.1 * frame
        seen = [[x - x_m, y, z] for x, y, z in there]
        assert tracker.update(frame, pose(x_m), boxes(seen), lifted(seen)).tolist() == [0, 1]
    for frame in range(3, 60):
        assert tracker.update(frame, pose(3.0), Detections.none(), lifted([])).tolist() == []
    seen = [there[1], [0.3, 0.1, 1.2]]
    assert tracker.update(60, pose(0.0), boxes(seen), lifted(seen)).tolist() == [1, 2]
    tracks = tracker.finish(1)
    assert tracks.numbers.tolist() == [0, 1, 2]
    assert tracks.n_views.tolist() == [3, 4, 1]
    assert len(tracker.finish()) == 0


def test_joined_fuses_fruits_at_one_place() -> None:
    covariance = np.eye(3) * 1e-5
    tracks = Tracks(
        numbers=np.array([3, 5, 8]),
        centres=np.array([[0.0, 0, 1], [0.01, 0, 1], [0.2, 0, 1]]),
        covariances=np.stack([covariance, covariance, covariance]),
        radii_m=np.full(3, 0.035),
        radius_sigmas_m=np.full(3, 0.002),
        n_views=np.array([2, 2, 1]),
        n_glimpses=np.array([0, 1, 0]),
        evidence=np.ones(3),
        frames=np.array([0, 1, 1, 2, 2]),
        rows=np.array([0, 0, 1, 0, 1]),
        fruits=np.array([0, 0, 2, 1, 1]),
        shared=np.zeros(5, bool),
    )
    joined = tracks.joined(place_sigma_m=0.01)
    assert joined.numbers.tolist() == [3, 8]
    assert joined.fruits.tolist() == [0, 0, 1, 0]
    assert joined.n_views.tolist() == [3, 1]
    assert np.allclose(joined.centres[0], [0.005, 0, 1])
    assert np.allclose(joined.covariances[0], covariance / 2)
    assert joined.n_glimpses.tolist() == [1, 0]
    assert joined.select(np.array([0])).numbers.tolist() == [3]
    apart = tracks.at(tracks.centres + np.array([[0, 0, 0], [0.07, 0, 0], [0, 0, 0]]), tracks.covariances)
    assert len(apart.joined()) == 3


def test_wrong_input_is_one_line() -> None:
    with pytest.raises(PomonaError, match=r"tracking\.min_views"):
        Tracker(CALIBRATION, {"tracking": {"min_views": 0}})
    with pytest.raises(PomonaError, match="min_view"):
        Tracker(CALIBRATION, {"tracking": {"min_view": 3}})
    tracker = Tracker(CALIBRATION)
    with pytest.raises(PomonaError, match=r"frame 0: session_from_camera: .* expected a rigid one"):
        tracker.update(0, 1.1 * np.eye(4), Detections.none(), lifted([]))
    with pytest.raises(PomonaError, match=r"found an array of shape \(3, 3\)"):
        tracker.update(0, np.eye(3), Detections.none(), lifted([]))
    tracker.update(7, np.eye(4), Detections.none(), lifted([]))
    with pytest.raises(PomonaError, match=r"^frame 7: found after frame 7"):
        tracker.update(7, np.eye(4), Detections.none(), lifted([]))
    with pytest.raises(PomonaError, match=r"^frame_number: found '7\.5', expected a whole number"):
        tracker.update(7.5, np.eye(4), Detections.none(), lifted([]))  # type: ignore[arg-type]
    one = lifted([[0.0, 0.0, 1.0]])
    box = boxes([[0.0, 0.0, 1.0]])
    with pytest.raises(PomonaError, match=r"^frame 8: covariances: row 0 is not symmetric positive semi-definite"):
        tracker.update(8, np.eye(4), box, replace(one, covariances=-one.covariances))
    with pytest.raises(PomonaError, match=r"lifted\.rows"):
        tracker.update(8, np.eye(4), Detections.none(), lifted([[0.0, 0.0, 1.0]]))
