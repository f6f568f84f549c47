"""Fruits of rows behind: left out of a row that is scanned, whatever the way of the camera, and nothing else is."""

import json
import re

import numpy as np
import pytest

from depth_scene import Sphere
from pomona import scan
from pomona.cloud import FruitCloud
from pomona.survey.rows_behind import rows_behind
from recording_maker import make_recording

UP = np.array([0.0, 0.0, 1.0])
WIDE, HIGH = 0.77, 0.45
"""Tangents of half the angle that a camera sees: 75 by 48 degrees."""

SPACING_M = 3.3


def hung(rng, trees, *, per_tree=30, spread_m=(0.35, 0.25, 0.5)):
    """Fruits about the middles of trees, (N, 3)."""
    spread = np.clip(rng.normal(0, 0.6, (len(trees), per_tree, 3)), -1, 1) * spread_m
    return (np.asarray(trees, float)[:, None] + spread).reshape(-1, 3)


def a_row(y_m=0.0, first_m=0.0, last_m=8.0, step_m=1.0):
    return [(x, y_m, 1.6) for x in np.arange(first_m, last_m + 0.01, step_m)]


def looking(place, towards, up=UP):
    pose = np.eye(4)
    ahead = np.asarray(towards, float) / np.linalg.norm(towards)
    right = np.cross(ahead, up)
    right /= np.linalg.norm(right)
    pose[:3, :3] = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    pose[:3, 3] = place
    return pose


def along(distance_m=1.5, side=-1, first_m=-1.0, last_m=9.0, up=UP):
    """Drive along the row at y = 0 on one of its sides, looking at it."""
    xs = np.arange(first_m, last_m, 0.2)
    distances_m = np.broadcast_to(distance_m, len(xs))
    return [looking((x, side * d, 1.5), (0, -side, 0), up) for x, d in zip(xs, distances_m, strict=True)]


def filmed(rng, centres, poses, *, found=0.7, far_m=6.5):
    """Which of the fruits a drive sees in three frames or more, and those of them that are left out."""
    poses, sightings = np.array(poses), []
    for frame, pose in enumerate(poses):
        x, y, z = ((centres - pose[:3, 3]) @ pose[:3, :3]).T
        in_view = (z > 0.3) & (z < far_m) & (np.abs(x) < WIDE * z) & (np.abs(y) < HIGH * z)
        rows = np.flatnonzero(in_view & (rng.random(len(centres)) < found))
        sightings.append(np.stack([np.full(len(rows), frame), rows], axis=1))
    frames, fruits = np.concatenate(sightings).T
    seen = np.flatnonzero(np.bincount(fruits, minlength=len(centres)) >= 3)
    kept = np.isin(fruits, seen)
    return seen, rows_behind(centres[seen], frames[kept], np.searchsorted(seen, fruits[kept]), poses)


def around():
    """Drive around the whole row at 1.5 m, looking at it."""
    turns = np.linspace(-np.pi / 2, np.pi / 2, 24)
    far = [looking((8 + 1.5 * np.cos(t), 1.5 * np.sin(t), 1.5), (-np.cos(t), -np.sin(t), 0)) for t in turns]
    near = [looking((-1.5 * np.cos(t), -1.5 * np.sin(t), 1.5), (np.cos(t), np.sin(t), 0)) for t in turns]
    return [*along(first_m=0, last_m=8), *far, *along(side=1, first_m=0, last_m=8)[::-1], *near]


