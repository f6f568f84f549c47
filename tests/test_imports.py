"""The house holds only while imports go one way and each name is one's own."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PYTHON = Path(__file__).parents[1] / "python"
ROOM_NAMES = {"opening", "files"}
"""Modules that do the same job in each room: from a path to the thing in it, and the files of the room."""


def modules() -> dict[str, ast.Module]:
    found = {}
    for path in sorted((PYTHON / "pomona").rglob("*.py")):
        parts = path.relative_to(PYTHON).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found[name] = ast.parse(path.read_text(encoding="utf-8"))
    return found


def is_for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def run_statements(node: ast.AST) -> Iterator[ast.AST]:
    """All that runs, in functions too; what is there for types only does not."""
    for child in ast.iter_child_nodes(node):
        if not is_for_types(child):
            yield child
            yield from run_statements(child)


def imported(tree: ast.Module, known: set[str]) -> set[str]:
    names = set()
    for node in run_statements(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            inside = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= {name if name in known else str(node.module) for name in inside}
    return names & known


def ancestors(name: str) -> set[str]:
    parts = name.split(".")
    return {".".join(parts[:depth]) for depth in range(1, len(parts))}


def graph(trees: dict[str, ast.Module]) -> dict[str, set[str]]:
    """What each module imports, with the packages that are run on the way there; the root loads its parts lazily."""
    direct = {name: imported(tree, set(trees)) for name, tree in trees.items()}
    return {
        name: {
            other for target in targets for other in {target, *(ancestors(target) - ancestors(name))} - {name, "pomona"}
        }
        for name, targets in direct.items()
        if name != "pomona"
    }


def test_no_imports_go_in_a_circle():
    try:
        order = list(TopologicalSorter(graph(modules())).static_order())
    except CycleError as error:
        pytest.fail("imports go in a circle: " + " -> ".join(error.args[1]))
    assert order.index("pomona.errors") < order.index("pomona.cloud.fruit_cloud") < order.index("pomona.cli")


def test_a_circle_is_found_in_functions_and_through_packages():
    function = "def read():\n    from pomona.two import b\n"
    trees = {"pomona": "", "pomona.one": function, "pomona.two": "from pomona.three import part", "pomona.two.b": ""}
    trees |= {"pomona.three": "", "pomona.three.part": "import pomona.one"}
    with pytest.raises(CycleError):
        list(TopologicalSorter(graph({name: ast.parse(text) for name, text in trees.items()})).static_order())


def test_nothing_below_knows_the_command_line():
    wrong = [
        f"{name} -> {target}"
        for name, targets in graph(modules()).items()
        for target in targets
        if target.startswith("pomona.cli") and not name.startswith(("pomona.cli", "pomona.__main__"))
    ]
    assert not wrong


def test_no_name_stands_twice():
    """A verb of the command line is called as the module that does its work; all other names are one's own."""
    places = defaultdict(list)
    for name, tree in modules().items():
        if not name.startswith("pomona.cli."):
            places[name.rpartition(".")[2]].append(name)
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{name}.{node.name}")
    twice = {name: where for name, where in places.items() if len(where) > 1}
    assert set(twice) <= ROOM_NAMES, twice
