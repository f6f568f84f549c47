"""Clouds as CSV: read back the same, wrong cells named, both readers agree."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pomona import FruitCloud, PomonaError, PomonaWarning
from pomona.cloud import csv_file
from refusal import refused_of


def write(folder: Path, text: str) -> Path:
    path = folder / "fruits.csv"
    path.write_text(text, encoding="utf-8", newline="")
    return path


def refusal(folder: Path, text: str) -> str:
    """The one line after the name of the file."""
    return refused_of(write(folder, text), FruitCloud.read)


def test_everything_but_the_sightings_reads_back_the_same(tmp_path: Path, full_cloud: FruitCloud) -> None:
    cloud = full_cloud
    cloud.write(tmp_path / "a.csv")
    back = FruitCloud.read(tmp_path / "a.csv")
    np.testing.assert_array_equal(back.positions, cloud.positions)
    np.testing.assert_array_equal(back.covariances, cloud.covariances)
    np.testing.assert_array_equal(back.diameters_m, cloud.diameters_m)
    np.testing.assert_array_equal(back.n_views, cloud.n_views)
    assert back.ids == cloud.ids
    assert back.extras == cloud.extras
    back.write(tmp_path / "b.csv")
    assert (tmp_path / "b.csv").read_bytes() == (tmp_path / "a.csv").read_bytes()


TEXT = st.text(st.characters(exclude_categories=("Cs",)) | st.sampled_from('\r\n", \t\0'), max_size=4)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ids=st.lists(TEXT.filter(bool), unique=True, min_size=1, max_size=4), note=TEXT, unknown=st.booleans())
def test_any_text_reads_back_the_same(tmp_path: Path, ids: list[str], note: str, unknown: bool) -> None:
    """By both readers: of numbers that are all known, and with a blank among them."""
    n, path = len(ids), tmp_path / "fruits.csv"
    cloud = FruitCloud(
        np.eye(n, 3),
        ids=tuple(ids),
        diameters_m=np.full(n, np.nan if unknown else 0.07),
        extras={"note": (note,) * n, 'a\r"b': (note,) * n},
    )
    cloud.write(path)
    back = FruitCloud.read(path)
    assert (back.ids, back.extras) == (cloud.ids, cloud.extras)


def test_a_carriage_return_in_a_cell_begins_no_row(tmp_path: Path) -> None:
    path = write(tmp_path, 'id,x,y,z\r\n"a\rb",1,2,3\r\n"c\r\nd",1,2,4\r\n')
    cloud = FruitCloud.read(path)
    assert cloud.ids == ("a\rb", "c\r\nd")
    cloud.write(path)
    assert path.read_bytes() == b'id,x,y,z\n"a\rb",1.0,2.0,3.0\n"c\r\nd",1.0,2.0,4.0\n'


def test_columns_come_in_any_order_and_others_are_kept(tmp_path: Path) -> None:
    text = '\ufeffnote, z,y,x,id\r\n"red, ""small""",3,2,1,7\r\n\r\n,6,5,4,8\r\n'
    cloud = FruitCloud.read(write(tmp_path, text))
    np.testing.assert_array_equal(cloud.positions, [[1, 2, 3], [4, 5, 6]])
    assert cloud.ids == ("7", "8")
    assert cloud.extras == {"note": ('red, "small"', "")}


def test_a_header_alone_is_a_cloud_without_fruits(tmp_path: Path) -> None:
    assert len(FruitCloud.read(write(tmp_path, "id,x,y,z\n"))) == 0


