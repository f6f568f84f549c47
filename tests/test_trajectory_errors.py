"""The measures of the odometry benchmark."""

import numpy as np
import pytest
from benchmarks.trajectory_errors import compare
from scipy.spatial.transform import Rotation


def straight(n: int, step_m: float = 1.0) -> np.ndarray:
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, 2, 3] = step_m * np.arange(n)
    return poses


def test_a_scale_of_two_percent_is_two_percent_everywhere() -> None:
    errors = compare(straight(11, 1.02), straight(11), 1, (1.0, 5.0))
    assert errors.length_m == pytest.approx(10.0)
    assert errors.end_m == pytest.approx(0.2)
    assert errors.segment_percent == pytest.approx(2.0)
    assert errors.end_deg == errors.rms_deg == errors.segment_deg_per_m == pytest.approx(0.0)
    # Deviations 0.02 (row - 5) of a straight drive of eleven poses.
    assert errors.rms_m == pytest.approx(0.02 * np.sqrt(10.0))


def test_a_turn_at_the_start_is_an_end_error_and_no_rms() -> None:
    true = straight(11)
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec([0.0, 0.1, 0.0]).as_matrix()
    assert compare(turn @ true, true, 1, (1.0,)).rms_deg == pytest.approx(0.0, abs=1e-6)
    late = true.copy()
    late[1:] = turn @ true[1:]
    assert compare(late, true, 1, (1.0,)).end_deg == pytest.approx(np.degrees(0.1))


def test_the_turn_about_a_straight_drive_is_seen() -> None:
    true = straight(11)
    rolled = true.copy()
    for row in range(11):
        rolled[row, :3, :3] = Rotation.from_rotvec([0.0, 0.0, 0.01 * row]).as_matrix()
    errors = compare(rolled, true, 1, (1.0,))
    assert errors.end_deg == pytest.approx(np.degrees(0.1))
    assert errors.segment_deg_per_m == pytest.approx(np.degrees(0.01))
    assert errors.rms_deg == pytest.approx(np.degrees(0.01 * np.sqrt(10.0)))
