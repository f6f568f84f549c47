"""`pomona report`: one file that is whole, replaces nothing of others, and stays small enough to mail."""

import base64
import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from command_line import Pomona
from growth_maker import grow_row
from pomona import FruitCloud
from pomona.fruit_crop import FruitCrop
from pomona.orchard import Session, add_session
from pomona.viewer.told_crops import small_crop


@pytest.fixture(scope="module")
def orchard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of one visit: nothing has to be fitted."""
    return grow_row(tmp_path_factory.mktemp("row") / "orchard.gpkg", (50,), n_trees=1).path


def document_of(report: Path) -> dict:
    text = report.read_text("utf-8").partition('<script type="application/json" id="season">')[2]
    return json.loads(text.partition("</script>")[0])


def test_a_report_is_one_file_that_may_run_nothing_else(pomona: Pomona, orchard: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.html"
    code, printed, told = pomona("report", orchard, "-o", report)
    assert (code, told) == (0, f"pomona: {orchard}: vertical guessed; give --up X,Y,Z\n")
    assert pomona("report", orchard, "-o", report, "--up", "0,0,1")[2] == ""
    assert printed == f"{report}: {report.stat().st_size / 1e6:.2f} MB, open it in a browser\n"
    text = report.read_text("utf-8")
    assert "default-src 'none'; script-src 'sha256-" in text
    assert not re.search(r'(src|href)="(?!data:)', text)
    assert document_of(report)["name"] == "orchard.gpkg"


def test_the_same_map_gives_the_same_report(pomona: Pomona, orchard: Path, tmp_path: Path) -> None:
    for name in ("one.html", "two.html"):
        assert pomona("report", orchard, "-o", tmp_path / name)[0] == 0
    assert (tmp_path / "one.html").read_bytes() == (tmp_path / "two.html").read_bytes()


def test_a_report_is_no_pdf(pomona: Pomona, orchard: Path, tmp_path: Path) -> None:
    code, _, told = pomona("report", orchard, "-o", tmp_path / "r.pdf")
    assert (code, told) == (2, f"pomona: {tmp_path / 'r.pdf'}: found suffix '.pdf', expected .html, .htm\n")
    assert not (tmp_path / "r.pdf").exists()


def test_a_report_replaces_reports_alone(pomona: Pomona, orchard: Path, tmp_path: Path) -> None:
    report, page = tmp_path / "report.html", tmp_path / "mine.html"
    page.write_text("<!doctype html><p>my own")
    for _ in range(2):
        assert pomona("report", orchard, "-o", report)[0] == 0
    code, _, told = pomona("report", orchard, "-o", page)
    assert (code, told.count("\n"), page.read_text()) == (2, 1, "<!doctype html><p>my own")
    assert "not a report of a season" in told
    before = orchard.read_bytes()
    for force in ((), ("--force",)):
        assert pomona("report", orchard, "-o", orchard, *force)[0] == 2
    assert orchard.read_bytes() == before


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("--harvest", "soon"), "--harvest: found 'soon'"),
        (("--classes", "70,60"), "--classes: found '70,60'"),
        (("--up", "1,2"), "--up: found '1,2'"),
        (("--up", "0,0,0"), "--up: found '0,0,0'"),
        (("--calipers", "none.csv"), "none.csv"),
        (("--target", "-1"), "--target"),
    ],
)
def test_what_is_wrong_is_told_in_a_line(
    pomona: Pomona, orchard: Path, tmp_path: Path, flags: tuple[str, str], said: str
) -> None:
    report = tmp_path / "report.html"
    code, printed, told = pomona("report", orchard, "-o", report, *flags)
    assert (code, printed, told.count("\n")) == (2, "", 1)
    assert said in told
    assert not report.exists()


def picture(seed: int, side: int = 48, suffix: str = ".webp") -> bytes:
    pixels = np.random.default_rng(seed).integers(0, 256, (side, side, 3), dtype=np.uint8)
    return cv2.imencode(suffix, pixels)[1].tobytes()


def test_pictures_lie_inside(pomona: Pomona, tmp_path: Path) -> None:
    places = np.random.default_rng(0).uniform((0, 0, 0), (6, 1, 2), (40, 3))
    crops = {3: FruitCrop(0, picture(1)), 7: FruitCrop(2, picture(2, suffix=".jpg"))}
    add_session(tmp_path / "o.gpkg", Session("one", "2024-06-01", "drawn", FruitCloud(places), crops=crops))
    assert pomona("report", tmp_path / "o.gpkg", "-o", tmp_path / "o.html")[0] == 0
    told = document_of(tmp_path / "o.html")["crops"]
    assert {base64.b64decode(one) for one in told["pictures"]} == {crop.picture for crop in crops.values()}
    assert (told["best"]["n"], told["sights"]) == (2, None)


@pytest.mark.parametrize("most_bytes", [700, 1500])
def test_a_picture_that_takes_too_much_is_made_smaller(most_bytes: int) -> None:
    large = picture(3, side=200)
    assert len(large) > 1500
    small = small_crop(large, most_bytes)
    assert small is not None
    assert len(small) <= most_bytes
    assert cv2.imdecode(np.frombuffer(small, np.uint8), cv2.IMREAD_COLOR).shape[0] <= 48
    assert small_crop(large, len(large)) == large
    assert small_crop(large, 20) is None


def test_what_is_no_picture_is_left_out() -> None:
    bomb = b"RIFF\0\0\0\0WEBPVP8X\x0a\0\0\0\0\0\0\0" + b"\xff\x7f\0" * 2
    for content in (b"", b"\xff\xd8\xff", b"RIFF\0\0\0\0WEBP", bomb, picture(4)[:60]):
        assert small_crop(content, 50) is None
    assert small_crop(bomb, 10_000) is None, "32,768 pixels a side take memory, whatever its bytes"
