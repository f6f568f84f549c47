"""Trees found from the fruits, or given, and numbered along their row."""

import dataclasses
import json
import sqlite3
from datetime import date
from pathlib import Path

import numpy as np
import pyogrio
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from command_line import assert_refused, run
from pomona import FruitCloud, PomonaError, geopackage
from pomona.cli import app
from pomona.demo import run_demo
from pomona.growth.bearing_trees import as_counted, bearing_trees
from pomona.orchard import OrchardMap, Session, add_session, problems, remove_session
from pomona.orchard.given_trees import KnownTree
from pomona.orchard.map_trees import find_trees
from pomona.synth.living import RowDesign, grow
from pomona.synth.planting import RowShape
from pomona.synth.planting import grow_row as synth_row
from pomona.trajectory import Trajectory
from pomona.tree_rows import planting_of, row_lines
from pomona.tree_rows.numbering_of_trees import UNNUMBERED, numbers_along
from pomona.tree_rows.told_rows import told_rows
from pomona.tree_rows.tree_spacing import crowding

SHIPPED = Path(__file__).parents[1] / "examples" / "row" / "2024-08-09" / "fruits.csv"
TURN = Rotation.from_euler("xyz", [-90, 4, 3], degrees=True).as_matrix()
"""From a row with z up to a camera's frame: x right, y down, z forward."""


