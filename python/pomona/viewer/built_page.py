"""The page as it was built out of `web/`: three texts inside the package."""

from __future__ import annotations

import base64
import hashlib
import json
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from pomona.likes import REPORT_MARK

__all__ = ["BuiltPage", "built_page", "report_of"]

_DOCTYPE = "<!doctype html>\n"
_STYLE = '<link rel="stylesheet" href="page.css" />'
_SCRIPT = '<script src="page.js"></script>'


@dataclass(frozen=True)
class BuiltPage:
    """The files of the page.

    Attributes
    ----------
    html, script, style : str
    """

    html: str
    script: str
    style: str


def built_page() -> BuiltPage:
    """Read the page that is shipped."""
    folder = files("pomona.viewer") / "page"
    html, script, style = ((folder / name).read_text("utf-8") for name in ("index.html", "page.js", "page.css"))
    return BuiltPage(html, script, style)


def report_of(page: BuiltPage, document: dict[str, Any]) -> str:
    """Put the page and what it is told into one file, which may run nothing else and ask nobody for anything."""
    policy = (
        f"default-src 'none'; script-src {_digest(page.script)}; style-src {_digest(page.style)}; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )
    head = f'{REPORT_MARK.decode()}\n<meta http-equiv="Content-Security-Policy" content="{policy}" />\n'
    told = f'<script type="application/json" id="season">{_inside_html(document)}</script>'
    html = page.html.replace(_DOCTYPE, f"{_DOCTYPE}{head}", 1)
    html = html.replace(_STYLE, f"<style>{page.style}</style>", 1)
    return html.replace(_SCRIPT, f"{told}\n<script>{page.script}</script>", 1)


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"


def _inside_html(document: dict[str, Any]) -> str:
    """Write JSON that no name in it can end: HTML looks for `<` alone."""
    return json.dumps(document, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