WAYS = {
    "straight": along(),
    "upside down": along(up=-UP),
    "from nearer and farther": along(1.7 + 0.5 * np.sin(np.arange(50) / 5)),
    "standing": [looking((4, -1.5, 1.5), (0, 1, 0))] * 8,
    "around": around(),
    "slantwise": [looking((x, -1.5, 1.5), (0.5, 1, 0.1)) for x in np.arange(-1, 9, 0.2)],
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("step_m", [1.0, 3.0])
def test_the_row_behind_is_left_out_and_nothing_of_the_row(way, step_m):
    rng = np.random.default_rng(5)
    row, behind = hung(rng, a_row(step_m=step_m)), hung(rng, a_row(SPACING_M, -3, 11, step_m))
    seen, is_behind = filmed(rng, np.concatenate([row, behind]), WAYS[way])
    assert is_behind.tolist() == (seen >= len(row)).tolist()
    assert is_behind.sum() >= 10


def test_where_trees_are_missing_the_row_behind_is_no_nearer():
    rng = np.random.default_rng(6)
    trees = [place for place in a_row(last_m=20.0) if not 8 < place[0] < 12]
    row, behind = hung(rng, trees), hung(rng, a_row(SPACING_M, -3, 23))
    seen, is_behind = filmed(rng, np.concatenate([row, behind]), along(last_m=21))
    assert is_behind.tolist() == (seen >= len(row)).tolist()


def test_strays_in_a_narrow_alley_do_not_join_the_row_behind():
    rng = np.random.default_rng(12)
    strays = hung(rng, [(x, 0.95, 1.6) for x in (0.5, 3.5, 6.5)], per_tree=1)
    row, behind = hung(rng, a_row()), hung(rng, a_row(1.9, -3, 11), per_tree=60)
    seen, is_behind = filmed(rng, np.concatenate([row, strays, behind]), along())
    is_row, hangs_behind = seen < len(row), seen >= len(row) + len(strays)
    assert not is_behind[is_row].any()
    assert is_behind[hangs_behind].all()


def test_a_row_that_bends_has_no_row_behind_itself():
    rng = np.random.default_rng(7)
    turns = np.linspace(0, np.pi, 40)

    def bow(radius_m, z_m):
        return [(radius_m * np.cos(turn), radius_m * np.sin(turn), z_m) for turn in turns]

    row, behind = hung(rng, bow(10, 1.6), spread_m=(0.3, 0.3, 0.5)), hung(rng, bow(13.3, 1.6), spread_m=(0.3, 0.3, 0.5))
    poses = [looking(place, (place[0], place[1], 0)) for place in bow(8.5, 1.5)]
    seen, is_behind = filmed(rng, np.concatenate([row, behind]), poses)
    assert is_behind.tolist() == (seen >= len(row)).tolist()


def test_leaves_taken_for_fruits_before_the_row_do_not_put_it_behind():
    rng = np.random.default_rng(8)
    weeds = hung(rng, [(2, -1.2, 1.5), (7, -1.2, 1.5)], per_tree=3, spread_m=(0.1, 0.1, 0.1))
    row, behind = hung(rng, a_row()), hung(rng, a_row(SPACING_M, -3, 11))
    seen, is_behind = filmed(rng, np.concatenate([weeds, row, behind]), along(1.9))
    assert is_behind.tolist() == (seen >= len(weeds) + len(row)).tolist()


def between():
    """Drive between two rows, looking now at the one and now at the other."""
    return [looking((x, 1.65, 1.5), (0, (-1) ** int(4 * x), 0)) for x in np.arange(-1, 9, 0.1)]


def to_and_fro():
    """Film one row on the way there and the next one, from the next alley, on the way back."""
    there = along()
    back = [looking((x, SPACING_M - 1.5, 1.5), (0, 1, 0)) for x in np.arange(9, -1, -0.2)]
    return [*there, *back]


def ahead():
    """Drive between two rows, looking ahead; the way ends before the rows do."""
    return [looking((x, 1.65, 1.5), (1, 0, 0)) for x in np.arange(-2, 5, 0.2)]


def v_trellis():
    """Two arms that lean apart from 0.7 to 2.4 m over the ground; 2 m apart at their ends."""
    arms = [(side * lean, 0.7 + 1.7 * lean) for lean in (0.1, 0.4, 0.7, 1.0) for side in (-1, 1)]
    return [(x, y, z) for x in range(9) for y, z in arms]


def under_a_pergola():
    return [looking((x, 0, 0.8), (0, 0.3, 1)) for x in np.arange(0, 8, 0.2)]


def vases(radius_m=1.5):
    """Places on the rims of trees that are open within."""
    turns = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    return [(x + radius_m * np.cos(t), radius_m * np.sin(t), 1.6) for x in (0, 4, 8) for t in turns]


KEPT = {
    "open vases": (vases(), along(3.0), {"per_tree": 4, "spread_m": (0.15, 0.15, 0.5)}),
    "between two rows": (a_row() + a_row(SPACING_M), between(), {}),
    "both rows, one after the other": (a_row() + a_row(SPACING_M), to_and_fro(), {}),
    "looking ahead": (a_row(0, 0, 16, 3.0) + a_row(SPACING_M, 0, 16, 3.0), ahead(), {}),
    "a V trellis": (v_trellis(), along(2.2), {"per_tree": 8, "spread_m": (0.4, 0.15, 0.2)}),
    "a pergola": ([(x, y, 2.3) for x in range(-2, 11) for y in range(-2, 5)], under_a_pergola(), {"per_tree": 12}),
    "wide crowns": (a_row(step_m=4.0), along(3.2), {"per_tree": 150, "spread_m": (1.8, 1.8, 0.9)}),
    "few fruits in wide crowns": (a_row(step_m=4.0), along(3.2), {"per_tree": 10, "spread_m": (1.8, 1.8, 0.9)}),
    "a single tree": (a_row(last_m=0.0), along(first_m=-1, last_m=1), {"spread_m": (0.8, 0.8, 0.8)}),
    "the row behind alone": (a_row(SPACING_M), along(), {}),
}


@pytest.mark.parametrize("scene", KEPT)
def test_what_is_behind_no_row_is_kept(scene):
    trees, poses, how = KEPT[scene]
    rng = np.random.default_rng(9)
    seen, is_behind = filmed(rng, hung(rng, trees, **how), poses)
    assert len(seen) > 10
    assert not is_behind.any()


@pytest.mark.parametrize("n", [0, 1, 2])
def test_next_to_nothing_is_behind_nothing(n):
    frames = np.zeros(n, np.int64)
    assert rows_behind(np.ones((n, 3)), frames, np.arange(n), np.eye(4)[None]).tolist() == [False] * n


ROW = {f"row{x}{y}": Sphere((0.2 * x - 0.3, 0.2 * y - 0.2, 1.0)) for x in range(4) for y in range(3)}
BEHIND = {f"behind{x}{y}": Sphere((0.54 * x - 0.54, 0.54 * y - 0.27, 2.7)) for x in range(3) for y in range(2)}
STEPS_M = tuple(0.03 * np.arange(8))


@pytest.fixture
def two_rows(tmp_path):
    return make_recording(tmp_path / "2024-08-09", STEPS_M, ids=False, fruits=ROW | BEHIND)


def test_a_scan_counts_its_row_and_says_what_it_left_out(run_here, two_rows, tmp_path):
    output = tmp_path / "row.csv"
    done = run_here("scan", two_rows, "-o", output)
    assert done.returncode == 0, done.stderr
    assert "12 fruits" in done.stdout.splitlines()[0]
    left_out = [line.strip() for line in done.stdout.splitlines() if "left out" in line]
    assert left_out == ["left out 6 fruits in rows behind the one that was scanned: --all-rows keeps them"]
    assert FruitCloud.read(output).positions[:, 2].max() < 1.1
    found = json.loads(run_here("scan", two_rows, "-o", output, "--json").stdout)
    assert (found["n_fruits"], found["tracks"]) == (12, {"fruit": 12, "behind": 6})
    assert found["boxes"] == {"fruit": 96, "behind": 48}


def test_a_dense_row_behind_a_sparse_one_is_told(run_here, tmp_path):
    few = {f"row{x}": Sphere((0.13 * x - 0.3, 0.1 * (x % 2), 1.0)) for x in range(6)}
    dense = {f"behind{x}{y}": Sphere((0.2 * x - 0.9, 0.2 * y - 0.7, 2.7)) for x in range(10) for y in range(8)}
    recording = make_recording(tmp_path / "2024-08-09", STEPS_M, ids=False, fruits=few | dense)
    done = run_here("scan", recording, "-o", tmp_path / "row.csv")
    assert done.returncode == 0, done.stderr
    assert re.search(
        r"2024-08-09: \d+ of \d+ fruits hang 1\.8 m farther away than the others: a row behind", done.stderr
    )
    assert "farther away" not in run_here("scan", recording, "-o", tmp_path / "all.csv", "--all-rows").stderr


def test_all_rows_are_counted_where_that_is_asked(run_here, two_rows, tmp_path):
    done = run_here("scan", two_rows, "-o", tmp_path / "row.csv", "--all-rows")
    assert done.returncode == 0, done.stderr
    assert "left out" not in done.stdout
    assert len(FruitCloud.read(tmp_path / "row.csv")) == len(scan(two_rows, all_rows=True).cloud) == 18


def test_boxes_with_names_are_what_they_name(tmp_path):
    named = make_recording(tmp_path / "2024-08-09", STEPS_M, fruits=ROW | BEHIND)
    assert len(scan(named).cloud) == 18
    assert len(scan(named, retrack=True).cloud) == 12
