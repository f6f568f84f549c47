"""Whether something is known to be wrong with what the lock files hold: asked of others, who may not be reachable."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Report", "crate_advisories", "package_advisories"]

ROOT = Path(__file__).parents[1]
UV = ROOT / ".tools" / "bin" / "uv"
PIP_AUDIT = "pip-audit==2.9.0"
CARGO_AUDIT = "cargo install cargo-audit --version 0.21.2 --locked"


@dataclass(frozen=True)
class Report:
    """What was asked, and the answer.

    Attributes
    ----------
    said : str
        What could be checked and what could not.
    found : tuple of str
        A line for each thing that is known to be wrong.
    """

    said: str
    found: tuple[str, ...] = ()


def package_advisories() -> Report:
    """Ask the package index about the versions of uv.lock, through pip-audit."""
    uv = os.fspath(UV) if UV.is_file() else shutil.which("uv")
    if uv is None:
        return Report("not checked: uv is not here, `make install` fetches it")
    with tempfile.TemporaryDirectory() as place:
        listed = Path(place) / "packages.txt"
        export = ["export", "--frozen", "--all-extras", "--no-dev", "--no-emit-project", "--no-hashes", "-q", "-o"]
        audit = [
            "tool",
            "run",
            "--from",
            PIP_AUDIT,
            "pip-audit",
            "--no-deps",
            "--disable-pip",
            "--progress-spinner",
            "off",
        ]
        _run(uv, *export, os.fspath(listed))
        done = _run(uv, *audit, "-f", "json", "-r", os.fspath(listed))
    try:
        packages = json.loads(done.stdout)["dependencies"]
    except (json.JSONDecodeError, KeyError, TypeError):
        return Report(f"not checked: {_last_line(done)}")
    unknown = [package for package in packages if "skip_reason" in package]
    found = tuple(
        f"{package['name']} {package['version']}: {flaw['id']}, mended in {', '.join(flaw['fix_versions']) or 'none'}"
        for package in packages
        for flaw in package.get("vulns", ())
    )
    said = f"{len(packages) - len(unknown)} checked, {len(found)} found"
    return Report(f"{said}; {len(unknown)} not: the index says nothing of them" if unknown else said, found)


def crate_advisories() -> Report:
    """Ask RustSec about the versions of Cargo.lock, through cargo-audit."""
    if shutil.which("cargo-audit") is None:
        return Report(f"not checked: cargo-audit is not here, `{CARGO_AUDIT}` brings it")
    done = _run("cargo", "audit", "--json")
    try:
        flaws = json.loads(done.stdout)["vulnerabilities"]["list"]
    except (json.JSONDecodeError, KeyError, TypeError):
        return Report(f"not checked: the database of RustSec could not be fetched ({_last_line(done)})")
    found = tuple(f"{flaw['package']['name']} {flaw['package']['version']}: {flaw['advisory']['id']}" for flaw in flaws)
    return Report(f"all checked, {len(found)} found", found)


def _run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def _last_line(done: subprocess.CompletedProcess[str]) -> str:
    return (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1][:200]
