"""Maps to look at, a server that shows one, and a browser."""

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from pomona.viewer.built_page import built_page, report_of

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox")
"""WebGL without a graphics card, and in a container."""


@contextmanager
def served(orchard: Path, *flags: str) -> Iterator[str]:
    """The address under which `pomona view` shows a map, in a process of its own."""
    command = [sys.executable, "-m", "pomona", "view", str(orchard), "--port", "0", *flags]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            assert re.fullmatch(r"http://[\d.]+:\d+/(\?token=[\w-]+)?\n", line), line
            yield line.strip()
        finally:
            process.terminate()


def write_page(path: Path, document: dict[str, Any]) -> str:
    """Write a page that shows a document; give its address."""
    path.write_text(report_of(built_page(), document), encoding="utf-8")
    return path.as_uri()


@contextmanager
def chromium() -> Iterator[object]:
    """Debian's browser, driven by playwright; tests that need it are skipped where one of them is missing."""
    playwright = pytest.importorskip("playwright.sync_api", reason="no playwright: it is in the dev group")
    if not CHROMIUM.exists():
        pytest.skip(f"no browser: {CHROMIUM} is not there; apt-get install chromium")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=str(CHROMIUM), args=list(FLAGS))
        yield browser
        browser.close()


@contextmanager
def opened(browser: Any, address: str, script: str = "", **settings: Any) -> Iterator[Any]:
    """A page that has drawn its row; nothing may have gone wrong by the end, and nobody else have been asked.

    The script runs before the page's own.
    """
    context = browser.new_context(**{"viewport": {"width": 1280, "height": 860}, **settings})
    page = context.new_page()
    page.add_init_script(script)
    wrong: list[str] = []
    asked: list[str] = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda said: wrong.append(said.text) if said.type in ("error", "warning") else None)
    page.on("dialog", lambda dialog: (wrong.append(dialog.message), dialog.dismiss()))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(address)
    page.wait_for_selector("canvas")
    yield page
    context.close()
    own = re.compile(rf"{re.escape(address)}|data:|blob:")
    assert [text for text in wrong if "GPU stall" not in text] == []
    assert [url for url in asked if not own.match(url)] == []
