"""The parts of a survey as files: the longest under the name that was asked for, none without fruits."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from pomona.cli.scan_output import as_lines, summary
from pomona.cloud import FruitCloud
from pomona.errors import PomonaWarning
from pomona.orchard import load_session
from pomona.recording import Recording, open_recording
from pomona.survey import Boxes, Part, Survey, write_stages, write_survey
from pomona.trajectory import Trajectory
from recording_maker import make_recording


def survey(*sizes: tuple[int, int]) -> Survey:
    """Parts of so many frames and fruits each, one after the other."""
    parts, first = [], 0
    for n_frames, n_fruits in sizes:
        frames = np.arange(first, first + n_frames)
        first += n_frames
        cloud = FruitCloud(
            np.random.default_rng(first).uniform(0, 3, (n_fruits, 3)), diameters_m=np.full(n_fruits, 0.07)
        )
        poses = np.tile(np.eye(4), (n_frames, 1, 1))
        boxes = Boxes(np.empty(0, np.int64), np.empty((0, 4)), np.empty(0), np.empty(0, np.int64))
        parts.append(
            Part(cloud, Trajectory(frames, frames / 10, poses), boxes, "covered" if first > n_frames else None)
        )
    return Survey(tuple(parts), 100, Counter())


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    return open_recording(make_recording(tmp_path / "R"))


def written(output: Path, found: Survey, recording: Recording) -> dict[int, str]:
    about = {"name": "row", "date": "2024-08-09", "configuration": {}, "inputs": []}
    return {number: path.name for number, path in write_survey(output, found, recording, **about).items()}  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("sizes", "longest"),
    [
        ([(5, 3)], 0),
        ([(5, 3), (9, 2)], 1),  # the most frames
        ([(5, 3), (5, 4), (5, 4)], 1),  # then the most fruits, then the first
        ([(9, 0), (5, 3), (2, 9)], 1),  # of those with fruits
        ([(5, 0), (9, 0)], 1),  # where there are any
    ],
)
def test_the_longest_part_has_the_name_that_was_asked_for(
    tmp_path: Path, recording: Recording, sizes: list[tuple[int, int]], longest: int
) -> None:
    found = survey(*sizes)
    files = written(tmp_path / "row.gpkg", found, recording)
    assert files[longest] == "row.gpkg"
    assert found.cloud is found.parts[longest].cloud
    assert found.trajectory is found.parts[longest].trajectory
    session = load_session(tmp_path / "row.gpkg")
    assert (session.name, len(session.cloud), len(session.trajectory or ())) == (
        "row",
        sizes[longest][1],
        sizes[longest][0],
    )


@pytest.mark.parametrize("suffix", [".gpkg", ".csv", ".ply"])
def test_the_others_go_by_their_place_in_time(tmp_path: Path, recording: Recording, suffix: str) -> None:
    files = written(tmp_path / f"row{suffix}", survey((5, 3), (9, 2), (4, 0), (1, 1)), recording)
    assert files == {0: f"row-part1{suffix}", 1: f"row{suffix}", 3: f"row-part4{suffix}"}
    assert {path.name for path in tmp_path.iterdir()} == {"R", *files.values()}
    if suffix == ".gpkg":
        assert load_session(tmp_path / "row-part4.gpkg").name == "row part 4"


def test_the_stages_are_named_as_the_sessions(tmp_path: Path) -> None:
    write_stages(tmp_path, survey((5, 3), (9, 2), (4, 0)))
    assert {path.name for path in tmp_path.iterdir()} == {
        "poses_tum.txt",
        "poses_tum-part1.txt",
        "tracks.csv",
        "tracks-part1.csv",
    }
    assert len((tmp_path / "poses_tum.txt").read_text().splitlines()) == 1 + 9


def test_the_summary_says_which_file_holds_what(tmp_path: Path, recording: Recording) -> None:
    found = survey((5, 3), (9, 2), (4, 0))
    about = {"name": "row", "date": "2024-08-09", "configuration": {}, "inputs": []}
    files = write_survey(tmp_path / "row.gpkg", found, recording, **about)  # type: ignore[arg-type]
    told = summary(recording, found, files)
    assert told["output"] == [str(tmp_path / "row.gpkg"), str(tmp_path / "row-part1.gpkg")]
    assert [part["output"] for part in told["parts"]] == [*reversed(told["output"]), None]
    assert [line.replace(f"{tmp_path}/", "") for line in as_lines(told, found)] == [
        "row.gpkg: 2 fruits in the longest of 3 parts (5 in all, some maybe twice), median diameter 70.0 mm, "
        "from 100 boxes in 1 frame",
        "  row-part1.gpkg: frames 0 to 4, 3 fruits",
        "  row.gpkg: frames 5 to 13, 2 fruits: covered",
        "  not written: frames 14 to 17, 0 fruits: covered",
    ]


def test_of_many_parts_without_fruits_the_first_are_named(tmp_path: Path, recording: Recording) -> None:
    found = survey((5, 3), *((2, 0) for _ in range(12)), (9, 2))
    about = {"name": "row", "date": "2024-08-09", "configuration": {}, "inputs": []}
    files = write_survey(tmp_path / "row.gpkg", found, recording, **about)  # type: ignore[arg-type]
    lines = as_lines(summary(recording, found, files), found)
    assert sum("not written: frames" in line for line in lines) == 3
    assert "  not written: 9 more parts of 18 frames without fruits" in lines
    assert any("row.gpkg: frames 29 to 37, 2 fruits" in line for line in lines)


def test_parts_of_an_earlier_scan_are_told_and_stay(tmp_path: Path, recording: Recording) -> None:
    written(tmp_path / "row.gpkg", survey((5, 3), (9, 2), (4, 1)), recording)
    before = (tmp_path / "row-part3.gpkg").read_bytes()
    (tmp_path / "row-part3.csv").touch()
    (tmp_path / "row-party3.gpkg").touch()
    with pytest.warns(
        PomonaWarning, match=r"row\.gpkg: \S*row-part3\.gpkg is of an earlier scan, not of this one"
    ) as told:
        written(tmp_path / "row.gpkg", survey((5, 3), (9, 2)), recording)
    assert len(told) == 1
    assert (tmp_path / "row-part3.gpkg").read_bytes() == before


def test_a_map_with_the_name_of_a_part_is_refused_first(here: Path, pomona) -> None:
    (here / "orchard.gpkg").rename(here / "row-part2.gpkg")
    code, _, told = pomona("scan", "R", "-o", "row.gpkg")
    assert code == 2
    assert "row-part2.gpkg: is an orchard map" in told
    assert not (here / "row.gpkg").exists()
