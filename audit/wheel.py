"""`python -m audit.wheel FOLDER`: what must be right about a wheel before others get it."""

from __future__ import annotations

import struct
import sys
import zipfile
from collections.abc import Sequence
from email.parser import HeaderParser
from pathlib import Path

MOST_EXTENSION_BYTES = 8_000_000
"""Of the compiled core: some 3 MB without debug symbols, 27 MB with them."""

MODELS = "pomona/detect/model/"
PAGE = "pomona/viewer/page/"
MOST_MODEL_BYTES = 6_000_000
"""Of the shipped detector, in 32 and in 8 bits."""

MACHINES = {"x86_64": 62, "aarch64": 183}
"""What the head of a library for Linux (ELF, e_machine) says of the processor that the wheel's name promises."""

MACHINE = struct.Struct("<18xH")

ROBOTS = "aarch64"
"""The processor of robots: a release has a wheel for it. It is built on another one, so nobody has run it there."""

NEEDED = ("Summary", "Author", "License-Expression", "Project-URL", "Keywords", "Classifier", "Requires-Python")
"""Fields of the metadata by which people find out what it is."""


def faults(wheel: Path) -> list[str]:
    """Say what is wrong with a wheel, one thing a line."""
    with zipfile.ZipFile(wheel) as archive:
        sizes = {entry.filename: entry.file_size for entry in archive.infolist()}
        about = next((name for name in sizes if name.endswith(".dist-info/METADATA")), None)
        text = "" if about is None else archive.read(about).decode("utf-8")
        heads = {name: archive.read(name)[: MACHINE.size] for name in _cores(sizes)}
        told = [name for name in sizes if any(folder in archive.read(name) for folder in _own_folders())]
    named = [f"{name}: names a folder of who built it" for name in told]
    return [*_of_extension(sizes), *_of_machine(wheel, heads), *_of_metadata(text), *_of_files(sizes), *named]


def _own_folders() -> list[bytes]:
    return [f"{folder}/".encode() for folder in (Path.home(), Path(__file__).parents[1])]


def _cores(sizes: dict[str, int]) -> list[str]:
    return [name for name in sizes if name.startswith("pomona/_core.") and name.endswith((".so", ".pyd"))]


def _of_machine(wheel: Path, heads: dict[str, bytes]) -> list[str]:
    """Compare the processor in the wheel's name, `manylinux_2_17_aarch64`, with that in the core."""
    platform = wheel.stem.rpartition("-")[2]
    expected = {number for machine, number in MACHINES.items() if "linux" in platform and machine in platform}
    if not expected:
        return []
    found = {name: MACHINE.unpack(head)[0] if len(head) == MACHINE.size else None for name, head in heads.items()}
    return [
        f"{name}: found a core for the processor {number}, expected one for {platform}"
        for name, number in found.items()
        if number not in expected
    ]


def missing(wheels: Sequence[Path]) -> list[str]:
    """Say which wheels a release lacks."""
    return [] if any(wheel.stem.endswith(ROBOTS) for wheel in wheels) else [f"found no wheel for {ROBOTS}"]


def _of_extension(sizes: dict[str, int]) -> list[str]:
    cores = _cores(sizes)
    if not cores:
        return ["found no compiled core, expected pomona/_core"]
    return [
        f"{name}: found {sizes[name]} bytes, expected at most {MOST_EXTENSION_BYTES}: debug symbols are in it"
        for name in cores
        if sizes[name] > MOST_EXTENSION_BYTES
    ]


def _of_metadata(text: str) -> list[str]:
    fields = HeaderParser().parsestr(text)
    return [f"METADATA: found no {name}" for name in NEEDED if name not in fields]


def _of_files(sizes: dict[str, int]) -> list[str]:
    needed = (
        "pomona/py.typed",
        "pomona/_core.pyi",
        *(f"{MODELS}{name}" for name in ("fruits.onnx", "fruits_int8.onnx", "CARD.md")),
        *(f"{PAGE}{name}" for name in ("index.html", "page.js", "page.css")),
    )
    missing = [f"found no {name}" for name in needed if name not in sizes]
    models = sum(size for name, size in sizes.items() if name.startswith(MODELS))
    large = (
        [f"{MODELS}: found {models} bytes, expected at most {MOST_MODEL_BYTES}"] if models > MOST_MODEL_BYTES else []
    )
    return missing + large


def main(folder: Path) -> None:
    """Look at the wheels of a folder; exit code 1 where something is wrong or one is missing."""
    wheels = sorted(folder.glob("pomona-*.whl"))
    wrong = [*(f"{wheel.name}: {fault}" for wheel in wheels for fault in faults(wheel)), *missing(wheels)]
    print("\n".join(wrong or [f"{wheel}: {wheel.stat().st_size / 1e6:.1f} MB" for wheel in wheels]))
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
