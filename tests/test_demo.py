"""The demo: from cloud to map to picture, and where to look."""

from pathlib import Path

import numpy as np
import pytest

from command_line import assert_refused, run
from pomona.demo import Demo, run_demo
from pomona.demo_row import run_row_demo
from pomona.errors import PomonaError
from pomona.orchard import OrchardMap


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    return run_demo(tmp_path_factory.mktemp("demo") / "new" / "folder")


def test_finds_the_second_visit_in_the_map_of_the_first(made: Demo) -> None:
    assert made.match.status.value == "Found"
    assert made.score.precision is not None
    assert made.score.precision > 0.9
    assert made.score.recall is not None
    assert made.score.recall > 0.9
    # The generator lets every fruit grow by 12 mm.
    assert made.growth_mm == pytest.approx(12.0, abs=1.0)


def test_the_map_holds_every_fruit_once(made: Demo) -> None:
    orchard = OrchardMap(made.orchard)
    first, second = orchard.visits()
    # Sizes speak in the map, too: pairs that did not grow as the others stay apart.
    assert 0.9 * len(made.match.pairs) < second.n_matched <= len(made.match.pairs)
    assert made.n_identities == first.n_fruits + second.n_fruits - second.n_matched == len(orchard.fruits())


def test_makes_the_same_again_over_its_own_files(made: Demo) -> None:
    again = run_demo(made.orchard.parent)
    assert again.score == made.score
    assert again.pairs.read_bytes() == made.pairs.read_bytes()


def test_the_verb_ends_with_files_that_are_there(tmp_path: Path) -> None:
    done = run("demo", "-o", "made", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("Found: ")
    for name in ("match.png", "orchard.gpkg", "pairs.csv"):
        assert f"made/{name}" in done.stdout
        assert (tmp_path / "made" / name).stat().st_size > 0
    go_on = next(line for line in done.stdout.splitlines() if "pomona match" in line).split()
    assert run(*go_on[1:], cwd=tmp_path).returncode == 0


def test_refuses_a_folder_that_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert_refused(run("demo", "-o", tmp_path / "file"))


ROW = Path(__file__).parents[1] / "examples" / "row"


@pytest.fixture
def two_visits(tmp_path: Path) -> Path:
    row = tmp_path / "row"
    row.mkdir()
    for day in ("2024-08-28", "2024-09-12"):
        (row / day).symlink_to(ROW / day)
    return row


def test_recordings_go_in_and_fruits_found_again_come_out(two_visits: Path, tmp_path: Path) -> None:
    lines: list[str] = []
    made = run_row_demo(two_visits, tmp_path / "out", lines.append)
    first, second = made.visits
    assert len(lines) == 2
    assert first.match is None
    assert second.match is not None
    assert second.score is not None
    assert second.match.status.value == "Found"
    assert second.score.precision is not None
    assert second.score.precision > 0.9
    assert len(second.match.pairs) > 100
    # The apples of the model grow by 4 to 5 mm in these 15 days.
    assert second.growth_mm == pytest.approx(4.5, abs=2.0)
    both = np.concatenate([first.fruit_ids, second.fruit_ids])
    assert made.n_identities == len(np.unique(both))
    # Who is who follows from sizes too, so a few of the pairs are not taken over.
    known = len(both) - made.n_identities
    assert 0.95 * len(second.match.pairs) < known <= len(second.match.pairs)
    assert made.same_fruits.stat().st_size > 100_000
    assert second.picture is not None
    assert second.picture.stat().st_size > 10_000
    season = made.season
    assert season is not None
    assert season.identities.precision is not None
    assert season.identities.precision > 0.9
    assert season.identities.recall is not None
    assert season.identities.recall > 0.9
    assert season.n_hanging <= made.n_identities
    assert season.harvest.isoformat() == "2024-09-26"
    assert season.mean_then_mm.low < season.mean_then_mm.mean < season.mean_then_mm.high
    assert season.mean_mm < season.mean_then_mm.mean < season.mean_mm + 14 * 0.6
    assert 0 < season.n_large_then.mean <= season.n_hanging
    page = season.report.read_text(encoding="utf-8")
    assert page.startswith("<!")
    assert "orchard.gpkg" in page


def test_a_row_with_a_visit_without_its_truth_is_refused_before_anything_is_made(
    two_visits: Path, tmp_path: Path
) -> None:
    (two_visits / "2024-08-30").mkdir()
    with pytest.raises(PomonaError, match=r"2024-08-30: found no row.mp4, expected one in the folder of each visit"):
        run_row_demo(two_visits, tmp_path / "out")
    with pytest.raises(PomonaError, match="found 0 folders, expected one for each of two visits or more"):
        run_row_demo(tmp_path / "nowhere", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_map_of_somebody_else_is_not_destroyed(two_visits: Path, tmp_path: Path, made: Demo) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "orchard.gpkg").write_bytes(b"somebody's")
    with pytest.raises(PomonaError, match="is not the map of a demo"):
        run_row_demo(two_visits, out)
    assert (out / "orchard.gpkg").read_bytes() == b"somebody's"