def test_a_blank_diameter_is_unknown(tmp_path: Path) -> None:
    cloud = FruitCloud.read(write(tmp_path, "x,y,z,diameter_m\n0,0,0,\n1,1,1,0.07\n2,2,2,nan\n"))
    assert cloud.diameters_m is not None
    np.testing.assert_array_equal(cloud.diameters_m, [np.nan, 0.07, np.nan])


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "the file is empty, expected a header with x,y,z"),
        ("\n \n", "the file is empty, expected a header with x,y,z"),
        ("1,2,3\n4,5,6\n", "line 1: found columns '1,2,3' without x,y,z, expected at least x,y,z"),
        ("X,y,z\n", "line 1: found columns 'X,y,z' without x, expected at least x,y,z, in small letters"),
        ("x,y,z,x\n", "line 1: column 'x' is there twice, expected each name once"),
        (
            "x,y,z,cxx\n",
            "line 1: found a covariance without cyy,czz,cxy,cxz,cyz, expected cxx,cyy,czz,cxy,cxz,cyz",
        ),
        ("x,y,z\n1,2,3\n\n1,2b,3\n", "line 4 (row 1), column y: found '2b', expected a number"),
        ("x,y,z\n1,2,3\n1,2,nan\n", "line 3 (row 1), column z: found 'nan', expected a finite number"),
        ("x,y,z\n-inf,2,3\n", "line 2 (row 0), column x: found '-inf', expected a finite number"),
        ("x,y,z\n1,,3\n", "line 2 (row 0), column y: found '', expected a number"),
        ("x,y,z\n1,1_0,3\n", "line 2 (row 0), column y: found '1_0', expected a number"),
        ("x,y,z\n1,2\n", "line 2: found 2 cells, expected 3 as in the header"),
        ("x,y,z\n1,2,3,4\n", "line 2: found 4 cells, expected 3 as in the header"),
        (
            "x;y;z\n1;2;3\n",
            "line 1: found columns 'x;y;z' without x,y,z, expected at least x,y,z, separated by commas and not by "
            "semicolons, with decimal points",
        ),
        ("X,Y,Z\n1,2,3\n", "line 1: found columns 'X,Y,Z' without x,y,z, expected at least x,y,z, in small letters"),
        ("id,x,y,z\na,1,2,3\nb,1,2,3\na,4,5,6\n", "line 4, column id: found 'a' as in line 2, expected each id once"),
        (
            "id,x,y,z\n,1,2,3\n",
            "line 2, column id: found nothing, expected a name for every fruit or no column id",
        ),
        (
            "x,y,z,diameter_m\n1,2,3,-1\n",
            "line 2 (row 0), column diameter_m: found '-1', expected a positive number or nothing",
        ),
        (
            "x,y,z,diameter_m\n1,2,3,0.066\n4,5,6,66\n",
            "line 3 (row 1), column diameter_m: found '66', expected at most 1 m or nothing",
        ),
        (
            "cxx,x,y,z,cyy,czz,cxy,cxz,cyz\n1,1,2,3,1,1,0,0,0\n\n1,1,2,3,1,1,2,0,0\n",
            "line 4 (row 1), columns cxx,cyy,czz,cxy,cxz,cyz: found a matrix that is not positive semi-definite, "
            "expected a covariance",
        ),
        (
            "diameter_m,x,y,z,cxx,cyy,czz,cxy,cxz,cyz\n,1,2,3,-1,1,1,0,0,0\n",
            "line 2 (row 0), columns cxx,cyy,czz,cxy,cxz,cyz: found a matrix that is not positive semi-definite, "
            "expected a covariance",
        ),
        ("x,y,z,n_views\n1,2,3,-1\n", "line 2 (row 0), column n_views: found '-1', expected 0 or more"),
        ("x,y,z,n_views\n1,2,3,1.5\n", "line 2 (row 0), column n_views: found '1.5', expected a whole number"),
    ],
)
def test_names_what_is_wrong(tmp_path: Path, text: str, line: str) -> None:
    assert refusal(tmp_path, text) == line


def test_refuses_what_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "picture.csv"
    path.write_bytes(b"x,y,z\n\xff\xfe\n")
    with pytest.raises(PomonaError, match="byte 6 is not UTF-8, expected a text file"):
        FruitCloud.read(path)


def test_refuses_a_missing_file_and_an_unknown_suffix(tmp_path: Path, full_cloud: FruitCloud) -> None:
    with pytest.raises(PomonaError, match=r"absent\.csv: not found, expected a fruit cloud"):
        FruitCloud.read(tmp_path / "absent.csv")
    with pytest.raises(PomonaError, match=r"found suffix '.xyz', expected .csv, .ply or .gpkg"):
        FruitCloud.read(tmp_path / "fruits.xyz")
    with pytest.raises(PomonaError, match=r"found suffix '.txt', expected .csv or .ply"):
        full_cloud.write(tmp_path / "fruits.txt")


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = write(tmp_path, "x,y,z\n1,2,3\n")
    cloud = FruitCloud(np.zeros((1, 3)), extras={"x": ("1",)})
    with pytest.raises(PomonaError, match="extras: found the name 'x'"):
        cloud.write(path)
    twice = FruitCloud(np.zeros((1, 3)), extras={"note ": ("1",), "note": ("1",)})  # readers strip the names
    with pytest.raises(PomonaError, match=f"^{path}: column 'note' is there twice, expected each name once"):
        twice.write(path)
    many = FruitCloud(np.zeros((1, 3)), extras={f"note {number}": ("1",) for number in range(1000)})
    with pytest.raises(PomonaError, match="found 1003 columns, expected at most 1000"):
        many.write(path)
    assert path.read_text() == "x,y,z\n1,2,3\n"
    assert list(tmp_path.iterdir()) == [path]


