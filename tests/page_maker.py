"""Maps to look at, a server that shows one, and a browser."""

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

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
