"""The demo: from cloud to map to picture, and where to look."""

import subprocess
import sys
from pathlib import Path

import pytest

from pomona.demo import Demo, run_demo
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
    pomona = Path(sys.executable).with_name("pomona")
    done = subprocess.run([pomona, "demo", "-o", "made"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("Found: ")
    for name in ("match.png", "orchard.gpkg", "pairs.csv"):
        assert f"made/{name}" in done.stdout
        assert (tmp_path / "made" / name).stat().st_size > 0
    go_on = next(line for line in done.stdout.splitlines() if "pomona match" in line).split()
    assert subprocess.run([pomona, *go_on[1:]], cwd=tmp_path, capture_output=True).returncode == 0


def test_refuses_a_folder_that_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    pomona = Path(sys.executable).with_name("pomona")
    done = subprocess.run([pomona, "demo", "-o", tmp_path / "file"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
