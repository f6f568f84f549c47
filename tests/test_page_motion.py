"""What is drawn of the row while it moves: all of it in time, less where that is late, all of it at rest."""

import base64
from typing import Any

import cv2
import numpy as np
import pytest
from benchmarks.page_draw import FRUITS_OF_TREE, drawn_document

from page_maker import opened, write_page

N = 160 * FRUITS_OF_TREE

WATCHED = """{
  const real = requestAnimationFrame.bind(window);
  let began = 0, clock = 0;
  // Each frame takes as long as the test says, and rest comes late, however busy this machine is.
  window.requestAnimationFrame = (work) => real((start) => {
    if (start !== began) [began, clock] = [start, clock + FRAME_MS];
    work(clock);
    if (window.cleared) window.picture = document.querySelector("canvas").toDataURL().split(",")[1];
    window.cleared = false;
  });
  const later = setTimeout.bind(window);
  window.setTimeout = (work, ms) => later(work, 10 * ms);
  const own = WebGL2RenderingContext.prototype;
  const { drawElements, clear, bufferSubData } = own;
  window.drawn = window.uploaded = 0;
  own.clear = function (...how) { window.drawn = 0; window.cleared = true; clear.apply(this, how); };
  own.drawElements = function (...how) { if (how[1] > 1) window.drawn += how[1]; drawElements.apply(this, how); };
  own.bufferSubData = function (...how) { window.uploaded += how[2].byteLength; bufferSubData.apply(this, how); };
}"""

TURN = """async (frames) => {
  const canvas = document.querySelector("canvas");
  const counts = [];
  for (let i = 0; i < frames; i++) {
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: i < frames / 2 ? "d" : "a" }));
    await new Promise(requestAnimationFrame);
    counts.push(window.drawn);
  }
  return counts;
}"""

GO_TO_DAY = """async (day) => {
  const slider = document.querySelector("input[type=range]");
  window.uploaded = 0;
  slider.value = String(day);
  slider.dispatchEvent(new Event("input"));
  await new Promise(requestAnimationFrame);
  return window.uploaded;
}"""

KEYS = """keys => {
  const canvas = document.querySelector("canvas");
  for (const key of keys) canvas.dispatchEvent(new KeyboardEvent("keydown", { key }));
}"""

FARTHER = ["-"] * 4
"""The whole row stays in the picture while it turns."""


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    return write_page(tmp_path_factory.mktemp("moved") / "report.html", drawn_document(N, with_pictures=False))


def watched(frame_ms: int) -> str:
    return WATCHED.replace("FRAME_MS", str(frame_ms))


def picture(page: Any) -> np.ndarray:
    """The row as it was drawn last, without what lies over it."""
    png = np.frombuffer(base64.b64decode(page.evaluate("window.picture")), np.uint8)
    return np.asarray(cv2.imdecode(png, cv2.IMREAD_COLOR), np.int16)


def at_rest(page: Any) -> np.ndarray:
    page.wait_for_timeout(2500)
    return picture(page)


def unlike(one: np.ndarray, other: np.ndarray) -> float:
    """Share of the pixels that differ by more than a shade."""
    return float(np.mean(np.abs(one - other).max(axis=2) > 8))


def test_what_is_in_time_is_drawn_in_full(browser: Any, address: str) -> None:
    with opened(browser, address, watched(33)) as page:
        page.evaluate(KEYS, FARTHER)
        at_rest(page)
        assert set(page.evaluate(TURN, 40)) == {N}


def test_what_is_late_is_thinned_until_it_rests(browser: Any, address: str) -> None:
    with opened(browser, address, watched(80)) as page:
        page.evaluate(KEYS, FARTHER)
        before = at_rest(page)
        counts = page.evaluate(TURN, 40)
        assert counts[0] == N
        assert counts[-1] == pytest.approx(N / 4, rel=0.02), "the frames stay late, so as few are drawn as helps"
        assert sorted(counts, reverse=True) == counts, "less and less: nothing flickers"
        assert unlike(at_rest(page), before) < 0.001
        assert page.evaluate("window.drawn") == N


def test_large_fruits_are_never_left_out(browser: Any, address: str) -> None:
    with opened(browser, address, watched(80)) as page:
        page.evaluate(KEYS, ["+"] * 20)
        at_rest(page)
        whole = page.evaluate("window.drawn")
        assert 0 < whole < N / 4, "trees out of the picture are not drawn"
        few = page.evaluate(TURN, 40)
        assert few[-1] == whole


def test_between_two_dates_nothing_is_told_anew(browser: Any, address: str) -> None:
    """Visits are 12 days apart: from one to the next the shader goes on by itself, to what is shown at rest."""
    with opened(browser, address, watched(16)) as page:
        page.get_by_role("button", name="Size", exact=True).first.click()
        last = at_rest(page)
        page.evaluate(GO_TO_DAY, 61)
        assert page.evaluate(GO_TO_DAY, 66) < 100, "only the mark of the chosen fruit"
        under_way = picture(page)
        rested = at_rest(page)
        assert unlike(under_way, rested) < 0.002
        assert unlike(last, rested) > 0.01
