"""Clouds as PLY: ascii and binary, texts in comments, wrong files named."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pomona import FruitCloud, PomonaError

HEADER = "ply\nformat {kind} 1.0\nelement vertex {n}\nproperty float x\nproperty float y\nproperty float z\n"


def write(folder: Path, text: str) -> Path:
    path = folder / "fruits.ply"
    path.write_bytes(text.encode())
    return path


def ascii_ply(n: int, rows: str, more: str = "") -> str:
    return HEADER.format(kind="ascii", n=n) + more + "end_header\n" + rows


def test_everything_but_the_sightings_reads_back_the_same(tmp_path: Path, full_cloud: FruitCloud) -> None:
    cloud = full_cloud
    cloud.write(tmp_path / "a.ply")
    back = FruitCloud.read(tmp_path / "a.ply")
    np.testing.assert_array_equal(back.positions, cloud.positions)
    np.testing.assert_array_equal(back.covariances, cloud.covariances)
    np.testing.assert_array_equal(back.diameters_m, cloud.diameters_m)
    np.testing.assert_array_equal(back.n_views, cloud.n_views)
    assert back.ids == cloud.ids
    assert back.extras == cloud.extras


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ids=st.lists(st.one_of(st.text(min_size=1), st.integers(0, 10**12).map(str)), unique=True, max_size=4))
def test_any_ids_read_back_the_same(tmp_path: Path, ids: list[str]) -> None:
    cloud = FruitCloud(np.zeros((len(ids), 3)), ids=tuple(ids))
    cloud.write(tmp_path / "a.ply")
    read = FruitCloud.read(tmp_path / "a.ply").ids
    assert read == cloud.ids or (read is None and not ids)


def test_whole_numbers_as_ids_are_a_property_that_other_programs_see(tmp_path: Path) -> None:
    FruitCloud(np.zeros((2, 3)), ids=("7", "2118")).write(tmp_path / "a.ply")
    head, _, points = (tmp_path / "a.ply").read_bytes().partition(b"end_header\n")
    assert b"property int id\n" in head
    assert struct.unpack("<i3di3d", points) == (7, 0, 0, 0, 2118, 0, 0, 0)


def test_reads_ascii_of_other_programs(tmp_path: Path) -> None:
    faces = "element face 1\nproperty list uchar int vertex_indices\n"
    text = ascii_ply(2, "1 2 3 255\n4 5 6 0\n3 0 1 1\n", "property uchar red\n" + faces)
    cloud = FruitCloud.read(write(tmp_path, text))
    np.testing.assert_array_equal(cloud.positions, [[1, 2, 3], [4, 5, 6]])
    assert cloud.extras == {"red": ("255", "0")}


@pytest.mark.parametrize(("kind", "order"), [("binary_little_endian", "<"), ("binary_big_endian", ">")])
def test_reads_binary_of_other_programs(tmp_path: Path, kind: str, order: str) -> None:
    head = HEADER.format(kind=kind, n=2) + "property uchar red\nend_header\n"
    path = tmp_path / "fruits.ply"
    path.write_bytes(head.encode() + struct.pack(f"{order}3fB3fB", 1, 2, 3, 9, 4, 5, 6, 8))
    cloud = FruitCloud.read(path)
    np.testing.assert_array_equal(cloud.positions, [[1, 2, 3], [4, 5, 6]])
    assert cloud.extras == {"red": ("9", "8")}


def test_no_vertices_is_a_cloud_without_fruits(tmp_path: Path) -> None:
    assert len(FruitCloud.read(write(tmp_path, ascii_ply(0, "")))) == 0
    FruitCloud(np.empty((0, 3))).write(tmp_path / "none.ply")
    assert len(FruitCloud.read(tmp_path / "none.ply")) == 0


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "line 1: is not a PLY file, expected 'ply'"),
        ("x,y,z\n1,2,3\n", "line 1: is not a PLY file, expected 'ply'"),
        ("ply\nformat ascii 1.0\n", "line 3: the file ends inside the header, expected 'end_header'"),
        (
            "ply\nformat utf8 1.0\n",
            "line 2: found 'format utf8 1.0', expected a PLY header with scalar vertex properties",
        ),
        (
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int x\n",
            "line 4: found 'property list uchar int x', expected a PLY header with scalar vertex properties",
        ),
        (
            "ply\nformat ascii 1.0\nelement face 1\nend_header\n",
            "expected a format line and 'element vertex' as the first element",
        ),
        (
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n",
            "header: found columns 'x' without y,z, expected at least x,y,z",
        ),
        (ascii_ply(2, "1 2 3\n"), "the file ends after 1 vertices, expected 2"),
        (ascii_ply(1, "1 2b 3\n"), "line 8 (row 0), property y: found '2b', expected a number"),
        (ascii_ply(2, "1 2 3\n1 2\n"), "line 9 (row 1): found 2 values, expected 3 as in the header"),
        (ascii_ply(1, "1 nan 3\n"), "row 0, property y: found nan, expected a finite number"),
        (ascii_ply(1, "1 2 3\n", "comment text id 0 a\n"), "line 7: found 'a', expected a quoted text"),
        (
            ascii_ply(1, "1 2 3\n", 'comment text id 0 "\\ud800"\n'),
            r"line 7: found '\ud800', expected characters of Unicode",
        ),
        (
            ascii_ply(1, "1 2 3\n", 'comment text id 0 ""\n'),
            "ids: row 0 is empty, expected a name for every fruit or no ids",
        ),
        (
            ascii_ply(2, "1 2 3\n4 5 6\n", 'comment text id 0 "a"\n'),
            "comments name id of 1 fruits, expected 2, one a fruit",
        ),
        (
            ascii_ply(1, "1 2 3 66\n", "property float diameter_m\n"),
            "row 0, property diameter_m: found 66.0, expected a positive number or nan, at most 1 m",
        ),
        (
            ascii_ply(1, "1 2 3 0\n", "property float diameter_m\n"),
            "row 0, property diameter_m: found 0.0, expected a positive number or nan, at most 1 m",
        ),
    ],
)
def test_names_what_is_wrong(tmp_path: Path, text: str, line: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(PomonaError) as caught:
        FruitCloud.read(path)
    assert str(caught.value) == f"{path}: {line}"


def test_a_binary_file_cut_short_is_named(tmp_path: Path, full_cloud: FruitCloud) -> None:
    path = tmp_path / "a.ply"
    full_cloud.write(path)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(PomonaError, match="the file ends after 5 vertices, expected 6"):
        FruitCloud.read(path)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    ids=st.lists(
        st.text(st.characters(exclude_categories=("Cs",)), min_size=1, max_size=4) | st.sampled_from(["-0", "0", "00"]),
        unique=True,
        min_size=1,
        max_size=4,
    )
)
def test_any_id_reads_back_the_same(tmp_path: Path, ids: list[str]) -> None:
    FruitCloud(np.eye(len(ids), 3), ids=tuple(ids)).write(tmp_path / "a.ply")
    assert FruitCloud.read(tmp_path / "a.ply").ids == tuple(ids)


def test_counts_beyond_32_bits_are_not_cut(tmp_path: Path) -> None:
    for counts in ([1, 2**31], [7, 2**53], [0, 2**31 - 1]):
        FruitCloud(np.eye(2, 3), n_views=np.array(counts)).write(tmp_path / "a.ply")
        back = FruitCloud.read(tmp_path / "a.ply").n_views
        assert back is not None
        assert back.tolist() == counts


def test_no_text_is_longer_than_a_line_of_the_header(tmp_path: Path) -> None:
    """Neither written nor read: the rest of such a line would be taken for the next one."""
    path = tmp_path / "a.ply"
    with pytest.raises(PomonaError, match="column note, row 0: found a text of 65536 characters, expected less"):
        FruitCloud(np.eye(1, 3), extras={"note": ("a" * 65_536,)}).write(path)
    assert not path.exists()
    long = f"comment {'a' * 65_528}element face 1\n"
    write(tmp_path, ascii_ply(1, "1 2 3\n", long))
    with pytest.raises(PomonaError, match="line 7: found a line of more than 65536 bytes, expected a PLY header"):
        FruitCloud.read(tmp_path / "fruits.ply")
    text = "a" * 65_000
    FruitCloud(np.eye(1, 3), extras={"note": (text,)}).write(path)
    assert FruitCloud.read(path).extras == {"note": (text,)}


def test_a_column_that_ply_cannot_name_is_refused(tmp_path: Path) -> None:
    cloud = FruitCloud(np.zeros((1, 3)), extras={"two words": ("1",)})
    with pytest.raises(PomonaError, match="column 'two words' cannot be named in a PLY header"):
        cloud.write(tmp_path / "a.ply")
    assert not list(tmp_path.iterdir())


def test_real_clouds_read_back_the_same(shared_data: Path, tmp_path: Path) -> None:
    cloud = FruitCloud.read(shared_data / "kinect_apples" / "121804_fruits.csv")
    cloud.write(tmp_path / "a.ply")
    back = FruitCloud.read(tmp_path / "a.ply")
    np.testing.assert_array_equal(back.positions, cloud.positions)
    assert back.ids == cloud.ids
