"""Draws the equations of the pages with matplotlib, so that the site needs no script from elsewhere.

`$...$` and `$$...$$` outside of code become pictures whose alternative text is the equation's source.
"""

import base64
import io
import re
from functools import cache
from html import escape
from typing import Any

from matplotlib import rc_context
from matplotlib.mathtext import math_to_image

# Code comes first, so that a dollar inside it is left alone.
_CODE_OR_EQUATION = re.compile(
    r"(?P<code>```.*?```|`[^`\n]+`)|\$\$(?P<block>.+?)\$\$|\$(?P<inline>[^$\n]+)\$", re.DOTALL
)
_POINTS_PER_EM = 10.0


def on_page_markdown(markdown: str, **_about: Any) -> str:
    """Replace the equations of a page; called by mkdocs."""
    return _CODE_OR_EQUATION.sub(_replace, markdown)


def _replace(found: re.Match[str]) -> str:
    if found["code"]:
        return found["code"]
    if found["block"]:
        return f'<p class="equation">{_picture(" ".join(found["block"].split()))}</p>'
    return _picture(found["inline"])


@cache
def _picture(source: str) -> str:
    svg = io.BytesIO()
    with rc_context({"mathtext.fontset": "cm", "svg.fonttype": "path", "svg.hashsalt": "pomona"}):
        depth_pt = math_to_image(f"${source}$", svg, format="svg")
    (height_pt,) = re.findall(rb'<svg [^>]*height="([0-9.]+)pt"', svg.getvalue())
    style = f"height:{_em(float(height_pt))};vertical-align:-{_em(depth_pt)}"
    image = base64.b64encode(svg.getvalue()).decode()
    return f'<img class="equation" alt="{escape(source)}" style="{style}" src="data:image/svg+xml;base64,{image}">'


def _em(points: float) -> str:
    return f"{points / _POINTS_PER_EM:.2f}em"
