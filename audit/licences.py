"""Licences of every crate of Cargo.lock and of every package that an install of pomona brings, with all its extras."""

from __future__ import annotations

import importlib.metadata
import json
import re
import subprocess
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

__all__ = [
    "ALLOWED",
    "BUNDLED",
    "EXCEPTIONS",
    "brought",
    "bundling",
    "crate_licences",
    "is_allowed",
    "package_licences",
    "wrong_licences",
]

ROOT = Path(__file__).parents[1]

ALLOWED = frozenset(
    {
        *(
            "0BSD",
            "Apache-2.0",
            "Apache-2.0 WITH LLVM-exception",
            "BSD-2-Clause",
            "BSD-3-Clause",
            "CC0-1.0",
            "ISC",
            "MIT",
            "MIT-0",
        ),
        *("MIT-CMU", "PSF-2.0", "Unicode-3.0", "Unlicense", "Zlib"),
    }
)
"""Permissive: what they ask for is their notice."""

APART = {"bpy": "GPL-3.0-or-later: installed on request only, a process of its own that exchanges files with pomona"}
"""Programs that extras bring beside pomona: it never imports them, and ships nothing of them."""

EXCEPTIONS = {
    "apsw": "any licence that the Open Source Initiative approves, at the user's choice: so MIT",
    "certifi": "MPL-2.0: certificates and the path to them, unchanged, brought by bpy alone",
    "matplotlib": "its own licence, made after the PSF's: permissive",
}
"""Packages whose metadata names no licence of the list, and why they are taken all the same."""

BUNDLED = {
    "av": "BSD-3-Clause; its wheels carry FFmpeg with x264 and x265 under the GPL, loaded where a user installs "
    "pomona, and no part of what pomona ships",
    "numpy": "its wheels carry OpenBLAS, BSD-3-Clause, and libgfortran, GPL with the runtime exception",
    "opencv-python-headless": "Apache-2.0; its wheels carry FFmpeg under the LGPL, as libraries of their own",
    "pillow": "MIT-CMU; its wheels carry codecs of pictures under permissive licences",
    "scipy": "its wheels carry OpenBLAS, BSD-3-Clause, and libgfortran, GPL with the runtime exception",
}
"""What wheels hold besides their package: known, and looked at again when one of them is new."""

NAMES = {
    "3-Clause BSD License": "BSD-3-Clause",
    "Apache 2.0": "Apache-2.0",
    "Apache Software License": "Apache-2.0",
    "BSD 3-Clause License": "BSD-3-Clause",
    "BSD License": "BSD-3-Clause",
    "ISC License": "ISC",
    "ISC License (ISCL)": "ISC",
    "MIT License": "MIT",
    "Python Software Foundation License": "PSF-2.0",
}
"""What packages call their licence where they do not use the names of SPDX."""


def crate_licences() -> dict[str, str]:
    """Licence of each crate of Cargo.lock, as it says itself, for every platform."""
    command = ["cargo", "metadata", "--locked", "--offline", "--format-version", "1"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    crates = json.loads(done.stdout)["packages"]
    return {f"{crate['name']} {crate['version']}": crate["license"] or "" for crate in crates}


def package_licences() -> dict[str, str]:
    """Licence of each package that pomona and its extras bring, as far as it is installed here."""
    found = {}
    for name in sorted(set(brought()) - APART.keys()):
        try:
            found[name] = _licence_of(importlib.metadata.metadata(name))
        except importlib.metadata.PackageNotFoundError:
            continue  # of another platform or Python
    return found


def bundling() -> list[str]:
    """Names of the packages brought whose wheels carry libraries of others."""
    names = package_licences()
    files = {name: importlib.metadata.files(name) or () for name in names}
    return sorted(name for name in names if any(".libs/" in str(file) for file in files[name]))


def brought() -> list[str]:
    """Names of all packages that an install with all extras brings on some platform, by uv.lock."""
    lock = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))
    packages: dict[str, Any] = {package["name"]: package for package in lock["package"]}
    waiting, seen = ["pomona"], {"pomona"}
    while waiting:
        for name in _needs(packages[waiting.pop()]):
            if name not in seen and name in packages:
                seen.add(name)
                waiting.append(name)
    return sorted(seen - {"pomona"})


def _needs(package: Mapping[str, Any]) -> Iterator[str]:
    extras: Iterable[list[Any]] = package.get("optional-dependencies", {}).values()
    for entries in (package.get("dependencies", []), *extras):
        yield from (entry["name"] for entry in entries)


def _licence_of(metadata: Any) -> str:
    """Take the expression of SPDX, else the short text, else the classifiers."""
    if metadata.get("License-Expression"):
        return str(metadata["License-Expression"])
    classes = [
        each.split("::")[-1].strip() for each in metadata.get_all("Classifier", []) if each.startswith("License")
    ]
    text = (metadata.get("License") or "").strip().split("\n")[0]
    known = [NAMES[each] for each in (text, *classes) if each in NAMES]
    return known[0] if known else text if text in ALLOWED else " AND ".join(classes) or text


def wrong_licences(licences: Mapping[str, str]) -> list[str]:
    """Lines for what is neither allowed nor a named exception."""
    return [
        f"{name}: found {licence or 'no licence'!r}, expected one of audit.licences.ALLOWED"
        for name, licence in sorted(licences.items())
        if name not in EXCEPTIONS and not is_allowed(licence)
    ]


def is_allowed(expression: str) -> bool:
    """Whether an expression of SPDX leaves a choice that is allowed; `/` is the old way to write OR."""
    tokens = re.findall(r"\(|\)|/|[\w.+-]+", expression)
    return bool(tokens) and _any(tokens) and not tokens


def _any(tokens: list[str]) -> bool:
    allowed = _all(tokens)
    while tokens and tokens[0] in ("OR", "/"):
        tokens.pop(0)
        allowed = _all(tokens) or allowed
    return allowed


def _all(tokens: list[str]) -> bool:
    allowed = _one(tokens)
    while tokens and tokens[0] == "AND":
        tokens.pop(0)
        allowed = _one(tokens) and allowed
    return allowed


def _one(tokens: list[str]) -> bool:
    first = tokens.pop(0) if tokens else ""
    if first == "(":
        allowed = _any(tokens)
        return allowed and bool(tokens) and tokens.pop(0) == ")"
    if tokens[:1] == ["WITH"]:
        first = f"{first} WITH {tokens[1] if len(tokens) > 1 else ''}"
        del tokens[:2]
    return first in ALLOWED
