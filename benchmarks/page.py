"""The page with many fruits: bytes of a report, and how long a picture of the row takes without a graphics card.

Rows of fruits at random places with curves of growth on ten dates, and a picture of 48 px of each, are told as a map is
told. Chromium draws with SwiftShader, on the processor alone; each frame turns the camera or goes on by a day, and
lasts until the next one can be read. Behind it are the processor time of all of the browser, and the share of the
fruits that were drawn: none that are out of the picture, and who is late draws fewer while they move. Idle is nobody
touching it for some seconds. Writes page.csv and page.md.
"""

import argparse
import os
import sys
from contextlib import suppress
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from playwright.sync_api import Page, sync_playwright

from benchmarks.page_draw import drawn_document
from benchmarks.results import markdown, write_rows, write_text
from pomona.viewer.built_page import built_page, report_of

CHROMIUM = "/usr/bin/chromium"
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]
SIZES = (1_000, 5_000, 50_000)
FRAMES = 60
SETTLED_S, IDLE_S = 3, 5
VIEWPORT: Any = {"width": 1280, "height": 860}

TURN = """async (how) => {
  const canvas = document.querySelector("canvas");
  const gl = canvas.getContext("webgl2");
  const slider = document.querySelector("input[type=range]");
  const step = (i) => {
    if (how === "turn") return canvas.dispatchEvent(new KeyboardEvent("keydown", { key: i % 20 < 10 ? "d" : "a" }));
    slider.value = String(i);
    slider.dispatchEvent(new Event("input"));
  };
  const times = [];
  await new Promise(requestAnimationFrame);
  let before = performance.now();
  for (let i = 0; i < FRAMES; i++) {
    step(i);
    await new Promise(requestAnimationFrame);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    times.push(performance.now() - before);
    before = performance.now();
  }
  return times;
}""".replace("FRAMES", str(FRAMES))


COUNT = """() => {
  const gl = document.querySelector("canvas").getContext("webgl2");
  const count = (name, what) => {
    const work = gl[name].bind(gl);
    gl[name] = (...how) => { what(how); return work(...how); };
  };
  window.drawn = window.points = window.frames = 0;
  count("clear", () => window.frames++);
  count("drawArrays", () => window.drawn++);
  count("drawElements", ([, points]) => { window.drawn++; window.points += points; });
}"""


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks page", description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    options = parser.parse_args(arguments)
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        rows = [measured(browser.new_page(viewport=VIEWPORT), n) for n in options.sizes]
        browser.close()
    write_rows("page.csv", rows)
    header = (
        "fruits",
        "report, MB",
        "without pictures, MB",
        "opens in, s",
        "drawn when idle",
        "turning, ms a frame",
        "playing, ms a frame",
    )
    lines = [[str(value) for value in row.values()] for row in rows]
    write_text("page.md", f"{' '.join((__doc__ or '').split())}\n\n{markdown(header, lines)}")


def measured(page: Page, n: int) -> dict[str, object]:
    document = drawn_document(n, with_pictures=n <= 5_000)
    report = report_of(built_page(), document)
    bare = report_of(built_page(), {**document, "crops": None})
    with TemporaryDirectory() as folder:
        path = Path(folder) / "report.html"
        path.write_text(report, encoding="utf-8")
        page.goto(path.as_uri(), wait_until="commit")
        page.wait_for_selector("canvas")
    opened = page.evaluate("performance.now() / 1000")
    drawn = idle(page)
    turning, playing = (timed(page, how, n) for how in ("turn", "play"))
    sys.stderr.write(f"page: {n} fruits done\n")
    return {
        "fruits": n,
        "report_mb": round(len(report) / 1e6, 2),
        "bare_mb": round(len(bare) / 1e6, 2),
        "opens_s": round(opened, 2),
        "idle": drawn,
        "turning_ms": turning,
        "playing_ms": playing,
    }


def idle(page: Page) -> str:
    """Count calls that draw while nobody touches the page; behind it the share of a processor that it takes."""
    page.wait_for_timeout(1000 * SETTLED_S)
    page.evaluate(COUNT)
    before = cpu_s()
    page.wait_for_timeout(1000 * IDLE_S)
    share = (cpu_s() - before) / IDLE_S
    return f"{page.evaluate('window.drawn')} ({100 * share:.0f} %)"


def timed(page: Page, how: str, n: int) -> str:
    """Median of the frames, processor time of all of the browser's processes for each, share of the fruits."""
    page.evaluate("window.points = window.frames = 0")
    before = cpu_s()
    times = page.evaluate(TURN, how)
    spent_ms = 1000 * (cpu_s() - before) / len(times)
    share = page.evaluate("window.points / window.frames") / n
    return f"{median(times):.0f} ({spent_ms:.0f}, {100 * min(1, share):.0f} %)"


def cpu_s() -> float:
    """Processor time of the browsers that run below this process: it does not depend on who else works here."""
    parents, spent = {}, {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            about = stat.read_text().rpartition(")")[2].split()
            parents[int(stat.parent.name)], spent[int(stat.parent.name)] = (
                int(about[1]),
                int(about[11]) + int(about[12]),
            )
    return sum(ticks for pid, ticks in spent.items() if is_below(pid, parents)) / os.sysconf("SC_CLK_TCK")


def is_below(pid: int, parents: dict[int, int]) -> bool:
    while (pid := parents.get(pid, 0)) not in (0, os.getpid()):
        pass
    return pid == os.getpid()
