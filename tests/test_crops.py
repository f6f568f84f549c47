"""A small picture of each fruit: cut while scanning, in the session, in the map, gone with its session."""

import sqlite3
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np
import pytest

from pomona.cloud import FruitCloud
from pomona.detect import Detections
from pomona.errors import PomonaError
from pomona.fruit_crop import FruitCrop
from pomona.orchard import Session, add_session, load_session, problems, remove_session, write_session
from pomona.orchard.crops import best_crops, crops_of
from pomona.store.opening import snapshot
from pomona.survey.best_shots import CROP_PX, BestShots
from pomona.survey.depth import Lifted
from pomona.survey.seeing import Look
from recording_maker import make_recording
from test_survey import STEPS_M, with_left

RED = (30, 40, 200)


def decoded(picture: bytes) -> np.ndarray:
    return np.asarray(cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR))


def webp(value: int) -> bytes:
    done, content = cv2.imencode(".webp", np.full((8, 8, 3), value, np.uint8))
    assert done
    return content.tobytes()


def look(frame: int, boxes_px, *, fruit_px, hidden) -> Look:
    n = len(boxes_px)
    lifted = Lifted(
        np.arange(n), np.zeros((n, 3)), np.zeros((n, 3, 3)), np.ones(n), np.ones(n), np.array(hidden), np.ones(n), {}
    )
    detections = Detections(np.array(boxes_px, np.float64), np.ones(n))
    return Look(frame, detections, lifted, fruit_px=np.array(fruit_px, np.float64))


def scene(seed: int = 0, blur: float = 0.0) -> np.ndarray:
    picture = np.random.default_rng(seed).integers(0, 256, (200, 300, 3)).astype(np.uint8)
    return picture if not blur else np.asarray(cv2.GaussianBlur(picture, (0, 0), blur))


@pytest.fixture(scope="module")
def sessions(tmp_path_factory) -> tuple[Path, Path]:
    """The same fruits on two days: a scan with colour, and another that saw red where the first saw green."""
    folder = tmp_path_factory.mktemp("crops")
    rng = np.random.default_rng(5)
    positions = rng.uniform((0, 0, 0), (6, 0.6, 2), (120, 3))
    for day, n_views, value in (("2024-08-09", 9, 10), ("2024-08-28", 4, 200)):
        cloud = FruitCloud(positions, diameters_m=np.full(120, 0.07), n_views=np.full(120, n_views))
        crops = {row: FruitCrop(row, webp(value)) for row in range(0, 120, 2)}
        write_session(folder / f"{day}.gpkg", cloud, name=day, date=day, recording="drawn", crops=crops)
        positions = positions + rng.normal(0, 0.003, positions.shape)
    return folder / "2024-08-09.gpkg", folder / "2024-08-28.gpkg"


@pytest.fixture
def orchard(sessions, tmp_path) -> Path:
    path = tmp_path / "orchard.gpkg"
    for session in sessions:
        assert add_session(path, load_session(session)).is_added
    return path


