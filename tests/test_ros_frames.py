"""Which frames a replay speaks of: the bag's own tree, the map's axes."""

from __future__ import annotations

import numpy as np
import pytest

from bag_maker import START_NS, odometry, tf, write_bag
from pomona import FruitCloud
from pomona.earth import Anchor
from pomona.orchard import OrchardMap, add_session, load_session, write_session
from pomona.recording.bags.kinds import open_messages
from pomona.ros.map_axes import map_axes
from pomona.ros.transform_tree import read_tree
from test_ros_messages import a_pose

STEP_NS = 100_000_000


def tree_of(folder, entries):
    folder.mkdir(exist_ok=True)
    return read_tree(open_messages(write_bag(folder / "bag", entries, "mcap")))


def along(x_m: float) -> np.ndarray:
    pose = np.eye(4)
    pose[0, 3] = x_m
    return pose


def test_a_frame_is_followed_through_joints_that_move_and_that_do_not(tmp_path):
    """world -> odom stands still, odom -> base moves, base -> mast turns, mast -> camera stands still."""
    fixed = [tf("/tf_static", START_NS, ("world", "odom", a_pose(1)), ("mast", "/camera", a_pose(2)))]
    moving = [
        tf("/tf", START_NS + row * STEP_NS, ("odom", "base", along(row)), ("base", "mast", a_pose(3)))
        for row in range(3)
    ]
    tree = tree_of(tmp_path, fixed + moving)
    assert tree.chain("camera") == ["camera", "mast", "base", "odom", "world"]
    assert tree.body_of("camera") == "mast"
    halfway = np.array([START_NS + STEP_NS // 2, START_NS + 3 * STEP_NS])
    poses, known = tree.at("world", "camera", halfway)
    np.testing.assert_allclose(poses[0], a_pose(1) @ along(0.5) @ a_pose(3) @ a_pose(2), atol=1e-12)
    assert known.tolist() == [True, False]
    assert not tree.at("elsewhere", "camera", halfway)[1].any()


def test_odometry_moves_what_nothing_else_moves(tmp_path):
    fixed = tf("/tf_static", START_NS, ("base_link", "camera", a_pose(2)))
    told = [odometry("/odom", START_NS + row * STEP_NS, along(row)) for row in range(2)]
    tree = tree_of(tmp_path, [fixed, *told])
    assert (tree.chain("camera")[-1], tree.body_of("camera")) == ("odom", "base_link")
    another = [odometry("/wheels", START_NS, along(5), child="wheels", frame="wheel_odom")]
    assert tree_of(tmp_path / "two", [fixed, *told, *another]).chain("camera") == ["camera", "base_link"]


def test_a_tree_that_bites_its_tail_ends(tmp_path):
    tree = tree_of(tmp_path, [tf("/tf_static", START_NS, ("a", "b", np.eye(4)), ("b", "a", np.eye(4)))])
    assert tree.chain("a") == ["a", "b"]


@pytest.mark.parametrize("as_path", [True, False])
def test_a_georeference_turns_the_map_to_east_north_up(tmp_path, as_path, monkeypatch, full_cloud: FruitCloud):
    session, orchard = tmp_path / "visit.gpkg", tmp_path / "orchard.gpkg"
    write_session(session, full_cloud, name="visit", date="2024-08-09", recording="test")
    add_session(orchard, load_session(session))
    given = orchard if as_path else OrchardMap(orchard)
    np.testing.assert_array_equal(map_axes(given, None), np.eye(4))
    monkeypatch.setattr(OrchardMap, "anchor", lambda _: Anchor(a_pose(4), 11.0, 46.0, None))
    np.testing.assert_array_equal(map_axes(given, (0, -1, 0)), a_pose(4))


def test_without_one_up_levels_and_else_nothing_is_turned(full_cloud: FruitCloud):
    np.testing.assert_array_equal(map_axes(full_cloud, None), np.eye(4))
    np.testing.assert_allclose(
        map_axes(full_cloud, ((0, 0, 1), (0, -1, 0)))[:3, :3] @ [0, -1, 0], [0, 0, 1], atol=1e-12
    )