def grown_row(system: str, n_trees: int, spacing_m: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Fruits that a visit saw, three of four, and the tree of each."""
    design = RowDesign(
        system=system, n_trees=n_trees, spacing_m=spacing_m, fruits_per_tree=(60, 110), leaves_per_tree=20,
        row_behind=False, grass_blades_per_m2=0.0,
    )  # fmt: skip
    fruits = grow(design, seed).fruits_on(date(2024, 8, 20))
    rng = np.random.default_rng(seed)
    seen = rng.random(len(fruits.trees)) < 0.75
    return fruits.centres_m[seen] + rng.normal(0.0, 0.01, (seen.sum(), 3)), fruits.trees[seen]


@pytest.fixture(scope="module")
def spindles() -> tuple[np.ndarray, np.ndarray]:
    return grown_row("spindle", 8, 1.2, 1)


def visit(places: np.ndarray, day: str, seed: int = 0) -> Session:
    """A visit that drives along what it sees."""
    rng = np.random.default_rng(seed)
    low, high = places[:, 0].min(), places[:, 0].max()
    row_m = float(places[:, 1].mean())
    way = np.column_stack([np.linspace(low, high, 20), np.full(20, row_m - 1.7), np.full(20, 1.5)])
    poses = np.tile(np.eye(4), (20, 1, 1))
    poses[:, :3, 3] = way @ TURN.T
    cloud = FruitCloud((places + rng.normal(0.0, 0.004, places.shape)) @ TURN.T, diameters_m=np.full(len(places), 0.07))
    return Session(day, day, "drawn", cloud, Trajectory(np.arange(20), np.arange(20) * 0.1, poses))


def asked(path: Path, question: str) -> list[tuple[object, ...]]:
    with sqlite3.connect(path) as connection:
        answer = connection.execute(question).fetchall()
    connection.close()
    return answer


def share_right(path: Path, places: np.ndarray, trees: np.ndarray, spacing_m: float) -> float:
    """Share of the fruits whose tree in the map is the one that they hang on."""
    fruits = OrchardMap(path).fruits()
    in_row = fruits.positions @ TURN
    nearest = np.linalg.norm(in_row[:, None] - places, axis=2).argmin(axis=1)
    numbers = dict(asked(path, "SELECT name, number FROM trees"))
    told = np.array([numbers.get(name, -99) for name in fruits.extras["tree"]])
    wanted = trees[nearest]
    offset = np.bincount((wanted - told + 200)[told != -99]).argmax() - 200
    falls = np.bincount((wanted + told + 200)[told != -99]).argmax() - 200
    return float(max((wanted == told + offset).mean(), (wanted == falls - told).mean()))


@pytest.mark.parametrize(("n_trees", "spacing_m"), [(3, 0.8), (5, 1.2), (4, 2.0), (5, 3.0)])
def test_trees_of_a_row_are_found(n_trees: int, spacing_m: float) -> None:
    places, trees = grown_row("spindle", n_trees, spacing_m, 1)
    (line,) = row_lines(places, [np.column_stack([np.linspace(0, n_trees * spacing_m, 9), np.full((9, 2), 1.0)])])
    planting = planting_of(places[line.members], line.along_m, line.beside_m)
    assert planting.crowns is not None
    trunks = line.places(planting.crowns.places_m)[:, 0]
    np.testing.assert_allclose(trunks, np.arange(n_trees) * spacing_m, atol=0.1 * spacing_m)
    bearers, chances = planting.bearers(line.along_m, line.beside_m)
    assert (bearers == trees[line.members]).mean() >= 0.95
    # A fruit between two trunks is doubted, one beside a trunk is not.
    off = np.abs(line.along_m - planting.crowns.places_m[bearers]) / spacing_m
    assert chances[off < 0.1].min() > chances[off > 0.45].mean()


@pytest.mark.parametrize("system", ["wall", "cordon"])
def test_of_walls_no_tree_is_told(system: str) -> None:
    places, _ = grown_row(system, 5, 1.2, 1)
    (line,) = row_lines(places)
    planting = planting_of(places[line.members], line.along_m, line.beside_m)
    assert planting.crowns is None
    assert planting.log_odds < 0


@pytest.mark.parametrize("seed", [1, 3, 4])
def test_the_better_a_row_is_known_the_more_it_tells(seed: int) -> None:
    """Fruits that touch were counted as one: where most hang, in the crowns, all touched once they were known."""
    row = synth_row(np.random.default_rng(seed), 5, RowShape(fruits_per_tree=(240, 300)))
    way = np.column_stack([np.linspace(0, 6, 9), np.ones((9, 2))])
    chances = np.random.default_rng(seed).random(len(row))
    told = []
    for share in (0.3, 0.6, 1.0):
        places = row.positions[chances < share]
        (line,) = row_lines(places, [way])
        planting = planting_of(places, line.along_m, line.beside_m)
        assert planting.crowns is not None
        trunks = np.sort(line.places(planting.crowns.places_m)[:, 0])
        np.testing.assert_allclose(trunks, 1.2 * np.arange(5), atol=0.4)
        told.append(planting.log_odds)
    assert told[2] > 1.15 * told[0]


def test_fruits_of_a_cluster_are_no_independent_evidence() -> None:
    rng = np.random.default_rng(2)
    spurs = rng.uniform(0.0, [20.0, 1.0, 2.5], (300, 3))
    assert crowding(spurs) == pytest.approx(1.0, abs=0.15)
    fruits = (spurs[:, None] + rng.normal(0.0, 0.02, (300, 4, 3))).reshape(-1, 3)
    assert crowding(fruits) == pytest.approx(4.0, abs=0.6)
    # So four that hang together say no more than one.
    along_m, beside_m = fruits[:, 0], fruits[:, [2, 1]]
    one = planting_of(spurs, spurs[:, 0], spurs[:, [2, 1]])
    four = planting_of(fruits, along_m, beside_m)
    assert one.crowns is None
    assert four.crowns is None


def test_one_row_runs_where_it_is_longest() -> None:
    """The way in which its fruits cover least is off by more, and turned the trees of a row that nobody drove along."""
    off_degrees = []
    for seed in range(100, 106):
        places = synth_row(np.random.default_rng(seed), 5, RowShape()).positions
        ((line, _),) = told_rows(places)
        (end_on,) = row_lines(places)
        off_degrees.append([np.degrees(np.arccos(abs(one.direction[0]))) for one in (line, end_on)])
    longest, end_on_degrees = np.median(off_degrees, axis=0)
    assert longest < 4.0
    assert end_on_degrees > 1.5 * longest


def test_the_map_of_two_drawn_visits_has_the_trees_that_were_drawn(tmp_path: Path) -> None:
    """Of a third of its fruits one visit alone has seen, and they count: the map says that most are fruits."""
    demo = run_demo(tmp_path)
    fruits = OrchardMap(demo.orchard).fruits()
    seen_once = np.array(fruits.extras["n_sessions"]) == "1"
    assert seen_once.mean() > 0.4
    assert min(float(chance) for chance in fruits.extras["fruit_probability"]) > 0.5
    (row,) = find_trees(demo.orchard)
    assert (row.kind, len(row.trees), row.n_fruits) == ("trees", 5, len(fruits))
    assert row.spacing_m == pytest.approx(1.2, abs=0.1)
    assert bearing_trees(fruits).names == ("1", "2", "3", "4", "5")


def test_the_shipped_row_has_five_trees() -> None:
    cloud = FruitCloud.read(SHIPPED)
    assert cloud.ids is not None
    wanted = grow(RowDesign(n_trees=5, leaves_per_tree=20, row_behind=False), 20).crop.trees
    trees = wanted[np.array(cloud.ids, np.int64) - 1]
    told = bearing_trees(cloud)
    assert told.names == ("1", "2", "3", "4", "5")
    assert (told.numbers == trees).mean() >= 0.97


def test_rows_are_parted_whatever_their_frame(spindles: tuple[np.ndarray, np.ndarray]) -> None:
    places, _ = spindles
    turn = Rotation.from_euler("zyx", [40, 10, 80], degrees=True).as_matrix()
    field = np.concatenate([places + np.array([0.0, 3.5 * row, 0.0]) for row in range(3)])
    rng = np.random.default_rng(0)
    strays = rng.uniform(field.min(axis=0), field.max(axis=0), (60, 3))
    lines = row_lines(np.concatenate([field, strays]) @ turn.T)
    assert len(lines) == 3
    for line in lines:
        inside = line.members[line.members < len(field)]
        assert len(set(inside // len(places))) == 1
        assert len(inside) >= 0.99 * len(places)
        assert abs(line.direction @ turn[:, 0]) > 0.999


def test_fruits_of_several_rows_know_their_row(tmp_path: Path) -> None:
    """Trees, and what is told of them, go row by row: of two that face each other one is not between the other's."""
    places = np.concatenate([foot + grown_row("spindle", 3, 1.2, 1)[0] for foot in ([0, 0, 0], [0.4, 3.5, 0])])
    path = tmp_path / "orchard.gpkg"
    add_session(path, visit(places, "2024-08-01"))
    assert "row" not in OrchardMap(path).fruits().extras
    assert len(find_trees(path)) == 2
    fruits = OrchardMap(path).fruits()
    across_m = (fruits.positions @ TURN)[:, 1]
    rows = np.array(fruits.extras["row"])
    assert set(rows) - {""} == {"row 1", "row 2"}
    assert min((rows[across_m < 1.75] == "row 1").mean(), (rows[across_m > 1.75] == "row 2").mean()) in (
        pytest.approx(0.0, abs=0.05), pytest.approx(1.0, abs=0.05),
    )  # fmt: skip
    assert bearing_trees(fruits).rows[:6] == ("row 1",) * 3 + ("row 2",) * 3
    assert sorted(["row 10", "row 2", "north"], key=as_counted) == ["north", "row 2", "row 10"]


def test_a_row_that_bends_is_unrolled() -> None:
    rng = np.random.default_rng(1)
    bend = np.arange(25) * 1.5
    feet = np.column_stack([60 * np.sin(bend / 60), 60 * (1 - np.cos(bend / 60)), 0 * bend])
    places = np.concatenate([foot + rng.normal(0, [0.3, 0.3, 0.6], (40, 3)) for foot in feet])
    (line,) = row_lines(places)
    planting = planting_of(places[line.members], line.along_m, line.beside_m)
    assert planting.crowns is not None
    assert len(planting.crowns.places_m) == 25
    np.testing.assert_allclose(np.diff(planting.crowns.places_m), 1.5, atol=0.15)
    off = np.linalg.norm((line.places(planting.crowns.places_m) - feet)[:, :2], axis=1)
    assert off.max() < 0.35


def test_numbers_count_places_and_stay() -> None:
    np.testing.assert_array_equal(numbers_along(np.array([0.0, 1.2, 3.6, 4.8]), 1.2), [1, 2, 4, 5])
    known = np.array([UNNUMBERED, 1, UNNUMBERED, 3])
    np.testing.assert_array_equal(numbers_along(np.array([0.0, 1.2, 2.4, 3.6]), 1.2, known), [0, 1, 2, 3])
    np.testing.assert_array_equal(
        numbers_along(np.array([0.0, 1.0, 2.0, 3.0]), 1.0, np.array([3, 2, UNNUMBERED, UNNUMBERED])), [3, 2, 1, 0]
    )


def test_numbers_stay_when_a_visit_sees_more(tmp_path: Path, spindles: tuple[np.ndarray, np.ndarray]) -> None:
    places, trees = spindles
    path = tmp_path / "orchard.gpkg"
    add_session(path, visit(places[np.isin(trees, [2, 3, 4, 5])], "2024-08-01"))
    (row,) = find_trees(path)
    assert [number for _, number, _ in row.trees] == [1, 2, 3, 4]
    before = dict(asked(path, "SELECT number, id FROM trees"))
    of_fruits = dict(asked(path, "SELECT id, tree_id FROM fruits"))
    assert add_session(path, visit(places, "2024-08-09", 1)).is_added
    # Fruits that are new beside trees of before have got theirs; the others wait for the next look.
    assert asked(path, "SELECT count(*) FROM fruits WHERE tree_id ISNULL")[0][0] > 0
    (row,) = find_trees(path)
    after = dict(asked(path, "SELECT number, id FROM trees"))
    assert before.items() <= after.items()
    assert len(after) == 8
    assert sorted(after) == list(range(min(after), min(after) + 8))
    now = dict(asked(path, "SELECT id, tree_id FROM fruits"))
    assert np.mean([now[fruit] == tree for fruit, tree in of_fruits.items()]) > 0.97
    assert share_right(path, places, trees, 1.2) >= 0.95
    assert problems(path) == []
    (row,) = find_trees(path, renumber=True)
    assert [number for _, number, _ in row.trees] == list(range(1, 9))


def test_a_map_keeps_its_trees_when_visits_come_and_go(tmp_path: Path, spindles: tuple[np.ndarray, np.ndarray]) -> None:
    places, _ = spindles
    path = tmp_path / "orchard.gpkg"
    rng = np.random.default_rng(5)
    add_session(path, visit(places[rng.random(len(places)) < 0.8], "2024-08-01"))
    find_trees(path)
    add_session(path, visit(places, "2024-08-09", 1))
    assert asked(path, "SELECT count(*) FROM fruits WHERE tree_id ISNULL") == [(0,)]
    counted = asked(path, "SELECT sum(n_fruits) FROM trees")
    assert counted == asked(path, "SELECT count(*) FROM fruits")
    assert remove_session(path, "2024-08-01") is not None
    assert problems(path) == []


def test_rows_that_are_parts_of_a_map_are_told_each_by_itself(
    tmp_path: Path, spindles: tuple[np.ndarray, np.ndarray]
) -> None:
    """How they lie to each other nobody knows: each is turned as its camera began."""
    path, places = tmp_path / "orchard.gpkg", spindles[0]
    other, _ = grown_row("spindle", 6, 1.5, 8)
    crosswise = other @ Rotation.from_euler("z", 70, degrees=True).as_matrix().T
    alone = []
    for number, row in enumerate((places, crosswise)):
        session = dataclasses.replace(visit(row, "2024-08-01"), name=f"row {number}", trajectory=None)
        add_session(tmp_path / f"{number}.gpkg", session)
        alone += find_trees(tmp_path / f"{number}.gpkg")
        assert add_session(path, session, new_part=True).is_added
    told = find_trees(path)
    assert [(row.kind, row.n_fruits, len(row.trees)) for row in told] == [
        (row.kind, row.n_fruits, len(row.trees)) for row in alone
    ]
    assert [row.spacing_m for row in told] == pytest.approx([row.spacing_m for row in alone], rel=1e-6)
    names = bearing_trees(OrchardMap(path).fruits()).names
    assert len(names) == sum(len(row.trees) for row in alone)


def test_trees_of_a_part_go_with_it_to_another_one(tmp_path: Path, spindles: tuple[np.ndarray, np.ndarray]) -> None:
    """The right end of a row lay elsewhere until a visit saw both."""
    places, trees = spindles
    path = tmp_path / "orchard.gpkg"
    is_left = trees <= np.unique(trees)[4]
    aside = np.array([-4.0, 0.0, 0.0])
    assert add_session(path, visit(places[is_left], "2024-08-01")).is_added
    assert add_session(path, visit(places[~is_left] + aside, "2024-08-02", 1), new_part=True).is_added
    assert [[number for _, number, _ in row.trees] for row in find_trees(path)] == [[1, 2, 3, 4, 5], [1, 2, 3]]
    of_fruits = dict(asked(path, "SELECT id, tree_id FROM fruits"))
    known = asked(path, "SELECT id FROM trees")
    assert add_session(path, visit(places, "2024-08-09", 2)).is_added
    now = dict(asked(path, "SELECT id, tree_id FROM fruits"))
    assert all(now[fruit] == tree for fruit, tree in of_fruits.items() if fruit in now)
    # Before anybody looks for trees anew each stands amid its fruits, and the line of its row runs by it.
    for tree_id, geom, line in asked(path, "SELECT t.id, t.geom, r.geom FROM trees t JOIN rows r ON r.id = t.row_id"):
        (place,) = geopackage.points_of([geom])
        hanging = geopackage.points_of(
            [one for (one,) in asked(path, f"SELECT geom FROM fruits WHERE tree_id = {tree_id}")]
        )
        assert np.abs(hanging.mean(axis=0) - place)[[0, 2]].max() < 0.3
        assert np.abs(geopackage.line_of(line) - place)[:, 2].min() < 0.3
    (row,) = find_trees(path)
    assert [name for name, _, _ in row.trees] == [f"1-{number}" for number in range(1, 9)]
    assert asked(path, "SELECT id FROM trees") == known
    assert problems(path) == []


def test_drawn_and_given_trees_are_taken_as_they_are(tmp_path: Path) -> None:
    places, trees = grown_row("wall", 4, 2.0, 3)
    path = tmp_path / "orchard.gpkg"
    add_session(path, visit(places, "2024-08-01"))
    (row,) = find_trees(path)
    assert (row.kind, row.trees) == ("none", ())
    feet = np.array([[2.0 * tree, 0.0, 1.2] for tree in range(4)]) @ TURN.T
    (row,) = find_trees(path, given=[KnownTree(f"Boskoop {tree}", foot) for tree, foot in enumerate(feet)])
    assert (row.kind, row.source) == ("trees", "given")
    assert sorted(name for name, _, _ in row.trees) == [f"Boskoop {tree}" for tree in range(4)]
    assert share_right(path, places, trees, 2.0) >= 0.93
    # They are known from then on; drawn ones too.
    (again,) = find_trees(path)
    assert again.trees == row.trees
    connection = geopackage.connect(path)
    connection.execute("UPDATE trees SET source = NULL, name = 'drawn' WHERE name = 'Boskoop 2'")
    connection.close()
    (drawn,) = find_trees(path)
    assert sorted(name for name, _, _ in drawn.trees) == ["Boskoop 0", "Boskoop 1", "Boskoop 3", "drawn"]
    assert asked(path, "SELECT count(*) FROM trees") == [(4,)]
    assert problems(path) == []


@pytest.mark.parametrize("n_trees", [2, 5])
def test_a_map_that_knows_no_trees_has_those_that_would_be_found(tmp_path: Path, n_trees: int) -> None:
    """The way of the cameras says where the row goes: of two trees nothing is told without."""
    places, _ = grown_row("spindle", n_trees, 1.2, 1)
    path = tmp_path / "orchard.gpkg"
    add_session(path, visit(places, "2024-08-01"))
    fruits = OrchardMap(path).fruits()
    told = bearing_trees(fruits)
    moved = bearing_trees(fruits.transformed(np.block([[TURN, np.ones((3, 1))], [np.zeros(3), 1.0]])))
    (row,) = find_trees(path)
    assert len(row.trees) == n_trees
    wanted = sorted(n_fruits for _, _, n_fruits in row.trees)
    for trees in (told, moved):
        assert sorted(np.bincount(trees.numbers[np.array(trees.of_fruits()) != ""])) == wanted


def test_walls_are_parted_into_segments(tmp_path: Path) -> None:
    places, _ = grown_row("wall", 5, 1.2, 1)
    path = tmp_path / "orchard.gpkg"
    add_session(path, visit(places, "2024-08-01"))
    (row,) = find_trees(path, segment_m=2.0)
    assert (row.kind, len(row.trees)) == ("segments", 3)
    assert sum(n_fruits for _, _, n_fruits in row.trees) == len(places)
    assert asked(path, "SELECT DISTINCT kind FROM trees") == [("segment",)]


def test_trees_that_sessions_name_are_taken(tmp_path: Path, spindles: tuple[np.ndarray, np.ndarray]) -> None:
    places, trees = spindles
    path = tmp_path / "orchard.gpkg"
    session = visit(places, "2024-08-01")
    named = dataclasses.replace(session.cloud, extras={"tree": tuple(f"T{tree}" for tree in trees)})
    add_session(path, dataclasses.replace(session, cloud=named))
    (row,) = find_trees(path)
    assert row.source == "given"
    assert sorted(name for name, _, _ in row.trees) == [f"T{tree}" for tree in range(8)]
    told = np.array(OrchardMap(path).fruits().extras["tree"])
    assert (told == named.extras["tree"]).mean() >= 0.95


# The verb.


@pytest.fixture
def orchard(tmp_path: Path, spindles: tuple[np.ndarray, np.ndarray]) -> Path:
    path = tmp_path / "orchard.gpkg"
    add_session(path, visit(spindles[0], "2024-08-01"))
    return path


def test_the_verb_tells_rows_and_trees(orchard: Path) -> None:
    result = CliRunner().invoke(app, ["map", "trees", str(orchard)])
    assert result.exit_code == 0, result.output
    first, *rest = result.stdout.splitlines()
    assert first.startswith("row 1: ")
    assert "8 trees, found, 1.2" in first
    assert len(rest) == 8
    assert rest[0].startswith("  1-1: ")
    (row,) = json.loads(CliRunner().invoke(app, ["map", "trees", str(orchard), "--json"]).stdout)
    assert (row["number"], row["kind"], len(row["trees"])) == (1, "trees", 8)


def test_given_trees_stay_until_they_are_forgotten(orchard: Path, tmp_path: Path) -> None:
    (found,) = find_trees(orchard)
    connection = geopackage.connect(orchard)
    place = connection.execute("SELECT geom FROM trees WHERE number = 1").fetchone()
    connection.close()
    (first,) = geopackage.points_of(place)
    (tmp_path / "trees.csv").write_text("name,x,y,z\nmine,{},{},{}\n".format(*first))

    def told(*arguments: str | Path) -> tuple[list[str], str]:
        done = run("map", "trees", orchard, *arguments)
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines(), done.stderr

    lines, warned = told("--trees", tmp_path / "trees.csv")
    assert "1 tree, given" in lines[0]
    # Fruits that hang nearer to no tree than the spacing allows are counted too.
    assert sum(int(line.split(": ")[1].split()[0]) for line in lines[1:]) == found.n_fruits
    assert warned == ""
    again, warned = told("--segments", "1", "--spacing", "1.2")
    assert again == lines
    assert warned == (
        "pomona: warning: --spacing and --segments: no effect in row 1, whose trees were given or drawn; "
        "--forget looks for trees where some were given\n"
    )
    anew, warned = told("--forget")
    assert warned == ""
    assert "8 trees, found" in anew[0]
    assert problems(orchard) == []


def test_gdal_draws_trees_and_rows(orchard: Path) -> None:
    find_trees(orchard)
    assert pyogrio.read_info(orchard, layer="trees")["features"] == 8
    bounds = pyogrio.read_info(orchard, layer="rows")["total_bounds"]
    window = (bounds[0] - 0.1, bounds[1] - 0.1, bounds[0] + 0.1, bounds[3] + 0.1)
    # The spatial index knows the line.
    assert len(pyogrio.raw.read(orchard, layer="rows", bbox=window)[2]) == 1


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ("x,y\n1,2\n", "found the header 'x,y', expected x,y,z of each tree"),
        ("x,y,z\n1,2,three\n", "line 2: z: found 'three', expected a number"),
        ("name,x,y,z\n", "found no trees, expected x,y,z"),
        ("name,x,y,z\nA,0,0,0\nA,1,0,0\n", "line 3: found tree 'A' a second time, expected each once"),
        ("name,x,y,z\nfar,900,0,0\n", "tree far: found it at 900, 0, 0, where no row of fruits is within 2 m"),
    ],
)
def test_a_table_that_cannot_be_is_refused_in_a_line(orchard: Path, tmp_path: Path, table: str, line: str) -> None:
    path = tmp_path / "trees.csv"
    path.write_text(table)
    before = orchard.read_bytes()
    assert_refused(run("map", "trees", orchard, "--trees", path), line)
    assert orchard.read_bytes() == before


def test_a_length_that_cannot_be_is_refused(orchard: Path) -> None:
    with pytest.raises(PomonaError, match=r"^--spacing: found 0.1 m, expected 0.65 to 43$"):
        find_trees(orchard, spacing_m=0.1)