CELLS = st.sampled_from(
    ["1", "2.5", "-3e-2", " 4 ", "nan", "", "1_0", "b", "0x1", '"7"', '"8', "é", "1 2", "+5", "inf"]
)


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rows=st.lists(st.lists(CELLS, min_size=4, max_size=5), max_size=4), end=st.sampled_from(["\n", "\r\n"]))
def test_the_fast_reader_agrees_with_the_one_of_cells(tmp_path: Path, rows: list[list[str]], end: str) -> None:
    names = ["id", "x", "diameter_m", "note"]
    path = write(tmp_path, "".join(",".join(row) + end for row in [names, *rows]))
    with csv_file._opened(path) as file:
        fast = csv_file._read_table(file, names, 1)
    if fast is None:
        return
    with csv_file._opened(path) as file:
        slow = csv_file._read_cells(path, file, names, 1)
    for name in names:
        np.testing.assert_array_equal(list(fast[name]), list(slow[name]))


def test_warns_of_millimetres_and_reads_them_when_told(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    metres = FruitCloud(rng.uniform(0, 2, (50, 3)), covariances=np.tile(1e-4 * np.eye(3), (50, 1, 1)))
    millimetres = FruitCloud(1000 * metres.positions, covariances=np.tile(100.0 * np.eye(3), (50, 1, 1)))
    path = tmp_path / "mm.csv"
    millimetres.write(path)
    with pytest.warns(PomonaWarning, match="m apart .median., expected 0.005 to 5 m; .* --unit mm"):
        FruitCloud.read(path)
    read = FruitCloud.read(path, unit="mm")
    np.testing.assert_allclose(read.positions, metres.positions, rtol=1e-12)
    np.testing.assert_allclose(read.covariances, metres.covariances, rtol=1e-12)
    assert FruitCloud.read(path, unit="free").positions.max() > 1000
    with pytest.raises(PomonaError, match="unit: found 'feet', expected one of m, cm, mm, free"):
        FruitCloud.read(path, unit="feet")  # type: ignore[arg-type]


def test_warns_of_metres_given_as_kilometres(tmp_path: Path) -> None:
    path = tmp_path / "km.csv"
    FruitCloud(np.random.default_rng(0).uniform(0, 0.002, (50, 3))).write(path)
    with pytest.warns(PomonaWarning, match="expected 0.005 to 5 m"):
        FruitCloud.read(path)


def test_real_clouds_are_read_without_a_warning(shared_data: Path) -> None:
    for path in sorted((shared_data / "kinect_apples").glob("*_fruits.csv")):
        cloud = FruitCloud.read(path)
        assert 25 <= len(cloud) <= 28
        assert cloud.ids is not None
        assert "2118" in cloud.ids


def test_a_real_cloud_in_millimetres_is_warned_of(shared_data: Path) -> None:
    path = shared_data / "clouds" / "fuji_row_a_centroids_mm.csv"
    with pytest.warns(PomonaWarning, match="96 m apart"):
        FruitCloud.read(path)
    assert set(FruitCloud.read(path, unit="mm").extras) == {"extent_mm", "npts"}


def test_two_million_points_take_the_fast_path(tmp_path: Path) -> None:
    # Speed is not tested; that numpy reads it all, and what it cannot read is told, is.
    n = 2_000_000
    path = tmp_path / "big.csv"
    line = "{0}.25,{1}.5,0.125\n"
    with path.open("w") as file:
        file.write("x,y,z\n")
        file.writelines(line.format(row % 2000, row // 2000) for row in range(n))
    with csv_file._opened(path) as file:
        table = csv_file._read_table(file, ["x", "y", "z"], 1)
    assert table is not None
    cloud = FruitCloud.read(path)
    assert len(cloud) == n
    np.testing.assert_array_equal(cloud.positions[-1], [1999.25, 999.5, 0.125])


def test_a_fruit_whose_squared_distance_is_no_number_is_told_by_its_row(tmp_path: Path) -> None:
    """And by nothing else: warnings of numpy are errors here."""
    rows = "".join(f"{0.1 * i},{0.1 * (i % 3)},0\n" for i in range(20))
    path = write(tmp_path, f"x,y,z\n{rows}1e300,0,0\n")
    with pytest.warns(PomonaWarning, match="row 20: found a fruit 1e.300 m from the middle of all"):
        assert len(FruitCloud.read(path)) == 21
