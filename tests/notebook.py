"""Notebooks without Jupyter: their code cells run in order, in one namespace, and what they show is kept.

`python tests/notebook.py examples/first_steps.ipynb` runs a notebook anew and writes what it shows into it.
"""

import ast
import base64
import contextlib
import io
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

DPI = 60
"""Of the pictures that a notebook keeps: it stays small."""


def executed(path: Path) -> dict[str, Any]:
    """Run a notebook in the current folder and give it with new outputs; what fails is raised."""
    notebook: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    names: dict[str, Any] = {"__name__": "__main__"}
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for count, cell in enumerate(code, start=1):
        cell["execution_count"] = count
        cell["outputs"] = run("".join(cell["source"]), f"{path.name}[{count}]", count, names)
    return notebook


def run(source: str, place: str, count: int, names: dict[str, Any]) -> list[dict[str, Any]]:
    tree = ast.parse(source, place)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, place, "exec"), names)
        value = None if last is None else eval(compile(ast.Expression(last.value), place, "eval"), names)
    outputs: list[dict[str, Any]] = []
    if printed.getvalue():
        outputs.append({"output_type": "stream", "name": "stdout", "text": lines(printed.getvalue())})
    if value is not None:
        shown = {"output_type": "execute_result", "execution_count": count, "metadata": {}, "data": shown_as(value)}
        outputs.append(shown)
    return outputs


def shown_as(value: Any) -> dict[str, Any]:
    if isinstance(value, Figure):
        picture = io.BytesIO()
        value.savefig(picture, format="png", dpi=DPI)
        size = "{:g}x{:g}".format(*value.get_size_inches().round(2))
        return {"text/plain": [f"<Figure {size}>"], "image/png": base64.b64encode(picture.getvalue()).decode()}
    data: dict[str, Any] = {"text/plain": lines(repr(value))}
    if hasattr(value, "_repr_html_"):
        data["text/html"] = lines(value._repr_html_())
    return data


def lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


def main(path: Path) -> None:
    path = path.resolve()
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        notebook = executed(path)
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
