"""The page that is shipped was built from the sources that are here, and asks nobody for anything."""

import hashlib
import json
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
WEB = ROOT / "web"
BUILT = ROOT / "python" / "pomona" / "viewer" / "page"
BESIDE_SOURCES = ("package.json", "package-lock.json", "public/index.html", "tsconfig.json", "vite.config.js")


def digest(folder: Path, names: list[str]) -> str:
    """As `web/vite.config.js` does it."""
    lines = [f"{name}\n{hashlib.sha256((folder / name).read_bytes()).hexdigest()}\n" for name in sorted(names)]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def test_the_page_was_built_from_these_sources() -> None:
    noted = json.loads((BUILT / "built_from.json").read_text())
    sources = [path.relative_to(WEB).as_posix() for path in (WEB / "src").rglob("*") if path.is_file()]
    assert noted["sources"] == digest(WEB, [*sources, *BESIDE_SOURCES]), "the sources have changed: make page"
    assert noted["page"] == digest(BUILT, ["index.html", "page.css", "page.js"]), "the page was edited: make page"


def test_the_page_carries_the_notices_of_what_is_inside() -> None:
    script = (BUILT / "page.js").read_text("utf-8")
    assert "Copyright (c) 2022 Leon Sorokin" in script
    assert "Permission is hereby granted, free of charge" in script
    inside = json.loads((WEB / "package.json").read_text())["dependencies"]
    assert f"ogl {inside['ogl']}" in script
    assert f"uPlot {inside['uplot']}" in script


def test_the_page_can_stand_inside_html() -> None:
    """A report holds script and style as they are."""
    assert "</script" not in (BUILT / "page.js").read_text("utf-8").lower()
    assert "</style" not in (BUILT / "page.css").read_text("utf-8").lower()


def test_the_page_names_no_other_host() -> None:
    text = "".join((BUILT / name).read_text("utf-8") for name in ("index.html", "page.css", "page.js"))
    assert set(re.findall(r"https?://[\w.]+", text)) <= {"http://www.w3.org"}, "namespaces are names, not addresses"


def test_the_lock_file_names_no_registry() -> None:
    lock = json.loads((WEB / "package-lock.json").read_text())
    assert all("resolved" not in package for package in lock["packages"].values())
    assert all("integrity" in package for name, package in lock["packages"].items() if name)


def test_names_never_become_markup() -> None:
    """Texts become text nodes: nothing in the sources writes HTML."""
    ways = re.compile(
        r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|DOMParser|createContextualFragment|eval\("
    )
    found = [path.name for path in (WEB / "src").rglob("*.ts") if ways.search(path.read_text("utf-8"))]
    assert found == []
