"""What the pages say works: their examples run, their links lead somewhere, their tasks exist."""

import contextlib
import os
import re
import runpy
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from benchmarks.__main__ import NAMES
from benchmarks.readme import blocks

from command_line import options_of, verbs

ROOT = Path(__file__).parent.parent
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
GUIDES = [page for page in PAGES if page.name != "CHANGELOG.md"]
"""What is said of this version; the change log is of all."""
page_parameter = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)

# `make TARGET` in an example is checked to exist, not run: it would build what runs this test.
MAKE_CHECKS_TARGETS = 'make() { for target in "$@"; do grep -q "^$target:" "$MAKEFILE"; done; }\n'

FLAG = re.compile(r"(?<![\w-])--?[a-z][\w-]*")


@dataclass(frozen=True)
class Example:
    language: str
    code: str
    line: int


def examples_of(page: Path) -> Iterator[Example]:
    text = page.read_text(encoding="utf-8")
    for block in re.finditer(r"^```(\w+)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
        yield Example(block[1], block[2], line=text.count("\n", 0, block.start(2)) + 1)


def run_shell(example: Example, folder: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", MAKE_CHECKS_TARGETS + example.code],
        cwd=folder,
        env={**os.environ, "PATH": path, "MAKEFILE": str(ROOT / "Makefile")},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, f"line {example.line}: exit code {done.returncode}\n{done.stderr}"


@page_parameter
def test_examples_run(page: Path, tmp_path: Path) -> None:
    """The examples of a page run from top to bottom in one folder; each Python one stands alone, as readers copy it."""
    examples = [example for example in examples_of(page) if example.language in ("sh", "python")]
    if not examples:
        pytest.skip("no examples on this page")
    with contextlib.chdir(tmp_path):
        for example in examples:
            if example.language == "sh":
                run_shell(example, tmp_path)
            else:
                exec(compile("\n" * (example.line - 1) + example.code, page, "exec"), {})


@page_parameter
def test_links_lead_to_files(page: Path) -> None:
    targets = re.findall(r"\]\((?!https?://|#)([^)#\s]+)", page.read_text(encoding="utf-8"))
    missing = [target for target in targets if not (page.parent / target).exists()]
    assert not missing


@page_parameter
def test_tasks_that_are_named_exist(page: Path) -> None:
    named = set(re.findall(r"`make ([a-z-]+)`", page.read_text(encoding="utf-8")))
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    assert named <= targets


@page_parameter
def test_equations_can_be_drawn(page: Path) -> None:
    """By the hook that draws them for the site, with the matplotlib that is locked."""
    drawing = runpy.run_path(str(ROOT / "docs" / "hooks" / "equations.py"))
    text = page.read_text(encoding="utf-8")
    drawn = drawing["on_page_markdown"](text)
    assert "$$" not in re.sub(r"```.*?```|`[^`\n]+`", "", drawn, flags=re.DOTALL)


def test_ci_runs_what_the_guide_says() -> None:
    guide = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (said,) = re.findall(r"`.ci/run` is what CI runs: (.*), nothing else", guide)
    run = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert re.findall(r"`(make [a-z]+)`", said) == re.findall(r"^(make [a-z]+)$", run, re.MULTILINE)
    assert "make docs" in run


def test_every_page_is_in_the_navigation() -> None:
    listed = set(re.findall(r":\s+([\w-]+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE))
    assert listed == {page.name for page in (ROOT / "docs").glob("*.md")}


def test_the_guide_that_says_what_is_where_names_what_is_there() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`((?:crates|python|tests|docs|benchmarks|testdata)/[\w./-]*)`", text))
    assert named
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []


def test_it_names_all_that_is_there() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    for folder in ("python/pomona", "crates/pomona/src", "crates/pomona-render/src", "web/src"):
        there = [path for path in (ROOT / folder).iterdir() if path.suffix in ("", ".py", ".rs", ".ts")]
        own = [path.name for path in there if not path.name.startswith("_") and path.name != "lib.rs"]
        assert [name for name in sorted(own) if f"`{name}" not in text] == [], folder


def test_every_benchmark_is_told() -> None:
    told = re.findall(r"^\| `(\w+)` \|", (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(NAMES) - set(told) == set()


def test_every_option_is_told() -> None:
    told = {"--help", "--version"}.union(*(FLAG.findall(page.read_text(encoding="utf-8")) for page in GUIDES))
    options = [(words, names) for words, verb in verbs().items() for names in options_of(verb)]
    assert [(words, names) for words, names in options if told.isdisjoint(names)] == []


@pytest.mark.parametrize("page", GUIDES, ids=lambda page: page.name)
def test_options_of_commands_exist(page: Path) -> None:
    options = {" ".join(words): {"--help"}.union(*options_of(verb)) for words, verb in verbs().items()}
    text = page.read_text(encoding="utf-8")
    for command, rest in re.findall(r"\bpomona ((?:[a-z]\S* )?[a-z]\S*)([^\n`#|&;>]*)", text):
        known = options.get(command, options.get(command.split()[0]))
        assert known is None or set(FLAG.findall(rest)) <= known, f"pomona {command}{rest}"


@pytest.mark.parametrize("block", blocks(), ids=lambda block: block[1])
def test_tables_of_the_documents_are_the_committed_benchmarks(block: tuple[Path, str, str]) -> None:
    page, _, text = block
    assert text in page.read_text(encoding="utf-8"), "stale: run python -m benchmarks readme"
