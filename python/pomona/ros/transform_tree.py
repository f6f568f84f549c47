"""The tree of frames that a bag tells: what stands still, what moves, and where one frame is in another at a time."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaWarning
from pomona.reading import shown
from pomona.recording.bags.frames_of_reference import bare_name, joint_of, matrix_of
from pomona.recording.bags.message_file import TREES, MessageFile, counted, decoded, stamp_ns
from pomona.recording.poses_in_time import poses_at

__all__ = ["ODOMETRY", "TransformTree", "read_tree"]

Array = NDArray[np.float64]

ODOMETRY = "nav_msgs/msg/Odometry"

Samples: TypeAlias = dict[str, dict[str, list[tuple[int, Array]]]]
"""Of each frame that moves and each that it was told to be in, when and where."""

LONGEST_GAP_S = 0.5
"""A joint is thought to move evenly for so long: a vehicle in a row moves half a metre."""


@dataclass(frozen=True, eq=False)
class TransformTree:
    """See the module.

    Attributes
    ----------
    parents : dict
        Of each frame the one above it.
    fixed : dict
        Of each frame that stands still, parent_from_frame (4, 4).
    moving : dict
        Of each that moves, times in nanoseconds, ascending, and parent_from_frame (K, 4, 4).
    """

    parents: dict[str, str] = field(default_factory=dict)
    fixed: dict[str, Array] = field(default_factory=dict)
    moving: dict[str, tuple[NDArray[np.int64], Array]] = field(default_factory=dict)

    def chain(self, frame: str) -> list[str]:
        """Walk from a frame to the top."""
        chain = [bare_name(frame)]
        while (above := self.parents.get(chain[-1])) is not None and above not in chain:
            chain.append(above)
        return chain

    def circle(self, frame: str) -> list[str]:
        """Give the frames above a frame that go in a circle, none in a tree."""
        chain = self.chain(frame)
        above = self.parents.get(chain[-1])
        return [] if above is None else chain[chain.index(above) :]

    def body_of(self, frame: str) -> str:
        """Give the topmost frame that is fixed to a frame."""
        chain = self.chain(frame)
        return next((each for each in chain[:-1] if each in self.moving), chain[-1])

    def at(self, ancestor: str, frame: str, stamps_ns: NDArray[np.int64]) -> tuple[Array, NDArray[np.bool_]]:
        """Give ancestor_from_frame (F, 4, 4) at times, and (F,) whether the bag tells it then."""
        poses = np.tile(np.eye(4), (len(stamps_ns), 1, 1))
        known = np.ones(len(stamps_ns), bool)
        for each in self.chain(frame):
            if each == ancestor:
                return poses, known
            if each in self.moving:
                steps, has_step = _between(stamps_ns, *self.moving[each])
                poses, known = steps @ poses, known & has_step
            elif each in self.fixed:
                poses = self.fixed[each] @ poses
        return poses, np.zeros(len(stamps_ns), bool)


def read_tree(file: MessageFile) -> TransformTree:
    """Read the transforms of a bag; where none moves what its only odometry is of, that moves as the odometry says."""
    tree = TransformTree()
    samples: Samples = {}
    _add_joints(file, tree, samples)
    odometries = [name for name, topic in file.topics.items() if topic.type == ODOMETRY]
    if len(odometries) == 1:
        _add_odometry(file, odometries[0], tree, samples)
    for child, by_parent in samples.items():
        parent = tree.parents[child]
        if len(by_parent) > 1:
            names = ", ".join(map(shown, sorted(by_parent)))
            told = f"{file.path}: found the frame {shown(child)} in {names}: the last, {shown(parent)}, counts"
            warnings.warn(told, PomonaWarning, stacklevel=3)
        if parent in by_parent:
            tree.moving[child] = _ascending(by_parent[parent])
    return tree


def _add_joints(file: MessageFile, tree: TransformTree, samples: Samples) -> None:
    topics = {name for name, topic in file.topics.items() if topic.type in TREES}
    for message in counted(file.path, file.messages(topics)):
        static = message.topic.name.rpartition("/")[2] == "tf_static"
        for each in decoded(message).transforms:
            joint, stamp = joint_of(each), each.header.stamp
            if joint is None:
                continue
            tree.parents[joint.child] = joint.parent
            if static:
                tree.fixed[joint.child] = joint.parent_from_child
                continue
            at_ns = int(stamp.sec) * 10**9 + int(stamp.nanosec) or message.logged_ns
            of_child = samples.setdefault(joint.child, {})
            of_child.setdefault(joint.parent, []).append((at_ns, joint.parent_from_child))


def _add_odometry(file: MessageFile, topic: str, tree: TransformTree, samples: Samples) -> None:
    taken: list[tuple[int, Array]] = []
    child = parent = ""
    for message in counted(file.path, file.messages({topic})):
        content: Any = decoded(message)
        child, parent = bare_name(str(content.child_frame_id)), bare_name(str(content.header.frame_id))
        pose = content.pose.pose
        matrix = matrix_of(pose.position, pose.orientation)
        if matrix is not None:
            taken.append((stamp_ns(message) or message.logged_ns, matrix))
    if taken and child and parent and child != parent and child not in tree.parents:
        tree.parents[child], samples[child] = parent, {parent: taken}


def _ascending(taken: list[tuple[int, Array]]) -> tuple[NDArray[np.int64], Array]:
    """Sort by time; of those of one time the first counts."""
    times_ns, first = np.unique(np.array([at_ns for at_ns, _ in taken], np.int64), return_index=True)
    return times_ns, np.array([taken[row][1] for row in first])


def _between(
    stamps_ns: NDArray[np.int64], times_ns: NDArray[np.int64], poses: Array
) -> tuple[Array, NDArray[np.bool_]]:
    # Differences of nanoseconds are exact as integers, and only then.
    start_ns = times_ns[0]
    return poses_at((stamps_ns - start_ns) / 1e9, (times_ns - start_ns) / 1e9, poses, LONGEST_GAP_S)
