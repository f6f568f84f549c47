"""`pomona metric` and `pomona triangulate` as a user meets them: processes, files, exit codes."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from command_line import run
from model_maker import Model
from pomona import FruitCloud, PomonaError
from pomona.free_scale import metric
from pomona.orchard import add_session, read_session
from pomona.reconstruction import open_reconstruction
from posed_row import PosedRow, posed_row

DAY = ("--date", "2024-08-09")


@pytest.fixture(scope="module")
def row() -> PosedRow:
    return posed_row(1)


@pytest.fixture
def given(row: PosedRow, tmp_path: Path) -> tuple[Path, Path, Path]:
    """A model, a map and boxes."""
    model = row.model.write(tmp_path / "model", "binary")
    return model, row.write_map(tmp_path / "map.csv"), row.write_boxes(tmp_path / "boxes.csv")


def test_a_model_becomes_metric_where_the_map_is(row, given, tmp_path):
    model, orchard, boxes = given
    done = run("metric", model, orchard, "--detections", boxes, "-o", tmp_path / "metres", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["scale"] == pytest.approx(row.scale, rel=0.005)
    assert told["interval_90"][0] < row.scale < told["interval_90"][1]
    assert 0 < told["sigma"] < 0.005 * row.scale
    after = open_reconstruction(tmp_path / "metres")
    found = np.array([np.linalg.inv(after.camera_from_model(image)) for image in after.images.values()])
    true = np.linalg.inv(row.camera_from_map)
    assert np.linalg.norm(found[:, :3, 3] - true[:, :3, 3], axis=1).max() < 0.01
    assert np.abs(found[:, :3, :3] - true[:, :3, :3]).max() < 0.01
    assert json.loads((tmp_path / "metres" / "metric.json").read_text())["scale"] == told["scale"]


def test_text_with_rigs_and_boxes_by_picture_say_the_same(row, given, tmp_path):
    layout = row.model
    layout.rigs = True
    layout.write(tmp_path / "text", "text")
    boxes = row.write_boxes(tmp_path / "named.csv", by="image")
    done = run("metric", tmp_path / "text", given[1], "--detections", boxes, "-o", tmp_path / "metres")
    assert done.returncode == 0, done.stderr
    assert "metres a unit" in done.stdout
    assert {file.name for file in (tmp_path / "metres").iterdir()} == {
        *(f"{name}.txt" for name in ("cameras", "images", "points3D", "rigs", "frames")),
        "metric.json",
    }
    scale = json.loads((tmp_path / "metres" / "metric.json").read_text())["scale"]
    assert scale == pytest.approx(row.scale, rel=0.005)


def test_no_match_is_a_result_and_nothing_is_written(given, tmp_path):
    model, _, boxes = given
    other = posed_row(8).write_map(tmp_path / "other.csv")
    done = run("metric", model, other, "--detections", boxes, "-o", tmp_path / "metres")
    assert done.returncode == 1
    assert done.stderr == ""
    assert "NoMatch" in done.stdout
    assert not (tmp_path / "metres").exists()


def test_a_folder_that_is_there_is_left_alone(given, tmp_path):
    model, orchard, boxes = given
    before = {file.name: file.read_bytes() for file in model.iterdir()}
    (tmp_path / "kept").mkdir()
    for output in (model, tmp_path / "kept"):
        for force in ((), ("--force",)):
            done = run("metric", model, orchard, "--detections", boxes, "-o", output, *force)
            assert done.returncode == 2
            assert done.stderr.count("\n") == 1
    assert {file.name: file.read_bytes() for file in model.iterdir()} == before
    assert not list((tmp_path / "kept").iterdir())


def test_a_session_with_a_map_is_in_its_metres_and_a_map_takes_it(row, given, tmp_path):
    model, orchard, boxes = given
    session = tmp_path / "visit.gpkg"
    done = run("triangulate", model, "--detections", boxes, "--map", orchard, "-o", session, *DAY)
    assert done.returncode == 0, done.stderr
    found = read_session(session)
    assert not found.is_scale_free
    distances = np.linalg.norm(found.cloud.positions[:, None] - row.positions[None], axis=2)
    assert np.median(distances.min(axis=1)) < 0.01
    sizes = found.cloud.diameters_m / row.diameters_m[distances.argmin(axis=1)]
    assert np.median(np.abs(sizes - 1)) < 0.05
    assert found.cloud.covariances is not None
    assert len(found.trajectory) == len(row.camera_from_map)
    away = found.trajectory.session_from_camera[:, :3, 3] - np.linalg.inv(row.camera_from_map)[:, :3, 3]
    assert np.abs(away).max() < 0.01
    assert found.configuration["scan"]["scale"]["scale"] == pytest.approx(row.scale, rel=0.005)
    assert run("map", "add", tmp_path / "orchard.gpkg", session).returncode == 0


def test_a_session_without_a_scale_says_so_and_no_map_takes_it(row, given, tmp_path):
    model, orchard, boxes = given
    session = tmp_path / "free.gpkg"
    done = run("triangulate", model, "--detections", boxes, "-o", session, *DAY)
    assert done.returncode == 0, done.stderr
    assert "without a scale" in done.stdout
    found = read_session(session)
    assert found.is_scale_free
    assert found.cloud.diameters_m is None
    sizes = np.array(found.cloud.extras["diameter_model_units"], float) * row.scale
    assert np.median(sizes) == pytest.approx(np.median(row.diameters_m), rel=0.05)
    added = run("map", "add", tmp_path / "orchard.gpkg", session)
    assert added.returncode == 2
    assert "without a scale" in added.stderr
    assert not (tmp_path / "orchard.gpkg").exists()
    with pytest.raises(PomonaError, match="without a scale"):
        add_session(tmp_path / "orchard.gpkg", found)
    with pytest.raises(PomonaError, match="only a match with --scale free takes it"):
        FruitCloud.read(session)
    matched = run("match", session, orchard, "--scale", "free", "--json")
    assert json.loads(matched.stdout)["scale"] == pytest.approx(row.scale, rel=0.005)


def test_boxes_with_ids_name_the_fruits(row, given, tmp_path):
    boxes = row.write_boxes(tmp_path / "named.csv", ids=True)
    done = run("triangulate", given[0], "--detections", boxes, "-o", tmp_path / "named.gpkg", *DAY)
    assert done.returncode == 0, done.stderr
    names = read_session(tmp_path / "named.gpkg").cloud.ids
    assert names
    assert all(name.startswith("fruit") for name in names)


def test_a_detector_looks_at_the_pictures(row, given, tmp_path):
    import cv2

    pictures = tmp_path / "pictures" / "cam"
    pictures.mkdir(parents=True)
    for number in range(len(row.boxes_px)):
        cv2.imwrite(str(pictures / f"{number:04d}.png"), np.full((480, 640, 3), (40, 120, 30), np.uint8))
    (pictures / "0003.png").write_bytes(b"no picture")
    looked = ("--pictures", tmp_path / "pictures", "--model", "shipped")
    done = run("triangulate", given[0], *looked, "-o", tmp_path / "none.gpkg", *DAY)
    assert done.returncode == 0, done.stderr
    assert "0 fruits triangulated from 0 of 0 boxes, 1 picture skipped" in done.stdout


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("none", "found no boxes, expected --detections FILE, or --pictures DIR"),
        ("unknown picture", "image: found 'cam/9999.png', which is no picture there"),
        ("unknown frame", "frame: found 9999, expected a frame there is"),
        ("one picture", "found one picture, expected two"),
        ("no pictures", "not found, expected the folder of the model's pictures"),
        ("no csv", "expected .gpkg"),
    ],
)
def test_wrong_input_is_one_line(row, given, tmp_path, change, said):
    model, _, boxes = given
    arguments: list[object] = ["--detections", boxes]
    output = tmp_path / ("out.csv" if change == "no csv" else "out.gpkg")
    if change == "none":
        arguments = []
    elif change.startswith("unknown"):
        by, key = ("image", "cam/9999.png") if change == "unknown picture" else ("frame", "9999")
        with row.write_boxes(boxes, by=by).open("a", newline="") as file:
            csv.writer(file).writerow([key, 1, 1, 5, 5])
    elif change == "one picture":
        Model(["cam/0000.png"], row.camera_from_model[:1]).write(model, "binary")
        boxes.write_text("frame,xmin,ymin,xmax,ymax\n0,1,1,9,9\n")
    elif change == "no pictures":
        arguments += ["--pictures", tmp_path / "nowhere"]
    done = run("triangulate", model, *arguments, "-o", output, *DAY)
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert not output.exists()


def bent_pair(seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    """A row of 9 m, and the same with noise of 1 cm and a bend of 2 cm, in another unit."""
    rng = np.random.Generator(np.random.PCG64(seed))
    fruits = rng.uniform((0, 0, 0), (9.0, 1.0, 2.0), (140, 3))
    waves, phases = rng.normal(0, 1 / 1.5, (3, 50)), rng.uniform(0, 2 * np.pi, (3, 50))
    bend = 0.02 * np.sqrt(2 / 50) * np.cos(fruits[:, :1, None] * waves + phases).sum(axis=2)
    units_per_m = float(np.exp(rng.uniform(-2, 2)))
    seen = (fruits + bend + rng.normal(0, 0.01, (140, 3)))[rng.permutation(140)[:110]]
    return units_per_m * seen[:, [2, 0, 1]], fruits, 1 / units_per_m


def test_the_interval_holds_the_scale_nine_times_of_ten_though_the_row_bends():
    inside, errors, sigmas = [], [], []
    for seed in range(30):
        query, known, scale = bent_pair(seed)
        found = metric(query, known, threads=1).scaling
        assert found is not None
        inside.append(found.low <= scale <= found.high)
        errors.append(found.scale / scale - 1)
        sigmas.append(found.sigma / found.scale)
    assert np.mean(inside) >= 0.8
    assert np.abs(errors).max() < 0.01
    assert 0.7 < np.sqrt(np.mean(np.square(np.array(errors) / sigmas))) < 1.4
