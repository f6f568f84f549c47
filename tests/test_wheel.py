"""What is given to others: the wheel's metadata, its size, how it is cited, what it says is missing."""

import re
import tomllib
import zipfile
from pathlib import Path

import pytest
from audit.wheel import MACHINES, MODELS, MOST_EXTENSION_BYTES, MOST_MODEL_BYTES, NEEDED, PAGE, faults, missing

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CARGO = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))
GOOD = {
    "pomona/_core.abi3.so": b"\x7fELF",
    "pomona/_core.pyi": b"",
    "pomona/py.typed": b"",
    **{f"{MODELS}{name}": b"" for name in ("fruits.onnx", "fruits_int8.onnx", "CARD.md")},
    **{f"{PAGE}{name}": b"" for name in ("index.html", "page.js", "page.css")},
    "pomona-0.1.0.dist-info/METADATA": "".join(f"{name}: something\n" for name in NEEDED).encode(),
}


def wheel(folder: Path, files: dict[str, bytes]) -> Path:
    path = folder / "pomona-0.1.0-any.whl"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


def test_a_good_wheel_has_no_faults(tmp_path: Path) -> None:
    assert faults(wheel(tmp_path, GOOD)) == []


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"pomona/_core.abi3.so": bytes(MOST_EXTENSION_BYTES + 1)}, "debug symbols are in it"),
        ({"pomona/_core.abi3.so": None}, "found no compiled core"),
        ({f"{MODELS}fruits.onnx": None}, "found no pomona/detect/model/fruits.onnx"),
        ({f"{MODELS}fruits.onnx": bytes(MOST_MODEL_BYTES + 1)}, "expected at most 6000000"),
        ({"pomona/py.typed": None}, "found no pomona/py.typed"),
        ({f"{PAGE}page.js": None}, "found no pomona/viewer/page/page.js"),
        ({"pomona-0.1.0.dist-info/METADATA": b"Author: us\n"}, "METADATA: found no Classifier"),
        ({"pomona/_core.abi3.so": f"\0{Path.home()}/.cargo/a.rs".encode()}, "names a folder of who built it"),
        ({"pomona-0.1.0.dist-info/a.json": f"file://{ROOT}/crates".encode()}, "a.json: names a folder"),
    ],
)
def test_what_is_wrong_with_a_wheel_is_told(tmp_path: Path, changed: dict[str, bytes | None], said: str) -> None:
    files = {name: content for name, content in {**GOOD, **changed}.items() if content is not None}
    assert any(said in fault for fault in faults(wheel(tmp_path, files)))


@pytest.mark.parametrize(("platform", "machine"), [("manylinux_2_17_aarch64", "aarch64"), ("linux_x86_64", "x86_64")])
def test_a_core_is_for_the_processor_that_its_wheel_names(tmp_path: Path, platform: str, machine: str) -> None:
    name = f"pomona-0.1.0-cp311-abi3-{platform}.whl"
    for built, number in MACHINES.items():
        core = b"\x7fELF".ljust(18, b"\0") + number.to_bytes(2, "little") + bytes(40)
        path = wheel(tmp_path, {**GOOD, "pomona/_core.abi3.so": core}).rename(tmp_path / name)
        found = faults(path)
        assert found == [] if built == machine else f"expected one for {platform}" in found[0]
    short = wheel(tmp_path, GOOD).rename(tmp_path / name)
    assert f"expected one for {platform}" in faults(short)[0]


def test_a_release_has_a_wheel_for_robots() -> None:
    desk, robot = Path("pomona-0.1.0-cp311-abi3-linux_x86_64.whl"), Path("pomona-0.1.0-cp311-abi3-linux_aarch64.whl")
    assert missing([desk, robot]) == []
    assert missing([desk]) == missing([]) == ["found no wheel for aarch64"]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "built but not run" in makefile
    assert "ziglang" in tomllib.loads((ROOT / "pyproject.toml").read_text())["dependency-groups"]["wheel"][0]


def test_the_project_says_who_and_what_it_is() -> None:
    assert PROJECT["authors"]
    assert PROJECT["keywords"]
    assert "Programming Language :: Rust" in PROJECT["classifiers"]
    assert PROJECT["urls"]


def test_the_extension_of_a_release_is_stripped() -> None:
    profile = CARGO["profile"]["release"]
    assert profile["strip"] is True
    assert "debug" not in profile


def test_the_citation_is_of_this_version_and_of_the_paper() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    version = CARGO["workspace"]["package"]["version"]
    assert re.search(rf"^version: {re.escape(version)}$", citation, re.MULTILINE)
    assert citation.startswith("cff-version: 1.2.0\n")
    assert 'value: "arXiv:2602.04722"' in citation
    assert f"license: {PROJECT['license']}" in citation


def test_hints_name_what_can_be_installed_without_us() -> None:
    """No index has Pomona itself; the packages of the extras are what an index has."""
    hints = set()
    for file in (ROOT / "python").rglob("*.py"):
        found = re.findall(r"pip install ([\w \[\]'.=-]+)\"", file.read_text(encoding="utf-8"))
        hints |= {name.split("==")[0] for names in found for name in names.split()}
    extras = {re.split("[<>= ]", name)[0] for names in PROJECT["optional-dependencies"].values() for name in names}
    assert extras <= hints
    assert not any("pomona" in name for name in hints)