def test_a_scan_keeps_the_picture_of_each_fruit(pomona, tmp_path):
    row = with_left(make_recording(tmp_path / "2024-08-09", STEPS_M))
    assert pomona("scan", row, "-o", tmp_path / "row.gpkg")[0] == 0
    session = load_session(tmp_path / "row.gpkg")
    assert sorted(session.crops) == [0, 1, 2]
    for crop in session.crops.values():
        picture = decoded(crop.picture)
        assert max(picture.shape[:2]) <= CROP_PX
        assert crop.frame in range(len(STEPS_M))
        middle = picture[picture.shape[0] // 2, picture.shape[1] // 2].astype(int)
        assert np.abs(middle - RED).max() < 40
        assert len(crop.picture) < 1000


def test_crops_can_be_left_out_and_are_the_same_each_time(pomona, tmp_path):
    row = with_left(make_recording(tmp_path / "2024-08-09", STEPS_M))
    for name, flags in (("one", ()), ("two", ()), ("none", ("--no-crops",))):
        assert pomona("scan", row, "-o", tmp_path / f"{name}.gpkg", *flags)[0] == 0
    assert (tmp_path / "one.gpkg").read_bytes() == (tmp_path / "two.gpkg").read_bytes()
    assert load_session(tmp_path / "none.gpkg").crops == {}


def test_a_recording_without_colour_has_fruits_without_crops(pomona, tmp_path):
    row = make_recording(tmp_path / "2024-08-09", STEPS_M)
    assert pomona("scan", row, "-o", tmp_path / "row.gpkg")[0] == 0
    session = load_session(tmp_path / "row.gpkg")
    assert (len(session.cloud), session.crops) == (3, {})


def test_the_best_sighting_shows_most_of_the_fruit_in_the_sharpest_frame():
    box, fruits = [[100, 80, 140, 120]], np.zeros(4, np.int64)
    views = [
        (look(0, box, fruit_px=[400], hidden=[0.0]), scene()),
        (look(1, box, fruit_px=[900], hidden=[0.0]), scene()),
        (look(2, box, fruit_px=[900], hidden=[0.4]), scene()),
        (look(3, box, fruit_px=[950], hidden=[0.0]), scene(blur=2.0)),
    ]
    shots = BestShots()
    for each, picture in views:
        shots.offer(each, ["7"], picture)
    crops = shots.crops(np.arange(4), fruits)
    assert {fruit: crop.frame for fruit, crop in crops.items()} == {0: 1}


def test_a_fruit_at_the_edge_has_a_crop_and_no_box_of_nothing_has_one():
    shots = BestShots()
    boxes = [[0, 0, 90, 90], [120, 60, 140, 80], [280, 180, 300, 200]]
    shots.offer(look(4, boxes, fruit_px=[9, 9, 9], hidden=[0, 0, 0]), [1, None, 3], scene())
    crops = shots.crops(np.array([4, 4, 4]), np.array([0, -1, 1]))
    assert {fruit: decoded(crop.picture).shape[:2] for fruit, crop in crops.items()} == {0: (48, 48), 1: (30, 30)}
    assert shots.crops(np.array([4, 4, 4]), np.array([-1, 0, -1])) == {}


def test_parts_that_become_one_bring_the_better_crop_of_each():
    parts = BestShots(), BestShots()
    for frame, (part, shown) in enumerate(zip(parts, (100, 900), strict=True)):
        part.offer(look(frame, [[100, 80, 140, 120]], fruit_px=[shown], hidden=[0.0]), [1], scene())
    together = parts[0].with_those_of(parts[1])
    assert together.crops(np.array([0, 1]), np.array([0, 0]))[0].frame == 1
    assert {fruit: crop.frame for fruit, crop in together.crops(np.array([0, 1]), np.array([0, 1])).items()} == {
        0: 0,
        1: 1,
    }


def test_a_session_reads_its_crops_back(sessions):
    session = load_session(sessions[0])
    assert sorted(session.crops) == list(range(0, 120, 2))
    assert session.crops[4] == FruitCrop(4, webp(10))


def test_a_map_has_the_crops_of_every_visit(orchard):
    assert problems(orchard) == []
    with snapshot(orchard) as (connection, _):
        best = best_crops(connection)
        assert len(best) == 60
        assert {crop.picture for crop in best.values()} == {webp(10)}  # the visit that saw the fruits more often
        per_session = crops_of(connection, next(iter(best)))
        assert [crop.picture for crop in per_session.values()] == [webp(10), webp(200)]
        assert crops_of(connection, 10**6) == {}


def test_crops_go_with_their_session(orchard, sessions):
    assert remove_session(orchard, "2024-08-09") is not None
    assert problems(orchard) == []
    with snapshot(orchard) as (connection, _):
        assert {crop.picture for crop in best_crops(connection).values()} == {webp(200)}


def test_what_is_no_picture_is_named(orchard):
    with closing(sqlite3.connect(orchard)) as connection, connection:
        connection.execute("UPDATE crops SET picture = x'3c7363726970743e' WHERE id = 3")
    assert any(line.startswith("crops 3: picture: found") for line in problems(orchard))
    with pytest.raises(PomonaError, match="crops 3: picture"), snapshot(orchard) as (connection, _):
        best_crops(connection)


def test_a_crop_of_another_sessions_fruit_is_refused(sessions, tmp_path):
    path = tmp_path / "session.gpkg"
    path.write_bytes(sessions[0].read_bytes())
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE crops SET observation_id = 9999 WHERE id = 1")
    with pytest.raises(PomonaError, match="crops: observation_id: found 9999, expected an observation of its session"):
        load_session(path)


def test_the_hash_of_a_session_is_that_of_what_it_saw_with_crops_or_without(sessions):
    session = load_session(sessions[0])
    bare = Session(session.name, session.date, session.recording, session.cloud)
    assert bare.content_sha256 == session.content_sha256
